"""Finite differences of second order."""

CENTRAL = ((0.5, 1), (-0.5, -1))
BEHIND = ((1.5, 0), (-2, -1), (0.5, -2))
AHEAD = ((-1.5, 0), (2, 1), (-0.5, 2))
"""Weights and steps of each difference."""
STENCILS = (CENTRAL, BEHIND, AHEAD)
"""The central difference, and one-sided differences for the case that one side is not allowed."""
