"""Text shared by the sections of the page on the paper: names of studies, and numbers as text."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from textwrap import fill
from typing import Any

from mitsuba_taxel.characterise.wording import with_error
from mitsuba_taxel.evidence.paper.slopes import Sensitivity

Found = Mapping[str, Any]
"""Studies by the name of their part, as returned by :func:`mitsuba_taxel.evidence.paper.parts.complete`."""
TANGENTIAL = ("fx", "fy", "resultant")
NAMES = {"fz": "normal", "fx": "along x", "fy": "along y", "resultant": "along the diagonal"}


paragraph = partial(fill, width=120, break_long_words=False, break_on_hyphens=False)
"""Sentences as lines of a page."""


def micro(value: float, error: float) -> str:
    """Text of a number and its error in millionths of its unit, such as µW for W."""
    return with_error(1e6 * value, 1e6 * error)


def steepest(slope: Sensitivity) -> str:
    """Text of a maximum slope in µW/N, with its error."""
    return micro(slope.max_slope, slope.max_slope_error)
