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
"""Default number of points, for scenes that need random paths."""
READ_KEYS = ("points", "mesh_size", "seed")
KEYS = (
    "maximise", "minimise", "variables", "choices", "loads", "constraints", "starts", "evaluations", "front",
    "tolerances",
)  # fmt: skip
FRONT = 5
"""Default number of points of a Pareto front."""
AT_REST = ""
"""Name of the only line of a study without loads: the scene itself."""


def read_plan(file: Path) -> Plan:
    """Read the definition of an optimisation from a study file (TOML) with a table ``[optimise]``.

    Raises
    ------
    InputError
        if the file is not such a study, or does not fit its scene.
    """
    # The study file; keys that an optimisation does not use are refused.
    content, table = read_study_of("optimise", file)
    (scene,) = content.pop("scenes")
    if not isinstance(table, dict) or not isinstance(table.get("variables"), dict) or not table["variables"]:
        raise InputError(f"study {file.name} has nothing to optimise: a table [optimise.variables] is needed.")
    for name in [*content, *scene]:
        if name not in (*READ_KEYS, "circuit", "scene", "define"):
            raise InputError(f"{name} is not allowed beside [optimise]: take it out.")
    for name in table:
        if name not in KEYS:
            raise InputError(f"optimise: {name} is not known: allowed are {', '.join(KEYS)}.")

    # The scene; a batch needs a varied parameter, here the first variable.
    circuit = circuit_of(content.pop("circuit")) if "circuit" in content else None
    defines, reading = dict(scene.get("define", {})), {"points": POINTS, **content}
    source, folder = str(scene.get("scene", "")), file.resolve().parent
    first = next(iter(table["variables"]))
    batch = make_batch(source, {}, defines, together={first: ["0"]}, folder=folder, **reading)
    base = batch.scene({}).parameters

    # Variables, choices and loads, then the figures, which refer to loads.
    choices = {name: _words(name, content_of, base) for name, content_of in _table(table, "choices").items()}
    variables = [_variable(name, content_of, base, choices) for name, content_of in table["variables"].items()]
    lines = {name: _line(name, content_of, base) for name, content_of in _table(table, "loads").items()} or {
        AT_REST: ("", [{}])
    }
    _refuse_twice(variables, choices, lines, defines)
    reader = _FigureReader(lines, circuit, units_of_parameters(batch.file))
    return Plan(
        batch=batch,
        circuit=circuit,
        variables=variables,
        choices=choices,
        lines=lines,
        goal=reader.goal(table),
        limits=reader.limits(table.get("constraints", [])),
        starts=_count(table, "starts", 1),
        evaluations=_count(table, "evaluations", 12),
        tolerances=_tolerances(table, base),
        front=reader.front(table),
    )  # fmt: skip


def _table(table: Mapping[str, Any], name: str) -> dict[str, Any]:
    """The sub-table ``name`` of ``[optimise]`` in a study file; empty if there is none."""
    inner = table.get(name, {})
    if not isinstance(inner, dict):
        raise InputError(f"optimise: {name} = {inner!r} is not allowed: a table [optimise.{name}] is needed.")
    return inner


def _count(table: Mapping[str, Any], name: str, default: int) -> int:
    count = table.get(name, default)
    check_whole(f"optimise: {name}", count, 1, TRIED)
    return count


def _variable(name: str, definition: Any, base: Mapping[str, str], choices: Mapping[str, list[str]]) -> Variable:
    """Create a variable from its definition in the study file. By default, its initial value is its value in the
    scene's parameters ``base``."""
    table = (
        {"low": definition[0], "high": definition[1]}
        if is_row(definition, is_number) and len(definition) == 2
        else definition
    )
    allowed = isinstance(table, Mapping) and {"low", "high"} <= set(table) <= {"low", "high", "start", "only"}
    if not allowed or not all(is_number(value) for key, value in table.items() if key != "only"):
        raise InputError(
            f"variable {name} = {definition!r} is not allowed: [low, high], or low, high, start and only, are needed."
        )
    word = table.get("start", _default(name, base))
    try:
        start = float(word)
    except ValueError:
        raise InputError(
            f"variable {name} = {word!r} is not allowed: a <default> of the scene with a number is needed."
        ) from None
    if not table["low"] < table["high"]:
        raise InputError(f"variable {name}: low = {table['low']:g} must be below high = {table['high']:g}.")
    if not table["low"] <= start <= table["high"]:
        raise InputError(f"variable {name}: start = {start:g} must lie from {table['low']:g} to {table['high']:g}.")
    return Variable(name, float(table["low"]), float(table["high"]), start, _only(name, table.get("only", {}), choices))


