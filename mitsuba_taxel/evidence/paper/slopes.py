"""Slopes of readings over force, and smooth curves through readings."""

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
    """Sensitivities of one study along one force, in W/N, with their total errors (1 sigma).

    Attributes
    ----------
    max_slope : float
        Largest magnitude of the slope over all taxels and forces.
    at, taxel : float, int
        Force in N and number of the taxel with the largest slope.
    mean_slope : float
        Mean slope from the first force to the last, with its sign, of the taxel for which it is largest in magnitude.
    """

    max_slope: float
    max_slope_error: float
    at: float
    taxel: int
    mean_slope: float
    mean_slope_error: float


def sensitivity(study: xr.Dataset, force: str) -> Sensitivity:
    """Compute the sensitivity as the paper defines it (the maximum slope of all taxels), and the mean slope.

    If readings were computed without random numbers, slopes are those of the cubic curves through readings and their
    derivatives. If there are no derivatives, slopes are differences between successive forces.
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
    """Largest relative error of the derivatives with respect to a force: the error of each taxel's derivative, divided
    by the derivative of the steepest taxel at the same force."""
    return float((study.derivative_error.max("taxel") / np.abs(study.derivative).max("taxel")).max())


class ForceCurves(NamedTuple):
    """Curves of readings over a force in N, in increasing order.

    Attributes
    ----------
    power : Callable[[ndarray], ndarray]
        Returns the readings (F, taxels) in W at F forces (F,).
    force : (N,) ndarray
        The N forces at which derivatives were computed.
    slope_error : (N, taxels) ndarray
        One standard deviation of the curves' slopes at these forces, in W/N.
    """

    power: Callable[[np.ndarray], np.ndarray]
    force: np.ndarray
    slope_error: np.ndarray


def curves(study: xr.Dataset, force: str) -> ForceCurves:
    """Curves through readings along a force: cubic polynomials through readings without random numbers and their
    derivatives.

    Raises
    ------
    ComputationError
        if derivatives are missing; the message contains the study's first note.
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
    """Change in W of a weighted sum of the taxels' readings from zero force to the force ``shown``, and its error;
    ``weights`` has the shape (taxels,).

    The error follows from the errors of the slopes in between, which are assumed to be fully correlated between taxels.
    """
    curve = curves(study, force)
    zero, final = curve.power(np.array([0.0, shown])) @ weights
    forces = np.unique(np.append(curve.force[(curve.force >= 0) & (curve.force <= shown)], [0.0, shown]))
    errors = [np.interp(forces, curve.force, column) for column in curve.slope_error.T]
    return float(final - zero), float(np.trapezoid(np.abs(weights) @ errors, forces))
