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
"""Most paths that are left out in turn, spread evenly over the candidates."""


class Unseen(NamedTuple):
    """Readings (rows, taxels) that a fit has not seen, and its predictions, in the unit of the readings."""

    wanted: np.ndarray
    predicted: np.ndarray


class Polynomial(NamedTuple):
    """Readings (rows, taxels) in W as a polynomial of inputs (rows, inputs), within a box.

    Attributes
    ----------
    names, units : tuple[str, ...]
        Of the inputs.
    low, high : (inputs,) ndarray
        The box, in the units of the inputs.
    exponents : (terms, inputs) ndarray of int
        Of the inputs, scaled to -1 ... 1.
    weights : (terms, taxels) ndarray
        In W.
    rms, worst : float
        Error of readings unseen by the fit, relative to the taxel's full scale, the range of its readings: root mean
        square of the worst taxel, and largest of all.
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
        """Readings (rows, taxels) at inputs (rows, inputs), which are clipped to the box."""
        span = np.where(self.high > self.low, self.high - self.low, 1.0)
        scaled = 2 * (np.clip(inputs, self.low, self.high) - self.low) / span - 1
        return terms(scaled, self.exponents) @ self.weights


def single(study: xr.Dataset | xr.DataTree) -> xr.Dataset:
    """The study if it is one of a single scene; raises `InputError` otherwise."""
    if isinstance(study, xr.DataTree):
        raise InputError("the study holds several scenes: the folder of one of them is needed.")
    return study


def polynomial_of(study: xr.Dataset) -> Polynomial:
    """The polynomial of the degree that predicts left-out paths best.

    A path is one curve of the study, at one combination of the other parameters. Inner paths are left out, so that the
    rest spans the same box; for a study of one path, inner points.

    Parameters
    ----------
    study : xr.Dataset
        Of one scene, as returned by ``sweep`` or ``open_study``.

    Returns
    -------
    Polynomial
        Readings in W from the varied parameters, with its error on what was left out.

    Raises
    ------
    InputError
        if words are varied, or no number has three values.
    """
    names, inputs, readings, path = _rows(study)
    low, high = inputs.min(axis=0), inputs.max(axis=0)
    scaled = 2 * (inputs - low) / (high - low) - 1
    most = [min(len(np.unique(column)) - 1, MOST_DEGREE) for column in scaled.T]
    if max(most) < 2:
        raise InputError("a polynomial takes at least three values of what is varied: the study has two.")
    groups, tested = _left_out(scaled, path)
    scale = np.ptp(readings, axis=0)
    scale = np.where(scale > 0, scale, np.inf)
    found = []
    for degree in range(1, max(most) + 1):
        exponents = np.array([e for e in product(*(range(m + 1) for m in most)) if sum(e) <= degree])
        if len(exponents) > len(scaled) - max(map(np.count_nonzero, groups)):
            break
        found.append((exponents, _unseen(scaled, readings, exponents, groups)))
    missed = [(unseen.predicted - unseen.wanted) / scale for _, unseen in found]
    rms = [float(np.sqrt(np.square(each).mean(axis=0)).max()) for each in missed]
    best = int(np.argmin(rms))
    exponents, unseen = found[best]
    weights = np.linalg.lstsq(terms(scaled, exponents), readings, rcond=None)[0]
    units = tuple(study[name].attrs.get("units", "") for name in names)
    worst = float(np.abs(missed[best]).max())
    return Polynomial(names, units, low, high, exponents, weights, rms[best], worst, tested, unseen)


def _rows(study: xr.Dataset) -> tuple[tuple[str, ...], np.ndarray, np.ndarray, np.ndarray]:
    """Names and values (rows, inputs) of the varied numbers, readings (rows, taxels) and the path of each row."""
    curve = study.attrs["curve"]
    power = study.smooth_power if "smooth_power" in study else study.power
    stacked = power.stack(row=[dim for dim in power.dims if dim != "taxel"]).transpose("row", "taxel")
    columns = {}
    for name, coordinate in stacked.coords.items():
        if coordinate.dims != ("row",) or name in ("row", "step"):
            continue
        if coordinate.dtype.kind not in "fi":
            words = ", ".join(map(str, dict.fromkeys(coordinate.values.tolist())))
            raise InputError(f"{name} is varied in words ({words}): a study of one of them is needed.")
        if len(np.unique(coordinate.values)) > 1:
            columns[str(name)] = coordinate.values.astype(float)
    if not columns:
        raise InputError("nothing is varied but one value: a study of several values is needed.")
    known = np.isfinite(stacked.values).all(axis=1)
    others = [values for name, values in columns.items() if study[name].dims != (curve,)]
    path = np.unique(np.stack(others, axis=1), axis=0, return_inverse=True)[1].ravel() if others else 0 * known
    return tuple(columns), np.stack(list(columns.values()), axis=1)[known], stacked.values[known], path[known]


def _left_out(scaled: np.ndarray, path: np.ndarray) -> tuple[list[np.ndarray], str]:
    """Rows (rows,) of each test, and a description: paths without which the box is unchanged."""
    paths = [path == number for number in np.unique(path)]
    inside = [rows for rows in paths if not rows.all() and _spans(scaled[~rows])]
    words = "path"
    if not inside:
        each = np.eye(len(scaled), dtype=bool)
        inside = [rows for rows in each if _spans(scaled[~rows])]
        words = "point"
    chosen = np.unique(np.linspace(0, len(inside) - 1, min(len(inside), MOST_TESTS)).round().astype(int))
    words = f"{len(chosen)} {words}{'s' if len(chosen) > 1 else ''} left out one by one"
    return [inside[number] for number in chosen], words


def _spans(scaled: np.ndarray) -> bool:
    return bool(len(scaled) and (scaled.min(axis=0) == -1).all() and (scaled.max(axis=0) == 1).all())


def _unseen(scaled: np.ndarray, readings: np.ndarray, exponents: np.ndarray, groups: Sequence[np.ndarray]) -> Unseen:
    """Each group of rows, and what fits without it predict."""
    columns, predicted = terms(scaled, exponents), []
    for rows in groups:
        weights = np.linalg.lstsq(columns[~rows], readings[~rows], rcond=None)[0]
        predicted.append(columns[rows] @ weights)
    return Unseen(np.concatenate([readings[rows] for rows in groups]), np.concatenate(predicted))


def terms(scaled: np.ndarray, exponents: np.ndarray) -> np.ndarray:
    """(rows, terms) products of powers of inputs (rows, inputs) with exponents (terms, inputs)."""
    return np.prod(scaled[:, None] ** exponents[None], axis=2)
