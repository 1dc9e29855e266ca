"""Forces from readings: a polynomial with prediction intervals, cross-validated on whole paths.

Intervals are computed from errors on paths that a fit has not seen, with the same weight for every path. The half width
is the quantile of these errors at the required coverage (R. Barber et al., Predictive inference with the jackknife+,
Annals of Statistics 49, 2021), and at least that of a Student distribution with as many degrees of freedom as there are
paths. An error that is common to a path, such as that of a stiffer pad, counts once, however many rows the path has.
"""

from __future__ import annotations

import math
from importlib.util import find_spec
from itertools import product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import xarray as xr

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.units import FORCES
from mitsuba_taxel.characterise.recorded.measurement import Measurement
from mitsuba_taxel.characterise.recorded.recorded_runs import runs_of
from mitsuba_taxel.characterise.roles import with_forces_named
from mitsuba_taxel.electronics.response import lit, respond
from mitsuba_taxel.electronics.samples import sampled
from mitsuba_taxel.electronics.saturation import saturated_words
from mitsuba_taxel.electronics.volts import circuit_of_study
from mitsuba_taxel.surrogates.polynomial import Polynomial, single

if TYPE_CHECKING:
    from sklearn.base import BaseEstimator
    from sklearn.pipeline import Pipeline

FOLDS = 5
"""Folds of the paths, left out in turn: for tests and, within the rest, for model selection."""
NOISE = 0.005
"""Relative noise of the light of a study without a circuit."""
COPIES = 8
"""Noisy copies of each reading of a study."""
DEGREES, STRENGTHS = (1, 2, 3), (1e-10, 1e-7, 1e-5, 1e-3)
"""Degrees of polynomials, and penalties on their weights, chosen by cross-validation."""
MOST_TERMS = 300


class Calibration(NamedTuple):
    """Forces from readings, with intervals.

    Attributes
    ----------
    polynomial : Polynomial
        Polynomial from readings to forces in N.
    forces : tuple[str, ...]
        Names of the forces.
    half_width : (forces,) ndarray
        Half width of the intervals, N.
    coverage : float
        Fraction of the forces that the intervals should contain.
    covered : float
        Fraction of the forces on left-out paths that lie in intervals computed from the other paths.
    unit : str
        Unit of the readings, W or V.
    noise : float
        Relative standard deviation of the noise added to the light; NaN for a measurement, which has its own noise.
    tested : str
        A description of the test.
    saturated : str
        A note on saturated readings of a study with a circuit; empty if there is none.
    """

    polynomial: Polynomial
    forces: tuple[str, ...]
    half_width: np.ndarray
    coverage: float
    covered: float
    unit: str
    noise: float
    tested: str
    saturated: str = ""


class _Rows(NamedTuple):
    """Data of a fit: readings (rows, taxels) in W or V, forces (rows, forces) in N, and path numbers (rows,)."""

    readings: np.ndarray
    forces: np.ndarray
    path: np.ndarray


def calibrate(
    source: xr.Dataset | xr.DataTree | Measurement, *, coverage: float = 0.9, noise: float | None = None, seed: int = 0
) -> Calibration:
    """Forces as a polynomial of readings, with intervals.

    Readings are in W, or in V where they are measured, or simulated with a circuit: then they have its noise and the
    steps of its converter.

    Parameters
    ----------
    source : xr.Dataset or xr.DataTree or Measurement
        A study with varied forces, in which a path is one curve; or a measurement along one line, in which it is a run
        between turning points of the force.
    coverage : float
        Fraction of forces that the intervals should contain, on paths like those given.
    noise : float, optional
        Relative standard deviation of the noise added to the light of a study; by default 0.005, or 0 with a circuit.
    seed : int
        Seed of this noise.

    Returns
    -------
    Calibration
        Polynomial, and half widths of its intervals in N.

    Raises
    ------
    InputError
        if scikit-learn is not installed, the study has several scenes, no force is varied, there are fewer than three
        paths, or the output is saturated in all readings.
    """
    if find_spec("sklearn") is None:
        raise InputError("calibrations need scikit-learn: pip install scikit-learn onnx.")
    # Rows of readings and forces, with noise for those of a study.
    saturated = ""
    if isinstance(source, Measurement):
        noise, (names, unit, rows) = math.nan, _measured(source)
    else:
        source = single(source)
        if noise is None:
            noise = NOISE if circuit_of_study(source) is None else 0.0
        saturated = _saturated(source)
        names, unit, rows = _simulated(source, noise, np.random.default_rng(seed))
    paths = len(np.unique(rows.path))
    if paths < 3:
        raise InputError("a calibration is tested on whole paths: at least three curves, or runs, are needed.")
    # Forces are fitted relative to their range, so that all have the same weight. Errors are those on unseen paths.
    size = np.ptp(rows.forces, axis=0)
    rows = rows._replace(forces=rows.forces / size)
    missed, fold = _cross_validate(rows)
    half_width = size * interval_of_paths(missed, rows.path, coverage)
    tested = f"{paths} paths, of which a part is left out in turn"
    model = _polynomial(_fit(rows), size, unit, missed, tested)
    covered = _contained_fraction(missed, fold, rows.path, coverage)
    return Calibration(model, names, half_width, coverage, covered, unit, noise, tested, saturated)


