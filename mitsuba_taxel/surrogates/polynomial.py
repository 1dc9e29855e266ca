"""Readings of a study as polynomials of its varied numbers, cross-validated on whole paths."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
import xarray as xr

from mitsuba_taxel.base.errors import InputError

MOST_DEGREE = 8
MOST_TESTS = 24
"""Largest number of paths that are left out in turn; they are spread evenly over the candidates."""


class Unseen(NamedTuple):
    """Readings (rows, taxels) that were left out of a fit, and their predictions by the fit, in the unit of the
    readings.
    """

    wanted: np.ndarray
    predicted: np.ndarray


class Polynomial(NamedTuple):
    """Polynomial from inputs (rows, inputs) to readings (rows, taxels) in W, valid within the ranges of the inputs.

    Attributes
    ----------
    names, units : tuple[str, ...]
        Names and units of the inputs.
    low, high : (inputs,) ndarray
        Ranges of the inputs, in their units.
    exponents : (terms, inputs) ndarray of int
        Exponents of the inputs, scaled to -1 ... 1.
    weights : (terms, taxels) ndarray
        Coefficients of the terms, in W.
    rms, worst : float
        Errors at readings that were left out of the fit, relative to the full scale of the taxel (the range of its
        readings): root mean square for the worst taxel, and largest error of all taxels.
    tested : str
        A description of the test.
    unseen : Unseen or None
        The readings of the test.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    low: np.ndarray
    high: np.ndarray
    exponents: np.ndarray
    weights: np.ndarray
    rms: float
    worst: float
    tested: str
    unseen: Unseen | None = None

    def __call__(self, inputs: np.ndarray) -> np.ndarray:
        """Readings (rows, taxels) at inputs (rows, inputs), which are clipped to their ranges."""
        span = np.where(self.high > self.low, self.high - self.low, 1.0)
        scaled = 2 * (np.clip(inputs, self.low, self.high) - self.low) / span - 1
        return terms(scaled, self.exponents) @ self.weights


def single(study: xr.Dataset | xr.DataTree) -> xr.Dataset:
    """Check that a study has a single scene, and return it; raises `InputError` otherwise."""
    if isinstance(study, xr.DataTree):
        raise InputError("the study holds several scenes: the folder of one of them is needed.")
    return study


def polynomial_of(study: xr.Dataset) -> Polynomial:
    """Fit the readings of a study by a polynomial of its varied numbers, of the degree that predicts new paths best.

    A path is one curve of the study, at one combination of the other parameters. Each test leaves out a path inside the
    ranges of the other parameters, so that the remaining paths span the same ranges. If the study has no such path, a
    test leaves out an inner point.

    Parameters
    ----------
    study : xr.Dataset
        Study of one scene, as returned by ``sweep`` or ``open_study``.

    Returns
    -------
    Polynomial
        Readings in W from the varied parameters, with the error on the readings that were left out.

    Raises
    ------
    InputError
        if words are varied, or no number has three values.
    """
    # Inputs are scaled to -1 ... 1. The degree in each input is limited by its number of values.
    names, inputs, readings, path = _rows(study)
    low, high = inputs.min(axis=0), inputs.max(axis=0)
    scaled = 2 * (inputs - low) / (high - low) - 1
    max_degrees = [min(len(np.unique(column)) - 1, MOST_DEGREE) for column in scaled.T]
    if max(max_degrees) < 2:
        raise InputError(
            "a polynomial needs at least three values of a varied parameter, and each has two: extend the study."
        )
    # Cross-validate each total degree that has fewer terms than rows.
    groups, tested = _test_groups(scaled, path)
    scale = np.ptp(readings, axis=0)
    scale = np.where(scale > 0, scale, np.inf)
    candidates = []
    for degree in range(1, max(max_degrees) + 1):
        exponents = np.array([e for e in product(*(range(m + 1) for m in max_degrees)) if sum(e) <= degree])
        if len(exponents) > len(scaled) - max(map(np.count_nonzero, groups)):
            break
        candidates.append((exponents, _test_readings(scaled, readings, exponents, groups)))
    # Fit all rows with the degree of the smallest error, relative to the range of each taxel.
    residuals = [(unseen.predicted - unseen.wanted) / scale for _, unseen in candidates]
    rms = [float(np.sqrt(np.square(residual).mean(axis=0)).max()) for residual in residuals]
    best = int(np.argmin(rms))
    exponents, unseen = candidates[best]
    weights = np.linalg.lstsq(terms(scaled, exponents), readings, rcond=None)[0]
    units = tuple(study[name].attrs.get("units", "") for name in names)
    worst = float(np.abs(residuals[best]).max())
    return Polynomial(
        names=names,
        units=units,
        low=low,
        high=high,
        exponents=exponents,
        weights=weights,
        rms=rms[best],
        worst=worst,
        tested=tested,
        unseen=unseen,
    )


