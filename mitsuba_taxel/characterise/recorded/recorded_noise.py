"""Errors of the points of a recording, from its own noise: white, correlated from row to row, or hidden by a converter.

The noise of rows around a run's curve is taken as an autoregressive process of first order, whose correlation follows
from that of neighbouring residuals: expected residuals of a mean and a line, which are smaller and less correlated than
the noise, are computed exactly. Noise that is slower than that, as seen in means of quarters of points, adds to it. A
converter whose steps are larger than the noise repeats the same error in every row: its standard deviation, a step /
sqrt(12) where the voltage stands still, is that of a point (B. Widrow, I. Kollar, Quantization Noise, 2008).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mitsuba_taxel.base.caches import kept

CHUNK = 48
"""Most consecutive rows from which residuals are taken."""
CORRELATIONS = np.linspace(-0.6, 0.98, 80)
LEAST_CORRELATION = 0.1
"""A smaller one is not worth a word."""
FEWEST_DEGREES = 8
"""Degrees of freedom of the noise below which it counts as unknown."""
LOCAL_DEGREES = 60
"""Of the neighbouring points from which a point's noise is taken."""
QUARTERS = 4
STILL = 0.1
"""Largest change of the curve between neighbouring rows, in steps, that counts as none."""
PHASES = 4
"""Parts of a step within which points of equal voltage are on the same place of it."""
MOST_DIVISOR = 6
"""Most steps between the two nearest voltages of a recording."""
LATTICE = 0.15
"""Largest distance from whole numbers of steps, in steps, of the differences of a converter's voltages."""


class PointErrors(NamedTuple):
    """Errors of the points of all runs.

    Attributes
    ----------
    errors : list of (points, channels) ndarray
        Standard errors of the mean voltage of each point in V by its noise, for each run; multiplied so that twice of
        it holds 95 %, where the noise is known from few rows.
    of_steps : list of (points, channels) ndarray
        The same by the steps of the converter.
    correlation : (channels,) ndarray
        Of the noise of neighbouring rows.
    step : (channels,) ndarray
        Of the converter in V; 0 if none is seen.
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
    """Errors of the points of all runs; None if the noise is unknown.

    Parameters
    ----------
    residuals : list of lists of (rows, channels) ndarray
        For each run and point, the voltages of its rows less the curve, in V and in the order of time.
    steady : list of lists of (rows, channels) ndarray
        The same with the noise of the force removed from the curve.
    curve : list of lists of (rows, channels) ndarray
        The curve there at a force without noise, in V.
    voltage : (rows, channels) ndarray
        The whole recording, in V.
    """
    from scipy.stats import t

    flat = [rows for run in residuals for rows in run]
    run_of = np.repeat(np.arange(len(residuals)), [len(run) for run in residuals])
    smooth = [rows for run in curve for rows in run]
    sums = [_sums(rows) for rows in flat]
    degrees = np.array([sum(_expected(len(part))[0][ZERO] for part in _chunks(rows)) for rows in flat])
    if degrees.sum() < FEWEST_DEGREES:
        return None
    counts, channels = np.array([len(rows) for rows in flat]), voltage.shape[1]
    errors, of_steps = np.empty((len(flat), channels)), np.zeros((len(flat), channels))
    correlation, step_sizes, hidden = np.zeros(channels), np.zeros(channels), np.zeros(channels, dtype=bool)
    for channel in range(channels):
        squares = np.array([own[channel] for own, _ in sums])
        products = np.array([next_[channel] for _, next_ in sums])
        step = step_sizes[channel] = step_of(voltage[:, channel])
        # Of neighbours: what a step leaves of a smooth voltage has at most the variance of uniform noise. Where the
        # curve stands still tells more than where it moves.
        jumps, moves = (
            np.concatenate([np.diff(rows[:, channel]) for run in of for rows in run]) for of in (steady, curve)
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
        # The correlation, and what a mean and a line leave of the noise with it.
        place = ZERO if hidden[channel] else _correlation(flat, products.sum() / squares.sum())
        rho = correlation[channel] = CORRELATIONS[place]
        left = np.array([sum(_expected(len(part))[0][place] for part in _chunks(rows)) for rows in flat])
        variance = _local(squares, left, run_of)
        of_mean = variance * np.array([_variance_of_mean(count, rho) for count in counts])
        if not hidden[channel]:
            of_mean *= _slower(flat, channel, variance, rho)
        # What a step leaves in the mean of a point: of the rows within one of the steps that its voltage passes, and of
        # rows that lie alike in every step.
        if step:
            within = np.array([_most_within(rows[:, channel], step) for rows in smooth])
            share = np.minimum(1.0, np.hypot(within, 1 / (within * counts)))
            dithered = np.exp(-2 * np.pi**2 * max(jump / step**2 - 1 / 12, 0.0))
            of_steps[:, channel] = step * share * dithered / np.sqrt(12)
        errors[:, channel] = np.sqrt(of_mean) * t.isf(0.02275, degrees.sum()) / 2
    ends = np.cumsum([len(run) for run in residuals])[:-1]
    return PointErrors(np.split(errors, ends), np.split(of_steps, ends), correlation, step_sizes, hidden)


def _most_within(voltage: np.ndarray, step: float) -> float:
    """Largest share of voltages (rows,) in V within one step."""
    ordered = np.sort(voltage)
    return float((np.searchsorted(ordered, ordered + step) - np.arange(len(ordered))).max() / len(ordered))


def step_of(voltage: np.ndarray) -> float:
    """Step of the converter that wrote voltages (rows,) in V: that of which all of their differences are multiples, if
    each occurs several times; 0 if there is none."""
    values = np.unique(voltage)
    if not 2 < len(values) <= len(voltage) / 3:
        return 0.0
    gaps = np.diff(values)
    for divisor in range(1, MOST_DIVISOR + 1):
        steps = gaps / (gaps.min() / divisor)
        whole = np.round(steps)
        if (np.abs(steps - whole) < LATTICE * np.maximum(1.0, 0.02 * steps)).mean() > 0.95:
            return float(gaps.sum() / whole.sum())
    return 0.0


def with_errors(values: list[np.ndarray], errors: PointErrors, replicates: int) -> list[np.ndarray]:
    """Samples (points, replicates, channels) of each run whose scatter states the errors of its values (points,
    channels).

    Deviations sum to zero over the replicates, and those of different points of a run are orthogonal; points of equal
    voltage share the error of the converter's steps. As the actual error of a value is as large as the deviation of a
    half of its replicates, halves are as independent as those of actual replicates, of which :func:`at_largest` makes
    use.
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
        parts = np.split(drawn, np.cumsum([len(value) for value in values])[:-1])
        for own, part, error in zip(samples, parts, errors.of_steps, strict=True):
            own[:, :, channel] += size * error[:, channel, None] * part
    return samples


