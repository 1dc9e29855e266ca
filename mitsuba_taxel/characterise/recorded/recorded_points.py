"""Points of a recorded run: one for each hold of the force, and one for each equal range of a moving force."""

from __future__ import annotations

import numpy as np

POINTS = 40
"""Most points of the ranges in which the force of a run moves: linear interpolation between them is accurate to 1/1600
of the largest change times the curvature."""
MOST_HOLDS = 60
"""Largest number of holds of a run: if there are more, they are steps of the converter that recorded the force."""
FEWEST_ROWS = 8
"""Least number of rows of a point in a moving range; fewer rows between two holds are a transition."""
JUMP = 5.0
"""Least step of the force between holds, in standard deviations of its noise."""
LEAST_DISTANCE = 4.0
"""Least distance of neighbouring points, in standard errors of their forces."""
ROUNDING = 1e-6
"""Differences of the force below this fraction of its range count as zero."""


def noise_of(force: np.ndarray) -> float:
    """Standard deviation of the white noise of a force (rows,), in its unit.

    It is estimated from second differences, which suit a force that changes slowly, and from first differences, which
    suit a force that jumps between holds of three rows or more. The smaller estimate is returned.
    """
    medians = [np.median(np.abs(np.diff(force, order))) / np.sqrt(size) for order, size in ((1, 2), (2, 6))]
    return float(min(medians) / 0.6745)


def middle_of_turn(force: np.ndarray, row: int, noise: float) -> int:
    """Row in the middle of the rows in which the force stays at its turning point.

    Noise places the extremum anywhere within the hold, so that the extremum itself is not used.

    Parameters
    ----------
    force : (rows,) ndarray
        Force in N.
    row : int
        Row of the turning point.
    noise : float
        Standard deviation of the noise of the force in N.

    Returns
    -------
    int
        Middle row; ``row`` itself if the hold reaches an end of the record, as the hold may continue beyond.
    """
    within_noise = np.abs(force - force[row]) <= max(6 * noise, ROUNDING * np.ptp(force))
    ends = np.flatnonzero(~within_noise)
    after, before = ends[ends > row], ends[ends < row]
    first = int(before[-1]) + 1 if len(before) else 0
    last = int(after[0]) - 1 if len(after) else len(force) - 1
    return row if first == 0 or last == len(force) - 1 else (first + last) // 2


def points_of(force: np.ndarray, noise: float) -> tuple[list[np.ndarray], tuple[bool, bool]]:
    """Divide the rows of a run into points: holds of the force, and ranges in which it moves.

    The force of a run, made monotonic, is cut where it jumps. A piece that stays within the noise is a hold, and a
    single point. A piece in which the force moves is divided into even ranges of force; a few rows between two holds
    are a transition and are left out. Neighbouring points that the noise of the force does not resolve are merged, so
    that no slope between them is noise divided by nearly zero.

    Parameters
    ----------
    force : (rows,) ndarray
        Force of the run, in N.
    noise : float
        Standard deviation of its noise in N.

    Returns
    -------
    points : list of ndarray of int
        Rows of each point.
    moving : tuple[bool, bool]
        Whether the first and the last point are ranges of a moving force.
    """
    from scipy.optimize import isotonic_regression

    # Levels between the jumps of the monotonic force, and which of them are holds.
    sign = 1.0 if force[-1] > force[0] else -1.0
    monotonic = isotonic_regression(sign * force).x
    least = max(noise, ROUNDING * np.ptp(force) / JUMP)
    levels = np.split(np.arange(len(force)), np.flatnonzero(np.diff(monotonic) > JUMP * least) + 1)
    is_hold = [len(rows) > 1 and np.ptp(monotonic[rows]) <= 2 * JUMP * least for rows in levels]
    if sum(is_hold) > MOST_HOLDS:
        is_hold = [False] * len(levels)

    # Neighbouring levels that move are joined to one piece.
    pieces: list[tuple[bool, np.ndarray]] = []
    for hold, rows in zip(is_hold, levels, strict=True):
        if pieces and not hold and not pieces[-1][0]:
            rows = np.concatenate([pieces.pop()[1], rows])
        pieces.append((hold, rows))

    # A hold is a point; a moving piece is divided into ranges of force.
    points: list[tuple[bool, np.ndarray]] = []
    for hold, rows in pieces:
        ranges = [rows] if hold else _ranges(monotonic, rows, noise)
        points += [(hold, range_rows) for range_rows in ranges]
    points = _merged(sign * force, points, noise)
    return [rows for _, rows in points], (not points[0][0], not points[-1][0])


def _ranges(monotonic: np.ndarray, rows: np.ndarray, noise: float) -> list[np.ndarray]:
    """Divide a moving force into ranges of equal size; returns the rows of each. A transition between holds gives no
    range."""
    span, most_ranges = np.ptp(monotonic[rows]), len(rows) // FEWEST_ROWS
    finest = span / (6 * noise) if noise > 0 else np.inf
    count = int(min(np.ceil(POINTS * span / np.ptp(monotonic)), max(finest, 1), most_ranges))
    # A run of too few rows to average has a point for each row.
    if most_ranges < FEWEST_ROWS // 2 and len(rows) > len(monotonic) / 2:
        count = min(POINTS, len(rows))
    if count < 1:
        return []
    edges = np.linspace(monotonic[rows[0]], monotonic[rows[-1]], count + 1)
    interval = np.searchsorted(edges[1:-1], monotonic[rows], side="right")
    return [rows[interval == number] for number in range(count) if (interval == number).any()]


def _merged(force: np.ndarray, points: list[tuple[bool, np.ndarray]], noise: float) -> list[tuple[bool, np.ndarray]]:
    """Merge points that are too close to their neighbour in force. ``points`` are sorted by rising force."""
    merged: list[tuple[bool, np.ndarray]] = []
    for hold, rows in points:
        merged.append((hold, rows))
        while len(merged) > 1:
            (first, before), (last, after) = merged[-2:]
            error = noise * np.sqrt(1 / len(before) + 1 / len(after))
            if force[after].mean() - force[before].mean() > max(LEAST_DISTANCE * error, ROUNDING * np.ptp(force)):
                break
            merged[-2:] = [(first or last, np.concatenate([before, after]))]
    return merged
