"""The file of an optimisation: a study with a table ``[optimise]``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mitsuba_taxel.base.arguments import check_whole, is_number, is_row, is_whole
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.electronics.circuit import Circuit, circuit_of
from mitsuba_taxel.optimum.figures import FIGURES_OF_MERIT, FURTHEST, TO_THE_END, Figure
from mitsuba_taxel.optimum.plan import TRIED, Goal, Limit, Plan, Variable
from mitsuba_taxel.sensing.scene.parameter_units import units_of_parameters
from mitsuba_taxel.studies.plan.batch import make_batch, read_study_of

POINTS = 16
"""Points of the random readings that accompany those without random numbers."""
READ_KEYS = ("points", "mesh_size", "seed")
KEYS = (
    "maximise", "minimise", "variables", "choices", "loads", "constraints", "starts", "evaluations", "front",
    "tolerances",
)  # fmt: skip
FRONT = 5
"""Trade-offs of two objectives."""
AT_REST = ""
"""The line of a study without loads: the scene itself."""


def read_plan(file: Path) -> Plan:
    """The plan in a study file.

    Raises
    ------
    InputError
        if it is not such a study, or does not fit its scene.
    """
    content, table = read_study_of("optimise", file)
    (scene,) = content.pop("scenes")
    if not isinstance(table, dict) or not isinstance(table.get("variables"), dict) or not table["variables"]:
        raise InputError(f"study {file.name} has nothing to optimise: a table [optimise.variables] is needed.")
    for name in [*content, *scene]:
        if name not in (*READ_KEYS, "circuit", "scene", "define"):
            raise InputError(f"{name} is not allowed beside [optimise].")
    for name in table:
        if name not in KEYS:
            raise InputError(f"optimise: {name} is not known: allowed are {', '.join(KEYS)}.")
    circuit = circuit_of(content.pop("circuit")) if "circuit" in content else None
    defines, reading = dict(scene.get("define", {})), {"points": POINTS, **content}
    source, folder = str(scene.get("scene", "")), file.resolve().parent
    first = next(iter(table["variables"]))
    batch = make_batch(source, {}, defines, together={first: ["0"]}, folder=folder, **reading)
    base = batch.scene({}).parameters
    choices = {name: _words(name, given, base) for name, given in _table(table, "choices").items()}
    variables = [_variable(name, given, base, choices) for name, given in table["variables"].items()]
    lines = {name: _line(name, given, base) for name, given in _table(table, "loads").items()} or {AT_REST: ("", [{}])}
    _refuse_twice(variables, choices, lines, defines)
    asked = _Asked(lines, circuit, units_of_parameters(batch.file))
    return Plan(
        batch, circuit, variables, choices, lines, asked.goal(table), asked.limits(table.get("constraints", [])),
        _count(table, "starts", 1), _count(table, "evaluations", 12), _tolerances(table, base), asked.front(table),
    )  # fmt: skip


def _table(table: Mapping[str, Any], name: str) -> dict[str, Any]:
    given = table.get(name, {})
    if not isinstance(given, dict):
        raise InputError(f"optimise: {name} = {given!r} is not allowed: a table [optimise.{name}] is needed.")
    return given


def _count(table: Mapping[str, Any], name: str, default: int) -> int:
    count = table.get(name, default)
    check_whole(f"optimise: {name}", count, 1, TRIED)
    return count


def _variable(name: str, given: Any, base: Mapping[str, str], choices: Mapping[str, list[str]]) -> Variable:
    table = {"low": given[0], "high": given[1]} if is_row(given, is_number) and len(given) == 2 else given
    allowed = isinstance(table, Mapping) and {"low", "high"} <= set(table) <= {"low", "high", "start", "only"}
    if not allowed or not all(is_number(value) for key, value in table.items() if key != "only"):
        raise InputError(
            f"variable {name} = {given!r} is not allowed: [low, high], or low, high, start and only, are needed."
        )
    word = table.get("start", _known(name, base))
    try:
        start = float(word)
    except ValueError:
        raise InputError(f"variable {name} = {word!r} is not allowed: a number in the scene is needed.") from None
    if not table["low"] < table["high"]:
        raise InputError(f"variable {name}: low = {table['low']:g} must be below high = {table['high']:g}.")
    if not table["low"] <= start <= table["high"]:
        raise InputError(f"variable {name}: start = {start:g} must lie from {table['low']:g} to {table['high']:g}.")
    return Variable(name, float(table["low"]), float(table["high"]), start, _only(name, table.get("only", {}), choices))


def _only(name: str, given: Any, choices: Mapping[str, list[str]]) -> dict[str, tuple[str, ...]]:
    """The words of choices that have a variable."""
    if not isinstance(given, Mapping):
        raise InputError(f"variable {name}: only = {given!r} is not allowed: choices and their words are needed.")
    only = {choice: [str(word) for word in (of if isinstance(of, list) else [of])] for choice, of in given.items()}
    for choice, words in only.items():
        if choice not in choices:
            known = ", ".join(choices) or "none"
            raise InputError(f"variable {name}: only.{choice} is not allowed: it is no choice, these are {known}.")
        if not words or not set(words) <= set(choices[choice]):
            known = ", ".join(choices[choice])
            raise InputError(f"variable {name}: only.{choice} = {given[choice]!r} is not allowed: some of {known}.")
    return {choice: tuple(words) for choice, words in only.items()}


def _known(name: str, base: Mapping[str, str]) -> str:
    if name not in base:
        raise InputError(f"{name} is no <default> of the scene with a value: it has {', '.join(base) or 'none'}.")
    return base[name]


def _tolerances(table: Mapping[str, Any], base: Mapping[str, str]) -> dict[str, float]:
    given = _table(table, "tolerances")
    for name, deviation in given.items():
        _known(name, base)
        if not (is_number(deviation) and deviation > 0):
            raise InputError(
                f"tolerance of {name} = {deviation!r} is not allowed: a standard deviation above 0 is needed."
            )
    return {name: float(deviation) for name, deviation in given.items()}


def _words(name: str, given: Any, base: Mapping[str, str]) -> list[str]:
    _known(name, base)
    words = [str(word) for word in given] if isinstance(given, list) else []
    if not words or len(set(words)) < len(words):
        raise InputError(f"choice {name} = {given!r} is not allowed: a list of different values is needed.")
    return words


def _line(name: str, given: Any, base: Mapping[str, str]) -> tuple[str, list[dict[str, str]]]:
    rows = [key for key, value in given.items() if isinstance(value, list)] if isinstance(given, dict) else []
    if len(rows) != 1 or not is_row(given[rows[0]], is_number) or len(given[rows[0]]) < 2:
        raise InputError(f"loads {name} = {given!r} are not allowed: one list of two numbers or more is needed.")
    (along,) = rows
    values = np.array(given[along], dtype=float)
    if not (np.all(np.diff(values) > 0) or np.all(np.diff(values) < 0)):
        raise InputError(f"loads {name}: {along} = {given[along]} must rise or fall all along.")
    fixed = {key: str(value) for key, value in given.items() if key != along}
    for key in given:
        _known(key, base)
    return along, [{**fixed, along: f"{value:.12g}"} for value in values.tolist()]


def _refuse_twice(
    variables: Sequence[Variable], choices: Mapping[str, Any], lines: Mapping[str, Any], defines: Mapping[str, Any]
) -> None:
    loads = {name for _, rows in lines.values() for name in rows[0]}
    places = [{one.name for one in variables}, set(choices), loads]
    for one, other in ((0, 1), (0, 2), (1, 2)):
        for name in sorted(places[one] & places[other]):
            raise InputError(f"{name} is given twice in [optimise]: as variable, choice or load.")
    for name in sorted((places[0] | places[1]) & set(defines)):
        raise InputError(f"{name} is both given a value and to be found: take one of them out.")


@dataclass(frozen=True)
class _Asked:
    """Parses figures of a study with these lines, circuit, and units of parameters."""

    lines: Mapping[str, tuple[str, list[dict[str, str]]]]
    circuit: Circuit | None
    units: Mapping[str, str]

    def goal(self, table: Mapping[str, Any]) -> Goal:
        given = [name for name in ("maximise", "minimise") if name in table]
        if len(given) != 1:
            raise InputError("optimise: either maximise or minimise, with the name of a figure, is needed.")
        return Goal(self.figure(table[given[0]]), -1 if given[0] == "maximise" else 1)

    def front(self, table: Mapping[str, Any]) -> tuple[Goal, int] | None:
        given = _table(table, "front")
        if not given:
            return None
        if not set(given) <= {"maximise", "minimise", "points"} or given.get("points", FRONT) in (1, 2):
            raise InputError(f"front = {given!r} is not allowed: maximise or minimise, and points, from 3, are needed.")
        return self.goal(given), _count(given, "points", FRONT)

    def limits(self, given: Any) -> list[Limit]:
        if not isinstance(given, list) or not all(isinstance(one, dict) for one in given):
            raise InputError("optimise: constraints are not allowed as they stand: [[optimise.constraints]] is needed.")
        limits = []
        for one in given:
            bounds = {name: value for name, value in one.items() if name in ("least", "most")}
            if not bounds or not all(map(is_number, bounds.values())):
                raise InputError(f"constraint {one!r} is not allowed: a number for least, most or both is needed.")
            figure = self.figure({name: value for name, value in one.items() if name not in bounds})
            limits += [Limit(figure, -1 if name == "least" else 1, float(value)) for name, value in bounds.items()]
        for limit in limits:
            self._refuse_beyond_loads(limit)
        return limits

    def _refuse_beyond_loads(self, limit: Limit) -> None:
        """Raise if a range or a contact is to be further than any that the loads tell of."""
        if limit.figure.kind in TO_THE_END and limit.sign < 0:
            along, rows = self.lines[limit.figure.told["along"]]
            largest = max(abs(float(row[along])) for row in rows)
            if limit.bound > FURTHEST * largest:
                raise InputError(
                    f"{limit.words} is not allowed with loads of {along} up to {largest:g}: it is told up to "
                    f"{FURTHEST:g} times that, so loads up to {limit.bound / FURTHEST:g} or more are needed."
                )

    def figure(self, given: Any) -> Figure:
        table = {"figure": given} if isinstance(given, str) else given
        kind = FIGURES_OF_MERIT.get(table.get("figure", "")) if isinstance(table, dict) else None
        if kind is None:
            named = table.get("figure", given) if isinstance(table, dict) else given
            raise InputError(f"figure {named!r} is not known: one of {', '.join(FIGURES_OF_MERIT)} is needed.")
        told = {name: value for name, value in table.items() if name != "figure"}
        name = table["figure"]
        allowed = (*kind.takes, *(("along",) if kind.lines else ()))
        for key in told:
            if key not in allowed:
                raise InputError(f"{name}: {key} is not known: allowed are {', '.join(allowed) or 'none'}.")
        if kind.lines:
            told["along"] = self._along(name, told.get("along"))
        self._check(name, told)
        return Figure(name, told, kind.unit.format(u="W" if self.circuit is None else "V", f=self._unit(name, told)))

    def _unit(self, name: str, told: dict[str, Any]) -> str:
        """That of the loads whose components are told; ``of`` becomes a tuple of their lines."""
        along = told.get("along", ())
        lines = tuple([along] if isinstance(along, str) else along)
        if "of" in told:
            given = told["of"]
            told["of"] = of = tuple([given] if isinstance(given, str) else given if isinstance(given, list) else ())
            if not of or not all(one in lines for one in of):
                raise InputError(f"{name}: of = {given!r} is not allowed: some of {', '.join(lines)} are needed.")
            lines = of
        units = sorted({self.units.get(self.lines[line][0], "1") for line in lines if line})
        if len(units) > 1:
            several = f"{', '.join(lines)} is in {' and '.join(units)}"
            raise InputError(f"{name} of {several}: of = a line, or lines of one unit, is needed.")
        return units[0] if units else "1"

    def _along(self, name: str, given: Any) -> str | tuple[str, ...]:
        several = FIGURES_OF_MERIT[name].lines > 1
        names = (list(self.lines) if several else list(self.lines)[:1]) if given is None else given
        names = [names] if isinstance(names, str) else names
        needed_lines = FIGURES_OF_MERIT[name].lines
        if not is_row(names, lambda line: isinstance(line, str) and line in self.lines) or len(names) < needed_lines:
            some = "two or more lines of loads" if several else "one line of loads"
            needed = f"of {', '.join(self.lines)} {'are' if several else 'is'} needed"
            raise InputError(f"{name}: along = {names!r} is not allowed: {some} {needed}.")
        for line in names:
            steps = FIGURES_OF_MERIT[name].steps
            if len(self.lines[line][1]) < steps:
                along = f" along {line}" if line else ""
                raise InputError(f"{name}{along} cannot be told: {steps} loads or more are needed.")
        if several and len({self.lines[line][0] for line in names}) < len(names):
            raise InputError(f"{name}: along = {names} is not allowed: each must have a load of its own that changes.")
        return tuple(names) if several else names[0]

    def _check(self, name: str, told: Mapping[str, Any]) -> None:
        takes = FIGURES_OF_MERIT[name].takes
        if name == "saturation" and self.circuit is None:
            raise InputError(f"{name} cannot be told without a table [circuit].")
        if "noise" in takes:
            noise = told.get("noise")
            if noise is None and self.circuit is None:
                raise InputError(f"{name} cannot be told without a table [circuit], or a noise of readings in W.")
            if noise is not None and not (is_number(noise) and noise > 0):
                raise InputError(f"{name}: noise = {noise!r} is not allowed: a number above 0 is needed.")
        if "taxel" in takes and not (is_whole(told.get("taxel")) and told["taxel"] > 0):
            raise InputError(f"{name}: taxel = {told.get('taxel')!r} is not allowed: the number of a taxel is needed.")
        if "by" in takes and told.get("by") not in self.lines:
            raise InputError(f"{name}: by = {told.get('by')!r} is not allowed: a line of loads is needed.")
