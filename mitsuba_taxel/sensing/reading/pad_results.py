"""Results of deformed pads that are not readings, such as the largest strain. Each is stated once, in a list from which
studies, tables and reports take it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

from mitsuba_taxel.base.convergence import ERROR_SHARE

if TYPE_CHECKING:  # the list is read in scenes without a pad, too
    from mitsuba_taxel.mechanics.continuation.state import State
    from mitsuba_taxel.mechanics.results.balance import Reactions


class Estimate(NamedTuple):
    """A value and its error, one standard deviation; either is NaN if unknown."""

    value: float
    error: float


class PadResult(NamedTuple):
    """Definition of a number that is computed from the state of a pad.

    Attributes
    ----------
    name, unit, meaning : str
        Name, unit and meaning, as in tables.
    of : Callable[[State, bool], Estimate]
        Computes the number and its error. If the second argument is False, the error is NaN, because it may need a
        second mesh.
    """

    name: str
    unit: str
    meaning: str
    of: Callable[[State, bool], Estimate]


def _largest_strain(state: State, with_error: bool) -> Estimate:
    """Largest strain of a state, with its error due to the finite elements. The error is a fixed fraction of the change
    of the strain on coarser elements."""
    from mitsuba_taxel.mechanics.results.largest_strain import largest_strain

    if not state.displacement.any():
        return Estimate(0.0, 0.0)
    strain = largest_strain(state)
    deviations = state.deviations if with_error else None
    if deviations is None:
        return Estimate(strain.value, math.nan)
    changes = (strain.rate(deviation, 0.0 * deviation) for deviation in deviations)
    return Estimate(strain.value, ERROR_SHARE * math.hypot(*changes))


class ReactionResult(NamedTuple):
    """Definition of a number that is computed from the force of a bonded plate or an indenter on a pad.

    Attributes
    ----------
    name, unit, meaning : str
        Name, unit and meaning, as in tables.
    of : Callable[[Reactions], float]
        Computes the number.
    error_of : Callable[[Reactions], float]
        Computes the error of the number; NaN if unknown.
    """

    name: str
    unit: str
    meaning: str
    of: Callable[[Reactions], float]
    error_of: Callable[[Reactions], float]


def _component(attribute: str, axis: int) -> Callable[[Reactions], float]:
    return lambda reactions: float(getattr(reactions, attribute)[axis])


def _centre(axis: int) -> Callable[[Reactions], float]:
    return lambda reactions: float(reactions.centre_of_pressure[axis])


def _unknown(reactions: Reactions) -> float:
    """Error of a reaction where it is not computed: NaN, but 0 for a pad that is not touched."""
    return math.nan if reactions.applied_force.any() else 0.0


REACTION_RESULTS: list[ReactionResult] = [
    *(
        ReactionResult(
            f"reaction_f{axis}",
            "N",
            f"force of the plate or the indenter on the pad, along {axis}",
            _component("applied_force", number),
            lambda reactions: reactions.force_error,
        )
        for number, axis in enumerate("xyz")
    ),
    *(
        ReactionResult(
            f"reaction_m{axis}",
            "N mm",
            f"moment of the plate or the indenter on the deformed pad, about {axis} through the centre of its bottom",
            _component("applied_moment", number),
            _unknown,
        )
        for number, axis in enumerate("xyz")
    ),
    *(
        ReactionResult(
            f"centre_of_pressure_{axis}",
            "mm",
            f"{axis} where the line of the force of the plate or the indenter meets the plane of the unloaded top",
            _centre(number),
            lambda reactions: math.nan,
        )
        for number, axis in enumerate("xy")
    ),
]
"""All results of forces. They exist for scenes with one pad that is loaded by a bonded plate or an indenter."""


def _plate_motion(attribute: str, axis: int) -> Callable[[State, bool], Estimate]:
    """Result: one component, along ``axis``, of the displacement or rotation of a plate."""

    def of(state: State, with_error: bool) -> Estimate:
        from mitsuba_taxel.mechanics.results.plate_motion import plate_motion

        motion = plate_motion(state)
        value = float(getattr(motion, attribute)[axis])
        if not with_error or not state.displacement.any():
            return Estimate(value, math.nan if state.displacement.any() else 0.0)
        return Estimate(value, float(motion.errors()[attribute == "rotation"][axis]))

    return of


PLATE_RESULTS = [
    *(
        PadResult(
            f"plate_u{axis}",
            "mm",
            f"displacement of the point of the tilting plate on which the force acts, along {axis}",
            _plate_motion("displacement", number),
        )
        for number, axis in enumerate("xyz")
    ),
    *(
        PadResult(
            f"plate_r{axis}",
            "degrees",
            f"component of the tilting plate's rotation vector (axis times angle) along {axis}",
            _plate_motion("rotation", number),
        )
        for number, axis in enumerate("xyz")
    ),
]
"""All results of the motion of a plate. They exist for scenes with one pad, whose plate tilts."""
PAD_RESULTS = [
    PadResult(
        "largest_strain",
        "1",
        "largest principal strain of the silicone, stretch - 1, mean over the most strained 1% of it",
        _largest_strain,
    ),
]
"""All results of pads. For a scene with several pads, the largest value counts."""


def pad_results(states: Sequence[State], with_errors: bool = True) -> dict[str, Estimate]:
    """Values and errors of all results of a scene's pads, by name; empty without pads.

    Parameters
    ----------
    states : Sequence[State]
        States of the pads.
    with_errors : bool
        Whether errors are computed, which may need second meshes; otherwise they are NaN.

    Returns
    -------
    dict[str, Estimate]
        Values and errors by name.
    """
    if not states:
        return {}
    results = {result.name: max(result.of(state, with_errors) for state in states) for result in PAD_RESULTS}
    load = getattr(states[0], "load", None)
    if len(states) == 1 and load is not None and load.tilts:
        results |= {result.name: result.of(states[0], with_errors) for result in PLATE_RESULTS}
    return {**results, **_reaction_results(states, with_errors)}


def _reaction_results(states: Sequence[State], with_errors: bool) -> dict[str, Estimate]:
    """Values and errors of the results of the force of a plate or an indenter, by name.

    The results are omitted for several pads, because there is then no single force, and for a bonded plate with
    self-contact, because contact forces also act on the nodes of the plate.
    """
    from mitsuba_taxel.mechanics.results.balance import reactions

    if len(states) > 1:
        return {}
    (state,) = states
    load = getattr(state, "load", None)
    if load is None or not (load.indenter is not None or (load.bonded_plate and not load.self_contact)):
        return {}
    if load.indenter is not None and state.indenter_moved is None:  # not touched yet
        zero = Estimate(0.0, 0.0 if with_errors else math.nan)
        unknown = Estimate(math.nan, math.nan)
        return {result.name: unknown if result.unit == "mm" else zero for result in REACTION_RESULTS}
    balance = reactions(state)
    return {
        result.name: Estimate(result.of(balance), result.error_of(balance) if with_errors else math.nan)
        for result in REACTION_RESULTS
    }
