"""Prony series of a relaxation test."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mitsuba_taxel.base.arguments import path_of
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.files.table import UNITS, Column, read_table

MOST_TERMS = 4
LEAST_ROWS = 8
SIGNIFICANT = 2.5
"""Number of standard deviations by which the cross-validated error must decrease for more terms."""


@dataclass(frozen=True, eq=False)
class RelaxationFit:
    """A Prony series fitted to a relaxation test.

    Attributes
    ----------
    file : str
        Name of the file.
    prony : tuple[tuple[float, float], ...]
        Weight and relaxation time in s of each term, the shortest time first.
    weight_errors, time_errors : (k,) ndarray
        Half-widths of 95 % intervals.
    rms : float
        Root mean square of the residuals, relative to the stress at the start.
    time, stress, model : (n,) ndarray
        Time since the start in s, and measured and fitted stress, relative to the fitted stress at the start.
    notes : list[str]
        Notes on omitted rows and assumptions.
    """

    file: str
    prony: tuple[tuple[float, float], ...]
    weight_errors: np.ndarray
    time_errors: np.ndarray
    rms: float
    time: np.ndarray
    stress: np.ndarray
    model: np.ndarray
    notes: list[str]


def fit_relaxation(file: str | Path) -> RelaxationFit:
    """Fit a Prony series to a relaxation test: stress or force over time at a constant strain.

    Series of one to four terms are fitted; a longer series is chosen if it predicts left-out rows better.

    Parameters
    ----------
    file : str or Path
        Table with a column ``time`` and a column of stress or force.

    Returns
    -------
    RelaxationFit
        Weights, relaxation times and their errors.

    Raises
    ------
    InputError
        if the table is not a relaxation test.
    """
    path = path_of("relaxation", file)
    what = f"relaxation {path.name!r}"
    table = read_table(what, path)
    times = [column for column in table.columns if column.heading.lower().startswith(("time", "t [", "t_"))]
    words = ("stress", "force", "load")
    loads = [column for column in table.columns if any(word in column.heading.lower() for word in words)]
    if len(times) != 1 or len(loads) != 1:
        raise InputError(f"{what}: one column 'time [s]' and one column of stress or force are needed.")
    time, stress = _seconds_per_unit(what, times[0]) * table.numbers(times[0]), np.abs(table.numbers(loads[0]))
    lines = np.array(table.lines)
    back = np.flatnonzero(np.diff(time) <= 0)
    if len(back):
        line = lines[back[0] + 1]
        raise InputError(f"{what}, line {line}: time does not grow; rows in the order of time are needed.")

    # The stress is held from its largest value on.
    width = max(1, len(stress) // 50)
    start = int(np.argmax(np.convolve(stress, np.ones(width) / width, mode="valid")))
    notes = [f"{path.name}: {start} rows before the largest stress are left out"] if start else []
    time, stress, lines = time[start:] - time[start], stress[start:], lines[start:]
    if len(time) < LEAST_ROWS:
        rows = f"{len(time)} rows from line {lines[0]} on"
        raise InputError(f"{what}: {rows} are too few: at least {LEAST_ROWS} are needed.")
    fits = [fit for fit in (_fit(time, stress, terms) for terms in range(1, MOST_TERMS + 1)) if fit is not None]
    if not fits:
        raise InputError(f"{what}, line {lines[0]}: the stress does not fall: a test at constant strain is needed.")
    chosen = fits[0]
    for fit in fits[1:]:
        gain = chosen.predicted**2 - fit.predicted**2
        if gain.mean() > SIGNIFICANT * gain.std() / np.sqrt(len(gain)):
            chosen = fit
    amplitude = chosen.weights[0]
    if chosen.shares.sum() < 1e-3:
        raise InputError(f"{what}, line {lines[0]}: the stress does not fall: a test at constant strain is needed.")
    notes.append(f"{path.name}: the strain is taken as applied at once at line {lines[0]}")
    return RelaxationFit(
        file=path.name,
        prony=tuple((float(g), float(tau)) for g, tau in zip(chosen.shares, chosen.times, strict=True)),
        weight_errors=chosen.share_errors,
        time_errors=chosen.time_errors,
        rms=float(np.sqrt(np.mean((chosen.model - stress) ** 2))) / amplitude,
        time=time,
        stress=stress / amplitude,
        model=chosen.model / amplitude,
        notes=notes,
    )


def _seconds_per_unit(what: str, column: Column) -> float:
    """Seconds per unit of a column of time, which is in s if its heading has no unit; raises `InputError`."""
    if UNITS.get(column.unit, ("",))[0] == "s":
        return float(UNITS[column.unit][1])
    word = column.heading.lower().removeprefix("time").removeprefix("t").strip(" _/[]()")
    if word in ("h", "hours"):
        return 3600.0
    if word:
        raise InputError(f"{what}, column {column.heading}: a unit of time is needed: s, ms, min or h.")
    return 1.0


@dataclass(frozen=True, eq=False)
class _Terms:
    """A fitted Prony series with a given number of terms: amplitude at the start, weights, relaxation times, and their
    errors."""

    weights: np.ndarray
    shares: np.ndarray
    times: np.ndarray
    share_errors: np.ndarray
    time_errors: np.ndarray
    model: np.ndarray
    predicted: np.ndarray


def _fit(time: np.ndarray, stress: np.ndarray, terms: int) -> _Terms | None:
    """Fit a Prony series to a relaxing stress, S0 (1 - sum of g_i (1 - exp(-t / tau_i))), by least squares over S0, g_i
    and ln tau_i; None if terms vanish."""
    from scipy.optimize import least_squares, nnls
    from scipy.stats import t

    freedom = len(time) - 2 * terms - 1
    if freedom < 3:
        return None
    last, first = float(time[-1]), max(float(time[1]), 1e-6 * float(time[-1]))

    def columns(logarithms: np.ndarray) -> np.ndarray:
        return np.column_stack([np.ones_like(time), *(np.exp(-time / np.exp(value)) for value in logarithms)])

    def residual(logarithms: np.ndarray) -> np.ndarray:
        basis = columns(logarithms)
        return basis @ nnls(basis, stress)[0] - stress

    inner = np.linspace(np.log(first), np.log(last), terms + 2)[1:-1]
    bounds = (np.log(first / 10), np.log(10 * last))
    solution = least_squares(residual, inner, bounds=bounds, max_nfev=200)
    logarithms = np.sort(solution.x)
    basis = columns(logarithms)
    amplitudes = nnls(basis, stress)[0]
    if np.any(amplitudes[1:] <= 0) or np.any(np.diff(logarithms) < 0.2):
        return None

    # Errors of S0, of the weights and of the logarithms of times.
    total = float(amplitudes.sum())
    shares = amplitudes[1:] / total
    decay = 1 - basis[:, 1:]
    by_time = -total * shares * basis[:, 1:] * -(time[:, None] / np.exp(logarithms))
    jacobian = np.column_stack([1 - decay @ shares, -total * decay, by_time])
    left, singular, right = np.linalg.svd(jacobian / (scale := np.linalg.norm(jacobian, axis=0)), full_matrices=False)
    difference = basis @ amplitudes - stress
    root = right.T / singular / scale[:, None]
    error = np.sqrt(float(difference @ difference) / freedom * np.diag(root @ root.T)) * t.ppf(0.975, freedom)
    leverage = np.minimum(np.square(left).sum(axis=1), 0.99)
    return _Terms(
        np.array([total]),
        shares,
        np.exp(logarithms),
        error[1 : terms + 1],
        error[terms + 1 :] * np.exp(logarithms),
        basis @ amplitudes,
        difference / (1 - leverage),
    )
