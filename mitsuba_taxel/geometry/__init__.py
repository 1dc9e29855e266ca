"""Geometry of points, triangles, curved patches and volume meshes.

Input: coordinates in mm and indices of their triangles or elements. Output: distances, sections, refined and mirrored
meshes, and derivatives of their maps; nothing here knows pads or light.
"""
