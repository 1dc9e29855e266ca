"""What the load of each step of a load path was before it, where steps have times: a silicone may remember it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from mitsuba_taxel.base.arguments import as_numbers
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.units import FORCES, TIME

HISTORY = "history"
"""Parameter of a scene that says what the load was before, in rows of a time and a value."""
LOADS = (FORCES, ("ux", "uy", "uz"), ("pressure",))
"""Parameters of a scene that are the components of a load."""


def histories(
    steps: Mapping[str, Sequence[str]], parameters: Mapping[str, str], varied: Sequence[str] = ()
) -> list[str] | None:
    """The history of each step, None where steps have no times or say it themselves.

    Parameters
    ----------
    steps : Mapping[str, Sequence[str]]
        Words by parameter, one for each step.
    parameters : Mapping[str, str]
        Of the scene. What it has of the components of the load and steps have not, stays; others are 0.
    varied : Sequence[str]
        What is varied besides.

    Raises
    ------
    InputError
        if the scene takes no history, or none can be told.
    """
    if TIME not in steps or HISTORY in steps:
        return None
    if HISTORY not in parameters:
        raise InputError(
            "steps with a column time need a parameter history of the scene, to put what the load was before into."
        )
    known = {**parameters, **steps}
    names = next((names for names in LOADS if set(names) & set(steps)), None)
    names = names or next((names for names in LOADS if set(names) & set(known)), FORCES)
    beside = [name for name in (*names, TIME, HISTORY) if name in varied]
    if beside:
        raise InputError(f"{beside[0]} cannot be varied beside steps with times: give it in the steps.")
    count = len(steps[TIME])
    columns = [steps.get(name, [parameters.get(name, "0")] * count) for name in (TIME, *names)]
    rows = [" ".join(row) for row in zip(*columns, strict=True)]
    if as_numbers(" ".join(rows).split()) is None:
        raise InputError(f"steps with times need finite numbers for {', '.join((TIME, *names))}.")
    earlier = [parameters[HISTORY] if parameters[HISTORY].strip() else " ".join(["0"] * (1 + len(names)))]
    return ["; ".join([*earlier, *rows[:number]]) for number in range(count)]
