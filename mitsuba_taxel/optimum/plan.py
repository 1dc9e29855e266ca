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
"""Largest number of points within the bounds that are tried in search of a valid pad."""


@dataclass(frozen=True)
class Variable:
    """A numeric parameter of the scene that is varied.

    Attributes
    ----------
    name : str
        Parameter.
    low, high : float
        Bounds.
    start : float
        Initial value.
    only : Mapping[str, tuple[str, ...]]
        For each choice, the words for which the variable applies; empty if it always applies.
    """

    name: str
    low: float
    high: float
    start: float
    only: Mapping[str, tuple[str, ...]]

    @property
    def start_fraction(self) -> float:
        """The initial value as a fraction of the range between the bounds."""
        return (self.start - self.low) / (self.high - self.low)


@dataclass(frozen=True)
class Goal:
    """A figure to be maximised (sign -1) or minimised (1)."""

    figure: Figure
    sign: int

    @property
    def words(self) -> str:
        """The goal in words, such as ``maximise sensitivity along normal``."""
        return f"{'maximise' if self.sign < 0 else 'minimise'} {self.figure.words}"


@dataclass(frozen=True)
class Limit:
    """A figure whose components must all be at least (sign -1) or at most (sign 1) a bound."""

    figure: Figure
    sign: int
    bound: float

    @property
    def words(self) -> str:
        """The constraint in words, such as ``nonlinearity along normal <= 0.03``."""
        return f"{self.figure.words} {'>=' if self.sign < 0 else '<='} {self.bound:g}"


@dataclass(frozen=True)
class Design:
    """A design: values of all variables and choices, and the origin of its mesh.

    Attributes
    ----------
    choice : tuple[str, ...]
        Word of each choice.
    x : tuple[float, ...]
        Variables, scaled by their bounds to the unit cube; variables that do not apply have their initial values.
    origin : tuple[float, ...] or None
        Variables of another design whose mesh is moved to the shape of this design; None if this design is meshed
        itself.
    """

    choice: tuple[str, ...]
    x: tuple[float, ...]
    origin: tuple[float, ...] | None = None

    @property
    def alone(self) -> Design:
        """The same design without an origin: its mesh is generated, not moved from another design."""
        return replace(self, origin=None)

    @property
    def family(self) -> tuple[float, ...]:
        """Key of a design's mesh: the variables of the design that was meshed, which is this design or the origin of
        its moved mesh.
        """
        return self.x if self.origin is None else self.origin