def _cross_validate(rows: _Rows) -> tuple[np.ndarray, np.ndarray]:
    """Errors (rows, forces) of predictions by fits without the row's path, and fold number (rows,).

    Each fold selects its own degree and penalty.
    """
    from sklearn.model_selection import GroupKFold

    missed, fold = np.empty_like(rows.forces), np.empty(len(rows.path), dtype=int)
    splits = GroupKFold(min(FOLDS, len(np.unique(rows.path)))).split(rows.readings, groups=rows.path)
    for number, (inside, outside) in enumerate(splits):
        fitted = _fit(_Rows(*(column[inside] for column in rows)))
        forces = rows.forces[outside]
        missed[outside], fold[outside] = fitted.predict(rows.readings[outside]).reshape(forces.shape) - forces, number
    return missed, fold


def _fit(rows: _Rows) -> Pipeline:
    """Fit a polynomial, with the degree and the penalty that predict left-out paths best."""
    from sklearn.linear_model import Ridge
    from sklearn.model_selection import GroupKFold

    count, inputs = rows.readings.shape
    term_limit = min(MOST_TERMS, count // 4)
    degrees = [degree for degree in DEGREES if degree == 1 or math.comb(inputs + degree, degree) <= term_limit]
    # Cross-validate all degrees and penalties. The terms take longer than a fit, and are shared by all penalties.
    folds = list(GroupKFold(min(FOLDS, len(np.unique(rows.path)))).split(rows.readings, groups=rows.path))
    squared_errors = dict.fromkeys(product(degrees, STRENGTHS), 0.0)
    for degree, (inside, outside) in product(degrees, folds):
        terms = _terms(degree)
        train_terms, test_terms = terms.fit_transform(rows.readings[inside]), terms.transform(rows.readings[outside])
        for strength in STRENGTHS:
            fitted = Ridge(count * strength).fit(train_terms, rows.forces[inside])
            residual = fitted.predict(test_terms).reshape(-1, rows.forces.shape[1]) - rows.forces[outside]
            squared_errors[degree, strength] += np.square(residual).mean()
    # Fit all rows with the best of them.
    degree, strength = min(squared_errors, key=lambda choice: squared_errors[choice])
    return _terms(degree, Ridge(count * strength)).fit(rows.readings, rows.forces)


def _terms(degree: int, *fit: BaseEstimator) -> Pipeline:
    """A pipeline that scales readings to -1 ... 1, forms their products up to a degree, and fits if a fit is given."""
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import MinMaxScaler, PolynomialFeatures

    return make_pipeline(MinMaxScaler((-1, 1), clip=True), PolynomialFeatures(degree, include_bias=False), *fit)


def _polynomial(fitted: Pipeline, size: np.ndarray, unit: str, missed: np.ndarray, tested: str) -> Polynomial:
    """The polynomial from readings to forces in N. The fit is relative to ``size``, the range of the forces."""
    scaler, features, ridge = (step for _, step in fitted.steps)
    inputs = len(scaler.data_min_)
    labels = tuple(f"reading_{number}" for number in range(1, inputs + 1))
    exponents = np.concatenate([np.zeros((1, inputs), dtype=int), features.powers_])
    weights = np.concatenate([np.atleast_1d(ridge.intercept_)[None], np.atleast_2d(ridge.coef_).T]) * size
    rms, worst = float(np.sqrt(np.mean(missed**2, axis=0)).max()), float(np.abs(missed).max())
    low, high = scaler.data_min_, scaler.data_max_
    return Polynomial(labels, (unit,) * inputs, low, high, exponents, weights, rms, worst, tested)


def interval_of_paths(missed: np.ndarray, path: np.ndarray, coverage: float) -> np.ndarray:
    """Half width of a prediction interval for forces on a new path.

    If errors are normal and common to a path, the error on a new path over the root mean square of ``n`` paths has
    Student's distribution with ``n`` degrees of freedom. It is narrower if errors vary within a path.

    Parameters
    ----------
    missed : (rows, forces) ndarray
        Errors of predictions of paths that the fit has not seen.
    path : (rows,) ndarray
        Path of each row.
    coverage : float
        Fraction of the errors that the interval should contain.

    Returns
    -------
    (forces,) ndarray
        Half widths, in the unit of the errors.
    """
    from scipy.stats import t

    # Each path has the same weight, distributed over its rows.

    _, number, count = np.unique(path, return_inverse=True, return_counts=True)
    weight = 1 / (len(count) * count[number])
    # The larger of Student's interval and the weighted quantile of the absolute errors.
    by_scatter = t.isf((1 - coverage) / 2, len(count)) * np.sqrt(weight @ missed**2)
    order = np.argsort(np.abs(missed), axis=0)
    below = np.cumsum(weight[order], axis=0)
    rank = np.minimum((below < coverage).sum(axis=0), len(missed) - 1)
    quantile = np.take_along_axis(np.abs(missed), np.take_along_axis(order, rank[None], axis=0), axis=0)[0]
    return np.maximum(by_scatter, quantile)


def _contained_fraction(missed: np.ndarray, folds: np.ndarray, path: np.ndarray, coverage: float) -> float:
    """Fraction of the forces on each fold's paths that lie in intervals from the other folds."""
    inside = []
    for fold in np.unique(folds):
        outside = folds != fold
        width = interval_of_paths(missed[outside], path[outside], coverage)
        inside.append(np.abs(missed[~outside]) <= width)
    return float(np.concatenate(inside).mean())


def _measured(measurement: Measurement) -> tuple[tuple[str, ...], str, _Rows]:
    """Names of the forces, unit of the readings, and rows of a measurement, in which each run is a path."""
    name, _, force, runs = runs_of(measurement)
    path = np.concatenate([np.full(run.stop - run.start, number) for number, run in enumerate(runs)])
    readings = np.concatenate([measurement.voltage[run] for run in runs])
    return (name,), "V", _Rows(readings, np.concatenate([force[run] for run in runs])[:, None], path)


def _saturated(study: xr.Dataset) -> str:
    """A note on saturated readings of a study. Raises `InputError` if all are saturated: they contain no information on
    the force."""
    circuit = circuit_of_study(study)
    if circuit is None:
        return ""
    power = study.power.transpose(..., "taxel").values
    at_limit = respond(circuit, lit(power)).saturated[np.isfinite(power)]
    if at_limit.all():
        raise InputError(
            f"the output is saturated (at {circuit.limit:.4g} V or more) in all {at_limit.size} readings: a larger "
            "full scale, or less amplification, is needed."
        )
    return saturated_words(circuit, power)


def _simulated(study: xr.Dataset, noise: float, random: np.random.Generator) -> tuple[tuple[str, ...], str, _Rows]:
    """Names of the forces, unit of the readings, and rows of a study, in which each curve is a path.

    Readings get noise of the light, and that of the circuit if there is one.
    """
    # One row per load, without loads that have no reading.
    study = with_forces_named(study)
    dims = [dim for dim in study.power.dims if dim != "taxel"]
    stacked = study.power.stack(row=dims).transpose("row", "taxel")
    stacked = stacked[np.isfinite(stacked.values).all(axis=1)]
    names = tuple(name for name in FORCES if name in stacked.coords and np.ptp(stacked[name].values) > 0)
    if not names:
        raise InputError("no force is varied: a study of several values of fx, fy or fz is needed.")
    path_indices = [
        np.unique(stacked[dim].values, return_inverse=True)[1] for dim in dims if dim != study.attrs["curve"]
    ]
    # The path of a row is its combination of indices along all dimensions except the curve.
    indices = np.stack([np.zeros(stacked.sizes["row"], dtype=int), *path_indices], axis=1)
    path = np.unique(indices, axis=0, return_inverse=True)[1].ravel()
    forces = np.stack([stacked[name].values for name in names], axis=1)
    # Noisy copies of the readings, in W or in V.
    copies = np.tile(stacked.values, (COPIES, 1))
    copies = copies * (1 + noise * random.normal(size=copies.shape))
    unit, circuit = "W", circuit_of_study(study)
    if circuit is not None:
        unit, copies = "V", circuit.step * sampled(circuit, copies, random)[1]
    return names, unit, _Rows(copies, np.tile(forces, (COPIES, 1)), np.tile(path, COPIES))
