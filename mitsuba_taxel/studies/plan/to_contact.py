"""Request for the first contact of a pad in a study: an additional parameter of its jobs states the load that grows."""

from __future__ import annotations

import math

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.sensing.scene.left_out import NONE

TO_CONTACT = "to_contact"
"""Parameter of all studies that requests the first contact.

With the value 'fz=-40', the load path of the scene is followed along fz until its pad first touches anything, at most
to -40; with 'none' it is not followed."""


def path_to_contact(word: str) -> tuple[str, float] | None:
    """Parse a value of `TO_CONTACT`, such as ``fz=-40``: the load that grows until contact, and its last value.

    Returns
    -------
    tuple[str, float] or None
        Name of the load's parameter and its last value; None for the value ``none``.

    Raises
    ------
    InputError
        if the word is not a value of `TO_CONTACT`.
    """
    if word == NONE:
        return None
    along, _, furthest = word.partition("=")
    value = as_number(furthest)
    if not math.isfinite(value):
        raise InputError(
            f"{TO_CONTACT} = {word!r} is not allowed: a load and its limit, such as 'fz=-40', or {NONE} is needed."
        )
    return along.strip(), value


def as_number(word: str) -> float:
    """Convert text to a number; NaN if it is not a number."""
    try:
        return float(word)
    except ValueError:
        return math.nan
