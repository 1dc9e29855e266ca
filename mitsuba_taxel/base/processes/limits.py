"""Limits of input."""

from __future__ import annotations

MOST_HISTORY = 4000
"""Largest number of rows of a load history: each step of a path in time contains all earlier rows."""
