"""Triangles from a file: repaired, smoothed to local sizes, their curvature, and meshes snapped back onto them."""
