"""Plan of an optimisation: its variables, figures and loads, and the designs within its bounds."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, islice, product

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.electronics.circuit import Circuit
from mitsuba_taxel.optimum.figures import FURTHEST, TO_THE_END, Figure
from mitsuba_taxel.sensing import Scene
from mitsuba_taxel.sensing.scene.description import MESHED_AS
from mitsuba_taxel.sensing.scene.left_out import NONE
from mitsuba_taxel.sensing.scene.parsed_parts import refusal_of
from mitsuba_taxel.studies.plan.batch import Batch
from mitsuba_taxel.studies.plan.to_contact import TO_CONTACT

TRIED = 256
"""Most points within the bounds at which a valid pad is searched."""


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
