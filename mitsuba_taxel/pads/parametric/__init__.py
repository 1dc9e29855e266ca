"""Pads of parametric cells: their dimensions, solids, meshes and mesh velocities."""
