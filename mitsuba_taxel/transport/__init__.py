"""Deterministic light transport between diffuse walls: readings, and their derivatives with respect to the positions of
the walls."""
