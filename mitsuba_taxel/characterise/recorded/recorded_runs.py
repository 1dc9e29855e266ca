"""From a recorded measurement to an experiment: turning points of the load, curves of the runs and their noise."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.units import FORCES
from mitsuba_taxel.characterise.experiment import Branch, Experiment, since
from mitsuba_taxel.characterise.load_lines import force_name
from mitsuba_taxel.characterise.recorded.measurement import Measurement
from mitsuba_taxel.characterise.recorded.recorded_noise import LEAST_CORRELATION, PointErrors, point_errors, with_errors
from mitsuba_taxel.characterise.recorded.recorded_points import middle_of_turn, noise_of, points_of

REPLICATES = 64
"""Samples of each point, whose scatter represents its error."""
SMALLEST_RUN = 0.1
"""Least fraction of the range of force that a run covers; less is noise or a hold."""
UNLOADED = 0.02
"""Largest force at rest, relative to the largest force, that is not mentioned in a note."""
ROUGH = 0.7
"""Correlation of neighbouring rows above which errors may be a third too small."""
NEAR_REST = 0.005
"""Points within this fraction of the largest force from the least force count as points of least force."""


def recorded_experiment(measurement: Measurement) -> Experiment:
    """Convert a recording to an experiment: its runs between the turning points of the force, with their errors.

    Turning points are extrema of the force with a prominence of a tenth of its range and ten standard deviations of its
    noise. Three components of force must change together along one line; the component along this line is used.

    Each run becomes a curve: a point for each hold of the force, such as a weight, and at most 40 points evenly spread
    over the ranges in which the force moves. A point is the mean of its rows. Errors of points follow from the noise of
    the rows around the curve, with its correlation, and from the steps of the converter; the scatter of the samples
    represents them. Slower changes are not noise: drift and creep count as hysteresis and lack of repeatability. If the
    noise is unknown, as for few rows, there is one sample and no error. Changes are relative to the point of least
    force, or the first of several such points.

    Parameters
    ----------
    measurement : Measurement
        Record in s, N and V.

    Returns
    -------
    Experiment
        Experiment with readings in V.

    Raises
    ------
    InputError
        if the force does not change by more than its noise, or not along one line, or stands still at one level.
    """
    name, direction, force, pieces = runs_of(measurement)
    noise, voltage = noise_of(force), measurement.voltage

    # Points of each run; a run that stands still at one level is left out.
    groups = [points_of(force[piece], noise) for piece in pieces]
    if not any(len(points) > 1 for points, _ in groups):
        raise InputError(
            f"measurement {measurement.file!r}: the force stays at one level: at least two levels are needed."
        )
    moving_runs = [(piece, *group) for piece, group in zip(pieces, groups, strict=True) if len(group[0]) > 1]
    curves = [_Curve(force[piece], voltage[piece], points) for piece, points, _ in moving_runs]

    # Samples of each point whose scatter represents its error.
    residuals, steady, smooth = (
        [getattr(curve, name) for curve in curves] for name in ("residuals", "steady", "curve")
    )
    errors = point_errors(residuals, steady, smooth, voltage)
    values = [curve.value for curve in curves]
    points = [value[:, None] for value in values] if errors is None else with_errors(values, errors, REPLICATES)
    runs = [
        curve.branch(samples, moving, noise)
        for curve, samples, (*_, moving) in zip(curves, points, moving_runs, strict=True)
    ]

    # The reading at rest is that of the first point of least force.
    nodes, samples = (np.concatenate([getattr(run, name) for run in runs]) for name in ("force", "samples"))
    least, largest = np.abs(nodes).min(), np.abs(nodes).max()
    rest = samples[np.flatnonzero(np.abs(nodes) <= least + NEAR_REST * largest)[0]]
    notes = [f"{len(runs)} runs of {min(len(run.force) for run in runs)} points or more.", *_words(errors)]
    if least > UNLOADED * largest:
        notes.append(
            f"The recording has no unloaded state: changes and relative slopes refer to the least force, {least:.3g} N."
        )
    return Experiment(
        force=name,
        direction=direction,
        where={},
        unit="V",
        taxel=measurement.taxel,
        runs=since(rest, runs),
        rest=rest,
        notes=tuple(notes),
    )


class _Curve:
    """The curve through the points of a run, and the residuals of its rows.

    ``node`` (points,) is the mean force of each point in N; ``value`` and ``slope`` (points, channels) are its voltage
    in V and the slope there in V/N. For each point, ``residuals`` (rows, channels) are the voltages minus the curve at
    the measured force in V; ``steady`` are the voltages minus the curve at the force made monotonic; ``curve`` is the
    curve at the monotonic force.
    """

    def __init__(self, force: np.ndarray, voltage: np.ndarray, points: list[np.ndarray]) -> None:
        from scipy.optimize import isotonic_regression

        self.force, self.points = force, points
        self.node = np.array([force[rows].mean() for rows in points])
        self.value = np.array([voltage[rows].mean(axis=0) for rows in points])
        self.slope = self._slopes(self.value)
        monotonic = isotonic_regression(force, increasing=bool(force[-1] > force[0])).x
        self.residuals, self.steady = (
            [
                voltage[rows] - value - np.outer(abscissa[rows] - node, slope)
                for rows, value, node, slope in zip(points, self.value, self.node, self.slope, strict=True)
            ]
            for abscissa in (force, monotonic)
        )
        self.curve = [
            value + np.outer(monotonic[rows] - node, slope)
            for rows, value, node, slope in zip(points, self.value, self.node, self.slope, strict=True)
        ]

    def _slopes(self, value: np.ndarray) -> np.ndarray:
        """Slopes of values (points, ...) against the force."""
        return np.gradient(value, self.node, axis=0, edge_order=2 if len(self.node) > 2 else 1)

    def branch(self, samples: np.ndarray, moving: tuple[bool, bool], noise: float) -> Branch:
        """The curve of a run as a branch, with samples (points, replicates, channels). ``noise`` is the standard
        deviation sigma of the force in N.

        Where the force moves at an end of the run, the curve is extended from the middle of its last range to the end
        of the run. The force at the end is estimated by the mean over the last c rows. If the force changes by s from
        row to row, this mean differs from the force at the end by c s / 2, and has the noise sigma / sqrt(c). The sum
        of the squares of both is least for c^3 = 2 (sigma / s)^2.
        """
        ends, samples = self.node.copy(), samples.copy()
        slope = self._slopes(samples)
        for end, rows in ((0, self.points[0]), (-1, self.points[-1])):
            if moving[end]:
                step = np.ptp(self.force[rows]) / len(rows)
                best = (2 * (noise / step) ** 2) ** (1 / 3) if step > 0 else np.inf
                count = int(np.clip(np.round(min(best, len(rows))), 1, max(len(rows) // 8, 1)))
                ends[end] = self.force[rows[:count] if end == 0 else rows[-count:]].mean()
        samples += slope * (ends - self.node)[:, None, None]
        return Branch(ends, samples)


def _words(errors: PointErrors | None) -> list[str]:
    """Notes for the user on what the stated errors of a recording contain."""
    if errors is None:
        return [
            "Error: unknown (few rows, or no noise); without it the largest slope and deviations contain the noise, "
            "which makes them too large."
        ]
    words = ["Error: 1 sigma of the recording's noise."]
    if (errors.correlation > LEAST_CORRELATION).any():
        rough = "" if errors.correlation.max() < ROUGH else ", roughly"
        words.append(
            f"Noise of neighbouring rows is correlated by {errors.correlation.max():.2f}: errors contain it{rough}."
        )
    if errors.hidden.any():
        words.append(
            f"The converter's step of {errors.step[errors.hidden].max():.3g} V hides the noise: errors contain "
            "step / sqrt(12), which is common to all rows of a point."
        )
    return words


def runs_of(measurement: Measurement) -> tuple[str, np.ndarray, np.ndarray, list[slice]]:
    """Divide the rows of a measurement into runs between the turning points of its force.

    Parameters
    ----------
    measurement : Measurement
        Record in s, N and V.

    Returns
    -------
    name : str
        Name of the line of the force.
    direction : (3,) ndarray
        Unit vector of that line.
    force : (rows,) ndarray
        The component along that line, N.
    runs : list[slice]
        Rows of each run.

    Raises
    ------
    InputError
        if the force does not change by more than its noise, or not along one line.
    """
    direction, force = _along_one_line(measurement)
    name = measurement.force_names[0] if len(measurement.force_names) == 1 else force_name(direction)
    turns = _turning_points(force, noise_of(force), measurement.file)
    pieces = [slice(first, last + 1) for first, last in zip(turns[:-1], turns[1:], strict=True)]
    least = SMALLEST_RUN / 2 * np.ptp(force)
    return name, direction, force, [run for run in pieces if abs(force[run.stop - 1] - force[run.start]) > least]


def _along_one_line(measurement: Measurement) -> tuple[np.ndarray, np.ndarray]:
    """Direction (3,) in which the force changes, and its component (rows,) along it."""
    force = measurement.force
    if force.shape[1] == 1:
        name = measurement.force_names[0]
        return np.array([float(name == component) for component in FORCES]), force[:, 0]
    centred = force - force.mean(axis=0)
    direction = np.linalg.svd(centred, full_matrices=False)[2][0]
    direction[np.abs(direction) < SMALLEST_RUN] = 0  # cross-axis signal of the reference sensor
    direction /= np.linalg.norm(direction)
    direction *= np.sign(direction[np.flatnonzero(direction)[0]])
    projection = centred @ direction
    residual = np.sqrt(np.square(centred - projection[:, None] * direction).sum(axis=1).mean())
    if residual > SMALLEST_RUN * np.ptp(projection):
        raise InputError(
            f"measurement {measurement.file!r}: the force changes in several directions "
            f"({residual:.2g} N root mean square away from a straight line): a separate file for each direction is "
            f"needed."
        )
    return direction, force @ direction


def _turning_points(force: np.ndarray, noise: float, file: str) -> np.ndarray:
    """Rows at which the force turns, including the first and the last row."""
    from scipy.signal import find_peaks

    spread = np.ptp(force)
    if not spread > 10 * noise:
        raise InputError(
            f"measurement {file!r}: the force changes by {spread:.2g} N, which is no more than its noise: "
            "runs of growing or falling force are needed."
        )
    prominence = min(max(SMALLEST_RUN * spread, 10 * noise), spread / 2)
    turns = [find_peaks(sign * force, prominence=prominence)[0] for sign in (1, -1)]
    rows = [middle_of_turn(force, int(row), noise) for row in np.sort(np.concatenate(turns))]
    return np.concatenate([[0], np.array(rows, dtype=int), [len(force) - 1]])
