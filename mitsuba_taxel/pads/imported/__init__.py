"""Pads from files: surfaces of triangles and STEP solids are repaired, tagged and meshed."""
