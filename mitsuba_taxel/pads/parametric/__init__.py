"""Pads of this package's own cell shapes: solids and their meshes."""
