"""Calibration: forces, depth or contact position as a polynomial of the readings, with prediction intervals. It is
cross-validated on whole load paths.

Intervals follow from errors on paths that were left out of a fit, with the same weight for each path
(:mod:`mitsuba_taxel.surrogates.path_intervals`). An error that all rows of a path share, such as the error of a stiffer
pad, counts once, however many rows or noisy copies the path has.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from importlib.util import find_spec
from itertools import product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import xarray as xr

from mitsuba_taxel.base.arguments import names_of, plain_number, refusal
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.characterise.recorded.measurement import Measurement
from mitsuba_taxel.electronics.response import lit, respond
from mitsuba_taxel.electronics.saturation import saturated_words
from mitsuba_taxel.electronics.volts import circuit_of_study
from mitsuba_taxel.surrogates.calibration_rows import OVER, Rows, measured_rows, simulated_rows
from mitsuba_taxel.surrogates.path_intervals import contained_by_path, interval_of_paths, paths_needed
from mitsuba_taxel.surrogates.polynomial import Polynomial, single

if TYPE_CHECKING:
    from sklearn.base import BaseEstimator
    from sklearn.pipeline import Pipeline

FOLDS = 5
"""Folds of the paths, left out in turn: for tests and, within the rest, for model selection."""
NOISE = 0.005
"""Relative noise of the light of a study without a circuit."""
DEGREES, STRENGTHS = (1, 2, 3), (1e-10, 1e-7, 1e-5, 1e-3)
"""Degrees of polynomials, and penalties on their weights, chosen by cross-validation."""
MOST_TERMS = 300


class Calibration(NamedTuple):
    """Result of :func:`calibrate`: a polynomial from readings to quantities, with prediction intervals.

    Quantities are components of the force, the depth of a displacement, or the position of the contact. A path is one
    series of loads of the study or the measurement; whole paths are left out in turn to test the intervals.

    Attributes
    ----------
    polynomial : Polynomial
        Polynomial from readings to the quantities, in their units.
    forces : tuple[str, ...]
        Names of the quantities: components of the force, or parameters of a depth or a place.
    half_width : (quantities,) ndarray
        Half width of the intervals, in the units of the quantities.
    coverage : float
        Nominal coverage: fraction of the quantities that the intervals should contain.
    covered : float
        Observed coverage: fraction of the quantities on left-out paths that lie within the intervals determined from
        the other paths, averaged over the paths.
    unit : str
        Unit of the readings, W or V.
    noise : float
        Relative standard deviation of the noise added to the light; NaN for a measurement, which has its own noise.
    tested : str
        Sentence on which paths were left out, and how.
    saturated : str
        A note on saturated readings of a study with a circuit; empty if there is none.
    units : tuple[str, ...]
        Units of the quantities, N or mm.
    paths : int
        Number of paths of loads.
    needed : int
        Least number of paths with which intervals are valid for any distribution of the errors. With fewer paths, they
        are valid for normally distributed errors.
    covered_error : float
        Standard error of `covered`, from the scatter of the paths.
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
    units: tuple[str, ...] = ()
    paths: int = 0
    needed: int = 0
    covered_error: float = math.nan


