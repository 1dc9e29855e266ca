"""Errors of figures of merit by those of a pad's shape: the figures of readings changed by these errors.

Small displacements and their errors are linear in the load, so that a coarse mesh changes all readings of a path by
nearly the same share of their change from rest: that of the deviation of a second mesh. At finite strains the share
changes along the path: from the first load to the last by 8 % of its size, in the root mean square over sweeps of
strains up to 0.11 (docs/theory/errors.md). The course of that change is not known, so it is taken as random. With the
stated size s(F) of a reading's error, the error is

    s(F) (c z + sqrt(1 - c^2) g(F)),    c^2 = (1 - r^2) a^2,

where r is `COURSE`, or more at large strains, z a normal number of the whole path, and g a Gaussian process of unit
variance and of the correlation exp(-|F - F'|^2 / (2 L^2)), L being the largest load of the study. Where the deviation
changes its sign along the path, two meshes do not tell a common share: a is the magnitude of its sum over the path,
relative to the sum of magnitudes.
The kernel of g is a sum of products of

    phi_m(F) = exp(-|x|^2 / 2) x_1^m_1 x_2^m_2 x_3^m_3 / sqrt(m_1! m_2! m_3!),    x = (F - F_middle) / L

(C. E. Rasmussen, C. K. I. Williams, Gaussian Processes for Machine Learning, 2006, section 4.3.1), few of which matter.
The squares of the changes that each of them makes to a figure add. No change of one sign makes that sum small.

Facets of curved walls change all readings of a path by nearly the same share too, up to as random a course.
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

COURSE, BY_STRAIN = 0.1, 5.0
"""Standard deviation of the random course of an error along a path, relative to the size of the error: at least, and
per strain of the silicone, as what changes the share is of second order."""
DEGREE = 2
"""Largest sum of the exponents m: on a path from rest, what is left out has 0.2 % of the variance at its ends."""
VARIANTS = math.exp(-1 / 8)
"""Correlation of the errors of variants that differ in dimensions: that of two loads half of the largest load apart."""
SIGNS = (1.0, -1.0)
KINDS = ("deviation", "geometry_error")
"""Errors that are common to a path; the word `RANDOM` begins the modes of their random course."""
RANDOM = "course"

Mode = tuple[str, ...]
"""A kind of error, or `RANDOM` and the forces whose product is the power of x."""
Changed = dict[Mode, list]
"""By mode: something computed from readings changed by it, and by its negative."""


def off_by_shape(study: xr.Dataset) -> dict[Mode, list[xr.Dataset]]:
    """The study with readings, and their derivatives by forces, changed by each mode of the errors of the pads' shape.

    Each twice: up and down. Forces are called as by `with_forces_named`.

    Parameters
    ----------
    study : xr.Dataset
        Results of one scene.

    Returns
    -------
    dict[Mode, list[xr.Dataset]]
        By mode, the two changed studies.
    """
    study = with_forces_named(study)
    sizes = _sizes(study) if "replicate_power" in study else {}
    return {mode: [_changed(study, mode, sign, sizes) for sign in SIGNS] for mode in _modes([study])}


def scenes_off_by_shape(study: xr.DataTree) -> dict[Mode, list[xr.DataTree]]:
    """The same of a study of several scenes: all change by the same mode, as far as they have it."""
    modes = _modes([leaf.to_dataset() for leaf in study.leaves])
    return {mode: [study.map_over_datasets(_changed, mode, sign) for sign in SIGNS] for mode in modes}


def shape_shift(value: np.ndarray, changed: list[np.ndarray]) -> np.ndarray:
    """Change of a figure by one mode: the larger one of those up and down, with the sign of that up.

    A magnitude of a difference that is smaller than its error may fold onto itself on one of the two sides.
    """
    up, down = (np.asarray(each) - value for each in changed)
    return np.where(np.abs(up) >= np.abs(down), up, -down)


def with_shape(
    error: np.ndarray, value: np.ndarray, off: Mapping[Mode, list[np.ndarray]], derived: np.ndarray | bool = False
) -> np.ndarray:
    """Errors of the light combined with those of the pads' shape.

    Parameters
    ----------
    error : ndarray
        Of the values by the light, one standard deviation.
    value : ndarray
        Of a figure, of the same shape.
    off : Mapping[Mode, list[ndarray]]
        The figure with readings changed by each mode, up and down.
    derived : ndarray of bool or bool
        Where the error is that of derivatives, which holds finite elements and patches already: of two estimates of one
        error the larger counts. Meshes may agree by chance in one of the two.

    Returns
    -------
    ndarray
        One standard deviation.
    """
    shape = np.sqrt(sum((shape_shift(value, changed) ** 2 for changed in off.values()), np.zeros_like(value)))
    return np.where(derived & ~(np.isnan(error) | np.isnan(shape)), np.maximum(error, shape), np.hypot(error, shape))


def besides_shape(error: np.ndarray, shifts: Iterable[np.ndarray]) -> np.ndarray:
    """Errors of derivatives beyond the changes by modes of the shape; with these in squares they are as stated."""
    return np.sqrt(np.maximum(error**2 - sum(shift**2 for shift in shifts), 0.0))


def _modes(scenes: list[xr.Dataset]) -> list[Mode]:
    """Those that change any reading."""
    known = [(kind,) for kind in KINDS if any(kind in scene for scene in scenes)]
    forces = {name for scene in scenes for name in _varied(with_forces_named(scene))}
    powers = [
        tuple(name for name, power in zip(FORCES, each, strict=True) for _ in range(power))
        for each in product(*(range(DEGREE + 1 if name in forces else 1) for name in FORCES))
        if sum(each) <= DEGREE
    ]
    return [*known, *((RANDOM, *power) for power in powers if known)]


def _varied(study: xr.Dataset) -> list[str]:
    return [name for name in FORCES if name in study.coords and study[name].ndim]


def _changed(
    study: xr.Dataset, mode: Mode, sign: float, sizes: Mapping[str, tuple[xr.DataArray, xr.DataArray]] | None = None
) -> xr.Dataset:
    """The study with all readings changed by a mode, its forces by name; ``sizes`` is that of :func:`_sizes`."""
    if "replicate_power" not in study or not any(kind in study for kind in KINDS):
        return study
    study = with_forces_named(study)
    sizes = _sizes(study) if sizes is None else sizes
    kind, *powers = mode
    if kind == RANDOM:
        square = sum(((1 - common**2) * size**2 for size, common in sizes.values()), xr.DataArray(0.0))
        change = square**0.5 * _course(study, powers)
    elif kind in sizes:
        size, common = sizes[kind]
        change = size * common
    else:
        return study
    return _with_change(study, sign * change)


def _sizes(study: xr.Dataset) -> dict[str, tuple[xr.DataArray, xr.DataArray]]:
    """By kind of error: the stated error of each reading, with one sign along a path, and the part of its size that is
    common to the path.

    That by the mechanics is as in `Readings.mechanics_error`, or larger as in :func:`_by_derivatives`; its sign is that
    of most of the deviation. That of the facets is the same share of the power along a curve. Readings of unknown error
    have none; the study's notes say so.
    """
    power = study.replicate_power.mean("replicate")
    lit = power.where(power > 0)
    strain = float(study.largest_strain.max()) if "largest_strain" in study else 0.0
    course = float(np.fmin(np.fmax(COURSE, BY_STRAIN * strain), 1.0))
    common, sizes = math.sqrt(1 - course**2), {}
    if "deviation" in study:
        deviation = study.deviation.fillna(0.0)
        share = np.sqrt(((deviation / lit) ** 2).mean("taxel")).fillna(0.0)
        along = sorted({dim for name in _varied(study) for dim in study[name].dims} & set(deviation.dims), key=str)
        total, most = deviation.sum(along), np.abs(deviation).sum(along)
        sign = xr.where(total < 0, -1.0, 1.0)
        size = ERROR_SHARE * sign * xr.where(power > 0, power * share, np.abs(deviation))
        square = (most**2).sum("taxel")
        size = size * _by_derivatives(study, size)
        agreed = np.sqrt((total**2).sum("taxel") / square.where(square > 0)).fillna(1.0)
        sizes["deviation"] = (size, common * agreed)
    if "geometry_error" in study:
        share = study.geometry_error / lit
        alike = [dim for dim in (study.attrs["curve"], "taxel") if dim in share.dims]
        sizes["geometry_error"] = (power * share.mean(alike).fillna(0.0), xr.DataArray(common))
    return sizes


def _by_derivatives(study: xr.Dataset, size: xr.DataArray) -> xr.DataArray:
    """Factor of the sizes of the errors of readings along a path, 1 or more.

    Errors of derivatives by the forces, added up along the path, are another estimate of the same error: in cells of
    thin roofs, two meshes may agree in the readings alone. The larger one counts.
    """
    factor = xr.DataArray(1.0)
    if "derivative_error" not in study:
        return factor
    error = study.derivative_error.fillna(0.0)
    for dim in {str(dim) for name in _varied(study) for dim in study[name].dims}:
        names = [name for name in _varied(study) if dim in study[name].dims and name in study.parameter.values]
        if study.sizes[dim] < 2 or not names:
            continue
        ends = (slice(None, -1), slice(1, None))
        middle = sum((error.isel({dim: end}).drop_vars(dim, errors="ignore") for end in ends), xr.DataArray(0.0)) / 2
        lengths = {name: abs(_steps(study[name], dim)).isel({dim: ends[1]}) for name in names}
        parts = (length * middle.sel(parameter=name, drop=True) for name, length in lengths.items())
        by_slopes = sum(parts, xr.DataArray(0.0)).sum(dim)
        by_readings = abs(_steps(size, dim)).isel({dim: ends[1]}).sum(dim)
        ratio = (by_slopes / by_readings.where(by_readings > 0)).fillna(1.0)
        factor = xr.where(ratio > factor, ratio, factor)
    return factor


def _with_change(study: xr.Dataset, change: xr.DataArray) -> xr.Dataset:
    """The study with readings and their derivatives by forces changed; forces are called by name."""
    changed = {"replicate_power": study.replicate_power + change}
    if "derivative" in study:
        changed |= {"smooth_power": study.smooth_power + change, "derivative": study.derivative}
        for dim in {str(dim) for name in _varied(study) for dim in study[name].dims}:
            names = [name for name in _varied(study) if dim in study[name].dims and name in study.parameter.values]
            if study.sizes[dim] < 2 or not names:
                continue
            # Along a path in which several forces change, the slope is that in the direction of the step.
            steps = {name: _steps(study[name], dim) for name in names}
            square = sum((step**2 for step in steps.values()), xr.DataArray(0.0))
            slope = _steps(change, dim) / square.where(square > 0)
            for name, step in steps.items():
                which = study.parameter == name
                changed["derivative"] = changed["derivative"] + (slope * step).fillna(0.0) * which
    return study.assign({name: array.transpose(*study[name].dims).variable for name, array in changed.items()})


def _steps(values: xr.DataArray, dim: str) -> xr.DataArray:
    """Differences from the point before along a dimension; at the first point, as at the second."""
    after = np.maximum(np.arange(values.sizes[dim]), 1)
    first, last = (values.isel({dim: places}).drop_vars(dim, errors="ignore") for places in (after - 1, after))
    return last - first


def _course(study: xr.Dataset, powers: list[str]) -> xr.DataArray:
    """phi_m along the loads of a study; forces that are not varied count in the largest load."""
    fixed = json.loads(study.attrs.get("parameters", "{}"))
    varied = _varied(study)
    load = {name: study[name] if name in varied else xr.DataArray(float(fixed.get(name, 0.0))) for name in FORCES}
    largest = float(np.sqrt(sum(force**2 for force in load.values())).max()) or 1.0
    x = {name: (load[name] - (load[name].max() + load[name].min()) / 2) / largest for name in varied}
    course = xr.DataArray(1.0)
    for name, place in x.items():
        power = powers.count(name)
        course = course * np.exp(-(place**2) / 2) * place**power / math.sqrt(math.factorial(power))
    return course if set(powers) <= set(varied) else 0.0 * course
