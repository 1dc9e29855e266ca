"""Units of the quantities in a study."""

from __future__ import annotations

FORCES = ("fx", "fy", "fz")
"""Parameters of a scene that are components of its force, in N."""
