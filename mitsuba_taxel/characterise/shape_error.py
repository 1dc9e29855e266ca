"""Errors of figures of merit by those of a pad's shape: the figures of readings changed by these errors.

The finite elements' error of a reading has a known size s(F), but its course along a load path is not known: the
difference of two meshes may have a course of its own, and passes through zero by chance. So the course is taken as
random: s(F) g(F), with a Gaussian process g of unit variance and correlation exp(-|F - F'|^2 / (2 L^2)), where L is the
largest load of the study. That kernel is a sum of products of

    phi_m(F) = exp(-|x|^2 / 2) x_1^m_1 x_2^m_2 x_3^m_3 / sqrt(m_1! m_2! m_3!),    x = (F - F_middle) / L

(C. E. Rasmussen, C. K. I. Williams, Gaussian Processes for Machine Learning, 2006, section 4.3.1), few of which matter.
The squares of the changes that each of them makes to a figure add. No change of one sign makes that sum small.

Facets of curved walls change all readings of a path, and so the slope, by nearly the same share.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from itertools import product

import numpy as np
import xarray as xr

from mitsuba_taxel.base.convergence import ERROR_SHARE
from mitsuba_taxel.base.units import FORCES
from mitsuba_taxel.characterise.roles import with_forces_named

DEGREE = 2
"""Largest sum of the exponents m: on a path from rest, what is left out has 0.2 % of the variance at its ends."""
VARIANTS = math.exp(-1 / 8)
"""Correlation of the errors of variants that differ in dimensions: that of two loads half of the largest load apart."""
SIGNS = (1.0, -1.0)

Mode = tuple[str, ...]
"""Kind of the error, and the forces whose product is the power of x."""
Changed = dict[Mode, list]
"""By mode: something computed from readings changed by it, and by its negative."""


def off_by_shape(study: xr.Dataset) -> dict[Mode, list[xr.Dataset]]:
    """The study with readings changed by each mode of the errors of the pads' shape, up and down."""
    size = _size(with_forces_named(study)) if {"deviation", "replicate_power"} <= set(study) else None
    return {mode: [_changed(study, mode, sign, size) for sign in SIGNS] for mode in _modes([study])}


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


def with_shape(error: np.ndarray, value: np.ndarray, off: Mapping[Mode, list[np.ndarray]]) -> np.ndarray:
    """Errors of the light combined with the changes of the values by each mode of the errors of the shape."""
    return np.sqrt(error**2 + sum(shape_shift(value, changed) ** 2 for changed in off.values()))


def _modes(scenes: list[xr.Dataset]) -> list[Mode]:
    """Those that change any reading."""
    forces = {name for scene in scenes for name in _varied(with_forces_named(scene))}
    powers = [
        tuple(name for name, power in zip(FORCES, each, strict=True) for _ in range(power))
        for each in product(*(range(DEGREE + 1 if name in forces else 1) for name in FORCES))
        if sum(each) <= DEGREE
    ]
    known = {name for name in ("deviation", "geometry_error") if any(name in scene for scene in scenes)}
    modes = [("deviation", *power) for power in powers] if "deviation" in known else []
    return [*modes, *([("geometry_error",)] if "geometry_error" in known else [])]


def _varied(study: xr.Dataset) -> list[str]:
    return [name for name in FORCES if name in study.coords and study[name].ndim]


def _changed(study: xr.Dataset, mode: Mode, sign: float, size: xr.DataArray | None = None) -> xr.Dataset:
    """The study with all readings changed by a mode of one kind of error; ``size`` is that of :func:`_size`."""
    kind, *powers = mode
    if kind not in study or "replicate_power" not in study:
        return study
    if kind == "geometry_error":
        return _faceted(study, sign)
    named = with_forces_named(study)
    size = _size(named) if size is None else size
    change = size * sign * _course(named, powers)
    changed = (named.replicate_power + change).transpose(*named.replicate_power.dims)
    return study.assign(replicate_power=changed.variable)


def _size(study: xr.Dataset) -> xr.DataArray:
    """Stated error of each reading by the mechanics, as in `Readings.mechanics_error`, with one sign along a path.

    The sign is that of most of the deviation. Readings of unknown error have none; the study's notes say so.
    """
    power = study.replicate_power.mean("replicate")
    deviation = study.deviation.fillna(0.0)
    share = np.sqrt(((deviation / power.where(power > 0)) ** 2).mean("taxel")).fillna(0.0)
    along = {dim for name in _varied(study) for dim in study[name].dims} & set(deviation.dims)
    sign = xr.where(deviation.sum(sorted(along, key=str)) < 0, -1.0, 1.0)
    return ERROR_SHARE * sign * xr.where(power > 0, power * share, np.abs(deviation))


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


def _faceted(study: xr.Dataset, sign: float) -> xr.Dataset:
    """The study with all readings along a curve changed by the same share, the mean of their ``geometry_error``."""
    power = study.replicate_power.mean("replicate")
    share = study.geometry_error / power.where(power > 0)
    alike = [dim for dim in (study.attrs["curve"], "taxel") if dim in share.dims]
    return study.assign(replicate_power=study.replicate_power * (1 + sign * share.mean(alike).fillna(0.0)))
