"""Pareto fronts of two objectives, by the epsilon-constraint method."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mitsuba_taxel.optimum.optimiser import Optimiser, worst_of
from mitsuba_taxel.optimum.plan import Goal, Limit

if TYPE_CHECKING:
    import pandas


def front(optimiser: Optimiser, other: Goal, points: int) -> pandas.DataFrame:
    """Compute a Pareto front of two objectives by the epsilon-constraint method: designs that no design dominates.

    The ends of the front are the best designs by the study's objective and by the other objective. Between them, the
    other objective is bounded at even steps, and each descent starts from the best design that already meets the bound.

    Parameters
    ----------
    optimiser : Optimiser
        Optimisation by the study's objective.
    other : Goal
        The other objective.
    points : int
        Number of designs, including the two ends.

    Returns
    -------
    DataFrame
        One row per design: both objectives, and the parameters.
    """
    import pandas

    plan = optimiser.plan
    goal, limits = plan.goal, plan.limits
    best = optimiser.best(goal, limits)
    assert best is not None

    # Ends of the front: the best designs by each of the two objectives.
    optimiser.descend(best, other, limits)
    ends = [optimiser.best(goal, limits) or best, optimiser.best(other, limits) or best]
    first, last = (worst_of(other, optimiser.read(end)) for end in ends)

    # The best designs by the study's objective within bounds of the other objective.
    candidates = dict.fromkeys(ends)
    for bound in np.linspace(first, last, points)[1:-1].tolist():
        bounded = [*limits, Limit(other.figure, other.sign, bound)]
        optimiser.descend(optimiser.best(goal, bounded) or ends[1], goal, bounded)
        candidates[optimiser.best(goal, bounded) or ends[1]] = None

    # A design is dominated if another is at least as good by both objectives, and better by one.
    rows = []
    for design in candidates:
        values = {objective.figure.words: worst_of(objective, optimiser.read(design)) for objective in (goal, other)}
        rows.append({**values, **dict(zip(plan.choices, design.choice, strict=True)), **plan.values(design)})
    table = pandas.DataFrame(rows).sort_values(goal.figure.words, ignore_index=True)
    losses = np.stack(
        [objective.sign * table[objective.figure.words].to_numpy() for objective in (goal, other)], axis=1
    )
    dominated = [bool(((losses <= loss).all(axis=1) & (losses < loss).any(axis=1)).any()) for loss in losses]
    return table[~np.array(dominated)].reset_index(drop=True)
