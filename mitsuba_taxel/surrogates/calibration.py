"""Forces from readings: a polynomial with intervals that cover, fitted and tested by whole paths.

Intervals are conformal (R. Barber et al., Predictive inference with the jackknife+, Annals of Statistics 49, 2021):
their half width is what the wanted share of forces, on paths that a fit has not seen, is missed by at most.
"""

from __future__ import annotations

import math
from itertools import combinations_with_replacement
from typing import NamedTuple

import numpy as np
import xarray as xr

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.units import FORCES
from mitsuba_taxel.characterise.measurement import Measurement
from mitsuba_taxel.characterise.recorded_runs import runs_of
from mitsuba_taxel.surrogates.polynomial import Polynomial, terms

FOLDS = 10
COPIES = 8
"""Noisy ones of each reading of a study."""
DEGREES, STRENGTHS = (1, 2, 3), (1e-10, 1e-7, 1e-5, 1e-3)
"""Of polynomials, and of the penalty on their weights, from which the paths that were left out choose."""
MOST_TERMS = 300


class Calibration(NamedTuple):
    """``polynomial`` : of readings, giving forces in N; ``forces`` : their names; ``half_width`` (forces,) in N, of the
    intervals that hold a share ``coverage`` of the forces; ``covered`` : the share of those on paths that were left
    out, when the others choose the width; ``unit`` of the readings; ``tested``, in words."""

    polynomial: Polynomial
    forces: tuple[str, ...]
    half_width: np.ndarray
    coverage: float
    covered: float
    unit: str
    tested: str


class _Rows(NamedTuple):
    readings: np.ndarray
    forces: np.ndarray
    path: np.ndarray


def calibrate(
    source: xr.Dataset | Measurement, *, coverage: float = 0.9, noise: float = 0.005, seed: int = 0
) -> Calibration:
    """Forces as a polynomial of readings, with intervals.

    Parameters
    ----------
    source : xr.Dataset or Measurement
        A study whose forces are varied, in which a path is one curve; or a measurement along one line, in which it is a
        run from one turning point of the force to the next.
    coverage : float
        Share of forces that the intervals should hold, on paths like those that there are.
    noise : float
        Relative standard deviation that is added to the readings of a study.
    seed : int
        Of this noise.

    Raises
    ------
    InputError
        if fewer than three paths, or no force, are varied.
    """
    if isinstance(source, Measurement):
        names, unit, rows = _measured(source)
    else:
        names, unit, rows = _simulated(source, noise, seed)
    folds = rows.path % FOLDS
    if len(np.unique(rows.path)) < 3:
        raise InputError("a calibration is tested on whole paths: at least three curves, or runs, are needed.")
    low, high = rows.readings.min(axis=0), rows.readings.max(axis=0)
    scaled = 2 * (rows.readings - low) / np.where(high > low, high - low, 1) - 1
    size = np.ptp(rows.forces, axis=0)
    found = []
    for degree in DEGREES:
        exponents = _exponents(scaled.shape[1], degree)
        if len(exponents) > min(MOST_TERMS, len(scaled) // 4):
            break
        columns = terms(scaled, exponents)
        for strength in STRENGTHS:
            missed = np.empty_like(rows.forces)
            for fold in np.unique(folds):
                out = folds == fold
                weights = _ridge(columns[~out], rows.forces[~out], strength)
                missed[out] = columns[out] @ weights - rows.forces[out]
            found.append((float(np.sqrt(np.mean((missed / size) ** 2))), exponents, strength, missed))
    _, exponents, strength, missed = min(found, key=lambda one: one[0])
    weights = _ridge(terms(scaled, exponents), rows.forces, strength)
    half_width = _quantile(np.abs(missed), coverage)
    rms = np.sqrt(np.mean((missed / size) ** 2, axis=0)).max()
    tested = f"{len(np.unique(rows.path))} paths, left out a part of them at a time"
    labels = tuple(f"reading_{number}" for number in range(1, scaled.shape[1] + 1))
    worst = float((np.abs(missed) / size).max())
    model = Polynomial(labels, (unit,) * len(labels), low, high, exponents, weights, float(rms), worst, tested)
    return Calibration(model, names, half_width, coverage, _covered(missed, folds, coverage), unit, tested)


def _quantile(sizes: np.ndarray, coverage: float) -> np.ndarray:
    """The least that a share of the sizes (rows, forces), and of one more, is at most."""
    rank = min(math.ceil((len(sizes) + 1) * coverage), len(sizes))
    return np.sort(sizes, axis=0)[rank - 1]


def _covered(missed: np.ndarray, folds: np.ndarray, coverage: float) -> float:
    """Share of the forces on each fold's paths that intervals by the other folds hold."""
    inside = [
        np.abs(missed[folds == fold]) <= _quantile(np.abs(missed[folds != fold]), coverage) for fold in np.unique(folds)
    ]
    return float(np.concatenate(inside).mean())


def _exponents(inputs: int, degree: int) -> np.ndarray:
    """(terms, inputs) of all products of up to so many inputs."""
    chosen = [each for d in range(degree + 1) for each in combinations_with_replacement(range(inputs), d)]
    return np.array([[each.count(number) for number in range(inputs)] for each in chosen])


def _ridge(columns: np.ndarray, wanted: np.ndarray, strength: float) -> np.ndarray:
    """Least squares with a penalty on all weights but the first, which is the constant's."""
    penalty = strength * len(columns) * np.eye(columns.shape[1])
    penalty[0, 0] = 0
    return np.linalg.lstsq(columns.T @ columns + penalty, columns.T @ wanted, rcond=None)[0]


def _measured(measurement: Measurement) -> tuple[tuple[str, ...], str, _Rows]:
    name, _, force, runs = runs_of(measurement)
    path = np.concatenate([np.full(run.stop - run.start, number) for number, run in enumerate(runs)])
    readings = np.concatenate([measurement.voltage[run] for run in runs])
    return (name,), "V", _Rows(readings, np.concatenate([force[run] for run in runs])[:, None], path)


def _simulated(study: xr.Dataset, noise: float, seed: int) -> tuple[tuple[str, ...], str, _Rows]:
    dims = [dim for dim in study.power.dims if dim != "taxel"]
    stacked = study.power.stack(row=dims).transpose("row", "taxel")
    stacked = stacked[np.isfinite(stacked.values).all(axis=1)]
    names = tuple(name for name in FORCES if name in stacked.coords and np.ptp(stacked[name].values) > 0)
    if not names:
        raise InputError("no force is varied: a study of several values of fx, fy or fz is needed.")
    others = [np.unique(stacked[dim].values, return_inverse=True)[1] for dim in dims if dim != study.attrs["curve"]]
    count = stacked.sizes["row"]
    path = np.unique(np.stack([np.zeros(count, dtype=int), *others], axis=1), axis=0, return_inverse=True)[1].ravel()
    forces = np.stack([stacked[name].values for name in names], axis=1)
    many = np.tile(stacked.values, (COPIES, 1))
    many = many * (1 + noise * np.random.default_rng(seed).normal(size=many.shape))
    return names, "W", _Rows(many, np.tile(forces, (COPIES, 1)), np.tile(path, COPIES))
