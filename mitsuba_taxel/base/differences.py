"""Differences of second order."""

STENCILS = (
    ((0.5, 1), (-0.5, -1)),
    ((1.5, 0), (-2, -1), (0.5, -2)),
    ((-1.5, 0), (2, 1), (-0.5, 2)),
)
"""Weights and steps: central, or one-sided if the other side is not allowed."""
