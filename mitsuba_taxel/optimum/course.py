"""The course of an optimisation: every design that was looked at, judged by what is asked for, and the best so far."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from mitsuba_taxel.optimum.designs import Designs, Read
from mitsuba_taxel.optimum.figures import TINY, Figure
from mitsuba_taxel.optimum.plan import Design, Goal, Limit, Plan
from mitsuba_taxel.optimum.search import Judged, descend

HELD = 1e-3
"""By how much of its bound a constraint may be violated."""


class Progress(NamedTuple):
    """How far an optimisation is.

    Attributes
    ----------
    designs, failed : int
        That were looked at, and those of them that could not be read.
    best : str
        The best so far, in words; empty where none is within all constraints yet.
    """

    designs: int
    failed: int
    best: str


class Enough(Exception):
    """A descent has had all evaluations that it may have."""


class Course:
    """Looks at designs, and keeps what it saw in ``history``, in order."""

    def __init__(self, plan: Plan, designs: Designs, progress: Callable[[Progress], None] | None) -> None:
        self.plan, self.designs, self._progress = plan, designs, progress
        self.history: list[Design] = []
        self._read: dict[Design, Read | None] = {}

    def look(self, designs: Sequence[Design]) -> list[Read | None]:
        """Read designs, all at once."""
        for design, read in zip(designs, self.designs.read(designs), strict=True):
            if design not in self._read:
                self._read[design] = read
                self.history.append(design)
        if self._progress:
            failed = sum(read is None for read in self._read.values())
            best = self.best(self.plan.goal, self.plan.limits)
            said = "" if best is None else f"{self.plan.goal.words}: {worst_of(self.plan.goal, self.read(best)):.4g}"
            self._progress(Progress(len(self.history), failed, said))
        return [self._read[design] for design in designs]

    @property
    def before(self) -> Design:
        """The first design that could be read."""
        return next(design for design in self.history if self._read[design] is not None)

    def read(self, design: Design) -> Read:
        """A design that was read."""
        found = self._read[design]
        assert found is not None
        return found

    def judged(self, design: Design, goal: Goal, limits: Sequence[Limit]) -> Judged | None:
        """A design beside what is asked for: goals relative to the worst of `before`, limits to their bounds."""
        (read,) = self.look([design])
        if read is None:
            return None
        scale = abs(worst_of(goal, self.read(self.before))) or 1.0
        goals, goal_rates = with_rates(goal.figure, read)
        rows = [_margins(limit, read) for limit in limits]
        empty = [(np.zeros(0), np.zeros((0, len(design.x))))]
        values, rates = (np.concatenate(parts) for parts in zip(*(rows or empty), strict=True))
        found = Judged(goal.sign * goals / scale, goal.sign * goal_rates / scale, values, rates)
        return found if all(np.isfinite(each).all() for each in vars(found).values()) else None

    def descend(self, start: Design, goal: Goal, limits: Sequence[Limit]) -> None:
        """Go down from a design; what is seen on the way is in the history."""
        before = len(self.history)

        def at(x: np.ndarray) -> Judged | None:
            if len(self.history) - before >= self.plan.evaluations:
                raise Enough
            return self.judged(Design(start.choice, tuple(x.tolist())), goal, limits)

        if self.judged(start, goal, limits) is not None:
            try:
                descend(at, np.array(start.x))
            except Enough:
                pass

    def best(self, goal: Goal, limits: Sequence[Limit]) -> Design | None:
        """The best design so far of those that keep all constraints; None if there is none."""
        kept = [(design, each) for design, each in self._all(goal, limits) if each.violation <= HELD]
        return min(kept, key=lambda pair: pair[1].worst)[0] if kept else None

    def nearest(self, goal: Goal, limits: Sequence[Limit]) -> tuple[Design, Judged]:
        """The design that violates its constraints least."""
        return min(self._all(goal, limits), key=lambda pair: pair[1].violation)

    def _all(self, goal: Goal, limits: Sequence[Limit]) -> list[tuple[Design, Judged]]:
        read = [design for design in self.history if self._read[design] is not None]
        return [(design, each) for design in read if (each := self._again(design, goal, limits)) is not None]

    def _again(self, design: Design, goal: Goal, limits: Sequence[Limit]) -> Judged | None:
        progress, self._progress = self._progress, None
        try:
            return self.judged(design, goal, limits)
        finally:
            self._progress = progress

    def rows(self) -> list[dict[str, Any]]:
        """The history as rows of a table."""
        plan, rows, best = self.plan, [], float("nan")
        for number, design in enumerate(self.history, start=1):
            row: dict[str, Any] = {"design": number, **dict(zip(plan.choices, design.choice, strict=True))}
            row |= plan.values(design)
            read = self._read[design]
            judged = None if read is None else self._again(design, plan.goal, plan.limits)
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


def with_rates(figure: Figure, read: Read) -> tuple[np.ndarray, np.ndarray]:
    """Components (N,) of a figure, and derivatives (N, V) by variables in the unit cube."""
    rates = [figure.components(each).imag / TINY for each in read.by]
    return figure.components(read.values).real, np.stack(rates, axis=1)


def worst_of(asked: Goal | Limit, read: Read) -> float:
    """The component of a figure that counts: the least where it should be large."""
    components = asked.figure.components(read.values).real
    return float(components.min() if asked.sign < 0 else components.max())


def _margins(limit: Limit, read: Read) -> tuple[np.ndarray, np.ndarray]:
    """Of each component, relative to the bound; above 0 where it is kept."""
    scale = -limit.sign / (abs(limit.bound) or 1.0)
    values, rates = with_rates(limit.figure, read)
    return scale * (values - limit.bound), scale * rates