def _only(name: str, words_of: Any, choices: Mapping[str, list[str]]) -> dict[str, tuple[str, ...]]:
    """For each choice of a design, the words with which a variable applies. With other words, the variable is
    omitted."""
    if not isinstance(words_of, Mapping):
        raise InputError(
            f"variable {name}: only = {words_of!r} is not allowed: a table of choices, each with a list "
            f"of its values, is needed."
        )
    only = {choice: [str(word) for word in (of if isinstance(of, list) else [of])] for choice, of in words_of.items()}
    for choice, words in only.items():
        if choice not in choices:
            allowed = ", ".join(choices) or "none"
            raise InputError(f"variable {name}: only.{choice} is not allowed: it is not one of the choices {allowed}.")
        if not words or not set(words) <= set(choices[choice]):
            allowed = ", ".join(choices[choice])
            raise InputError(
                f"variable {name}: only.{choice} = {words_of[choice]!r} is not allowed: one or more of {allowed} are "
                f"needed."
            )
    return {choice: tuple(words) for choice, words in only.items()}


def _default(name: str, base: Mapping[str, str]) -> str:
    """Value of a parameter of the scene; raises `InputError` if there is none."""
    if name not in base:
        raise InputError(
            f"{name} is not a <default> of the scene with a value: allowed are {', '.join(base) or 'none'}."
        )
    return base[name]


def _tolerances(table: Mapping[str, Any], base: Mapping[str, str]) -> dict[str, float]:
    """Standard deviations of parameters with a tolerance, by name, from the study file."""
    deviations = _table(table, "tolerances")
    for name, deviation in deviations.items():
        _default(name, base)
        if not (is_number(deviation) and deviation > 0):
            raise InputError(
                f"tolerance of {name} = {deviation!r} is not allowed: a standard deviation above 0 is needed."
            )
    return {name: float(deviation) for name, deviation in deviations.items()}


def _words(name: str, listed: Any, base: Mapping[str, str]) -> list[str]:
    _default(name, base)
    words = [str(word) for word in listed] if isinstance(listed, list) else []
    if not words or len(set(words)) < len(words):
        raise InputError(f"choice {name} = {listed!r} is not allowed: a list of different values is needed.")
    return words


def _line(name: str, definition: Any, base: Mapping[str, str]) -> tuple[str, list[dict[str, str]]]:
    rows = [key for key, value in definition.items() if isinstance(value, list)] if isinstance(definition, dict) else []
    if len(rows) != 1 or not is_row(definition[rows[0]], is_number) or len(definition[rows[0]]) < 2:
        raise InputError(f"loads {name} = {definition!r} are not allowed: one list of two numbers or more is needed.")
    (along,) = rows
    values = np.array(definition[along], dtype=float)
    if not (np.all(np.diff(values) > 0) or np.all(np.diff(values) < 0)):
        raise InputError(
            f"loads {name}: {along} = {definition[along]} is not allowed: values must only rise, or only fall."
        )
    fixed = {key: str(value) for key, value in definition.items() if key != along}
    for key in definition:
        _default(key, base)
    return along, [{**fixed, along: f"{value:.12g}"} for value in values.tolist()]


def _refuse_twice(
    variables: Sequence[Variable], choices: Mapping[str, Any], lines: Mapping[str, Any], defines: Mapping[str, Any]
) -> None:
    loads = {name for _, rows in lines.values() for name in rows[0]}
    names = [{first.name for first in variables}, set(choices), loads]
    for first, second in ((0, 1), (0, 2), (1, 2)):
        for name in sorted(names[first] & names[second]):
            raise InputError(f"{name} is given twice in [optimise]: give it once, as a variable, a choice or a load.")
    for name in sorted((names[0] | names[1]) & set(defines)):
        raise InputError(f"{name} is both given a value and optimised: take one of them out.")


