"""Walls and pads as surfaces: laws of scattering, regions, triangles of a mesh."""
