"""Plan of an optimisation: a study file with a table ``[optimise]``."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, islice, product
from pathlib import Path
from typing import Any

import numpy as np

from mitsuba_taxel.base.arguments import is_number, is_row, is_whole
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.electronics.circuit import Circuit, circuit_of
from mitsuba_taxel.optimum.figures import FURTHEST, KINDS, TO_THE_END, Figure
from mitsuba_taxel.sensing import Scene
from mitsuba_taxel.sensing.left_out import NONE
from mitsuba_taxel.sensing.parameter_units import units_of_parameters
from mitsuba_taxel.sensing.parsed_parts import refusal_of
from mitsuba_taxel.sensing.scene import MESHED_AS
from mitsuba_taxel.studies.plan.batch import Batch, make_batch, read_study_of
from mitsuba_taxel.studies.plan.to_contact import TO_CONTACT

POINTS = 16
"""Points of the random readings that accompany those without random numbers."""
READ_KEYS = ("points", "mesh_size", "seed")
KEYS = (
    "maximise",
    "minimise",
    "variables",
    "choices",
    "loads",
    "constraints",
    "starts",
    "evaluations",
    "front",
    "tolerances",
)
FRONT = 5
"""Trade-offs of two objectives."""
TRIED = 256
"""Most points within the bounds at which a valid pad is searched."""
AT_REST = ""
"""The line of a study without loads: the scene itself."""


@dataclass(frozen=True)
class Variable:
    """A number of the scene, its bounds, its initial value, and the words of choices that have it, if not all."""

    name: str
    low: float
    high: float
    start: float
    only: Mapping[str, tuple[str, ...]]

    @property
    def begins(self) -> float:
        """The initial value, relative to the bounds."""
        return (self.start - self.low) / (self.high - self.low)


@dataclass(frozen=True)
class Goal:
    """A figure to be maximised (sign -1) or minimised (1)."""

    figure: Figure
    sign: int

    @property
    def words(self) -> str:
        """Such as ``maximise sensitivity along normal``."""
        return f"{'maximise' if self.sign < 0 else 'minimise'} {self.figure.words}"


@dataclass(frozen=True)
class Limit:
    """A figure of which all components must be at least (sign -1) or at most (1) a bound."""

    figure: Figure
    sign: int
    bound: float

    @property
    def words(self) -> str:
        """Such as ``nonlinearity along normal <= 0.03``."""
        return f"{self.figure.words} {'>=' if self.sign < 0 else '<='} {self.bound:g}"


@dataclass(frozen=True)
class Design:
    """A sensor, and its mesh.

    Attributes
    ----------
    choice : tuple[str, ...]
        Words of the choices.
    x : tuple[float, ...]
        The variables in the unit cube of their bounds; those that do not apply are at their initial values.
    origin : tuple[float, ...] or None
        Those of the design whose mesh is moved onto this one; None if it has its own.
    """

    choice: tuple[str, ...]
    x: tuple[float, ...]
    origin: tuple[float, ...] | None = None

    @property
    def alone(self) -> Design:
        """The same sensor with a mesh of its own."""
        return replace(self, origin=None)

    @property
    def family(self) -> tuple[float, ...]:
        """The variables of the design whose mesh, moved or not, this one has."""
        return self.x if self.origin is None else self.origin


@dataclass(frozen=True, eq=False)
class Plan:
    """An optimisation.

    Attributes
    ----------
    batch : Batch
        The scene, and the settings of its readings; its one row is the original scene.
    circuit : Circuit or None
    variables : list[Variable]
    choices : dict[str, list[str]]
        Words of parameters that are tried one by one.
    lines : dict[str, tuple[str, list[dict[str, str]]]]
        By name: the parameter that changes, and the values of all parameters at each load.
    goal : Goal
    limits : list[Limit]
    starts, evaluations : int
        For each choice, and for each start.
    tolerances : dict[str, float]
        Standard deviations of parameters.
    front : tuple[Goal, int] or None
        Another objective, and the number of points of the front.
    """

    batch: Batch
    circuit: Circuit | None
    variables: list[Variable]
    choices: dict[str, list[str]]
    lines: dict[str, tuple[str, list[dict[str, str]]]]
    goal: Goal
    limits: list[Limit]
    starts: int
    evaluations: int
    tolerances: dict[str, float]
    front: tuple[Goal, int] | None

    @property
    def asked(self) -> list[Goal | Limit]:
        """The objective, and all constraints."""
        return [self.goal, *self.limits]

    @property
    def front_units(self) -> list[str]:
        """Units of the two objectives of a front."""
        return [self.goal.figure.unit, *([self.front[0].figure.unit] if self.front else [])]

    @property
    def base(self) -> dict[str, str]:
        """Parameters of the original scene."""
        return self.batch.scene({}).parameters

    @property
    def loads(self) -> list[dict[str, str]]:
        """All distinct loads of all lines."""
        rows = [tuple(sorted(row.items())) for _, rows in self.lines.values() for row in rows]
        return [dict(row) for row in dict.fromkeys(rows)]

    @property
    def figures(self) -> list[Figure]:
        """All figures."""
        return [one.figure for one in (*self.asked, *([self.front[0]] if self.front else []))]

    @property
    def to_contact(self) -> dict[str, dict[str, str]]:
        """The last load of each line along which the first contact counts, to be followed to there."""
        found = {}
        for line in dict.fromkeys(one.told["along"] for one in self.figures if one.kind in TO_THE_END):
            along, rows = self.lines[line]
            first, last = float(rows[0][along]), float(rows[-1][along])
            furthest = math.copysign(FURTHEST * max(abs(first), abs(last)), last - first)
            found[line] = {**rows[-1], TO_CONTACT: f"{along}={furthest:.12g}"}
        return found

    @property
    def before(self) -> Design:
        """The original scene, or the first choices if its own are not among them."""
        base = self.base
        choice = tuple(base[name] if base[name] in words else words[0] for name, words in self.choices.items())
        return Design(choice, tuple(one.begins for one in self.variables))

    def has(self, choice: tuple[str, ...]) -> list[bool]:
        """Which variables a choice has."""
        words = dict(zip(self.choices, choice, strict=True))
        return [all(words[name] in of for name, of in one.only.items()) for one in self.variables]

    def design(self, choice: tuple[str, ...], x: Sequence[float]) -> Design:
        """The design with these words and variables, as far as they apply."""
        pairs = zip(self.variables, x, self.has(choice), strict=True)
        return Design(choice, tuple(at if there else one.begins for one, at, there in pairs))

    def values(self, design: Design) -> dict[str, float]:
        """The variables that a design has, rounded as written."""
        pairs = zip(self.variables, design.x, self.has(design.choice), strict=True)
        return {one.name: float(f"{one.low + x * (one.high - one.low):.12g}") for one, x, there in pairs if there}

    def parameters(self, design: Design) -> dict[str, str]:
        """Parameters of the scene of a design; what uses variables that it does not have is left out."""
        numbers = {name: f"{value:.12g}" for name, value in self.values(design).items()}
        words = dict(zip(self.choices, design.choice, strict=True))
        return {**words, **{one.name: numbers.get(one.name, NONE) for one in self.variables}}

    def refusal(self, design: Design) -> InputError | None:
        """Why a design is invalid, as far as its description tells; None if it is valid."""
        return refusal_of(self.scene(design))

    def mesh_of(self, design: Design) -> str:
        """The parameters of the scene whose mesh a design has, as `MESHED_AS`."""
        if design.origin is None:
            return NONE
        origin = self.parameters(replace(design, x=design.origin))
        return ", ".join(f"{name}={word}" for name, word in origin.items() if word != NONE)

    def told(self, design: Design) -> dict[str, str]:
        """Parameters of the scene of a design, with those of its mesh."""
        return self.parameters(design) | ({} if design.origin is None else {MESHED_AS: self.mesh_of(design)})

    def scene(self, design: Design) -> Scene:
        """The scene of a design."""
        return self.batch.scene(self.told(design))

    def begun(self) -> list[Design]:
        """Initial designs for each choice: the scene's own values if valid, and points of a Sobol' set.

        Raises
        ------
        InputError
            if no point within the bounds is valid for any choice, or for one of its words, with a reason.
        """
        found: dict[Design, None] = {}
        for choice in product(*self.choices.values()):
            places = chain([self.before.x], _spread(len(self.variables), self.batch.seed))
            distinct = dict.fromkeys(self.design(choice, x) for x in places)
            found |= dict.fromkeys(islice((one for one in distinct if self.refusal(one) is None), self.starts))
        if not found:
            first = self.design(self.before.choice, self.before.x)
            raise InputError(f"no sensor within the bounds of variables is possible: {self.refusal(first)}")
        self._refuse_words_without(list(found))
        return list(found)

    def _refuse_words_without(self, found: Sequence[Design]) -> None:
        for place, (name, words) in enumerate(self.choices.items()):
            for word in words:
                if not any(design.choice[place] == word for design in found):
                    choice = list(found[0].choice)
                    choice[place] = word
                    refused = self.refusal(self.design(tuple(choice), self.before.x))
                    raise InputError(f"{name} = {word} is no choice within the bounds of variables: {refused}")


def _spread(dimensions: int, seed: int) -> Iterator[tuple[float, ...]]:
    from scipy.stats import qmc

    points = qmc.Sobol(dimensions, seed=np.random.default_rng(seed)).random(TRIED)
    yield from map(tuple, points.tolist())


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
    if not (is_whole(count) and 1 <= count <= TRIED):
        raise InputError(f"optimise: {name} = {count!r} is not allowed: a whole number from 1 to {TRIED} is needed.")
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
        kind = KINDS.get(table.get("figure", "")) if isinstance(table, dict) else None
        if kind is None:
            named = table.get("figure", given) if isinstance(table, dict) else given
            raise InputError(f"figure {named!r} is not known: one of {', '.join(KINDS)} is needed.")
        told = {name: value for name, value in table.items() if name != "figure"}
        name = table["figure"]
        allowed = (*kind.takes, *(("along",) if kind.lines else ()))
        for key in told:
            if key not in allowed:
                raise InputError(f"{name}: {key} is not known: allowed are {', '.join(allowed) or 'none'}.")
        if kind.lines:
            told["along"] = self._along(name, told.get("along"))
        self._check(name, told)
        along = told.get("along", ())
        first = along if isinstance(along, str) else next(iter(along), "")
        of = self.units.get(self.lines[first][0], "1") if first else "1"
        return Figure(name, told, kind.unit.format(u="W" if self.circuit is None else "V", f=of))

    def _along(self, name: str, given: Any) -> str | tuple[str, ...]:
        several = KINDS[name].lines > 1
        names = (list(self.lines) if several else list(self.lines)[:1]) if given is None else given
        names = [names] if isinstance(names, str) else names
        if not is_row(names, lambda one: isinstance(one, str) and one in self.lines) or len(names) < KINDS[name].lines:
            some = "two or more lines of loads" if several else "one line of loads"
            needed = f"of {', '.join(self.lines)} {'are' if several else 'is'} needed"
            raise InputError(f"{name}: along = {names!r} is not allowed: {some} {needed}.")
        for line in names:
            if len(self.lines[line][1]) < KINDS[name].steps:
                along = f" along {line}" if line else ""
                raise InputError(f"{name}{along} cannot be told: {KINDS[name].steps} loads or more are needed.")
        if several and len({self.lines[line][0] for line in names}) < len(names):
            raise InputError(f"{name}: along = {names} is not allowed: each must have a load of its own that changes.")
        return tuple(names) if several else names[0]

    def _check(self, name: str, told: Mapping[str, Any]) -> None:
        takes = KINDS[name].takes
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