@dataclass(frozen=True, eq=False)
class Plan:
    """Definition of an optimisation: variables, loads, objective and constraints.

    Attributes
    ----------
    batch : Batch
        The scene, and the settings of its readings; its only row is the original scene.
    circuit : Circuit or None
        Read-out circuit; figures are then in V.
    variables : list[Variable]
        Numeric parameters that are varied continuously.
    choices : dict[str, list[str]]
        Values to try, one after another, for each parameter.
    lines : dict[str, tuple[str, list[dict[str, str]]]]
        Lines of loads by name. A line is the name of the parameter that changes, and for each load the values of all
        parameters.
    goal : Goal
        Objective.
    limits : list[Limit]
        Constraints.
    starts, evaluations : int
        Number of starts for each choice, and number of evaluations for each start.
    tolerances : dict[str, float]
        Standard deviations by parameter.
    front : tuple[Goal, int] or None
        Second objective of a Pareto front, and the number of its points.
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
    def criteria(self) -> list[Goal | Limit]:
        """The objective and all constraints of the optimisation, in one list."""
        return [self.goal, *self.limits]

    @property
    def front_units(self) -> list[str]:
        """Units of the two objectives of a front."""
        return [self.goal.figure.unit, *([self.front[0].figure.unit] if self.front else [])]

    @property
    def base(self) -> dict[str, str]:
        """Values of the parameters of the original scene, by name."""
        return self.batch.scene({}).parameters

    @property
    def loads(self) -> list[dict[str, str]]:
        """All distinct loads of all lines of loads, as values of the scene's parameters."""
        rows = [tuple(sorted(row.items())) for _, rows in self.lines.values() for row in rows]
        return [dict(row) for row in dict.fromkeys(rows)]

    @property
    def figures(self) -> list[Figure]:
        """The figures of merit of the objective and of all constraints."""
        return [criterion.figure for criterion in (*self.criteria, *([self.front[0]] if self.front else []))]

    @property
    def to_contact(self) -> dict[str, dict[str, str]]:
        """Parameters of the scene with which the first contact of the pad is computed, for each line of loads that
        needs it.

        They are the parameters of the last load of the line, and `TO_CONTACT`, which extends the load path until the
        contact.
        """
        last_loads = {}
        for line in dict.fromkeys(figure.parameters["along"] for figure in self.figures if figure.kind in TO_THE_END):
            along, rows = self.lines[line]
            first, last = float(rows[0][along]), float(rows[-1][along])
            furthest = math.copysign(FURTHEST * max(abs(first), abs(last)), last - first)
            last_loads[line] = {**rows[-1], TO_CONTACT: f"{along}={furthest:.12g}"}
        return last_loads

    @property
    def before(self) -> Design:
        """The design of the original scene. Where a choice does not contain the word of the scene, the design has the
        first word of the choice.
        """
        base = self.base
        choice = tuple(base[name] if base[name] in words else words[0] for name, words in self.choices.items())
        return Design(choice, tuple(variable.start_fraction for variable in self.variables))

    def has(self, choice: tuple[str, ...]) -> list[bool]:
        """Whether each variable applies to a choice of words (a tuple with one word for each parameter)."""
        words = dict(zip(self.choices, choice, strict=True))
        return [all(words[name] in of for name, of in variable.only.items()) for variable in self.variables]

    def design(self, choice: tuple[str, ...], x: Sequence[float]) -> Design:
        """The design with a word for each choice and a value for each variable; variables that do not apply get their
        initial values.
        """
        pairs = zip(self.variables, x, self.has(choice), strict=True)
        return Design(
            choice, tuple(value if applies else variable.start_fraction for variable, value, applies in pairs)
        )

    def values(self, design: Design) -> dict[str, float]:
        """Values by name of the variables that apply to a design, rounded as in written scenes."""
        pairs = zip(self.variables, design.x, self.has(design.choice), strict=True)
        return {
            variable.name: float(f"{variable.low + x * (variable.high - variable.low):.12g}")
            for variable, x, applies in pairs
            if applies
        }

    def parameters(self, design: Design) -> dict[str, str]:
        """Values of the scene's parameters for a design. Variables that do not apply are `NONE`, which removes the
        elements that use them.
        """
        numbers = {name: f"{value:.12g}" for name, value in self.values(design).items()}
        words = dict(zip(self.choices, design.choice, strict=True))
        return {**words, **{variable.name: numbers.get(variable.name, NONE) for variable in self.variables}}

    def refusal(self, design: Design) -> InputError | None:
        """The error of a design whose description is invalid; None if it is valid."""
        return refusal_of(self.scene(design))

    def mesh_of(self, design: Design) -> str:
        """Parameters of the design whose mesh is deformed to fit this design, as text; `NONE` if this design is meshed
        itself. It is the value of the scene's parameter `MESHED_AS`."""
        if design.origin is None:
            return NONE
        origin = self.parameters(replace(design, x=design.origin))
        return ", ".join(f"{name}={word}" for name, word in origin.items() if word != NONE)

    def scene_parameters(self, design: Design) -> dict[str, str]:
        """Values of the scene's parameters for a design, including `MESHED_AS`, the design whose mesh is deformed."""
        return self.parameters(design) | ({} if design.origin is None else {MESHED_AS: self.mesh_of(design)})

    def scene(self, design: Design) -> Scene:
        """The loaded scene of a design."""
        return self.batch.scene(self.scene_parameters(design))

    def initial_designs(self) -> list[Design]:
        """Initial designs for each choice: the values of the scene if valid, and points of a Sobol' sequence.

        Raises
        ------
        InputError
            if no point within the bounds is valid for any choice, or for one of the words of a choice.
        """
        designs: dict[Design, None] = {}
        for choice in product(*self.choices.values()):
            points = chain([self.before.x], _spread(len(self.variables), self.batch.seed))
            distinct = dict.fromkeys(self.design(choice, x) for x in points)
            designs |= dict.fromkeys(
                islice((design for design in distinct if self.refusal(design) is None), self.starts)
            )
        if not designs:
            first = self.design(self.before.choice, self.before.x)
            raise InputError(f"no sensor within the bounds of variables is possible: {self.refusal(first)}")
        self._refuse_words_without(list(designs))
        return list(designs)

    def _refuse_words_without(self, designs: Sequence[Design]) -> None:
        """Raise `InputError` for a word of a choice for which there is no valid initial design."""
        for number, (name, words) in enumerate(self.choices.items()):
            for word in words:
                if not any(design.choice[number] == word for design in designs):
                    choice = list(designs[0].choice)
                    choice[number] = word
                    refused = self.refusal(self.design(tuple(choice), self.before.x))
                    raise InputError(f"{name} = {word} is not possible within the bounds of variables: {refused}")


def _spread(dimensions: int, seed: int) -> Iterator[tuple[float, ...]]:
    """Points of a scrambled Sobol' sequence, spread evenly over the unit cube of the variables."""
    from scipy.stats import qmc

    points = qmc.Sobol(dimensions, seed=np.random.default_rng(seed)).random(TRIED)
    yield from map(tuple, points.tolist())
