"""The resolution of a sensor: how accurately its readings determine several unknowns at once (Fisher information)."""

from __future__ import annotations

import numpy as np
import xarray as xr

from mitsuba_taxel.base.arguments import is_number, refusal, require
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.electronics import Circuit, in_volts, total_noise
from mitsuba_taxel.electronics.volts import circuit_of_study


def resolution(study: xr.Dataset, noise: float | None = None, circuit: Circuit | None = None) -> xr.Dataset:
    """Resolution of a sensor: standard deviations with which its readings determine several parameters at once.

    At each point of the study, all taxels together determine all parameters with derivatives. Their covariance is the
    inverse of the Fisher information J^T N^-1 J, with the derivatives J and the covariance N of independent noise. No
    unbiased estimate has a smaller covariance (Cramer-Rao bound).

    Parameters
    ----------
    study : Dataset
        Results with derivatives, for example with respect to fx, fy, fz, patch_x and patch_y, at one or more positions
        of the contact.
    noise : float, optional
        Standard deviation of each reading in W, instead of the noise of a circuit.
    circuit : Circuit, optional
        Circuit that replaces the circuit of the study.

    Returns
    -------
    xr.Dataset
        ``resolution`` over the study's dimensions and ``parameter``: one standard deviation, in the parameter's
        ``unit``; infinite where the readings do not determine all parameters. ``resolution_error``: its standard error
        due to the errors of the derivatives, NaN where these are unknown. ``covariance`` over ``parameter`` and
        ``other``.

    Raises
    ------
    InputError
        if the study has no derivatives, or if neither a circuit nor a noise is given.
    """
    require("study", study, xr.Dataset, "the results of one scene")
    if "derivative" not in study:
        raise InputError(
            "a resolution needs a study with derivatives with respect to its unknowns, such as fx, fy, "
            "fz, patch_x and patch_y."
        )
    circuit = circuit or circuit_of_study(study)
    if noise is None and circuit is None:
        raise InputError("a resolution needs a circuit, or the noise of readings in W.")
    if noise is not None and not (is_number(noise) and noise > 0):
        raise refusal("noise", noise, "a number above 0 is needed")

    # Slopes and their errors over the standard deviation of the noise, (..., taxels, parameters).
    dims = [str(dim) for dim in study.smooth_power.dims if dim != "taxel"]
    if noise is None:
        assert circuit is not None
        power = np.maximum(study.smooth_power.transpose(*dims, "taxel").values, 0.0)
        deviation, readings = total_noise(circuit, power), in_volts(study, circuit)
    else:
        deviation, readings = np.full(study.smooth_power.transpose(*dims, "taxel").shape, noise), study
    slopes = readings.derivative.transpose(*dims, "taxel", "parameter").values / deviation[..., None]
    errors = np.full_like(slopes, np.nan)
    if "derivative_error" in readings:
        errors = readings.derivative_error.transpose(*dims, "taxel", "parameter").values / deviation[..., None]

    covariance = _inverse_information(slopes)
    unit = [str(unit).partition("/")[2] or "1" for unit in study.derivative_unit.values]
    names = study.parameter.values.tolist()
    spread = np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))
    return xr.Dataset(
        {
            "resolution": ([*dims, "parameter"], spread, {"long_name": "1 sigma if all are estimated"}),
            "resolution_error": ([*dims, "parameter"], _error(slopes, errors, covariance), {"long_name": "its error"}),
            "covariance": ([*dims, "parameter", "other"], covariance),
        },
        {
            **{name: coordinate for name, coordinate in study.coords.items() if set(coordinate.dims) <= set(dims)},
            "parameter": names,
            "other": names,
            "unit": ("parameter", unit),
        },
        {name: study.attrs[name] for name in ("forces", "roles") if name in study.attrs},
    )


def _error(slopes: np.ndarray, errors: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Standard errors (..., P) of the resolution of P parameters, due to the errors of the slopes (..., T, P) of T
    taxels.

    The correlation of the errors of derivatives is unknown. Finite elements change the derivatives with respect to one
    parameter at all taxels together, as a softer pad would, or at each taxel independently, as meshes are irregular.
    The effects of both kinds are added in squares, so that neither their signs nor their correlation makes the sum
    small. To first order, with A the slopes over the noise and C the covariance, the root of C_pp changes by -(C_pq (A
    C)_tp) / sqrt(C_pp) per change of A_tq.
    """
    finite = np.isfinite(covariance).all(axis=(-2, -1))
    finite_covariance = np.where(finite[..., None, None], covariance, 0.0)
    spread = np.sqrt(np.diagonal(finite_covariance, axis1=-2, axis2=-1))
    effect = np.einsum("...pq,...tp->...ptq", finite_covariance, slopes @ finite_covariance) * errors[..., None, :, :]
    together = (effect * np.sign(slopes)[..., None, :, :]).sum(axis=-2)
    squares = (together**2).sum(axis=-1) + (effect**2).sum(axis=(-2, -1))
    return np.where(finite[..., None], np.sqrt(squares) / np.where(spread > 0, spread, 1.0), np.nan)


def _inverse_information(slopes: np.ndarray) -> np.ndarray:
    """Covariance (..., P, P) from slopes (..., T, P) over the noise; NaN where slopes are unknown, infinite where they
    do not determine all parameters."""
    # Columns are scaled to unit length, so that the rank does not depend on the units of the parameters.
    scale = np.linalg.norm(slopes, axis=-2, keepdims=True)
    finite = np.isfinite(slopes).all(axis=(-2, -1))
    scale[~(scale > 0)] = 1.0
    scaled = np.where(finite[..., None, None], slopes / scale, 0.0)
    full_rank = np.linalg.matrix_rank(scaled) == slopes.shape[-1]
    information = np.swapaxes(scaled, -1, -2) @ scaled
    inverse = np.linalg.inv(np.where(full_rank[..., None, None], information, np.eye(slopes.shape[-1])))
    covariance = np.where(full_rank[..., None, None], inverse / (scale * np.swapaxes(scale, -1, -2)), np.inf)
    return np.where(finite[..., None, None], covariance, np.nan)
