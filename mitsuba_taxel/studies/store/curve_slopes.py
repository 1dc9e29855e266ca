"""Slopes of readings by random paths along a force: those of the smooth curve through the readings of a study."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
import xarray as xr

from mitsuba_taxel.base.arguments import as_numbers
from mitsuba_taxel.base.replicates import standard_error
from mitsuba_taxel.characterise.fitted_curve import FEWEST, fitted_slopes
from mitsuba_taxel.characterise.shape_error import changed_by_shape, shape_shift
from mitsuba_taxel.sensing.reading.derivative_values import BY_CURVE
from mitsuba_taxel.studies.plan.vary import Axis

FILLED = ("smooth_power", "smooth_power_error", "derivative", "derivative_error", "derivative_method")
"""Results that curves through readings provide."""


def fitted_forces(axes: Sequence[Axis], derivatives: Collection[str], forces: Collection[str]) -> tuple[str, ...]:
    """Forces for which derivatives of readings with random paths are the slopes of a smooth curve through the readings.

    Parameters
    ----------
    axes : Sequence[Axis]
        Dimensions of the study.
    derivatives : Collection[str]
        Parameters with respect to which readings are differentiated.
    forces : Collection[str]
        Names of the parameters that are forces.

    Returns
    -------
    tuple[str, ...]
        Forces that are varied alone, over enough values.
    """
    named = [axis for axis in axes if axis.dim in derivatives and axis.dim in forces]
    return tuple(axis.dim for axis in named if axis.size >= FEWEST)


def with_curve_slopes(study: xr.Dataset, forces: Sequence[str]) -> xr.Dataset:
    """Add the derivatives that jobs left NaN: slopes of smooth curves through the readings of a study.

    Parameters
    ----------
    study : xr.Dataset
        Results of one scene, in W, with a column of derivatives for each of the forces.
    forces : Sequence[str]
        Result of :func:`fitted_forces`.

    Returns
    -------
    xr.Dataset
        The study with these derivatives, their errors and methods, and with the values of the curves, ``smooth_power``.
    """
    if "derivative" not in study or not forces:
        return study
    dims = [str(dim) for dim in study.power.dims]
    replicates = study.replicate_power.transpose(*dims[:-1], "replicate", "taxel").values
    changed = {mode: [other.replicate_power.values for other in pair] for mode, pair in changed_by_shape(study).items()}
    arrays = {name: study[name].values.copy() for name in FILLED}
    arrays["derivative_method"] = arrays["derivative_method"].astype(object)
    for force in forces:
        axis, column = dims.index(force), study.parameter.values.tolist().index(force)
        loads = np.array(as_numbers(study[force].values.tolist()))
        for index in np.ndindex(*(size for number, size in enumerate(replicates.shape[:-2]) if number != axis)):
            along = (*index[:axis], slice(None), *index[axis:])
            samples, slopes = replicates[along], arrays["derivative"][along][..., column]
            finite = np.isfinite(samples).all(axis=(1, 2))
            rows = finite & ~np.isfinite(slopes).all(axis=1)
            if finite.sum() < FEWEST or not rows.any():
                continue

            # The curve, and its changes by the errors of the pads' shape.
            fit = fitted_slopes(loads[finite], samples[finite], loads)
            of_slope, of_value = np.zeros((2, *fit.slope.shape))
            for pair in changed.values():
                fits = [fitted_slopes(loads[finite], other[along][finite], loads) for other in pair]
                of_slope += shape_shift(fit.slope, [other.slope for other in fits]) ** 2
                of_value += shape_shift(fit.values.mean(axis=1), [other.values.mean(axis=1) for other in fits]) ** 2
            value_error = np.hypot(standard_error(fit.values, axis=1), fit.value_fit_error)
            for name, values in (
                ("smooth_power", fit.values.mean(axis=1)),
                ("smooth_power_error", np.sqrt(value_error**2 + of_value)),
                ("derivative", fit.slope),
                ("derivative_error", np.sqrt(fit.error**2 + of_slope)),
            ):
                array = arrays[name][along][..., column] if name.startswith("derivative") else arrays[name][along]
                array[rows] = values[rows]  # a view
            arrays["derivative_method"][along][rows, column] = BY_CURVE
    arrays["derivative_method"] = arrays["derivative_method"].astype(str)
    return study.assign({name: study[name].copy(data=values) for name, values in arrays.items()})
