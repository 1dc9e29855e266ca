"""A study as a labelled array: readings with units, errors, cost and provenance."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from mitsuba_taxel.base.arguments import as_numbers
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.units import FORCES, HISTORY
from mitsuba_taxel.sensing import Readings
from mitsuba_taxel.sensing.reading.derivative_values import Derivatives
from mitsuba_taxel.sensing.reading.readings import (
    describe_mechanics,
    error_budget,
    geometry_share,
    mechanics_share,
    shares,
)
from mitsuba_taxel.sensing.reading.results import RESULTS
from mitsuba_taxel.studies.plan.job import MAPS, MESHES, Failure, describe
from mitsuba_taxel.studies.plan.vary import STEP, Axis, combinations, curve_dimension
from mitsuba_taxel.studies.store.folder import Kept

Place = tuple[int, ...]

NOT_COMPUTED = "errors of the pads' shape were not computed: the stated error is that of the light alone"
"""Note of a study whose scenes were read without them."""


def assemble(
    axes: Sequence[Axis], results: Mapping[Place, Kept], failures: Mapping[Place, Failure], about: Mapping[str, Any]
) -> xr.Dataset:
    """Dataset over the axes' dimensions, ``taxel``, ``replicate`` and ``stage``.

    Parameters
    ----------
    results, failures : Mapping[Place, Kept] and Mapping[Place, Failure]
        By place along the axes; readings without a result are NaN.
    about : Mapping[str, Any]
        ``scene``, ``seed``, ``target_error``, ``target_slope``, ``points``, ``mesh_size``, ``parameters``, ``units``,
        ``versions``, ``pilot_seconds``.

    Raises
    ------
    InputError
        if results differ in the number of taxels.
    """
    counts = sorted({result.readings.replicates.shape[1] for result in results.values()})
    if len(counts) > 1:
        raise InputError(
            f"the study holds scenes of {' and '.join(map(str, counts))} taxels: the same number in each is needed."
        )
    shape, dims, curve = tuple(axis.size for axis in axes), [axis.dim for axis in axes], curve_dimension(axes)
    abscissa = _abscissa(axes[dims.index(curve)])
    first = next(iter(results.values())).readings
    stages = sorted({stage for result in results.values() for stage in result.seconds})
    replicates = np.full(shape + first.replicates.shape, math.nan)
    error = np.full(shape + first.power.shape, math.nan)
    seconds = np.zeros((*shape, len(stages)))
    for place, result in results.items():
        replicates[place], error[place] = result.readings.replicates, result.readings.standard_error
        seconds[place] = [result.seconds.get(stage, 0.0) for stage in stages]
    power = replicates.mean(axis=-2)
    deviation = _deviation(results, power, dims.index(curve), abscissa)
    mechanics = power * _shares(deviation, power, mechanics_share)
    facets = _facets(results, power, dims.index(curve), abscissa)
    geometry = power * _shares(facets, power, geometry_share)
    total = np.hypot(np.hypot(error, mechanics), geometry)
    along = {"power": power, "standard_error": error, "total_error": total}
    if any(result.readings.roof_errors for result in results.values()):
        along |= {"mechanics_error": mechanics, "deviation": deviation}
    if np.nan_to_num(geometry).any():
        along["geometry_error"] = geometry
    variables = _variables([*dims], shape, results, along, curve, abscissa)
    notes = _notes(results)
    if missing := math.prod(shape) - len(results) - len(failures):
        notes.insert(0, f"{missing} of {math.prod(shape)} scenes have no reading yet: the same command computes them")
    if about["target_error"] is not None and (missed := missed_target(about["target_error"], power, total)):
        notes.insert(0, missed)
    if about["target_slope"] is not None and (
        missed := missed_slope(about["target_slope"], variables, results, about.get("forces", FORCES))
    ):
        notes.insert(0, missed)
    return xr.Dataset(
        {
            **variables,
            "replicate_power": ([*dims, "replicate", "taxel"], replicates, {"units": "W"}),
            **_responsivity(first),
            "seconds": ([*dims, "stage"], seconds, {"units": "s"}),
            **_files("mesh", MESHES, "file of the deformed pad, lengths in mm", dims, shape, results),
            **_files("map", MAPS, "file of the irradiance in W/mm2, a block of pixels per taxel", dims, shape, results),
        },
        coords={
            **_coordinates(axes, about.get("units", {}), about.get("roles", {})),
            "taxel": ("taxel", first.taxel, {"long_name": "taxel, row by row from (-x, +y)"}),
            "stage": ("stage", stages),
            **_parameters(results),
        },
        attrs={
            **_provenance(about),
            "curve": curve,
            "notes": "\n".join(notes),
            "failures": "\n".join(_failures(axes, failures, about.get("roles", {}))),
        },
    )


def _provenance(about: Mapping[str, Any]) -> dict[str, Any]:
    """Attributes of a dataset that say what it is of, and how it was computed."""
    return {
        **{name: about[name] for name in ("scene", "seed", "points")},
        **{name: about[name] for name in ("target_error", "target_slope", "mesh_size") if about[name] is not None},
        **{name: json.dumps(about[name]) for name in ("parameters", "versions", "pilot_seconds")},
        "units": json.dumps(about.get("units", {})),
        **{name: json.dumps(about[name]) for name in ("forces", "roles") if name in about},
    }


def _files(
    name: str, folder: str, about: str, dims: list[str], shape: tuple[int, ...], results: Mapping[Place, Kept]
) -> dict[str, tuple]:
    """The variable ``name``: the files of each result in a folder; empty if there are none."""
    names = np.full(shape, "", dtype=object)
    for place, result in results.items():
        names[place] = " ".join(file for file in result.files if file.startswith(f"{folder}/"))
    return {name: (dims, names.astype(str), {"long_name": about})} if names.any() else {}


def _coordinates(
    axes: Sequence[Axis], units: Mapping[str, str], roles: Mapping[str, Sequence[Any]]
) -> dict[str, tuple]:
    """Values along each dimension; parameters taken together are coordinates of ``step``."""
    coordinates: dict[str, tuple] = {}
    for axis in axes:
        for name, words in axis.values.items():
            if roles.get(name, (name,))[0] == HISTORY:  # repeats the earlier steps
                continue
            numbers = as_numbers(words)
            unit = {"units": units[name]} if numbers and name in units else {}
            coordinates[name] = (axis.dim, numbers or words, unit)
        if axis.dim == STEP:
            coordinates[STEP] = (STEP, np.arange(1, axis.size + 1))
    return coordinates


def _notes(results: Mapping[Place, Kept]) -> list[str]:
    """Distinct notes of all readings; of those on mechanics, the worst."""
    remarks = [remark for result in results.values() for remark in result.readings.remarks]
    errors = [error for result in results.values() for error in result.readings.roof_errors]
    points = [result.readings.points for result in results.values()]
    few = sum(each < max(points) for each in points)
    if few and min(points):  # without random numbers, a scene that needs paths gets its own number
        remarks.append(f"{few} of {len(results)} scenes have fewer points: the same command computes the rest")
    asked = not errors or any(result.readings.deviation is not None for result in results.values())
    return [*dict.fromkeys(remarks), *(describe_mechanics(errors) if asked else [NOT_COMPUTED])]


def _failures(axes: Sequence[Axis], failures: Mapping[Place, Failure], roles: Mapping[str, Sequence[Any]]) -> list[str]:
    values = dict(combinations(axes))
    return [f"{describe(values[place], roles)}: {failure.message}" for place, failure in failures.items()]


def _responsivity(readings: Readings) -> dict[str, tuple]:
    if readings.responsivity is None:
        return {}
    about = {"units": "A/W", "long_name": "photocurrent per optical power"}
    return {"responsivity": ("taxel", readings.responsivity, about)}


def _abscissa(axis: Axis) -> np.ndarray:
    """(size,) place along a dimension, by which results between two scenes are interpolated: the length of the way
    through the space of its numeric parameters, each over its range; the number of the scene if none changes.

    Errors of the mechanics grow with the load, and loads need not be evenly spaced.
    """
    numbers = [np.array(values) for values in map(as_numbers, axis.values.values()) if values]
    ranges = [(values, np.ptp(values)) for values in numbers]
    scaled = [values / width for values, width in ranges if width > 0]
    if not scaled:
        return np.arange(axis.size, dtype=float)
    steps = np.linalg.norm(np.diff(scaled, axis=1), axis=0)
    # Scenes of equal parameters are told apart, as interpolation needs places that grow.
    return np.concatenate([[0.0], np.cumsum(np.maximum(steps, 1e-9))])


def _deviation(results: Mapping[Place, Kept], power: np.ndarray, curve: int, abscissa: np.ndarray) -> np.ndarray:
    """(..., T) W, effect of the mechanics' error on each reading."""

    def found(readings: Readings) -> np.ndarray | None:
        unloaded = readings.deviation is None and not readings.roof_errors
        return np.zeros(len(readings.taxel)) if unloaded else readings.deviation

    return _along_curves({place: found(result.readings) for place, result in results.items()}, power, curve, abscissa)


