"""Names and codes of the regions of a pad's surface: roof, side, bottom, top and outer."""

REGIONS = {"roof": 1, "side": 2, "bottom": 3, "top": 4, "outer": 5}
"""Codes of the regions, as in the face attribute ``face_region`` of meshes."""