@dataclass(frozen=True)
class _FigureReader:
    """Reads goals and constraints of a study.

    Attributes
    ----------
    lines : Mapping[str, tuple[str, list[dict[str, str]]]]
        Lines of loads, as in `Plan`.
    circuit : Circuit or None
        Read-out circuit.
    units : Mapping[str, str]
        Units by parameter.
    """

    lines: Mapping[str, tuple[str, list[dict[str, str]]]]
    circuit: Circuit | None
    units: Mapping[str, str]

    def goal(self, table: Mapping[str, Any]) -> Goal:
        directions = [name for name in ("maximise", "minimise") if name in table]
        if len(directions) != 1:
            raise InputError("optimise: one goal is needed, maximise or minimise, with the name of a figure.")
        return Goal(self.figure(table[directions[0]]), -1 if directions[0] == "maximise" else 1)

    def front(self, table: Mapping[str, Any]) -> tuple[Goal, int] | None:
        definition = _table(table, "front")
        if not definition:
            return None
        if not set(definition) <= {"maximise", "minimise", "points"} or definition.get("points", FRONT) in (1, 2):
            raise InputError(
                f"front = {definition!r} is not allowed: a table with maximise or minimise, and with points = 3 or "
                "more, is needed."
            )
        return self.goal(definition), _count(definition, "points", FRONT)

    def limits(self, constraints: Any) -> list[Limit]:
        if not isinstance(constraints, list) or not all(isinstance(constraint, dict) for constraint in constraints):
            raise InputError("optimise: constraints must be tables [[optimise.constraints]].")
        limits = []
        for constraint in constraints:
            bounds = {name: value for name, value in constraint.items() if name in ("least", "most")}
            if not bounds or not all(map(is_number, bounds.values())):
                raise InputError(
                    f"constraint {constraint!r} is not allowed: a number for least, most or both is needed."
                )
            figure = self.figure({name: value for name, value in constraint.items() if name not in bounds})
            limits += [Limit(figure, -1 if name == "least" else 1, float(value)) for name, value in bounds.items()]
        for limit in limits:
            self._refuse_beyond_loads(limit)
        return limits

    def _refuse_beyond_loads(self, limit: Limit) -> None:
        """Raise `InputError` if the bound of a range or of a first contact is beyond the largest computed load."""
        if limit.figure.kind in TO_THE_END and limit.sign < 0:
            along, rows = self.lines[limit.figure.parameters["along"]]
            largest = max(abs(float(row[along])) for row in rows)
            if limit.bound > FURTHEST * largest:
                raise InputError(
                    f"{limit.words} is not allowed with loads of {along} up to {largest:g}: the figure is computed "
                    f"up to {FURTHEST:g} times that load, so loads up to {limit.bound / FURTHEST:g} or more are needed."
                )

    def figure(self, definition: Any) -> Figure:
        table = {"figure": definition} if isinstance(definition, str) else definition
        kind = FIGURES_OF_MERIT.get(table.get("figure", "")) if isinstance(table, dict) else None
        if kind is None:
            named = table.get("figure", definition) if isinstance(table, dict) else definition
            raise InputError(f"figure {named!r} is not known: one of {', '.join(FIGURES_OF_MERIT)} is needed.")
        parameters = {name: value for name, value in table.items() if name != "figure"}
        name = table["figure"]
        allowed = (*kind.takes, *(("along",) if kind.lines else ()))
        for key in parameters:
            if key not in allowed:
                raise InputError(f"{name}: {key} is not known: allowed are {', '.join(allowed) or 'none'}.")
        if kind.lines:
            parameters["along"] = self._along(name, parameters.get("along"))
        self._check(name, parameters)
        return Figure(
            name, parameters, kind.unit.format(u="W" if self.circuit is None else "V", f=self._unit(name, parameters))
        )

    def _unit(self, name: str, parameters: dict[str, Any]) -> str:
        """Unit of the loads of a figure; the parameter ``of`` is replaced by a tuple of lines."""
        along = parameters.get("along", ())
        lines = tuple([along] if isinstance(along, str) else along)
        if "of" in parameters:
            lines_of = parameters["of"]
            parameters["of"] = of = tuple(
                [lines_of] if isinstance(lines_of, str) else lines_of if isinstance(lines_of, list) else ()
            )
            if not of or not all(line in lines for line in of):
                raise InputError(
                    f"{name}: of = {lines_of!r} is not allowed: one or more of {', '.join(lines)} are needed."
                )
            lines = of
        units = sorted({self.units.get(self.lines[line][0], "1") for line in lines if line})
        if len(units) > 1:
            several = f"{', '.join(lines)} is in {' and '.join(units)}"
            raise InputError(f"{name} of {several}: of = a line, or lines of one unit, is needed.")
        return units[0] if units else "1"

    def _along(self, name: str, requested: Any) -> str | tuple[str, ...]:
        """Line of loads of a figure, by default the first line. For figures of several lines: the lines, by default
        all."""
        several = FIGURES_OF_MERIT[name].lines > 1
        names = (list(self.lines) if several else list(self.lines)[:1]) if requested is None else requested
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
                raise InputError(f"{name}{along} cannot be computed: {steps} loads or more are needed.")
        if several and len({self.lines[line][0] for line in names}) < len(names):
            raise InputError(f"{name}: along = {names} is not allowed: each must have a different load that changes.")
        return tuple(names) if several else names[0]

    def _check(self, name: str, parameters: Mapping[str, Any]) -> None:
        takes = FIGURES_OF_MERIT[name].takes
        if name == "saturation" and self.circuit is None:
            raise InputError(f"{name} cannot be computed without a table [circuit]: add one.")
        if "noise" in takes:
            noise = parameters.get("noise")
            if noise is None and self.circuit is None:
                raise InputError(
                    f"{name} cannot be computed without a table [circuit], or a noise of readings in W: add one."
                )
            if noise is not None and not (is_number(noise) and noise > 0):
                raise InputError(f"{name}: noise = {noise!r} is not allowed: a number above 0 is needed.")
        if "taxel" in takes and not (is_whole(parameters.get("taxel")) and parameters["taxel"] > 0):
            raise InputError(
                f"{name}: taxel = {parameters.get('taxel')!r} is not allowed: the number of a taxel is needed."
            )
        if "by" in takes and parameters.get("by") not in self.lines:
            raise InputError(f"{name}: by = {parameters.get('by')!r} is not allowed: a line of loads is needed.")
