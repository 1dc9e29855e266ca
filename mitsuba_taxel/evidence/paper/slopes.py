"""Slopes of readings against force, and smooth curves through them."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import xarray as xr

from mitsuba_taxel import characterise
from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.characterise.experiment import Branch
from mitsuba_taxel.characterise.load_lines import load_lines, runs


class Sensitivity(NamedTuple):
    """Slopes of the readings of one study along one force, in W/N, with their total errors (1 sigma).

    Attributes
    ----------
    max_slope : float
        Largest magnitude of the slope over all taxels and forces.
        at, taxel : float, int
            Force in N and number of the taxel with that slope.
    mean_slope : float
        Mean slope from the first force to the last, of the taxel for which it is largest in magnitude, with its sign.
    """

    max_slope: float
    max_slope_error: float
    at: float
    taxel: int
    mean_slope: float
    mean_slope_error: float


def sensitivity(study: xr.Dataset, force: str) -> Sensitivity:
    """The paper's sensitivity, the maximum slope of all curves, and the mean slope.

    Slopes are those of the cubic curves through readings without random numbers and their derivatives. If there are no
    derivatives, slopes are differences between successive forces.
    """
    slopes = characterise.sensitivity(study, force)
    steepest = slopes.isel(taxel=int(np.abs(slopes.max_slope.values).argmax()))
    mean = slopes.isel(taxel=int(np.abs(slopes.mean_slope.values).argmax()))
    return Sensitivity(
        abs(steepest.max_slope.item()),
        steepest.max_slope_error.item(),
        steepest.max_slope_at.item(),
        steepest.taxel.item(),
        mean.mean_slope.item(),
        mean.mean_slope_error.item(),
    )


def slope_share(study: xr.Dataset) -> float:
    """Largest error of a derivative with respect to a force, relative to that of the steepest taxel at the same
    force."""
    return float((study.derivative_error.max("taxel") / np.abs(study.derivative).max("taxel")).max())


class ForceCurves(NamedTuple):
    """Readings against a force in N, from the least to the largest.

    Attributes
    ----------
    power : Callable[[ndarray], ndarray]
        (F, taxels) in W at forces (F,).
    force : (N,) ndarray
        Forces with derivatives.
    slope_error : (N, taxels) ndarray
        One standard deviation of the curves' slopes there, in W/N.
    """

    power: Callable[[np.ndarray], np.ndarray]
    force: np.ndarray
    slope_error: np.ndarray


def curves(study: xr.Dataset, force: str) -> ForceCurves:
    """The cubic curves through readings without random numbers and their derivatives.

    Raises
    ------
    ComputationError
        if derivatives are missing, with the study's first note.
    """
    from scipy.interpolate import CubicHermiteSpline

    run = _branch(study, force)
    order = np.argsort(run.force)
    if run.tangents is None:
        why = next(iter(study.attrs["notes"].splitlines()), "none were computed.")
        raise ComputationError(
            f"a study along {force} lacks derivatives: {why} Remove the file of this study, and compute it again."
        )
    x, (value, slope, error) = run.force[order], run.tangents.part(order)
    return ForceCurves(CubicHermiteSpline(x, value, slope), x, error)


def _branch(study: xr.Dataset, force: str) -> Branch:
    (line,) = (line for line in load_lines(study) if line.dim == force)
    ((_, run),) = runs(study, line)
    return run


def change(study: xr.Dataset, force: str, shown: float, weights: np.ndarray) -> tuple[float, float]:
    """Change in W of a weighted sum of the taxels' readings, with ``weights`` (taxels,), from zero force to the force
    ``shown``, and its error.

    The error follows from those of the slopes in between, which are taken as fully correlated between taxels.
    """
    curve = curves(study, force)
    zero, final = curve.power(np.array([0.0, shown])) @ weights
    forces = np.unique(np.append(curve.force[(curve.force >= 0) & (curve.force <= shown)], [0.0, shown]))
    errors = [np.interp(forces, curve.force, column) for column in curve.slope_error.T]
    return float(final - zero), float(np.trapezoid(np.abs(weights) @ errors, forces))
