"""Pads of the built-in cell shapes: solids and their meshes."""
