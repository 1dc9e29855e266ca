"""From a recorded measurement to an experiment: turning points of the load, and each run's curve with its noise."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.units import FORCES
from mitsuba_taxel.characterise.experiment import Branch, Experiment, since
from mitsuba_taxel.characterise.load_lines import force_name
from mitsuba_taxel.characterise.measurement import Measurement

POINTS = 40
"""Most points of a run's curve: linear interpolation is accurate to 1/1600 of the largest change times the
curvature."""
FEWEST_POINTS = 5
REPLICATES = 8
FEWEST_ROWS = 2 * REPLICATES * POINTS // 2
"""Rows of a run needed for replicates: two rows for each of 20 points and each replicate."""
SMALLEST_RUN = 0.1
"""Least share of the whole range of force covered by a run; less is noise or a hold."""
WHITE = 1.5
"""Least von Neumann ratio of successive differences to the variance, which is 2 for white noise. Below, standard errors
would be too small by a quarter or more."""


def recorded_experiment(measurement: Measurement) -> Experiment:
    """The runs of a measurement between the turning points of its force.

    Turning points are extrema of the force with a prominence of a tenth of its range and ten standard deviations of its
    noise. Three components of force must change together along one line; the component along this line is used.

    Each run becomes a curve of at most 40 points evenly spread over its force, each the mean of the rows around it. The
    rows of each point are divided, in time, into eight replicates, whose scatter is the noise of the recording. Slower
    changes are not noise: drift and creep count as hysteresis and lack of repeatability. If neighbouring parts are
    correlated, or there are too few rows, there is one replicate and no error. Changes are relative to the first point,
    so a recording must begin unloaded.

    Raises
    ------
    InputError
        if the force does not change by more than its noise, or not along one line.
    """
    name, direction, force, pieces = runs_of(measurement)
    noise = _noise(force)
    rows = min(piece.stop - piece.start for piece in pieces)
    replicates = REPLICATES if rows >= FEWEST_ROWS else 1
    curves = [_curve(force[piece], measurement.voltage[piece], noise, replicates) for piece in pieces]
    if replicates > 1 and not all(white for _, white in curves):
        curves = [(Branch(run.force, run.samples.mean(axis=1, keepdims=True)), white) for run, white in curves]
    runs = [run for run, _ in curves]
    rest = runs[0].samples[0]
    return Experiment(name, direction, {}, "V", measurement.taxel, since(rest, runs), rest=rest)


def runs_of(measurement: Measurement) -> tuple[str, np.ndarray, np.ndarray, list[slice]]:
    """Name and direction (3,) of the force's line, its component (rows,) along it in N, and the rows of each run.

    Raises
    ------
    InputError
        if the force does not change by more than its noise, or not along one line.
    """
    direction, force = _along_one_line(measurement)
    name = measurement.force_names[0] if len(measurement.force_names) == 1 else force_name(direction)
    turns = _turning_points(force, _noise(force), measurement.file)
    pieces = [slice(first, last + 1) for first, last in zip(turns[:-1], turns[1:], strict=True)]
    least = SMALLEST_RUN / 2 * np.ptp(force)
    return name, direction, force, [run for run in pieces if abs(force[run.stop - 1] - force[run.start]) > least]


def _along_one_line(measurement: Measurement) -> tuple[np.ndarray, np.ndarray]:
    """Direction (3,) in which the force changes, and its component (rows,) along it."""
    force = measurement.force
    if force.shape[1] == 1:
        name = measurement.force_names[0]
        return np.array([float(name == other) for other in FORCES]), force[:, 0]
    centred = force - force.mean(axis=0)
    direction = np.linalg.svd(centred, full_matrices=False)[2][0]
    direction[np.abs(direction) < SMALLEST_RUN] = 0  # cross-axis signal of the reference sensor
    direction /= np.linalg.norm(direction)
    direction *= np.sign(direction[np.flatnonzero(direction)[0]])
    along = centred @ direction
    across = np.sqrt(np.square(centred - along[:, None] * direction).sum(axis=1).mean())
    if across > SMALLEST_RUN * np.ptp(along):
        raise InputError(
            f"measurement {measurement.file!r}: the force changes in several directions "
            f"({across:.2g} N, root mean square, off a line): a file for each direction is needed."
        )
    return direction, force @ direction


def _noise(force: np.ndarray) -> float:
    """Standard deviation of white noise on a force that changes slowly, from its second differences."""
    return float(np.median(np.abs(np.diff(force, 2))) / (0.6745 * np.sqrt(6)))


def _turning_points(force: np.ndarray, noise: float, file: str) -> np.ndarray:
    """Rows at which the force turns, with the first and the last."""
    from scipy.signal import find_peaks

    spread = np.ptp(force)
    if not spread > 10 * noise:
        raise InputError(
            f"measurement {file!r}: the force changes by {spread:.2g} N, which is no more than its noise: "
            "runs of growing or falling force are needed."
        )
    prominence = min(max(SMALLEST_RUN * spread, 10 * noise), spread / 2)
    turns = [find_peaks(sign * force, prominence=prominence)[0] for sign in (1, -1)]
    return np.concatenate([[0], np.sort(np.concatenate(turns)), [len(force) - 1]])


def _curve(force: np.ndarray, voltage: np.ndarray, noise: float, replicates: int) -> tuple[Branch, bool]:
    """Curve of the voltages of one run, and whether its noise is white.

    Rows within each of evenly spaced ranges of force make a point; rows are assigned by the nearest monotonic force, so
    that those of a point are consecutive. Ranges with too few rows, as between the steps of a staircase, are left out.
    """
    from scipy.optimize import isotonic_regression

    along = isotonic_regression(force, increasing=bool(force[-1] > force[0])).x * np.sign(force[-1] - force[0])
    points = POINTS
    if replicates > 1:
        finest = np.ptp(force) / (6 * noise) if noise > 0 else np.inf
        points = max(int(min(POINTS, finest, len(force) / (2 * replicates))), FEWEST_POINTS)
    edges = np.linspace(along[0], along[-1], points + 1)
    place = np.searchsorted(edges[1:-1], along, side="right")
    groups = [np.flatnonzero(place == number) for number in range(points)]
    parts = [np.array_split(group, replicates) for group in groups if len(group) >= replicates]
    x = np.array([[force[rows].mean() for rows in part] for part in parts])
    y = np.array([[voltage[rows].mean(axis=0) for rows in part] for part in parts])
    node, value = x.mean(axis=1), y.mean(axis=1)
    if replicates == 1 or len(parts) < FEWEST_POINTS:
        return Branch(node, value[:, None]), False
    level = y - _tilt(x, node, value)
    jumps = np.square(np.diff(level, axis=1)).sum(axis=(0, 1))
    scatter = np.square(level - value[:, None]).sum(axis=(0, 1))
    white = bool((jumps >= WHITE * scatter).all())
    # Curvature within the ranges would separate the first part of each from the last: interleave them.
    x, y = (np.stack([np.roll(part, number, axis=0) for number, part in enumerate(z)]) for z in (x, y))
    ends = node.copy()
    ends[[0, -1]] = x[0, 0], x[-1, (len(x) - 2) % replicates]  # ends of the run, not the middles of its end ranges
    level = y - _tilt(x, ends, value)
    # Each replicate gets its own slope, to include the noise of the slopes.
    slope = np.gradient(level - level.mean(axis=1, keepdims=True), node, axis=0, edge_order=2)
    return Branch(ends, level - slope * (x - ends[:, None])[..., None]), white


def _tilt(x: np.ndarray, node: np.ndarray, value: np.ndarray) -> np.ndarray:
    """Difference of each part (points, replicates, channels) from its point due to its different force."""
    slope = np.gradient(value, x.mean(axis=1), axis=0, edge_order=2)
    return slope[:, None] * (x - node[:, None])[..., None]
