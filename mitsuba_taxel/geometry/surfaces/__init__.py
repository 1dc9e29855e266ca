"""Surfaces of flat triangles: normals, nearest points, cuts, slices, and removal of degenerate triangles."""
