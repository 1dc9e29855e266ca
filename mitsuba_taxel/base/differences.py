"""Differences of second order."""

CENTRAL = ((0.5, 1), (-0.5, -1))
BEHIND = ((1.5, 0), (-2, -1), (0.5, -2))
AHEAD = ((-1.5, 0), (2, 1), (-0.5, 2))
"""Weights and steps."""
STENCILS = (CENTRAL, BEHIND, AHEAD)
"""Central, or one-sided if the other side is not allowed."""
