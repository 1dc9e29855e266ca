"""Deterministic light transport between diffuse walls: readings, and their derivatives with respect to the positions of
the walls.

Input: patches of walls, their reflectance, an LED and a phototransistor. Output: the reading, its error by the size of
the patches, and its gradient; no random numbers are used.
"""
