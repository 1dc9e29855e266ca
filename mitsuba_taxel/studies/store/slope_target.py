"""Comparison of the slopes of a study with their target error, in words."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import NamedTuple

import numpy as np
import xarray as xr

from mitsuba_taxel.base.units import FORCES, in_percent
from mitsuba_taxel.characterise.fitted_curve import fitted_slopes
from mitsuba_taxel.characterise.load_lines import loading_lines, runs
from mitsuba_taxel.characterise.roles import with_forces_named
from mitsuba_taxel.characterise.shape_error import changed_by_shape, shape_shift
from mitsuba_taxel.characterise.slopes import slopes
from mitsuba_taxel.sensing.reading.derivative_values import BY_CURVE
from mitsuba_taxel.sensing.reading.runs import MOST_POINTS

FIGURES = {"mean_slope": "mean slopes", "max_slope": "largest slopes"}
SOURCES = ("light", "curve between the loads", "finite elements and facets")


class CurveErrors(NamedTuple):
    """Mean or largest slope of each of T taxels along a fitted curve, and its errors by source.

    Attributes
    ----------
    force, figure : str
        Name of the force, and of the slope in `FIGURES`.
    value : (T,) ndarray
        Slopes in the unit of the readings per N.
    errors : (3, T) ndarray
        Errors by source, in the order of `SOURCES`.
    is_bent : (T,) ndarray of bool
        Whether the fitted curve is uncertain because its loads are too few, not because of noise.
    """

    force: str
    figure: str
    value: np.ndarray
    errors: np.ndarray
    is_bent: np.ndarray

    @property
    def relative(self) -> np.ndarray:
        """Errors (3, T) of the slopes by source, relative to the slope of the steepest taxel."""
        steepest = np.abs(self.value).max()
        return self.errors / (steepest if steepest > 0 else np.inf)


def missed_slopes(study: xr.Dataset, target: float, forces: Collection[str] = FORCES) -> list[str]:
    """Notes on slopes of readings whose relative error exceeds the target or is unknown.

    Parameters
    ----------
    study : xr.Dataset
        Results of one scene, in W.
    target : float
        Largest allowed error of a slope, relative to the slope of the steepest taxel. For smooth curves through
        readings it applies to the mean and the largest slope, otherwise to the derivative at each load.
    forces : Collection[str]
        Names of the parameters that are forces.

    Returns
    -------
    list[str]
        Notes; empty if all slopes reach the target.
    """
    if "derivative" not in study:
        return [f"target slope {target:g} not reached: the study has no derivatives with respect to its forces"]

    # Derivatives at each load.
    names = [name for name in study.parameter.values.tolist() if name in forces]
    rates = study[["derivative", "derivative_error", "derivative_method"]].sel(parameter=names)
    is_read = np.isfinite(study.power).all("taxel")
    is_curve = rates.derivative_method == BY_CURVE
    steepest = np.abs(rates.derivative).max("taxel")
    relative = rates.derivative_error.max("taxel", skipna=False) / steepest.where(steepest > 0, np.inf)
    relative = relative.where(np.isfinite(rates.derivative).all("taxel"))
    single = relative.values[(is_read & ~is_curve).transpose(*relative.dims).values]
    notes = []
    if not np.all(single <= target):
        worst = "unknown" if np.isnan(single).any() else f"{single.max():.2g}"
        notes.append(f"target slope {target:g} not reached: the worst error is {worst}")

    # Mean and largest slopes of curves; of each, the worst curve is described.
    worst_of: dict[str, CurveErrors] = {}
    for errors in curve_errors(study) if is_curve.any() else ():
        known = worst_of.get(errors.figure)
        if known is None or _worst(errors) > _worst(known):
            worst_of[errors.figure] = errors
    for figure, errors in worst_of.items():
        total = np.linalg.norm(errors.relative, axis=0)
        if np.all(total <= target):
            continue
        taxel = int(np.argmax(np.where(np.isnan(total), np.inf, total)))
        by_source = errors.relative[:, taxel]
        sources = ", ".join(f"{name} {in_percent(error)}" for name, error in zip(SOURCES, by_source, strict=True))
        notes.append(
            f"target slope {target:g} not reached by {np.sum(~(total <= target))} of {len(total)} {FIGURES[figure]} by "
            f"{errors.force}: the error of taxel {taxel + 1} is {in_percent(total[taxel])} of the steepest slope "
            f"({sources}); "
            f"{_advice(errors, taxel, study.attrs['points'])}"
        )
    return notes


def curve_errors(study: xr.Dataset) -> Iterator[CurveErrors]:
    """Mean and largest slopes of all fitted curves of a study, with their errors by source.

    Parameters
    ----------
    study : xr.Dataset
        Results of one scene, in W.

    Yields
    ------
    CurveErrors
        One for each curve and figure.
    """
    changed = changed_by_shape(study)
    study = with_forces_named(study)
    for line in loading_lines(study):
        others = {mode: [[run for _, run in runs(other, line)] for other in pair] for mode, pair in changed.items()}
        for number, (_, run) in enumerate(runs(study, line)):
            if not run.is_fitted:
                continue
            own = slopes(run)
            of_pairs = [[slopes(other[number]) for other in pair] for pair in others.values()]
            for figure in FIGURES:
                value = getattr(own, figure)
                shifts = [shape_shift(value, [getattr(other, figure) for other in pair]) for pair in of_pairs]
                shape = np.sqrt(sum((shift**2 for shift in shifts), np.zeros_like(value)))
                fit, is_bent = np.zeros_like(value), np.zeros(len(value), dtype=bool)
                if figure == "max_slope":
                    curve = fitted_slopes(run.force, run.samples, own.max_slope_at)
                    fit = np.diagonal(curve.fit_error)
                    is_bent = fit > np.diagonal(curve.interpolation_noise)
                light = np.sqrt(np.maximum(getattr(own, f"{figure}_error") ** 2 - fit**2, 0.0))
                yield CurveErrors(line.name, figure, value, np.array([light, fit, shape]), is_bent)


def _worst(errors: CurveErrors) -> float:
    total = np.linalg.norm(errors.relative, axis=0)
    return float(np.where(np.isnan(total), np.inf, total).max())


def _advice(errors: CurveErrors, taxel: int, points: int) -> str:
    """Advice on how to reduce the largest error of a taxel's slope."""
    light, fit, shape = np.nan_to_num(errors.errors[:, taxel], nan=np.inf)
    if shape > np.hypot(light, fit):
        return "the pad's mesh is fixed or at its limit"
    if fit > light and errors.is_bent[taxel]:
        return "the curve bends between its loads, as at a kink: give steps where it bends, start:stop:step"
    return "points are at their largest number" if points >= MOST_POINTS else "more points reduce the first two"
