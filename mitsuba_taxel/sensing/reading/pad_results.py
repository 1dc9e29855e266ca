"""Results of deformed pads beside readings: one entry each, from which studies, tables and reports take them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

from mitsuba_taxel.base.convergence import ERROR_SHARE

if TYPE_CHECKING:  # the list is read in scenes without a pad, too
    from mitsuba_taxel.mechanics.continuation.state import State


class Estimate(NamedTuple):
    """A value and its error, one standard deviation; NaN if unknown."""

    value: float
    error: float


class PadResult(NamedTuple):
    """A number that is computed from the state of a pad.

    Attributes
    ----------
    name, unit, meaning : str
        Name, unit and meaning, as in tables.
    of : Callable[[State, bool], Estimate]
        Computes the number; without its error if the second argument is False, because a second mesh may be expensive.
    """

    name: str
    unit: str
    meaning: str
    of: Callable[[State, bool], Estimate]


def _largest_strain(state: State, with_error: bool) -> Estimate:
    """The largest strain of a state. Its error is that of the finite elements: the change of the strain by both parts
    of the deviation of coarser elements."""
    from mitsuba_taxel.mechanics.results.largest_strain import largest_strain

    if not state.displacement.any():
        return Estimate(0.0, 0.0)
    strain = largest_strain(state)
    deviations = state.deviations if with_error else None
    if deviations is None:
        return Estimate(strain.value, math.nan)
    changes = (strain.rate(deviation, 0.0 * deviation) for deviation in deviations)
    return Estimate(strain.value, ERROR_SHARE * math.hypot(*changes))


PAD_RESULTS = [
    PadResult(
        "largest_strain",
        "1",
        "largest principal strain of the silicone, stretch - 1, mean over the most strained 1% of it",
        _largest_strain,
    ),
]
"""All of them; where a scene has several pads, the largest value counts."""


def pad_results(states: Sequence[State], with_errors: bool = True) -> dict[str, Estimate]:
    """Results of pads by name; empty without pads."""
    if not states:
        return {}
    return {result.name: max(result.of(state, with_errors) for state in states) for result in PAD_RESULTS}
