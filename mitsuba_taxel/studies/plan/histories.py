"""Load history of each step of a load path with times, on which a viscoelastic silicone depends."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

from mitsuba_taxel.base.arguments import as_numbers
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.limits import MOST_HISTORY
from mitsuba_taxel.base.units import FORCES, TIME

HISTORY = "history"
"""Parameter of a scene for the load history: rows of time and load."""
LOADS = (FORCES, ("ux", "uy", "uz"), ("pressure",))
"""Parameters of a scene that are the components of a load."""


def histories(
    steps: Mapping[str, Sequence[str]], parameters: Mapping[str, str], varied: Sequence[str] = ()
) -> list[str] | None:
    """The load history of each step; None where steps have no times or give their histories themselves.

    Parameters
    ----------
    steps : Mapping[str, Sequence[str]]
        Words by parameter, one for each step.
    parameters : Mapping[str, str]
        Of the scene. Load components that steps do not give keep its values, or are 0.
    varied : Sequence[str]
        Parameters that are varied besides.

    Raises
    ------
    InputError
        if the scene takes no history, it cannot be determined, or times go back.
    """
    if TIME not in steps or HISTORY in steps:
        return None
    if HISTORY not in parameters:
        raise InputError(
            "steps with a column time need a scene with the parameter history, which receives the earlier loads."
        )
    known = {**parameters, **steps}
    names = next((names for names in LOADS if set(names) & set(steps)), None)
    names = names or next((names for names in LOADS if set(names) & set(known)), FORCES)
    beside = [name for name in (*names, TIME, HISTORY) if name in varied]
    if beside:
        raise InputError(f"{beside[0]} cannot be varied beside steps with times: give it in the steps.")
    count = len(steps[TIME])
    if count > MOST_HISTORY:
        raise InputError(f"{count} steps with times are not allowed: at most {MOST_HISTORY} are.")
    columns = [steps.get(name, [parameters.get(name, "0")] * count) for name in (TIME, *names)]
    rows = [" ".join(row) for row in zip(*columns, strict=True)]
    if as_numbers(" ".join(rows).split()) is None:
        raise InputError(f"steps with times need finite numbers for {', '.join((TIME, *names))}.")
    _check_times([float(word) for word in columns[0]])
    earlier = [parameters[HISTORY] if parameters[HISTORY].strip() else " ".join(["0"] * (1 + len(names)))]
    return ["; ".join([*earlier, *rows[:number]]) for number in range(count)]


def _check_times(times: Sequence[float]) -> None:
    for number, (before, time) in enumerate(pairwise(times), start=2):
        if time < before:
            raise InputError(
                f"steps: time = {time:g} s in row {number} is not allowed: at least {before:g} s is needed."
            )