def calibrate(
    source: xr.Dataset | xr.DataTree | Measurement,
    *,
    coverage: float = 0.9,
    noise: float | None = None,
    seed: int = 0,
    over: str | Sequence[str] | None = None,
) -> Calibration:
    """Fit a polynomial that estimates force, depth or contact position from readings, with prediction intervals.

    Readings are in W, or in V if they are measured or simulated with a circuit. With a circuit, they have its noise and
    the steps of its converter. Rows without load are left out of a fit of the contact position, as unloaded readings
    do not depend on it.

    Parameters
    ----------
    source : xr.Dataset or xr.DataTree or Measurement
        A study with varied loads or contact positions, where each curve is a path; or a measurement along one line,
        where each run between turning points of the force is a path.
    coverage : float
        Fraction of the estimates on new, similar paths whose interval should contain the true value.
    noise : float, optional
        Relative standard deviation of the noise added to the light of a study; by default 0.005, or 0 with a circuit.
    seed : int
        Seed of this noise.
    over : str or sequence of str, optional
        Quantities to estimate: ``force``, ``depth``, ``place`` (the position of an indenter or a patch), or several of
        them. By default the force, or the depth if no force is varied or known, and the position if it is varied.

    Returns
    -------
    Calibration
        Polynomial, and half widths of its intervals.

    Raises
    ------
    InputError
        if scikit-learn is not installed, the study has several scenes, a requested quantity is not varied, there are
        fewer than three paths, or the output is saturated in all readings.
    """
    if find_spec("sklearn") is None:
        raise InputError("calibrations need scikit-learn: pip install scikit-learn onnx.")
    coverage = plain_number(coverage)
    if not (isinstance(coverage, float) and 0 < coverage < 1):
        raise refusal("coverage", coverage, "a number above 0 and below 1 is needed")
    if over is not None:
        over = (over,) if isinstance(over, str) else names_of("over", over)
        for kind in over:
            if kind not in OVER:
                raise refusal("over", kind, f"one or several of {', '.join(OVER)} are needed")
    # Rows of readings and quantities, with noise for those of a study.
    saturated = ""
    if isinstance(source, Measurement):
        noise, table = math.nan, measured_rows(source, over)
    else:
        source = single(source)
        if noise is None:
            noise = NOISE if circuit_of_study(source) is None else 0.0
        saturated = _saturated(source)
        table = simulated_rows(source, over, noise, np.random.default_rng(seed))
    rows = table.rows
    paths = len(np.unique(rows.path))
    if paths < 3:
        raise InputError("a calibration is tested on whole paths: at least three curves, or runs, are needed.")
    # Quantities are fitted relative to their range, so that all have the same weight. Errors are computed on left-out
    # paths.
    size = np.ptp(rows.quantities, axis=0)
    rows = rows._replace(quantities=rows.quantities / size)
    missed, fold = _cross_validate(rows)
    half_width = size * interval_of_paths(missed, rows.path, coverage)
    tested = f"{paths} paths, of which a part is left out in turn"
    model = _polynomial(_fit(rows), size, table.unit, missed, tested)
    contained = contained_by_path(missed, fold, rows.path, coverage)
    return Calibration(
        polynomial=model,
        forces=table.names,
        half_width=half_width,
        coverage=coverage,
        covered=float(contained.mean()),
        unit=table.unit,
        noise=noise,
        tested=tested,
        saturated=saturated,
        units=table.units,
        paths=paths,
        needed=paths_needed(coverage),
        covered_error=float(contained.std(ddof=1) / math.sqrt(paths)),
    )


def _cross_validate(rows: Rows) -> tuple[np.ndarray, np.ndarray]:
    """Errors (rows, quantities) of predictions of each row by a fit without the row's path, and the number (rows,) of
    the fold.

    Degree and penalty are selected again for each fold.
    """
    from sklearn.model_selection import GroupKFold

    missed, fold = np.empty_like(rows.quantities), np.empty(len(rows.path), dtype=int)
    splits = GroupKFold(min(FOLDS, len(np.unique(rows.path)))).split(rows.readings, groups=rows.path)
    for number, (inside, outside) in enumerate(splits):
        fitted = _fit(Rows(*(column[inside] for column in rows)))
        quantities = rows.quantities[outside]
        missed[outside] = fitted.predict(rows.readings[outside]).reshape(quantities.shape) - quantities
        fold[outside] = number
    return missed, fold


def _fit(rows: Rows) -> Pipeline:
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
            fitted = Ridge(count * strength).fit(train_terms, rows.quantities[inside])
            residual = fitted.predict(test_terms).reshape(-1, rows.quantities.shape[1]) - rows.quantities[outside]
            squared_errors[degree, strength] += np.square(residual).mean()
    # Fit all rows with the best of them.
    degree, strength = min(squared_errors, key=lambda choice: squared_errors[choice])
    return _terms(degree, Ridge(count * strength)).fit(rows.readings, rows.quantities)


def _terms(degree: int, *fit: BaseEstimator) -> Pipeline:
    """Create a pipeline of scikit-learn: it scales readings to -1 ... 1 and forms their products up to a degree. With
    ``fit``, the regression follows."""
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import MinMaxScaler, PolynomialFeatures

    return make_pipeline(MinMaxScaler((-1, 1), clip=True), PolynomialFeatures(degree, include_bias=False), *fit)


def _polynomial(fitted: Pipeline, size: np.ndarray, unit: str, missed: np.ndarray, tested: str) -> Polynomial:
    """Convert a fitted pipeline to a polynomial from readings to quantities. ``size`` is the range by which quantities
    are divided in the fit."""
    scaler, features, ridge = (step for _, step in fitted.steps)
    inputs = len(scaler.data_min_)
    labels = tuple(f"reading_{number}" for number in range(1, inputs + 1))
    exponents = np.concatenate([np.zeros((1, inputs), dtype=int), features.powers_])
    weights = np.concatenate([np.atleast_1d(ridge.intercept_)[None], np.atleast_2d(ridge.coef_).T]) * size
    rms, worst = float(np.sqrt(np.mean(missed**2, axis=0)).max()), float(np.abs(missed).max())
    low, high = scaler.data_min_, scaler.data_max_
    return Polynomial(
        names=labels,
        units=(unit,) * inputs,
        low=low,
        high=high,
        exponents=exponents,
        weights=weights,
        rms=rms,
        worst=worst,
        tested=tested,
    )


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
