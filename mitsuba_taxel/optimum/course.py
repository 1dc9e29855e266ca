"""The course of an optimisation: every evaluated design with its objective and constraints, and the best so far."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from mitsuba_taxel.optimum.descent import JUMP, JUMP_BARE, JUMP_MOVED, TOLERANCE, TOLERANCE_BARE, Trial, descend
from mitsuba_taxel.optimum.designs import Designs, Read
from mitsuba_taxel.optimum.figures import TINY, Figure
from mitsuba_taxel.optimum.plan import Design, Goal, Limit, Plan
from mitsuba_taxel.optimum.search import Judged, Stationarity, stationarity

QUANTILE = 1.2816
"""Quantile of 90 % of a normal distribution, in standard deviations."""
ROUNDS = 3
"""Most successive descents with tolerances, which are evaluated at the start of each."""
SAME = 1e-6
"""Relative to the bounds' width: designs that differ by less count as equal, as another mesh makes more difference."""
NEAR = 0.02
"""The same for designs whose gradients differ by their meshes rather than by the designs."""
HELD = 1e-3
"""Allowed violation of a constraint, relative to its bound."""


class OptimisationProgress(NamedTuple):
    """Progress of an optimisation.

    Attributes
    ----------
    designs, failed : int
        Numbers of evaluated designs, and of those that failed.
    best : str
        The best so far; empty if none meets all constraints yet.
    """

    designs: int
    failed: int
    best: str


class Enough(Exception):
    """A descent has used all of its evaluations."""


