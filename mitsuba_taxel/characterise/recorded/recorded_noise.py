"""Errors of the points of a recording, from its own noise: white, correlated from row to row, or hidden by a converter.

The noise of rows around the curve of a run is modelled as an autoregressive process of first order. Its correlation
follows from that of neighbouring residuals: residuals about a mean and a line are smaller and less correlated than the
noise, and their expected values are computed exactly. Slower noise, as observed in means of quarters of points, is
added. A converter whose steps are larger than the noise repeats the same error in every row: the standard deviation of
a point is then that of the converter, step / sqrt(12) where the voltage is constant (B. Widrow, I. Kollar, Quantization
Noise, 2008).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mitsuba_taxel.base.caches import kept

CHUNK = 48
"""Largest number of consecutive rows that form a chunk for residuals."""
CORRELATIONS = np.linspace(-0.6, 0.98, 80)
LEAST_CORRELATION = 0.1
"""Least correlation that is mentioned in a note."""
FEWEST_DEGREES = 8
"""Least number of degrees of freedom with which the noise counts as known."""
LOCAL_DEGREES = 60
"""Degrees of freedom of the neighbouring points from which the noise of a point is taken."""
QUARTERS = 4
STILL = 0.1
"""Largest change of the curve between neighbouring rows, in steps of the converter, at which it counts as constant."""
PHASES = 4
"""Fractions into which a step is divided: points within the same fraction have the same error of the converter."""
MOST_DIVISOR = 6
"""Largest number of steps of the converter between the two closest voltages of a recording."""
LATTICE = 0.15
"""Largest distance of a difference of voltages from an integer number of steps, in steps."""


class PointErrors(NamedTuple):
    """Standard errors of the points of a recording, and properties of its noise.

    Attributes
    ----------
    errors : list of (points, channels) ndarray
        For each run, standard errors of the mean voltage of each point in V due to the noise. Where the noise is known
        from few rows, they are enlarged so that twice the error is an interval of 95 %.
    of_steps : list of (points, channels) ndarray
        For each run, standard errors in V due to the steps of the converter.
    correlation : (channels,) ndarray
        Correlation of the noise of neighbouring rows.
    step : (channels,) ndarray
        Step of the converter in V; 0 if none is found.
    hidden : (channels,) ndarray of bool
        Whether the step hides the noise.
    """

    errors: list[np.ndarray]
    of_steps: list[np.ndarray]
    correlation: np.ndarray
    step: np.ndarray
    hidden: np.ndarray


def point_errors(
    residuals: list[list[np.ndarray]],
    steady: list[list[np.ndarray]],
    curve: list[list[np.ndarray]],
    voltage: np.ndarray,
) -> PointErrors | None:
    """Estimate the standard errors of the points of a recording from the scatter of its rows.

    A point is the mean of several rows of a run (see `points_of`).

    Parameters
    ----------
    residuals : list of lists of (rows, channels) ndarray
        For each run and point: voltages of the rows of the point minus the curve at the measured force, in V and in the
        order of time.
    steady : list of lists of (rows, channels) ndarray
        The same voltages minus the curve at the force made monotonic by isotonic regression, in V.
    curve : list of lists of (rows, channels) ndarray
        The curve at the monotonic force of each row, in V.
    voltage : (rows, channels) ndarray
        All voltages of the recording, in V.

    Returns
    -------
    PointErrors or None
        The errors; None if there are too few rows to estimate the noise.
    """
    from scipy.stats import t

    # Points of all runs in one list, with the squares and products of neighbours of their residuals.
    flat = [rows for run in residuals for rows in run]
    run_of = np.repeat(np.arange(len(residuals)), [len(run) for run in residuals])
    smooth = [rows for run in curve for rows in run]
    sums = [_sums(rows) for rows in flat]
    degrees = np.array([sum(_expected(len(chunk))[0][ZERO] for chunk in _chunks(rows)) for rows in flat])
    if degrees.sum() < FEWEST_DEGREES:
        return None
    counts, channels = np.array([len(rows) for rows in flat]), voltage.shape[1]
    errors, of_steps = np.empty((len(flat), channels)), np.zeros((len(flat), channels))
    correlation, step_sizes, hidden = np.zeros(channels), np.zeros(channels), np.zeros(channels, dtype=bool)
    for channel in range(channels):
        squares = np.array([square[channel] for square, _ in sums])
        products = np.array([product[channel] for _, product in sums])
        step = step_sizes[channel] = step_of(voltage[:, channel])

        # Whether the step hides the noise: the rounding of a smooth voltage to steps has at most the variance of
        # uniform noise. Rows at which the curve is constant are preferred, as rounding shows there most clearly.
        jumps, moves = (
            np.concatenate([np.diff(rows[:, channel]) for run in source for rows in run]) for source in (steady, curve)
        )
        still = np.abs(moves) < STILL * step
        jumps = jumps[still] if still.sum() >= FEWEST_DEGREES else jumps
        jump = np.square(jumps).mean() / 2 if len(jumps) else 0.0
        if step and jump < step**2 * (1 / 12 + 1 / 16):
            hidden[channel] = True
        elif not step and (np.diff(voltage[:, channel]) == 0).mean() > 0.5:
            return None
        elif squares.sum() <= 1e-24 * np.ptp(voltage[:, channel]) ** 2:
            return None

        # The correlation of the noise, and its variance at each point from the residuals about a mean and a line.
        index = ZERO if hidden[channel] else _correlation(flat, products.sum() / squares.sum())
        rho = correlation[channel] = CORRELATIONS[index]
        degrees_left = np.array([sum(_expected(len(chunk))[0][index] for chunk in _chunks(rows)) for rows in flat])
        variance = _local(squares, degrees_left, run_of)
        of_mean = variance * np.array([_variance_of_mean(count, rho) for count in counts])
        if not hidden[channel]:
            of_mean *= _slower(flat, channel, variance, rho)

        # The error of the converter in the mean of a point: due to the rows within one of the steps that its voltage
        # passes, and due to rows at the same position in every step. Noise reduces it (dithering).
        if step:
            most_within = np.array([_most_within(rows[:, channel], step) for rows in smooth])
            fraction = np.minimum(1.0, np.hypot(most_within, 1 / (most_within * counts)))
            dithered = np.exp(-2 * np.pi**2 * max(jump / step**2 - 1 / 12, 0.0))
            of_steps[:, channel] = step * fraction * dithered / np.sqrt(12)
        errors[:, channel] = np.sqrt(of_mean) * t.isf(0.02275, degrees.sum()) / 2
    ends = np.cumsum([len(run) for run in residuals])[:-1]
    return PointErrors(np.split(errors, ends), np.split(of_steps, ends), correlation, step_sizes, hidden)


def _most_within(voltage: np.ndarray, step: float) -> float:
    """Largest fraction of voltages (rows,) in V that lie within one step."""
    ascending = np.sort(voltage)
    return float((np.searchsorted(ascending, ascending + step) - np.arange(len(ascending))).max() / len(ascending))


def step_of(voltage: np.ndarray) -> float:
    """Step in V of the converter that recorded voltages (rows,): all differences of voltages are multiples of it.

    The result is 0 if there is no such step, or if voltages do not repeat.
    """
    values = np.unique(voltage)
    if not 2 < len(values) <= len(voltage) / 3:
        return 0.0
    gaps = np.diff(values)
    for divisor in range(1, MOST_DIVISOR + 1):
        steps = gaps / (gaps.min() / divisor)
        multiples = np.round(steps)
        if (np.abs(steps - multiples) < LATTICE * np.maximum(1.0, 0.02 * steps)).mean() > 0.95:
            return float(gaps.sum() / multiples.sum())
    return 0.0


def with_errors(values: list[np.ndarray], errors: PointErrors, replicates: int) -> list[np.ndarray]:
    """Create replicates of each run whose scatter equals the stated errors, because figures of merit take their errors
    from replicates.

    Deviations sum to zero over the replicates, and deviations of different points of a run are orthogonal. Points of
    equal voltage have the same error of the converter. The actual error of a value is as large as the deviation of half
    of its replicates, so the halves are as independent as halves of actual replicates, which :func:`at_largest`
    requires.

    Parameters
    ----------
    values : list of (points, channels) ndarray
        Mean voltages of the points of each run, in V.
    errors : PointErrors
        Errors of these values.
    replicates : int
        Number of samples per point.

    Returns
    -------
    list of (points, replicates, channels) ndarray
        Samples in V.
    """
    random = np.random.default_rng(0)
    size = np.sqrt(replicates * (replicates - 1))
    channels = values[0].shape[1]
    samples = []
    for value, error in zip(values, errors.errors, strict=True):
        drawn = np.stack([_deviations(replicates, len(value), random) for _ in range(channels)], axis=-1)
        samples.append(value[:, None] + size * error[:, None] * drawn)
    for channel in np.flatnonzero(errors.step):
        levels = np.concatenate([value[:, channel] for value in values]) / errors.step[channel]
        level = np.unique(np.round(levels * PHASES), return_inverse=True)[1]
        drawn = _bounded(replicates, level.max() + 1, random)[level]
        draws = np.split(drawn, np.cumsum([len(value) for value in values])[:-1])
        for run_samples, draw, error in zip(samples, draws, errors.of_steps, strict=True):
            run_samples[:, :, channel] += size * error[:, channel, None] * draw
    return samples


def _deviations(replicates: int, count: int, random: np.random.Generator) -> np.ndarray:
    """Unit vectors (count, replicates) whose components sum to zero, orthogonal if ``count`` < ``replicates``."""
    drawn = random.normal(size=(replicates, count))
    drawn -= drawn.mean(axis=0)
    if count < replicates:
        drawn = np.linalg.qr(drawn)[0]
    return (drawn / np.linalg.norm(drawn, axis=0)).T


def _bounded(replicates: int, count: int, random: np.random.Generator) -> np.ndarray:
    """Unit vectors like the result of `_deviations`, but with means over the even replicates that are uniformly
    distributed, like errors due to the steps of a converter.

    A figure of merit, such as a largest slope, is found with two halves of the replicates, whose deviations are
    opposite: one half chooses the point, and the other half is evaluated there. With a normal distribution, the first
    half would choose points of large errors, and the value of the second half would be too small.
    """
    contrast = np.resize([1.0, -1.0], replicates) / np.sqrt(replicates)
    rest = _deviations(replicates, count, random)
    rest -= np.outer(rest @ contrast, contrast)
    rest /= np.linalg.norm(rest, axis=1, keepdims=True)
    along = random.uniform(-1, 1, size=(count, 1)) * np.sqrt(3 / (replicates - 1))
    return along * contrast + np.sqrt(1 - along**2) * rest


ZERO = int(np.abs(CORRELATIONS).argmin())
"""Index of the correlation nearest to zero."""


def _chunks(rows: np.ndarray) -> list[np.ndarray]:
    """Consecutive rows in chunks of at most CHUNK rows, as equal as possible."""
    return [rows] if 0 < len(rows) <= CHUNK else np.array_split(rows, -(-len(rows) // CHUNK))


def _without_line(rows: np.ndarray) -> np.ndarray:
    """Rows minus their mean. If there are four or more rows, their linear trend in time is subtracted as well."""
    rows = rows - rows.mean(axis=0)
    if len(rows) < 4:
        return rows
    time = np.arange(len(rows)) - (len(rows) - 1) / 2
    return rows - np.outer(time, time @ rows / (time @ time))


def _sums(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sums (channels,) over the residuals of rows (n, channels): of their squares, and of the products of neighbouring
    rows."""
    residuals = [_without_line(chunk) for chunk in _chunks(rows)]
    return sum((chunk**2).sum(axis=0) for chunk in residuals), sum(
        (chunk[1:] * chunk[:-1]).sum(axis=0) for chunk in residuals
    )


