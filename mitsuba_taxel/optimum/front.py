"""Pareto fronts of two objectives, by the epsilon-constraint method."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mitsuba_taxel.optimum.course import Course, worst_of
from mitsuba_taxel.optimum.plan import Goal, Limit

if TYPE_CHECKING:
    import pandas


def front(course: Course, other: Goal, points: int) -> pandas.DataFrame:
    """Non-dominated designs from the best by the study's objective to the best by ``other``.

    The other objective is bounded at even steps between the two (epsilon-constraint), and each descent begins at the
    best design that already meets the bound.

    Returns
    -------
    One row per design: both objectives, and the parameters.
    """
    import pandas

    plan = course.plan
    goal, limits = plan.goal, plan.limits
    best = course.best(goal, limits)
    assert best is not None
    course.descend(best, other, limits)
    ends = [course.best(goal, limits) or best, course.best(other, limits) or best]
    first, last = (worst_of(other, course.read(end)) for end in ends)
    found = dict.fromkeys(ends)
    for bound in np.linspace(first, last, points)[1:-1].tolist():
        bounded = [*limits, Limit(other.figure, other.sign, bound)]
        course.descend(course.best(goal, bounded) or ends[1], goal, bounded)
        found[course.best(goal, bounded) or ends[1]] = None
    rows = []
    for design in found:
        values = {one.figure.words: worst_of(one, course.read(design)) for one in (goal, other)}
        rows.append({**values, **dict(zip(plan.choices, design.choice, strict=True)), **plan.values(design)})
    table = pandas.DataFrame(rows).sort_values(goal.figure.words, ignore_index=True)
    worth = np.stack([one.sign * table[one.figure.words].to_numpy() for one in (goal, other)], axis=1)
    beaten = [bool(((worth <= one).all(axis=1) & (worth < one).any(axis=1)).any()) for one in worth]
    return table[~np.array(beaten)].reset_index(drop=True)
