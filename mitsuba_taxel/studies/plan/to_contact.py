"""First contacts in studies: a parameter beside those of a scene asks for one."""

from __future__ import annotations

import math

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.sensing.scene.left_out import NONE

TO_CONTACT = "to_contact"
"""Parameter of all studies, such as 'fz=-40': the load path of the scene is followed along fz to where its pad first
touches anything, or to there; 'none' leaves it where it is."""


def way_to_contact(word: str) -> tuple[str, float] | None:
    """The parameter along which a path is followed, and the furthest value; None if it is not followed.

    Raises
    ------
    InputError
        if the word is no value of `TO_CONTACT`.
    """
    if word == NONE:
        return None
    along, _, furthest = word.partition("=")
    value = as_number(furthest)
    if not math.isfinite(value):
        raise InputError(f"{TO_CONTACT} = {word!r} is not allowed: such as 'fz=-40' is needed, or {NONE}.")
    return along.strip(), value


def as_number(word: str) -> float:
    """The number that a word tells; NaN if it tells none."""
    try:
        return float(word)
    except ValueError:
        return math.nan
