"""The resolution of a sensor: how well its readings tell several unknowns at once, by their Fisher information."""

from __future__ import annotations

import numpy as np
import xarray as xr

from mitsuba_taxel.base.arguments import is_number, refusal, require
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.electronics import Circuit, in_volts, total_noise
from mitsuba_taxel.electronics.volts import circuit_of_study


def resolution(study: xr.Dataset, noise: float | None = None, circuit: Circuit | None = None) -> xr.Dataset:
    """Smallest covariance of the parameters by which a study has derivatives, if all are estimated from all readings.

    It is the inverse of the Fisher information J^T N^-1 J of readings with slopes J and independent noise N: no
    unbiased estimate is better (Cramer and Rao).

    Parameters
    ----------
    study : Dataset
        With derivatives, such as by fx, fy, fz, patch_x and patch_y, at any number of places of the touch.
    noise : float, optional
        One standard deviation of each reading in W, instead of that of a circuit.
    circuit : Circuit, optional
        Instead of the study's own.

    Returns
    -------
    xr.Dataset
        ``resolution`` over the study's dimensions and ``parameter``, one standard deviation in the parameter's
        ``unit``; ``resolution_error``, the standard error of that by the derivatives' errors, see :func:`_error`, NaN
        where these are not known; ``covariance`` over ``parameter`` and ``other``. Infinite where readings do not tell
        all parameters.

    Raises
    ------
    InputError
        if the study has no derivatives, or neither it nor the caller states a noise.
    """
    require("study", study, xr.Dataset, "the results of one scene")
    if "derivative" not in study:
        raise InputError("a resolution needs a study with derivatives, such as by fx, fy, fz, patch_x and patch_y.")
    circuit = circuit or circuit_of_study(study)
    if noise is None and circuit is None:
        raise InputError("a resolution needs a circuit, or the noise of readings in W.")
    if noise is not None and not (is_number(noise) and noise > 0):
        raise refusal("noise", noise, "a number above 0 is needed")
    dims = [str(dim) for dim in study.smooth_power.dims if dim != "taxel"]
    if noise is None:
        assert circuit is not None
        power = np.maximum(study.smooth_power.transpose(*dims, "taxel").values, 0.0)
        deviation, shown = total_noise(circuit, power), in_volts(study, circuit)
    else:
        deviation, shown = np.full(study.smooth_power.transpose(*dims, "taxel").shape, noise), study
    slopes = shown.derivative.transpose(*dims, "taxel", "parameter").values / deviation[..., None]
    covariance = _inverse_information(slopes)
    errors = np.full_like(slopes, np.nan)
    if "derivative_error" in shown:
        errors = shown.derivative_error.transpose(*dims, "taxel", "parameter").values / deviation[..., None]
    unit = [str(each).partition("/")[2] or "1" for each in study.derivative_unit.values]
    names = study.parameter.values.tolist()
    spread = np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))
    return xr.Dataset(
        {
            "resolution": ([*dims, "parameter"], spread, {"long_name": "1 sigma if all are estimated"}),
            "resolution_error": ([*dims, "parameter"], _error(slopes, errors, covariance), {"long_name": "its error"}),
            "covariance": ([*dims, "parameter", "other"], covariance),
        },
        {
            **{name: each for name, each in study.coords.items() if set(each.dims) <= set(dims)},
            "parameter": names,
            "other": names,
            "unit": ("parameter", unit),
        },
        {name: study.attrs[name] for name in ("forces", "roles") if name in study.attrs},
    )


def _error(slopes: np.ndarray, errors: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """(..., P) standard errors of the roots of the covariance's diagonal, by those of slopes (..., T, P) over noise.

    How the errors of derivatives are correlated is not known. Finite elements change the derivatives by one parameter
    at all taxels together, as a softer pad would, or each taxel by itself, as meshes are irregular. Effects of both
    kinds add in squares, so that neither sign nor correlation makes the sum small. To first order, with A the slopes
    and C the covariance, the root of C_pp changes by -(C_pq (A C)_tp) / sqrt(C_pp) per change of A_tq.
    """
    told = np.isfinite(covariance).all(axis=(-2, -1))
    known = np.where(told[..., None, None], covariance, 0.0)
    spread = np.sqrt(np.diagonal(known, axis1=-2, axis2=-1))
    effect = np.einsum("...pq,...tp->...ptq", known, slopes @ known) * errors[..., None, :, :]
    together = (effect * np.sign(slopes)[..., None, :, :]).sum(axis=-2)
    squares = (together**2).sum(axis=-1) + (effect**2).sum(axis=(-2, -1))
    return np.where(told[..., None], np.sqrt(squares) / np.where(spread > 0, spread, 1.0), np.nan)


def _inverse_information(slopes: np.ndarray) -> np.ndarray:
    """(..., P, P) covariance by slopes (..., T, P) over the noise; NaN where they are unknown."""
    scale = np.linalg.norm(slopes, axis=-2, keepdims=True)
    known = np.isfinite(slopes).all(axis=(-2, -1))
    scale[~(scale > 0)] = 1.0
    scaled = np.where(known[..., None, None], slopes / scale, 0.0)
    told = np.linalg.matrix_rank(scaled) == slopes.shape[-1]
    information = np.swapaxes(scaled, -1, -2) @ scaled
    inverse = np.linalg.inv(np.where(told[..., None, None], information, np.eye(slopes.shape[-1])))
    found = np.where(told[..., None, None], inverse / (scale * np.swapaxes(scale, -1, -2)), np.inf)
    return np.where(known[..., None, None], found, np.nan)
