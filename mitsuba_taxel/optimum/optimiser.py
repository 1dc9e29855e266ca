"""The optimiser: all evaluated designs, their objectives and constraints, and the best so far."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from mitsuba_taxel.optimum.descent import JUMP, JUMP_BARE, JUMP_MOVED, TOLERANCE, TOLERANCE_BARE, Trial, descend
from mitsuba_taxel.optimum.designs import DesignEvaluation, DesignEvaluator
from mitsuba_taxel.optimum.figures import TINY, Figure
from mitsuba_taxel.optimum.plan import Design, Goal, Limit, Plan
from mitsuba_taxel.optimum.search import Linearisation, Stationarity, stationarity

QUANTILE = 1.2816
"""Quantile of 90 % of a normal distribution, in standard deviations."""
ROUNDS = 3
"""Largest number of successive descents with tolerances; the spread is evaluated at the start of each."""
SAME = 1e-6
"""Largest difference of designs that count as equal, relative to the bounds' width; another mesh changes readings
more."""
NEAR = 0.02
"""Largest difference, relative to the bounds' width, of designs whose gradients differ by their meshes rather than by
the designs."""
HELD = 1e-3
"""Allowed violation of a constraint, relative to its bound."""


class OptimisationProgress(NamedTuple):
    """Progress of an optimisation.

    Attributes
    ----------
    designs, failed : int
        Number of evaluated designs, and number of failed designs.
    best : str
        Objective of the best design so far, in words; empty if none meets all constraints yet.
    """

    designs: int
    failed: int
    best: str


class EvaluationsExhausted(Exception):
    """Raised when a descent has used its largest number of evaluations."""


class Optimiser:
    """Evaluates designs, keeps all evaluations, and improves designs by gradient-based descents.

    Attributes
    ----------
    plan : Plan
        The optimisation.
    designs : DesignEvaluator
        Evaluation of its designs.
    history : list[Design]
        All evaluated designs, in their order.
    """

    def __init__(
        self, plan: Plan, designs: DesignEvaluator, progress: Callable[[OptimisationProgress], None] | None
    ) -> None:
        self.plan, self.designs, self._progress = plan, designs, progress
        self.history: list[Design] = []
        self._read: dict[Design, DesignEvaluation | None] = {}
        self._descents = 0
        self._descent_of: dict[Design, int] = {}

    def evaluate(self, designs: Sequence[Design]) -> list[DesignEvaluation | None]:
        """Evaluate designs in one run of their study; None for a design that fails."""
        for design, read in zip(designs, self.designs.read(designs), strict=True):
            if design not in self._read:
                self._read[design], self._descent_of[design] = read, self._descents
                self.history.append(design)
        if self._progress:
            failed = sum(read is None for read in self._read.values())
            best = self.best(self.plan.goal, self.plan.limits)
            said = "" if best is None else f"{self.plan.goal.words}: {worst_of(self.plan.goal, self.read(best)):.4g}"
            self._progress(OptimisationProgress(len(self.history), failed, said))
        return [self._read[design] for design in designs]

    @property
    def before(self) -> Design:
        """The design with which the best design is compared: that of the original scene or, if its evaluation failed,
        the first evaluated design.
        """
        readable = [design for design in self.history if self._read[design] is not None]
        return next((design for design in readable if design == self.plan.before), readable[0])

    def read(self, design: Design) -> DesignEvaluation:
        """The evaluation of a design that has been evaluated already."""
        evaluated = self._read[design]
        assert evaluated is not None
        return evaluated

    def linearisation(self, design: Design, goal: Goal, limits: Sequence[Limit]) -> Linearisation | None:
        """Goals and limits of a design with their gradients, as `descend` takes them.

        Goals are relative to the worst goal of `before`, limits are relative to their bounds. None if the evaluation of
        the design fails, the design has no goal, or a figure is not finite.
        """
        (read,) = self.evaluate([design])
        return None if read is None else self._linearise(read, read, goal, limits)

    def _linearise(
        self, read: DesignEvaluation, spread: DesignEvaluation, goal: Goal, limits: Sequence[Limit]
    ) -> Linearisation | None:
        """Goals and limits as in :meth:`linearisation`, with each figure made worse by its spread.

        The spread is caused by tolerances and computed at the design ``spread``."""
        scale = abs(worst_of(goal, self.read(self.before))) or 1.0
        goals, goal_rates = _loss(goal, read, spread)
        none = np.zeros((0, len(read.by)))
        margins, rates = [none[:, 0]], [none]
        for limit in limits:
            values, slopes = _loss(limit, read, spread)
            size = abs(limit.bound) or 1.0
            margins.append((limit.sign * limit.bound - values) / size)
            rates.append(-slopes / size)
        linearisation = Linearisation(goals / scale, goal_rates / scale, np.concatenate(margins), np.concatenate(rates))
        is_finite = all(np.isfinite(array).all() for array in vars(linearisation).values())
        return linearisation if goals.size and is_finite else None

    def descend(self, start: Design, goal: Goal, limits: Sequence[Limit]) -> None:
        """Improve a design by a gradient-based descent; all evaluated designs are in the history.

        During a descent, the spread due to tolerances is the spread at its start. With tolerances, further descents
        therefore start from the end of the last descent.
        """
        # Designs at points, by their variables: the same point may be evaluated on several meshes.
        before = len(self.history)
        self._descents += 1
        placed: dict[tuple[float, ...], Design] = {start.x: start}

        def linearisation(design: Design) -> Linearisation | None:
            if len(self.history) - before >= self.plan.evaluations:
                raise EvaluationsExhausted
            (read,) = self.evaluate([design])
            return None if read is None else self._linearise(read, self.read(start), goal, limits)

        def at(end: np.ndarray, x: np.ndarray) -> Trial:
            # The mesh of the last point is moved to the end; if that is impossible, the last point is evaluated again.
            here = placed[tuple(x.tolist())]
            if np.array_equal(end, x):
                return Trial(linearisation(here))
            beside, there = self._beside(here, end)
            anew = None if beside == here else linearisation(beside)
            if anew is None:
                beside = here
            placed[tuple(x.tolist())], placed[tuple(end.tolist())] = beside, there
            return Trial(linearisation(there), anew, self._jump(there, beside))

        tolerance = TOLERANCE if self.designs.has_parts else TOLERANCE_BARE

        for _ in range(ROUNDS if self.plan.tolerances else 1):
            try:
                if self._read[start] is None or linearisation(start) is None:
                    return
                x = descend(at, np.array(start.x), tolerance)
            except EvaluationsExhausted:
                return
            end = placed[tuple(x.tolist())]
            if self._read.get(end) is None or end == start:
                return
            start = end

    def _jump(self, first: Design, second: Design) -> float:
        """Relative error with which the figures of two designs can be compared, because their meshes differ."""
        if not self.designs.has_parts:
            return JUMP_BARE
        return JUMP_MOVED if first.family == second.family else JUMP

    def _beside(self, here: Design, x: np.ndarray) -> tuple[Design, Design]:
        """Two designs on a common mesh, if possible: ``here``, and the design at the variables ``x``.

        The mesh of ``here`` is moved to ``x``. If that mesh is itself a moved one and cannot be moved again, ``here``
        is meshed anew, and the new mesh is moved. If that fails, too, the design at ``x`` gets its own mesh.
        """
        there = self.plan.design(here.choice, x.tolist())
        if self.plan.refusal(there) is None:
            for neighbour in dict.fromkeys((here, here.alone)):
                shifted = replace(there, origin=neighbour.family)
                if self.designs.can_move(shifted):
                    return neighbour, self._alike(shifted)
        return here, self._alike(there)

    def _alike(self, design: Design) -> Design:
        """An evaluated design with the same mesh and nearly the same variables, to be used instead of ``design``;
        ``design`` itself if there is none."""
        for evaluated in self.history:
            equal = evaluated.choice == design.choice and _distance(evaluated, design) <= SAME
            if equal and (evaluated.origin == design.origin or evaluated.family == design.family):
                return evaluated
        return design

    def best(self, goal: Goal, limits: Sequence[Limit]) -> Design | None:
        """The best evaluated design that meets all constraints; None if no design does."""
        feasible = [
            (design, linearisation)
            for design, linearisation in self._all(goal, limits)
            if linearisation.violation <= HELD
        ]
        return min(feasible, key=lambda pair: pair[1].worst)[0] if feasible else None

    def gain_from(self, start: Design) -> tuple[float, int]:
        """Run a descent from an evaluated design on one mesh; returns its gain, and the number of designs that it
        evaluated.

        The gain is relative to the objective of the start. Designs are compared on the same mesh only; where the mesh
        is renewed, the gains on both meshes are added.
        """
        goal, limits, before = self.plan.goal, self.plan.limits, len(self.history)
        first = self.linearisation(start, goal, limits)
        if first is None:
            return math.nan, 0
        self.descend(start, goal, limits)
        new = {start, *self.history[before:]}
        feasible = [
            (design, linearisation)
            for design, linearisation in self._all(goal, limits)
            if design in new and linearisation.violation <= HELD
        ]
        gain = 0.0
        for family in dict.fromkeys(design.family for design, _ in feasible):
            goals = [linearisation.worst for design, linearisation in feasible if design.family == family]
            gain += goals[0] - min(goals)
        return gain / (abs(first.worst) or 1.0), len(self.history) - before

    def stationarity(self, best: Design, *finer: DesignEvaluation) -> Stationarity:
        """Whether a design satisfies the conditions of an optimum (Karush-Kuhn-Tucker): its Lagrange multipliers, and
        the slope that remains.

        Gradients differ from mesh to mesh. They are averaged over the design itself, a close design on each of the
        other meshes, and ``finer``, the design on finer meshes.
        """
        goal, limits = self.plan.goal, self.plan.limits
        own = self.linearisation(best, goal, limits)
        assert own is not None
        meshes: dict[tuple[float, ...], Linearisation] = {}
        for design, linearisation in sorted(self._all(goal, limits), key=lambda pair: _distance(pair[0], best)):
            if design.family != best.family and _is_near(design, best):
                meshes.setdefault(design.family, linearisation)
        on_finer = [at_design for read in finer if (at_design := self._linearise(read, read, goal, limits)) is not None]
        return stationarity(np.array(best.x), own, [*meshes.values(), *on_finer])

    def nearest(self, goal: Goal, limits: Sequence[Limit]) -> tuple[Design, Linearisation]:
        """The design that violates its constraints least."""
        return min(self._all(goal, limits), key=lambda pair: pair[1].violation)

    def _all(self, goal: Goal, limits: Sequence[Limit]) -> list[tuple[Design, Linearisation]]:
        """All designs that could be evaluated, each with its goals and limits."""
        readable = ((design, evaluated) for design in self.history if (evaluated := self._read[design]) is not None)
        return [
            (design, linearisation)
            for design, evaluated in readable
            if (linearisation := self._linearise(evaluated, evaluated, goal, limits)) is not None
        ]

    def _number_of(self, design: Design) -> int:
        """Number, in the history, of the design whose mesh was moved to the shape of this design."""
        return 1 + self.history.index(Design(design.choice, design.family))

    def rows(self) -> list[dict[str, Any]]:
        """The evaluated designs as rows of the table ``history`` of an `Optimum`."""
        plan, rows, best = self.plan, [], float("nan")
        for number, design in enumerate(self.history, start=1):
            row: dict[str, Any] = {"design": number, "descent": self._descent_of[design]}
            row["mesh_of"] = number if design.origin is None else self._number_of(design)
            row |= dict(zip(plan.choices, design.choice, strict=True)) | plan.values(design)
            read = self._read[design]
            linearisation = None if read is None else self._linearise(read, read, plan.goal, plan.limits)
            if read is None or linearisation is None:
                row["failed"] = self.designs.failures.get(design, "a figure cannot be computed")
            else:
                value = row[plan.goal.figure.words] = worst_of(plan.goal, read)
                row |= {limit.words: worst_of(limit, read) for limit in plan.limits}
                row["allowed"] = linearisation.violation <= HELD
                if row["allowed"] and not plan.goal.sign * (best - value) <= 0:
                    best = value
            rows.append({**row, "best": best})
        return rows


def _is_near(first: Design, second: Design) -> bool:
    """Whether two designs are so close that their gradients differ by their meshes rather than by their variables."""
    return first.choice == second.choice and _distance(first, second) <= NEAR


def _distance(first: Design, second: Design) -> float:
    """Largest difference of a variable between two designs, relative to the width of its bounds."""
    return float(np.abs(np.subtract(first.x, second.x)).max())


def with_rates(figure: Figure, read: DesignEvaluation) -> tuple[np.ndarray, np.ndarray]:
    """Components (N,) of a figure of a design, and their derivatives (N, V) with respect to variables in the unit
    cube."""
    rates = [figure.components(readings).imag / TINY for readings in read.by]
    return figure.components(read.values).real, np.stack(rates, axis=1)


def worst_of(criterion: Goal | Limit, read: DesignEvaluation) -> float:
    """The worst component of a figure of merit, such as that of the worst taxel, including its spread due to
    tolerances.

    It is the largest component if the figure should be small, else the least; NaN if the design has no component, as a
    flat roof has no radius.
    """
    losses = _loss(criterion, read, read)[0]
    return criterion.sign * float(losses.max()) if losses.size else math.nan


def _loss(criterion: Goal | Limit, read: DesignEvaluation, spread: DesignEvaluation) -> tuple[np.ndarray, np.ndarray]:
    """Components (N,) to be minimised and their derivatives (N, V).

    Components include the spread due to tolerances at the design ``spread``; derivatives do not."""
    values, rates = with_rates(criterion.figure, read)
    shifts = [criterion.figure.components(readings).imag / TINY for readings in spread.by_tolerance]
    return criterion.sign * values + QUANTILE * np.sqrt(np.square(shifts).sum(axis=0)), criterion.sign * rates
