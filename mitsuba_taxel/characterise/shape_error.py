"""Errors of figures of merit due to errors of the pad's shape: figures of readings that are changed by these errors.

Small displacements and their errors are linear in the load, so that a coarse mesh changes all readings of a path by
nearly the same fraction of their change from rest, which the deviation of a second mesh gives. At finite strains the
fraction changes along the path, by some percent of its size (docs/figures.md). The course of that change is unknown and
is therefore modelled as random. With the stated size s(F) of a reading's error, the error is

    s(F) (c z + sqrt(1 - c^2) g(F)),    c^2 = (1 - r^2) a^2,

where r is `COURSE`, or more at large strains, z a normal number common to the path, and g a Gaussian process of unit
variance with the correlation exp(-|F - F'|^2 / (2 L^2)), L being the largest load of the study. If the deviation
changes its sign along the path, two meshes do not give a common fraction: a is the magnitude of the sum of deviations
over the path, relative to the sum of their magnitudes. The kernel of g is a sum of products of

    phi_m(F) = exp(-|x|^2 / 2) x_1^m_1 x_2^m_2 x_3^m_3 / sqrt(m_1! m_2! m_3!),    x = (F - F_middle) / L

(C. E. Rasmussen, C. K. I. Williams, Gaussian Processes for Machine Learning, 2006, section 4.3.1), of which only a few
contribute. Each function is a mode of the error. The squares of the changes of a figure by all modes are added, so that
changes of opposite signs do not cancel.

Facets of curved walls also change all readings of a path by nearly the same fraction, with a random course of the same
size.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from itertools import product

import numpy as np
import xarray as xr

from mitsuba_taxel.base.convergence import ERROR_SHARE
from mitsuba_taxel.base.units import FORCES
from mitsuba_taxel.characterise.roles import with_forces_named
from mitsuba_taxel.sensing.reading.derivative_values import DETERMINISTIC

COURSE, BY_STRAIN = 0.1, 5.0
"""Standard deviation of the random course of an error along a path, relative to the size of the error: its least value,
and its value per strain of the silicone. The latter is proportional, as effects of second order change the fraction."""
DEGREE = 2
"""Largest sum of the exponents m: on a path from rest, the other functions have 0.2 % of the variance at its ends."""
VARIANTS = math.exp(-1 / 8)
"""Correlation of the errors of variants that differ in dimensions: that of two loads that differ by half of the largest
load."""
SIGNS = (1.0, -1.0)
KINDS = ("deviation", "geometry_error")
"""Errors that are common to a path; modes of their random course start with the word `RANDOM`."""
RANDOM = "course"

Mode = tuple[str, ...]
"""A kind of error, or `RANDOM` followed by the forces whose components of x are the factors of phi_m."""
Changed = dict[Mode, list]
"""Results by mode: one for readings changed by the mode, one for readings changed by its negative."""


def changed_by_shape(study: xr.Dataset) -> dict[Mode, list[xr.Dataset]]:
    """Copies of a study whose readings are changed by each independent component (mode) of the pads' shape errors.

    Derivatives with respect to forces change accordingly. The module text defines the modes. Each mode gives two
    studies: readings changed by one standard deviation up, and down. Forces have the names of `with_forces_named`.

    Parameters
    ----------
    study : xr.Dataset
        Results of one scene.

    Returns
    -------
    dict[Mode, list[xr.Dataset]]
        The two changed studies of each mode.
    """
    study = with_forces_named(study)
    modes = _modes([study])
    return _by_mode(modes, _changed(study, modes))


def scenes_changed_by_shape(study: xr.DataTree) -> dict[Mode, list[xr.DataTree]]:
    """The result of `changed_by_shape` for a study of several scenes. A mode (independent component of the shape error)
    leaves a scene unchanged if it does not exist there.
    """
    modes = _modes([leaf.to_dataset() for leaf in study.leaves])
    return _by_mode(modes, study.map_over_datasets(_changed, modes)) if modes else {}


def _by_mode(modes: list[Mode], changed: tuple) -> dict[Mode, list]:
    """Group studies by mode. ``changed`` lists the study changed up and the study changed down for each mode, in the
    order of ``modes``."""
    return {mode: list(pair) for mode, pair in zip(modes, zip(changed[::2], changed[1::2], strict=True), strict=True)}


def shape_shift(value: np.ndarray, changed: list[np.ndarray]) -> np.ndarray:
    """Change of a figure of merit by a mode (an independent component of the shape error): the larger of its changes up
    and down, with the sign of the change up.

    A figure that is the magnitude of a difference may change little on one side, where the difference changes its sign.

    Parameters
    ----------
    value : ndarray
        The figure.
    changed : list of ndarray
        The figure with readings changed up and down.

    Returns
    -------
    ndarray
        Changes, of the same shape.
    """
    up, down = (np.asarray(figure) - value for figure in changed)
    return np.where(np.abs(up) >= np.abs(down), up, -down)


def with_shape(
    error: np.ndarray,
    value: np.ndarray,
    changed_figures: Mapping[Mode, list[np.ndarray]],
    derived: np.ndarray | bool = False,
) -> np.ndarray:
    """Total error of a figure of merit: the error due to the light, combined with the errors due to the pads' shape.

    Parameters
    ----------
    error : ndarray
        Error of a figure due to the light, one standard deviation.
    value : ndarray
        Values of the figure, of the same shape.
    changed_figures : Mapping[Mode, list[ndarray]]
        The figure with readings changed by each mode, up and down.
    derived : ndarray of bool or bool
        Mask of the errors that are errors of derivatives, which already contain those of finite elements and patches.
        There the larger of the two estimates is used, because meshes may agree by chance in one of them.

    Returns
    -------
    ndarray
        Total errors, one standard deviation, of the same shape.
    """
    shape = np.sqrt(sum((shape_shift(value, pair) ** 2 for pair in changed_figures.values()), np.zeros_like(value)))
    return np.where(derived & ~(np.isnan(error) | np.isnan(shape)), np.maximum(error, shape), np.hypot(error, shape))


def besides_shape(error: np.ndarray, shifts: Iterable[np.ndarray]) -> np.ndarray:
    """Remove the errors of the pads' shape from the errors of derivatives: root of the difference of the squares, at
    least 0.
    """
    return np.sqrt(np.maximum(error**2 - sum(shift**2 for shift in shifts), 0.0))


def _modes(scenes: list[xr.Dataset]) -> list[Mode]:
    """All modes of the errors of several scenes. A mode is a pair: the kind of error, and the powers of the varied
    forces."""
    kinds = [(kind,) for kind in KINDS if any(kind in scene for scene in scenes)]
    forces = {name for scene in scenes for name in _varied(with_forces_named(scene))}
    powers = [
        tuple(name for name, power in zip(FORCES, exponents, strict=True) for _ in range(power))
        for exponents in product(*(range(DEGREE + 1 if name in forces else 1) for name in FORCES))
        if sum(exponents) <= DEGREE
    ]
    return [*kinds, *((RANDOM, *power) for power in powers if kinds)]


def _varied(study: xr.Dataset) -> list[str]:
    """Names of the components of force that vary in a study."""
    return [name for name in FORCES if name in study.coords and study[name].ndim]


def _changed(study: xr.Dataset, modes: list[Mode]) -> tuple[xr.Dataset, ...]:
    """Copies of a study whose readings are changed by each mode, up and down. Forces have the names ``fx``, ``fy`` and
    ``fz``.

    Quantities that all modes share are computed once: xarray takes a millisecond for each operation.
    """
    if "replicate_power" not in study or not any(kind in study for kind in KINDS):
        return (study,) * (len(SIGNS) * len(modes))
    study = with_forces_named(study)
    sizes, loads, along = _sizes(study), _relative_loads(study), _along_steps(study)
    square = sum(((1 - common**2) * size**2 for size, common in sizes.values()), xr.DataArray(0.0))
    random, changed = square**0.5, []
    for kind, *powers in modes:
        if kind == RANDOM:
            change = random * _course(loads, powers)
        elif kind in sizes:
            size, common = sizes[kind]
            change = size * common
        else:
            changed += [study] * len(SIGNS)
            continue
        changed += _with_change(study, change, along)
    return tuple(changed)


def _sizes(study: xr.Dataset) -> dict[str, tuple[xr.DataArray, xr.DataArray]]:
    """Size of the error of each reading, by kind of error, and the fraction of the error that is common to the load
    path. Errors have the same sign along a path.

    The error of the mechanics is that of `Readings.mechanics_error`, times the factor of :func:`_by_derivatives`; its
    sign is that of the sum of deviations. The error of the facets is a constant fraction of the power along a curve.
    Readings of unknown error have no error here, which the notes of the study mention.
    """
    # The course of errors is more random at large strains.
    power = study.replicate_power.mean("replicate")
    positive = power.where(power > 0)
    strain = float(study.largest_strain.max()) if "largest_strain" in study else 0.0
    course = float(np.fmin(np.fmax(COURSE, BY_STRAIN * strain), 1.0))
    common, sizes = math.sqrt(1 - course**2), {}

    # Mechanics: the deviation of a second mesh, as a fraction of the power common to the taxels.
    if "deviation" in study:
        deviation = study.deviation.fillna(0.0)
        relative = np.sqrt(((deviation / positive) ** 2).mean("taxel")).fillna(0.0)
        along = sorted({dim for name in _varied(study) for dim in study[name].dims} & set(deviation.dims), key=str)
        total, magnitude = deviation.sum(along), np.abs(deviation).sum(along)
        sign = xr.where(total < 0, -1.0, 1.0)
        size = ERROR_SHARE * sign * xr.where(power > 0, power * relative, np.abs(deviation))
        square = (magnitude**2).sum("taxel")
        size = size * _by_derivatives(study, size)
        agreement = np.sqrt((total**2).sum("taxel") / square.where(square > 0)).fillna(1.0)
        sizes["deviation"] = (size, common * agreement)

    # Facets of curved walls: the mean over the curve and the taxels.
    if "geometry_error" in study:
        relative = study.geometry_error / positive
        common_dims = [dim for dim in (study.attrs["curve"], "taxel") if dim in relative.dims]
        sizes["geometry_error"] = (power * relative.mean(common_dims).fillna(0.0), xr.DataArray(common))
    return sizes


def _by_derivatives(study: xr.Dataset, size: xr.DataArray) -> xr.DataArray:
    """Factor, at least 1, by which the errors of readings along a load path are enlarged, because the errors of the
    derivatives with respect to the forces show larger ones.

    The sum of the errors of derivatives along the path is another estimate of the same error. The larger estimate is
    used: in cells with thin roofs, two meshes may agree in the readings alone.
    """
    factor = xr.DataArray(1.0)
    if "derivative_error" not in study:
        return factor
    error = study.derivative_error.fillna(0.0)
    if "derivative_method" in study:  # errors of other methods are due to noise
        error = error.where(study.derivative_method == DETERMINISTIC, 0.0)
    for dim in {str(dim) for name in _varied(study) for dim in study[name].dims}:
        names = [name for name in _varied(study) if dim in study[name].dims and name in study.parameter.values]
        if study.sizes[dim] < 2 or not names:
            continue
        ends = (slice(None, -1), slice(1, None))
        # Errors of derivatives at the midpoints of steps, times the steps, over changes of the errors of readings.
        midpoint = sum((error.isel({dim: end}).drop_vars(dim, errors="ignore") for end in ends), xr.DataArray(0.0)) / 2
        lengths = {name: abs(_steps(study[name], dim)).isel({dim: ends[1]}) for name in names}
        changes = (length * midpoint.sel(parameter=name, drop=True) for name, length in lengths.items())
        by_slopes = sum(changes, xr.DataArray(0.0)).sum(dim)
        by_readings = abs(_steps(size, dim)).isel({dim: ends[1]}).sum(dim)
        ratio = (by_slopes / by_readings.where(by_readings > 0)).fillna(1.0)
        factor = xr.where(ratio > factor, ratio, factor)
    return factor


def _along_steps(study: xr.Dataset) -> dict[str, xr.DataArray]:
    """For each dimension: ratio of the change of a derivative with respect to a force to the change of the reading
    along a step.

    Along a path in which several forces change, the slope is that in the direction of the step.
    """
    if "derivative" not in study:
        return {}
    along = {}
    for dim in {str(dim) for name in _varied(study) for dim in study[name].dims}:
        names = [name for name in _varied(study) if dim in study[name].dims and name in study.parameter.values]
        if study.sizes[dim] < 2 or not names:
            continue
        steps = {name: _steps(study[name], dim) for name in names}
        square = sum((step**2 for step in steps.values()), xr.DataArray(0.0))
        parts = (step * (study.parameter == name) for name, step in steps.items())
        along[dim] = sum(parts, xr.DataArray(0.0)) / square.where(square > 0)
    return along


def _with_change(study: xr.Dataset, change: xr.DataArray, along: Mapping[str, xr.DataArray]) -> list[xr.Dataset]:
    """Copies of a study whose readings are changed by ``change`` up and down. Derivatives with respect to forces change
    accordingly; ``along`` is the result of :func:`_along_steps`."""
    changes = {"replicate_power": change}
    if "derivative" in study:
        slopes = ((_steps(change, dim) * relative).fillna(0.0) for dim, relative in along.items())
        changes |= {"smooth_power": change, "derivative": sum(slopes, xr.DataArray(0.0))}
    # Without coordinates, which are the same, arithmetic is several times as fast.
    readings = study.variables
    return [
        study.assign(
            {
                name: (readings[name] + sign * by.variable).transpose(*readings[name].dims)
                for name, by in changes.items()
            }
        )
        for sign in SIGNS
    ]


def _steps(values: xr.DataArray, dim: str) -> xr.DataArray:
    """Differences from the previous point along a dimension. The first point has no previous point; it gets the
    difference of the second point.
    """
    after = np.maximum(np.arange(values.sizes[dim]), 1)
    first, last = (values.isel({dim: points}).drop_vars(dim, errors="ignore") for points in (after - 1, after))
    return last - first


def _relative_loads(study: xr.Dataset) -> dict[str, xr.DataArray]:
    """Coordinates x of the loads of a study, by varied force; fixed forces contribute to the largest load L."""
    fixed = json.loads(study.attrs.get("parameters", "{}"))
    varied = _varied(study)
    load = {name: study[name] if name in varied else xr.DataArray(float(fixed.get(name, 0.0))) for name in FORCES}
    largest = float(np.sqrt(sum(force**2 for force in load.values())).max()) or 1.0
    return {name: (load[name] - (load[name].max() + load[name].min()) / 2) / largest for name in varied}


def _course(loads: Mapping[str, xr.DataArray], powers: list[str]) -> xr.DataArray:
    """Functions phi_m of the module text, by which an error varies over the loads, at the relative loads of
    :func:`_relative_loads`.
    """
    course = xr.DataArray(1.0 if set(powers) <= set(loads) else 0.0)
    for name, load in loads.items():
        power = powers.count(name)
        course = course * (np.exp(-(load**2) / 2) * load**power / math.sqrt(math.factorial(power)))
    return course
