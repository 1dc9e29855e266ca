"""Plan of a fit: a study file with a table ``[fit]``."""

from __future__ import annotations

import math
import warnings
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from mitsuba_taxel.base.arguments import is_number
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.units import FORCES, TIME
from mitsuba_taxel.electronics.circuit import Circuit, circuit_of
from mitsuba_taxel.fitting.data import MeasuredData, read_data
from mitsuba_taxel.parameters import Number, parameters_of
from mitsuba_taxel.sensing import find_scene
from mitsuba_taxel.sensing.scene.finding import is_file
from mitsuba_taxel.sensing.scene.parameter_roles import roles_of_parameters
from mitsuba_taxel.studies.plan.batch import parameters_in, read_study_of

OWN = ("gain", "offset")
"""Unknowns of electronics that are not described by a circuit: volts per watt, and volts without light."""
CIRCUIT = "circuit."
"""Prefix of the name of an unknown of the circuit."""
READ_KEYS = ("points", "mesh_size", "seed")


@dataclass(frozen=True)
class Unknown:
    """An unknown of a fit: its name, initial value and bounds."""

    name: str
    start: float
    low: float
    high: float

    @property
    def in_scene(self) -> bool:
        """Whether the unknown is a parameter of the scene."""
        return self.name not in OWN and not self.name.startswith(CIRCUIT)


@dataclass(frozen=True, eq=False)
class FitPlan:
    """Definition of a fit: scene, unknowns and measured data.

    Attributes
    ----------
    scene : str
        File relative to ``folder``, or the name of a shipped scene.
    folder : Path
        Folder of the study file.
    defines : dict[str, Any]
        Values of parameters of the scene.
    reading : dict[str, Any]
        Settings of readings, as for `make_batch`.
    circuit : Circuit or None
        Read-out circuit.
    unknowns : list[Unknown]
        Numbers to be estimated.
    data : MeasuredData
        Measurements.
    """

    scene: str
    folder: Path
    defines: dict[str, Any]
    reading: dict[str, Any]
    circuit: Circuit | None
    unknowns: list[Unknown]
    data: MeasuredData


def read_plan(file: Path) -> FitPlan:
    """Read the definition of a fit from a study file with a table ``[fit]``.

    Raises
    ------
    InputError
        if the file is not such a study, or its data cannot be read or are too few.
    """
    content, table = read_study_of("fit", file)
    (scene,) = content.pop("scenes")
    if not isinstance(table, dict) or set(table) != {"data", "unknowns"} or not isinstance(table["data"], str):
        raise InputError(f"study {file.name} is not allowed: a table [fit] with data and unknowns is needed.")
    if not isinstance(table["unknowns"], dict) or not table["unknowns"]:
        raise InputError(f"study {file.name} is not allowed: a table [fit.unknowns] is needed.")
    for name in [*content, *scene]:
        if name not in (*READ_KEYS, "circuit", "scene", "define"):
            raise InputError(f"{name} is not allowed in a fit: each row of the data defines a scene; take it out.")

    # The data, with settings named as the parameters of the scene.
    folder = file.resolve().parent
    parameters = parameters_in(str(scene.get("scene", "")), folder)
    data = read_data(folder / table["data"], parameters)
    if parameters:
        relative = folder / str(scene["scene"])
        data = _named_by_scene(data, parameters, find_scene(relative if is_file(relative) else str(scene["scene"])))
    if TIME in data.settings and parameters and TIME not in parameters:
        warnings.warn(
            f"data {table['data']!r}: the scene has no parameter {TIME}, so this column is not used.", stacklevel=1
        )
        data = replace(data, settings={name: words for name, words in data.settings.items() if name != TIME})
    circuit = circuit_of(content.pop("circuit")) if "circuit" in content else None
    unknowns = [_unknown(name, definition) for name, definition in table["unknowns"].items()]
    plan = FitPlan(str(scene.get("scene", "")), folder, dict(scene.get("define", {})), content, circuit, unknowns, data)
    _check(plan)
    return plan


def _named_by_scene(data: MeasuredData, parameters: Collection[str], scene: Path) -> MeasuredData:
    """The data, with times and force components named and signed as the parameters of the scene.

    A setting that already has the name of a parameter is unchanged.
    """
    named = {role: (name, sign) for name, (role, sign) in roles_of_parameters(scene).items() if role in (TIME, *FORCES)}
    settings = {}
    for name, words in data.settings.items():
        scene_name, sign = named.get(name, (name, 1))
        if name in parameters or scene_name in data.settings:
            scene_name, sign = name, 1
        settings[scene_name] = [f"{-float(word) + 0.0:.12g}" for word in words] if sign < 0 else words
    return replace(data, settings=settings)


def _unknown(name: str, definition: object) -> Unknown:
    table: Any = {"start": definition} if is_number(definition) else definition
    allowed = isinstance(table, Mapping) and "start" in table and set(table) <= {"start", "low", "high"}
    if not allowed or not all(is_number(value) for value in table.values()):
        raise InputError(
            f"unknown {name} = {definition!r} is not allowed: {{ start = ..., low = ..., high = ... }} of numbers is "
            "needed."
        )
    least, most = _range(name)
    low, high, start = (float(table.get(key, end)) for key, end in (("low", least), ("high", most), ("start", 0.0)))
    low, high = max(low, least), min(high, most)
    if not low < start < high:
        raise InputError(f"unknown {name}: start = {start:g} must lie between low = {low:g} and high = {high:g}.")
    return Unknown(name, start, low, high)


def _range(name: str) -> tuple[float, float]:
    """Allowed range of an unknown: for a number of the circuit, its range; for others, unlimited."""
    number = parameters_of(Circuit).get(name.removeprefix(CIRCUIT)) if name.startswith(CIRCUIT) else None
    if not isinstance(number, Number):
        return -math.inf, math.inf
    return max(number.above, number.minimum), number.maximum


def _check(plan: FitPlan) -> None:
    """Raise `InputError` if unknowns, circuit and data do not fit together."""
    names = [unknown.name for unknown in plan.unknowns]
    for name in names:
        if name in plan.defines or name in plan.data.settings:
            raise InputError(f"{name} is both unknown and given a value: take one of them out.")
        if name in OWN and plan.circuit is not None:
            raise InputError(
                f"{name} is not allowed beside a circuit: a number of the circuit is needed as the unknown, such as "
                f"circuit.transfer."
            )
        if name.startswith(CIRCUIT) and (
            plan.circuit is None or name.removeprefix(CIRCUIT) not in _numbers(plan.circuit)
        ):
            raise InputError(f"{name} is not allowed: a number of the table [circuit] is needed.")
    if plan.data.unit == "V" and plan.circuit is None and "gain" not in names:
        raise InputError("data in volts are not allowed without a table [circuit], or gain, in V/W, as an unknown.")
    if plan.data.unit == "W" and plan.circuit is not None:
        raise InputError("data in watts are not allowed with a circuit: give data in volts, or leave the circuit out.")
    count = plan.data.readings.size
    if count <= len(names):
        raise InputError(
            f"{count} readings are not enough for {len(names)} unknowns: at least {len(names) + 1} are needed."
        )


def _numbers(circuit: Circuit) -> dict[str, float]:
    return {name: value for name, value in circuit.as_table().items() if isinstance(value, float)}