def _facets(results: Mapping[Place, Kept], power: np.ndarray, curve: int, abscissa: np.ndarray) -> np.ndarray:
    """(..., T) W, effect of the facets of curved walls on each reading, from that of chords."""
    known = {place: result.readings.facets for place, result in results.items()}
    facets = _along_curves(known, power, curve, abscissa)
    return np.where(np.isfinite(power), np.nan_to_num(facets), math.nan)


def _along_curves(
    changes: Mapping[Place, np.ndarray | None], power: np.ndarray, curve: int, abscissa: np.ndarray
) -> np.ndarray:
    """(..., T) W, changes of readings; along the curve, between scenes where they are known, the share of the power is
    interpolated linearly."""
    share = np.full(power.shape, math.nan)
    open_places = np.zeros(power.shape[:-1], dtype=bool)
    for place, change in changes.items():
        if change is None:
            open_places[place] = True
        else:
            share[place] = np.divide(change, power[place], out=np.zeros_like(change), where=power[place] > 0)
    for line, is_open in zip(_lines_along(share, curve), _lines_along(open_places[..., None], curve), strict=True):
        known, wanted = np.isfinite(line).all(axis=1), is_open[:, 0]
        if known.any() and wanted.any():
            columns = [np.interp(abscissa[wanted], abscissa[known], column[known]) for column in line.T]
            line[wanted] = np.column_stack(columns)
    return share * power


