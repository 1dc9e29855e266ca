"""Pads from files: surfaces of triangles and STEP solids, mended, tagged and meshed."""
