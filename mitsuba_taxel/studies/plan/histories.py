"""Load history of each step of a load path with times, on which a viscoelastic silicone depends."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from types import MappingProxyType

from mitsuba_taxel.base.arguments import MOST_HISTORY, as_numbers
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.units import FORCES, HISTORY, LOADS, TIME


def histories(
    steps: Mapping[str, Sequence[str]],
    parameters: Mapping[str, str],
    varied: Sequence[str] = (),
    roles: Mapping[str, tuple[str, int]] = MappingProxyType({}),
    constants: Mapping[str, str] = MappingProxyType({}),
) -> dict[str, list[str]] | None:
    """Load history of each step of a load path with times: the times and loads of all earlier steps.

    Parameters
    ----------
    steps : Mapping[str, Sequence[str]]
        Values as text by parameter, one for each step.
    parameters : Mapping[str, str]
        Parameters of the scene. Load components without a column in the steps keep its values, or are 0.
    varied : Sequence[str]
        Names of parameters that are varied in other dimensions of the study.
    roles : Mapping[str, tuple[str, int]]
        Roles of parameters and their signs; see `roles_of_parameters`. A parameter without an entry has its name as
        role.
    constants : Mapping[str, str]
        Components of the load that no parameter changes, by role.

    Returns
    -------
    dict[str, list[str]] or None
        Histories as text, one for each step, under the name of the scene's parameter for the history. None if the steps
        have no times, or already have a column of histories.

    Raises
    ------
    InputError
        if the scene has no parameter for the history, the history cannot be determined, or times decrease.
    """
    named = {role: (name, sign) for name, (role, sign) in roles.items()}

    def name_of(role: str) -> str:
        return named.get(role, (role if role not in roles else "", 1))[0]

    time, history = name_of(TIME), name_of(HISTORY)
    if time not in steps or history in steps:
        return None
    if history not in parameters:
        raise InputError(
            "steps with a column 'time' need a scene with a parameter named 'history', which receives the loads of "
            "earlier steps: add it, or remove the column."
        )

    # The load's components: those that are columns of the steps, else those that are parameters of the scene.
    available = {**parameters, **steps}
    names = next((names for names in LOADS if {*map(name_of, names)} & set(steps)), None)
    names = names or next((names for names in LOADS if {*map(name_of, names)} & set(available)), FORCES)
    conflicts = [name for name in (*map(name_of, names), time, history) if name in varied]
    if conflicts:
        raise InputError(f"{conflicts[0]} cannot be varied beside steps with times: give it in the steps.")

    # One column for the time and one for each component of the load, as the plugin reads them.
    count = len(steps[time])
    if count > MOST_HISTORY:
        raise InputError(f"{count} steps with times are not allowed: at most {MOST_HISTORY} are.")
    columns = [list(steps[time])]
    for role in names:
        name, sign = name_of(role), named.get(role, ("", 1))[1]
        words = steps.get(name, [parameters.get(name, constants.get(role, "0"))] * count)
        columns.append([_negative(word) for word in words] if sign < 0 else list(words))
    rows = [" ".join(row) for row in zip(*columns, strict=True)]
    if as_numbers(" ".join(rows).split()) is None:
        shown = ", ".join(name_of(role) for role in (TIME, *names) if name_of(role) in available)
        raise InputError(f"steps with times need finite numbers for {shown}.")
    for number, (before, now) in enumerate(pairwise(float(word) for word in columns[0]), start=2):
        if now < before:
            raise InputError(
                f"steps: time = {now:g} s in row {number} is not allowed: at least {before:g} s is needed."
            )

    # Each step's history is that of the scene, or an unloaded state at time 0, and all rows before the step.
    earlier = [parameters[history] if parameters[history].strip() else " ".join(["0"] * (1 + len(names)))]
    return {history: ["; ".join([*earlier, *rows[:number]]) for number in range(count)]}


def _negative(word: str) -> str:
    """Text of a number with the opposite sign; ``0`` is unchanged."""
    word = word.strip()
    return word[1:] if word.startswith("-") else word if as_numbers([word]) == [0.0] else f"-{word.removeprefix('+')}"