def _lines_along(array: np.ndarray, axis: int) -> Iterator[np.ndarray]:
    """Views (n, last) of an array along one of its axes and the last one."""
    lines = np.moveaxis(array, axis, -2)
    for index in np.ndindex(lines.shape[:-2]):
        yield lines[index]


def _shares(change: np.ndarray, power: np.ndarray, share: Callable[[np.ndarray, np.ndarray], float]) -> np.ndarray:
    """(..., 1) relative error of each scene, from the changes of its readings."""
    shares = [share(change[place], power[place]) for place in np.ndindex(power.shape[:-1])]
    return np.reshape(shares, (*power.shape[:-1], 1))


def _variables(
    dims: list[str],
    shape: tuple[int, ...],
    results: Mapping[Place, Kept],
    along: Mapping[str, np.ndarray],
    curve: str,
    abscissa: np.ndarray,
) -> dict[str, xr.DataArray]:
    """The listed results of all readings; those ``along`` the curves are given, and others are absent without a
    value."""
    variables = {}
    for result in RESULTS:
        if result.name in _ALONG:
            values = along.get(result.name)
        else:
            values = _collected({place: result.of(kept.readings) for place, kept in results.items()}, shape)
        if values is None:
            continue
        about = {"long_name": result.meaning} | ({"units": result.unit} if result.unit else {})
        array = xr.DataArray(values, dims=[*dims, *result.per], attrs=about)
        if result.along_curve:
            array = array.assign_coords({_ALONG_CURVE: (curve, abscissa)})
            array = array.interpolate_na(curve, use_coordinate=_ALONG_CURVE).drop_vars(_ALONG_CURVE)
        variables[result.name] = array
    return variables


