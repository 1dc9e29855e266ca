"""Geometry of points, triangles, curved patches and volume meshes."""