def _deviations(replicates: int, count: int, random: np.random.Generator) -> np.ndarray:
    """(count, replicates) unit vectors whose components sum to zero, orthogonal if there are not too many."""
    drawn = random.normal(size=(replicates, count))
    drawn -= drawn.mean(axis=0)
    if count < replicates:
        drawn = np.linalg.qr(drawn)[0]
    return (drawn / np.linalg.norm(drawn, axis=0)).T


def _bounded(replicates: int, count: int, random: np.random.Generator) -> np.ndarray:
    """The same with means of the even replicates that are uniformly distributed, as errors by steps are.

    If the errors of the two halves had another distribution than the actual errors, halves would not be independent:
    the half that chooses the largest of many numbers would do so by its own tails, which steps do not have, and the
    other, of the opposite deviation, would be too small there.
    """
    contrast = np.resize([1.0, -1.0], replicates) / np.sqrt(replicates)
    rest = _deviations(replicates, count, random)
    rest -= np.outer(rest @ contrast, contrast)
    rest /= np.linalg.norm(rest, axis=1, keepdims=True)
    along = random.uniform(-1, 1, size=(count, 1)) * np.sqrt(3 / (replicates - 1))
    return along * contrast + np.sqrt(1 - along**2) * rest


ZERO = int(np.abs(CORRELATIONS).argmin())


def _chunks(rows: np.ndarray) -> list[np.ndarray]:
    """Consecutive rows in parts of at most CHUNK, as equal as possible."""
    return np.array_split(rows, -(-len(rows) // CHUNK))


def _without_line(rows: np.ndarray) -> np.ndarray:
    """Rows less their mean and, of four or more, less a line in time."""
    rows = rows - rows.mean(axis=0)
    if len(rows) < 4:
        return rows
    time = np.arange(len(rows)) - (len(rows) - 1) / 2
    return rows - np.outer(time, time @ rows / (time @ time))


def _sums(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Squares, and products of neighbours, of the residuals of rows (n, channels)."""
    parts = [_without_line(part) for part in _chunks(rows)]
    return sum((part**2).sum(axis=0) for part in parts), sum((part[1:] * part[:-1]).sum(axis=0) for part in parts)


@kept(CHUNK)
def _expected(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Expected squares, and products of neighbours, of residuals of noise of variance 1, for each of CORRELATIONS."""
    lag = np.abs(np.subtract.outer(np.arange(count), np.arange(count)))
    left = _without_line(np.eye(count))
    covariances = [left @ rho**lag @ left.T for rho in CORRELATIONS]
    return tuple(np.array([np.diagonal(each, lag).sum() for each in covariances]) for lag in (0, 1))  # type: ignore[return-value]


def _correlation(flat: list[np.ndarray], ratio: float) -> int:
    """Place in CORRELATIONS whose expected ratio of products to squares is the nearest."""
    expected = [sum(parts) for parts in zip(*(_expected(len(p)) for rows in flat for p in _chunks(rows)), strict=True)]
    return int(np.abs(expected[1] / expected[0] - ratio).argmin())


def _variance_of_mean(count: int, rho: float) -> float:
    """Of noise of variance 1."""
    lags = np.arange(1, min(count, 2000))
    return float(1 + 2 * ((1 - lags / count) * rho**lags).sum()) / count


def _local(squares: np.ndarray, degrees: np.ndarray, run_of: np.ndarray) -> np.ndarray:
    """Variance at each point, from those next to it in its run and, of too few rows there, from all."""
    variance = np.empty(len(squares))
    for number in range(len(squares)):
        same = np.flatnonzero(run_of == run_of[number])
        order = same[np.argsort(np.abs(same - number), kind="stable")]
        enough = int(np.searchsorted(np.cumsum(degrees[order]), LOCAL_DEGREES)) + 1
        near = order[:enough] if enough <= len(order) else slice(None)
        variance[number] = squares[near].sum() / degrees[near].sum()
    return variance


def _slower(flat: list[np.ndarray], channel: int, variance: np.ndarray, rho: float) -> float:
    """Factor of the variance of means by noise that is slower than the correlation of neighbours, at least 1: squares
    of means of quarters of points less their line, over those expected."""
    seen = expected = 0.0
    for rows, square in zip(flat, variance, strict=True):
        if len(rows) >= 8 * QUARTERS:
            parts = np.array_split(_without_line(rows[:, [channel]])[:, 0], QUARTERS)
            seen += float((_without_line(np.array([part.mean() for part in parts])[:, None]) ** 2).sum())
            expected += (QUARTERS - 2) * square * _variance_of_mean(len(parts[0]), rho)
    return max(1.0, seen / expected) if expected > 0 else 1.0