def _rows(study: xr.Dataset) -> tuple[tuple[str, ...], np.ndarray, np.ndarray, np.ndarray]:
    """Names and values (rows, inputs) of the varied numbers, readings (rows, taxels), and path number (rows,)."""
    curve = study.attrs["curve"]
    power = study.smooth_power if "smooth_power" in study else study.power
    stacked = power.stack(row=[dim for dim in power.dims if dim != "taxel"]).transpose("row", "taxel")
    columns = {}
    for name, coordinate in stacked.coords.items():
        if coordinate.dims != ("row",) or name in ("row", "step"):
            continue
        if coordinate.dtype.kind not in "fi":
            values = ", ".join(map(str, dict.fromkeys(coordinate.values.tolist())))
            raise InputError(f"{name} has values that are words ({values}): a study with one of them is needed.")
        if len(np.unique(coordinate.values)) > 1:
            columns[str(name)] = coordinate.values.astype(float)
    if not columns:
        raise InputError("no parameter has more than one value: a study of several values is needed.")
    finite = np.isfinite(stacked.values).all(axis=1)
    other_columns = [values for name, values in columns.items() if study[name].dims != (curve,)]
    path = (
        np.unique(np.stack(other_columns, axis=1), axis=0, return_inverse=True)[1].ravel()
        if other_columns
        else 0 * finite
    )
    return tuple(columns), np.stack(list(columns.values()), axis=1)[finite], stacked.values[finite], path[finite]


def _test_groups(scaled: np.ndarray, path: np.ndarray) -> tuple[list[np.ndarray], str]:
    """Masks (rows,) of the rows that each test leaves out, and a description of the tests.

    A test leaves out a path such that the remaining rows span the same ranges of inputs. If no path is of this kind, a
    test leaves out a single row of this kind.
    """
    paths = [path == number for number in np.unique(path)]
    inside = [rows for rows in paths if not rows.all() and _spans(scaled[~rows])]
    unit = "path"
    if not inside:
        single_rows = np.eye(len(scaled), dtype=bool)
        inside = [rows for rows in single_rows if _spans(scaled[~rows])]
        unit = "point"
    chosen = np.unique(np.linspace(0, len(inside) - 1, min(len(inside), MOST_TESTS)).round().astype(int))
    unit = f"{len(chosen)} {unit}{'s' if len(chosen) > 1 else ''} left out one by one"
    return [inside[number] for number in chosen], unit


def _spans(scaled: np.ndarray) -> bool:
    """Whether scaled inputs (rows, inputs) reach both -1 and 1 in every column."""
    return bool(len(scaled) and (scaled.min(axis=0) == -1).all() and (scaled.max(axis=0) == 1).all())


def _test_readings(
    scaled: np.ndarray, readings: np.ndarray, exponents: np.ndarray, groups: Sequence[np.ndarray]
) -> Unseen:
    """The readings of each group of rows, and their predictions by fits without that group."""
    columns, predicted = terms(scaled, exponents), []
    for rows in groups:
        weights = np.linalg.lstsq(columns[~rows], readings[~rows], rcond=None)[0]
        predicted.append(columns[rows] @ weights)
    return Unseen(np.concatenate([readings[rows] for rows in groups]), np.concatenate(predicted))


def terms(scaled: np.ndarray, exponents: np.ndarray) -> np.ndarray:
    """Evaluate the terms of a polynomial: products of powers of its inputs.

    Parameters
    ----------
    scaled : (rows, inputs) ndarray
        Inputs, scaled to -1 ... 1.
    exponents : (terms, inputs) ndarray of int
        Exponent of each input in each term.

    Returns
    -------
    (rows, terms) ndarray
        Value of each term.
    """
    return np.prod(scaled[:, None] ** exponents[None], axis=2)