class Course:
    """Evaluates designs, and keeps them in ``history``, in order."""

    def __init__(self, plan: Plan, designs: Designs, progress: Callable[[OptimisationProgress], None] | None) -> None:
        self.plan, self.designs, self._progress = plan, designs, progress
        self.history: list[Design] = []
        self._read: dict[Design, Read | None] = {}
        self._descents = 0
        self._descent_of: dict[Design, int] = {}

    def look(self, designs: Sequence[Design]) -> list[Read | None]:
        """Evaluate designs, all at once."""
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
        """The original scene, or the first design that could be read."""
        readable = [design for design in self.history if self._read[design] is not None]
        return next((design for design in readable if design == self.plan.before), readable[0])

    def read(self, design: Design) -> Read:
        """A design that was read."""
        found = self._read[design]
        assert found is not None
        return found

    def judged(self, design: Design, goal: Goal, limits: Sequence[Limit]) -> Judged | None:
        """Goals of a design relative to the worst of `before`, and limits relative to their bounds."""
        (read,) = self.look([design])
        return None if read is None else self._judge(read, read, goal, limits)

    def _judge(self, read: Read, spread: Read, goal: Goal, limits: Sequence[Limit]) -> Judged | None:
        """The same, with each figure worse by its spread due to tolerances of the design ``spread``."""
        scale = abs(worst_of(goal, self.read(self.before))) or 1.0
        goals, goal_rates = _loss(goal, read, spread)
        none = np.zeros((0, len(read.by)))
        margins, rates = [none[:, 0]], [none]
        for limit in limits:
            values, slopes = _loss(limit, read, spread)
            size = abs(limit.bound) or 1.0
            margins.append((limit.sign * limit.bound - values) / size)
            rates.append(-slopes / size)
        found = Judged(goals / scale, goal_rates / scale, np.concatenate(margins), np.concatenate(rates))
        return found if goals.size and all(np.isfinite(each).all() for each in vars(found).values()) else None

    def descend(self, start: Design, goal: Goal, limits: Sequence[Limit]) -> None:
        """Descend from a design; all evaluated designs are in the history.

        The spread due to tolerances is held at that of the start. With tolerances, further descents begin where the
        last one ended.
        """
        before = len(self.history)
        self._descents += 1
        placed: dict[tuple[float, ...], Design] = {start.x: start}

        def judged(design: Design) -> Judged | None:
            if len(self.history) - before >= self.plan.evaluations:
                raise Enough
            (read,) = self.look([design])
            return None if read is None else self._judge(read, self.read(start), goal, limits)

        def at(end: np.ndarray, x: np.ndarray) -> Trial:
            here = placed[tuple(x.tolist())]
            if np.array_equal(end, x):
                return Trial(judged(here))
            beside, there = self._beside(here, end)
            anew = None if beside == here else judged(beside)
            if anew is None:
                beside = here
            placed[tuple(x.tolist())], placed[tuple(end.tolist())] = beside, there
            return Trial(judged(there), anew, self._jump(there, beside))

        tolerance = TOLERANCE if self.designs.has_parts else TOLERANCE_BARE

        for _ in range(ROUNDS if self.plan.tolerances else 1):
            try:
                if self._read[start] is None or judged(start) is None:
                    return
                x = descend(at, np.array(start.x), tolerance)
            except Enough:
                return
            end = placed[tuple(x.tolist())]
            if self._read.get(end) is None or end == start:
                return
            start = end

    def _jump(self, one: Design, other: Design) -> float:
        """Relative error of a comparison of two designs."""
        if not self.designs.has_parts:
            return JUMP_BARE
        return JUMP_MOVED if one.family == other.family else JUMP

    def _beside(self, here: Design, x: np.ndarray) -> tuple[Design, Design]:
        """A design at ``x`` with the mesh of ``here``, moved, and ``here``; with its own mesh, if the one that it was
        moved from does not reach as far; or, if even that does not, the design at ``x`` with a mesh of its own."""
        there = self.plan.design(here.choice, x.tolist())
        if self.plan.refusal(there) is None:
            for beside in dict.fromkeys((here, here.alone)):
                moved = replace(there, origin=beside.family)
                if self.designs.can_move(moved):
                    return beside, self._alike(moved)
        return here, self._alike(there)

    def _alike(self, design: Design) -> Design:
        """An evaluated design that is nearly equal, with the same mesh, or else this one."""
        for known in self.history:
            alike = known.choice == design.choice and _apart(known, design) <= SAME
            if alike and (known.origin == design.origin or known.family == design.family):
                return known
        return design

    def best(self, goal: Goal, limits: Sequence[Limit]) -> Design | None:
        """The best design so far that meets all constraints; None if there is none."""
        kept = [(design, each) for design, each in self._all(goal, limits) if each.violation <= HELD]
        return min(kept, key=lambda pair: pair[1].worst)[0] if kept else None

    def gain_from(self, start: Design) -> tuple[float, int]:
        """What a descent gains from an evaluated design, relative to its objective, and the number of its designs.

        Gains are those on one mesh; where it is renewed, those on both add up.
        """
        goal, limits, before = self.plan.goal, self.plan.limits, len(self.history)
        first = self.judged(start, goal, limits)
        if first is None:
            return math.nan, 0
        self.descend(start, goal, limits)
        new = {start, *self.history[before:]}
        found = [(design, each) for design, each in self._all(goal, limits) if design in new and each.violation <= HELD]
        gain = 0.0
        for family in dict.fromkeys(design.family for design, _ in found):
            own = [each.worst for design, each in found if design.family == family]
            gain += own[0] - min(own)
        return gain / (abs(first.worst) or 1.0), len(self.history) - before

    def stationarity(self, best: Design, *finer: Read) -> Stationarity:
        """What holds a design, by the mean of its own gradients, of those of designs near it with other meshes, one of
        each, and of those on finer meshes, as gradients scatter from mesh to mesh."""
        goal, limits = self.plan.goal, self.plan.limits
        own = self.judged(best, goal, limits)
        assert own is not None
        meshes: dict[tuple[float, ...], Judged] = {}
        for design, judged in sorted(self._all(goal, limits), key=lambda pair: _apart(pair[0], best)):
            if design.family != best.family and _is_near(design, best):
                meshes.setdefault(design.family, judged)
        again = [each for read in finer if (each := self._judge(read, read, goal, limits)) is not None]
        return stationarity(np.array(best.x), own, [*meshes.values(), *again])

    def nearest(self, goal: Goal, limits: Sequence[Limit]) -> tuple[Design, Judged]:
        """The design that violates its constraints least."""
        return min(self._all(goal, limits), key=lambda pair: pair[1].violation)

    def _all(self, goal: Goal, limits: Sequence[Limit]) -> list[tuple[Design, Judged]]:
        read = ((design, of) for design in self.history if (of := self._read[design]) is not None)
        return [(design, each) for design, of in read if (each := self._judge(of, of, goal, limits)) is not None]

    def _number_of(self, design: Design) -> int:
        """The number in the history of the design whose mesh was moved onto this one."""
        return 1 + self.history.index(Design(design.choice, design.family))

    def rows(self) -> list[dict[str, Any]]:
        """The history as rows of a table."""
        plan, rows, best = self.plan, [], float("nan")
        for number, design in enumerate(self.history, start=1):
            row: dict[str, Any] = {"design": number, "descent": self._descent_of[design]}
            row["mesh_of"] = number if design.origin is None else self._number_of(design)
            row |= dict(zip(plan.choices, design.choice, strict=True)) | plan.values(design)
            read = self._read[design]
            judged = None if read is None else self._judge(read, read, plan.goal, plan.limits)
            if read is None or judged is None:
                row["failed"] = self.designs.failures.get(design, "a figure cannot be told")
            else:
                value = row[plan.goal.figure.words] = worst_of(plan.goal, read)
                row |= {limit.words: worst_of(limit, read) for limit in plan.limits}
                row["allowed"] = judged.violation <= HELD
                if row["allowed"] and not plan.goal.sign * (best - value) <= 0:
                    best = value
            rows.append({**row, "best": best})
        return rows


def _is_near(one: Design, other: Design) -> bool:
    """Whether two designs differ by less than their gradients do by their meshes."""
    return one.choice == other.choice and _apart(one, other) <= NEAR


def _apart(one: Design, other: Design) -> float:
    """Largest difference of a variable, relative to the bounds' width."""
    return float(np.abs(np.subtract(one.x, other.x)).max())


def with_rates(figure: Figure, read: Read) -> tuple[np.ndarray, np.ndarray]:
    """Components (N,) of a figure, and derivatives (N, V) with respect to variables in the unit cube."""
    rates = [figure.components(each).imag / TINY for each in read.by]
    return figure.components(read.values).real, np.stack(rates, axis=1)


def worst_of(asked: Goal | Limit, read: Read) -> float:
    """The worst component of a figure, with tolerances: the largest of what should be small, else the least; NaN if the
    design has none, such as a flat roof of radii."""
    losses = _loss(asked, read, read)[0]
    return asked.sign * float(losses.max()) if losses.size else math.nan


def _loss(asked: Goal | Limit, read: Read, spread: Read) -> tuple[np.ndarray, np.ndarray]:
    """Components (N,) to be minimised, including their spread, and derivatives (N, V) of those of the nominal
    design."""
    values, rates = with_rates(asked.figure, read)
    shifts = [asked.figure.components(each).imag / TINY for each in spread.off]
    return asked.sign * values + QUANTILE * np.sqrt(np.square(shifts).sum(axis=0)), asked.sign * rates