_ALONG_CURVE = "along_curve"
"""Name of the coordinate by which results are interpolated; it is not kept."""
_ALONG = ("power", "standard_error", "mechanics_error", "geometry_error", "total_error", "deviation")
"""Results whose errors are the same share of all readings of a scene, known at some scenes of a curve only."""


def _collected(values: Mapping[Place, Any], shape: tuple[int, ...]) -> np.ndarray | None:
    """Values of all places in one array, NaN or empty text where there is none; None if nowhere."""
    known = {place: np.asarray(value) for place, value in values.items() if value is not None}
    if not known:
        return None
    own = np.max([value.shape for value in known.values()], axis=0).astype(int)  # a contact may lack its derivatives
    is_text = any(value.dtype.kind == "U" for value in known.values())
    array = np.full((*shape, *own), "", dtype=object) if is_text else np.full((*shape, *own), math.nan)
    for place, value in known.items():
        if value.shape == tuple(own):
            array[place] = value
    return array.astype(str) if is_text else array


def _parameters(results: Mapping[Place, Kept]) -> dict[str, tuple]:
    """Parameters of the derivatives, and units."""
    for each in _derivatives(results).values():
        return {"parameter": ("parameter", list(each.parameters)), "derivative_unit": ("parameter", list(each.units))}
    return {}


def _derivatives(results: Mapping[Place, Kept]) -> dict[Place, Derivatives]:
    found = ((place, result.readings.derivatives) for place, result in results.items())
    return {place: each for place, each in found if each is not None}


def missed_target(target_error: float, power: np.ndarray, total: np.ndarray) -> str:
    """Note on readings (..., T) in W whose total error exceeds the target or is unknown; empty if there are none."""
    read = np.isfinite(power)
    relative = shares(total[read], power[read])
    beyond = ~(relative <= target_error)
    if not beyond.any():
        return ""
    worst = f"{relative.max():.2g}" if np.isfinite(relative).all() else "unknown"
    return f"target error {target_error:g} not reached: {beyond.sum()} of {beyond.size} readings, the worst {worst}"


def missed_slope(
    target: float, rates: Mapping[str, Any], results: Mapping[Place, Kept], forces: Collection[str] = FORCES
) -> str:
    """Note on slopes whose error, relative to the steepest, exceeds the target or is unknown; empty if there are
    none."""
    names = next((each.parameters for each in _derivatives(results).values()), ())
    if not names:
        return f"target slope {target:g} not reached: there are no derivatives"
    by_force = [number for number, name in enumerate(names) if name in forces]
    relative = []
    for place in results:
        values, errors = (rates[name].values[place][:, by_force] for name in ("derivative", "derivative_error"))
        steepest = np.abs(values).max(axis=0)
        relative.append(errors.max(axis=0) / np.where(steepest > 0, steepest, np.inf))
    worst = "unknown" if np.isnan(relative).any() else f"{np.max(relative):.2g}"
    reached = np.all(np.array(relative) <= target)
    return "" if reached else f"target slope {target:g} not reached: the worst error is {worst}"


def study_error_budget(study: xr.Dataset) -> dict[str, float]:
    """The error budget of `Readings`, for the worst reading of a study; those that failed are left out.

    Parameters
    ----------
    study : xr.Dataset
        Of one scene.

    Returns
    -------
    dict[str, float]
        Relative errors by source.
    """
    read = np.isfinite(study.power.values)
    power, light = study.power.values[read], study.standard_error.values[read]
    mechanics, geometry = (
        study[name].values[read] if name in study else np.zeros_like(light)
        for name in ("mechanics_error", "geometry_error")
    )
    return error_budget(power, light, mechanics, geometry)


def stage_totals(study: xr.Dataset) -> dict[str, float]:
    """Seconds of a study by stage, pilot runs included.

    Parameters
    ----------
    study : xr.Dataset
        Of one scene.

    Returns
    -------
    dict[str, float]
        In s.
    """
    totals = json.loads(study.attrs["pilot_seconds"])
    for stage in study.stage.values:
        totals[str(stage)] = totals.get(str(stage), 0.0) + float(study.seconds.sel(stage=stage).sum())
    return totals
