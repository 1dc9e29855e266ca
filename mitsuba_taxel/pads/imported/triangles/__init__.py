"""Triangles from a file: they are repaired and remeshed to local sizes; their curvature; meshes projected onto them."""
