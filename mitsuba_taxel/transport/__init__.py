"""Deterministic light transport between diffuse walls: readings, and their derivatives by the positions of the
walls."""
