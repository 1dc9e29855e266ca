"""Points of a recorded run: one for each hold of the force, and even ranges of force where it moves."""

from __future__ import annotations

import numpy as np

POINTS = 40
"""Most points of the moving parts of a run: linear interpolation is accurate to 1/1600 of the largest change times the
curvature."""
MOST_HOLDS = 60
"""More holds than this in one run are the steps of the force's own converter."""
FEWEST_ROWS = 8
"""Rows of a point between holds; fewer are a transition."""
JUMP = 5.0
"""Least step of the force between holds, in standard deviations of its noise."""
APART = 4.0
"""Least distance of neighbouring points, in standard errors of their forces."""
ROUNDING = 1e-6
"""Relative to the range of the force: differences below are none."""


def noise_of(force: np.ndarray) -> float:
    """Standard deviation of white noise on a force that changes slowly, from its second differences, or jumps between
    holds of three rows or more, from its first ones."""
    medians = [np.median(np.abs(np.diff(force, order))) / np.sqrt(size) for order, size in ((1, 2), (2, 6))]
    return float(min(medians) / 0.6745)


def middle_of_turn(force: np.ndarray, row: int, noise: float) -> int:
    """Row in the middle of the hold around a turning point, which noise puts anywhere within it."""
    near = np.abs(force - force[row]) <= max(6 * noise, ROUNDING * np.ptp(force))
    ends = np.flatnonzero(~near)
    after, before = ends[ends > row], ends[ends < row]
    first = int(before[-1]) + 1 if len(before) else 0
    last = int(after[0]) - 1 if len(after) else len(force) - 1
    # At the ends of a record a hold goes on beyond it.
    return row if first == 0 or last == len(force) - 1 else (first + last) // 2


def points_of(force: np.ndarray, noise: float) -> tuple[list[np.ndarray], tuple[bool, bool]]:
    """Rows of each point of a run, and whether the first and the last one are ranges of a moving force.

    The force of a run, made monotonic, is cut where it jumps. What stays within its noise between two cuts is a hold,
    and one point. What moves is divided into even ranges of force; a few rows between two holds are a transition, and
    left out. Neighbouring points that the noise of the force does not tell apart are merged, so that none of the slopes
    between them is noise over nearly nothing.

    Parameters
    ----------
    force : (rows,) ndarray
        Of one run, in N.
    noise : float
        Its standard deviation in N.
    """
    from scipy.optimize import isotonic_regression

    sign = 1.0 if force[-1] > force[0] else -1.0
    along = isotonic_regression(sign * force).x
    least = max(noise, ROUNDING * np.ptp(force) / JUMP)
    levels = np.split(np.arange(len(force)), np.flatnonzero(np.diff(along) > JUMP * least) + 1)
    still = [len(rows) > 1 and np.ptp(along[rows]) <= 2 * JUMP * least for rows in levels]
    if sum(still) > MOST_HOLDS:
        still = [False] * len(levels)
    # Neighbouring pieces that move are one.
    pieces: list[tuple[bool, np.ndarray]] = []
    for hold, rows in zip(still, levels, strict=True):
        if pieces and not hold and not pieces[-1][0]:
            rows = np.concatenate([pieces.pop()[1], rows])
        pieces.append((hold, rows))
    points: list[tuple[bool, np.ndarray]] = []
    for hold, rows in pieces:
        ranges = [rows] if hold else _ranges(along, rows, noise)
        points += [(hold, each) for each in ranges]
    points = _merged(sign * force, points, noise)
    return [rows for _, rows in points], (not points[0][0], not points[-1][0])


def _ranges(along: np.ndarray, rows: np.ndarray, noise: float) -> list[np.ndarray]:
    """Even ranges of a moving force; none of a transition between holds."""
    span, enough = np.ptp(along[rows]), len(rows) // FEWEST_ROWS
    finest = span / (6 * noise) if noise > 0 else np.inf
    count = int(min(np.ceil(POINTS * span / np.ptp(along)), max(finest, 1), enough))
    if enough < FEWEST_ROWS // 2 and len(rows) > len(along) / 2:  # too few rows of the run to average any
        count = min(POINTS, len(rows))
    if count < 1:
        return []
    edges = np.linspace(along[rows[0]], along[rows[-1]], count + 1)
    place = np.searchsorted(edges[1:-1], along[rows], side="right")
    return [rows[place == number] for number in range(count) if (place == number).any()]


def _merged(force: np.ndarray, points: list[tuple[bool, np.ndarray]], noise: float) -> list[tuple[bool, np.ndarray]]:
    """Points in the order of a rising force, those too close to their neighbour merged with it."""
    merged: list[tuple[bool, np.ndarray]] = []
    for hold, rows in points:
        merged.append((hold, rows))
        while len(merged) > 1:
            (first, before), (last, after) = merged[-2:]
            error = noise * np.sqrt(1 / len(before) + 1 / len(after))
            if force[after].mean() - force[before].mean() > max(APART * error, ROUNDING * np.ptp(force)):
                break
            merged[-2:] = [(first or last, np.concatenate([before, after]))]
    return merged
