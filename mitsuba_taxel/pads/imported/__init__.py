"""Pads from files: surfaces of triangles and STEP solids, repaired, tagged and meshed."""