@kept(CHUNK)
def _expected(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Expected values of the two sums of `_sums`, for ``count`` rows of noise with variance 1, for each correlation in
    CORRELATIONS.
    """
    lag = np.abs(np.subtract.outer(np.arange(count), np.arange(count)))
    projection = _without_line(np.eye(count))
    covariances = [projection @ rho**lag @ projection.T for rho in CORRELATIONS]
    return tuple(np.array([np.diagonal(covariance, lag).sum() for covariance in covariances]) for lag in (0, 1))  # type: ignore[return-value]


def _correlation(flat: list[np.ndarray], ratio: float) -> int:
    """Estimate the correlation of noise: the index in CORRELATIONS whose expected ratio of products to squares is
    nearest to ``ratio``."""
    expected = [
        sum(sums) for sums in zip(*(_expected(len(chunk)) for rows in flat for chunk in _chunks(rows)), strict=True)
    ]
    return int(np.abs(expected[1] / expected[0] - ratio).argmin())


def _variance_of_mean(count: int, rho: float) -> float:
    """Variance of the mean of ``count`` rows of noise of variance 1 and correlation ``rho``."""
    lags = np.arange(1, min(count, 2000))
    return float(1 + 2 * ((1 - lags / count) * rho**lags).sum()) / count


def _local(squares: np.ndarray, degrees: np.ndarray, run_of: np.ndarray) -> np.ndarray:
    """Variance of the noise at each point of a run, estimated from neighbouring points, or from all points if the run
    has too few rows.
    """
    variance = np.empty(len(squares))
    for number in range(len(squares)):
        run_points = np.flatnonzero(run_of == run_of[number])
        order = run_points[np.argsort(np.abs(run_points - number), kind="stable")]
        count = int(np.searchsorted(np.cumsum(degrees[order]), LOCAL_DEGREES)) + 1
        selection = order[:count] if count <= len(order) else slice(None)
        variance[number] = squares[selection].sum() / degrees[selection].sum()
    return variance


def _slower(flat: list[np.ndarray], channel: int, variance: np.ndarray, rho: float) -> float:
    """Factor, at least 1, by which slow noise enlarges the variance of means of rows. Slow noise is slower than the
    correlation of neighbouring rows.

    It is the ratio of observed to expected squares of the means of quarters of points about their linear trend.
    """
    observed = expected = 0.0
    for rows, square in zip(flat, variance, strict=True):
        if len(rows) >= 8 * QUARTERS:
            quarters = np.array_split(_without_line(rows[:, [channel]])[:, 0], QUARTERS)
            observed += float((_without_line(np.array([quarter.mean() for quarter in quarters])[:, None]) ** 2).sum())
            expected += (QUARTERS - 2) * square * _variance_of_mean(len(quarters[0]), rho)
    return max(1.0, observed / expected) if expected > 0 else 1.0
