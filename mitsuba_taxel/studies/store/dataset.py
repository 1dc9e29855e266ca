"""A study as a labelled array: readings with units, errors, cost and provenance."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from mitsuba_taxel.base.arguments import as_numbers
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.units import FORCES, HISTORY
from mitsuba_taxel.sensing import Readings
from mitsuba_taxel.sensing.reading.derivative_values import BY_CURVE, Derivatives
from mitsuba_taxel.sensing.reading.finish_notes import finish_notes, merged_finishes
from mitsuba_taxel.sensing.reading.readings import (
    describe_mechanics,
    error_budget,
    geometry_share,
    mechanics_share,
    shares,
)
from mitsuba_taxel.sensing.reading.results import RESULTS
from mitsuba_taxel.sensing.reading.stretch_notes import largest_stretches, stretch_notes
from mitsuba_taxel.studies.plan.job import MAPS, MESHES, Failure, describe
from mitsuba_taxel.studies.plan.vary import STEP, Axis, combinations, curve_dimension
from mitsuba_taxel.studies.store.curve_slopes import fitted_forces, with_curve_slopes
from mitsuba_taxel.studies.store.folder import StoredResult
from mitsuba_taxel.studies.store.slope_target import missed_slopes

Index = tuple[int, ...]

NOT_COMPUTED = "errors of the pads' shape were not computed: the stated error is that of the light alone"
"""Note on studies whose scenes were read without the errors of the pads' shape."""


FITTED = "slopes by force: of smooth curves through readings that share their random numbers"
"""Note of a study whose slopes are those of curves through its readings."""


def assemble(
    axes: Sequence[Axis],
    results: Mapping[Index, StoredResult],
    failures: Mapping[Index, Failure],
    about: Mapping[str, Any],
) -> xr.Dataset:
    """Assemble the outcomes of all jobs into one dataset.

    Its dimensions are those of the study, ``taxel``, ``replicate`` and ``stage``.

    Parameters
    ----------
    axes : Sequence[Axis]
        Dimensions of the study.
    results, failures : Mapping[Index, StoredResult] and Mapping[Index, Failure]
        Outcomes of the jobs by index along the axes; readings without a result are NaN.
    about : Mapping[str, Any]
        ``scene``, ``seed``, ``target_error``, ``target_slope``, ``derivatives``, ``points``, ``mesh_size``,
        ``parameters``, ``units``, ``forces``, ``roles``, ``versions``, ``pilot_seconds``.

    Returns
    -------
    xr.Dataset
        The dataset that ``sweep`` returns, without the results of a circuit.

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
    # Readings, errors of the light and seconds of all scenes, NaN where there is no result.
    shape, dims, curve = tuple(axis.size for axis in axes), [axis.dim for axis in axes], curve_dimension(axes)
    abscissa = _abscissa(axes[dims.index(curve)])
    first = next(iter(results.values())).readings
    stages = sorted({stage for result in results.values() for stage in result.seconds})
    replicates = np.full(shape + first.replicates.shape, math.nan)
    error = np.full(shape + first.power.shape, math.nan)
    seconds = np.zeros((*shape, len(stages)))
    for index, result in results.items():
        replicates[index], error[index] = result.readings.replicates, result.readings.standard_error
        seconds[index] = [result.seconds.get(stage, 0.0) for stage in stages]
    power = replicates.mean(axis=-2)

    # Errors of mechanics and geometry, interpolated along curves, and the total of all errors in W.
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

    # Notes: missing scenes, missed targets, then the remarks of the readings.
    notes = _notes(results)
    if missing := math.prod(shape) - len(results) - len(failures):
        notes.insert(0, f"{missing} of {math.prod(shape)} scenes have no reading yet: the same command computes them")
    if about["target_error"] is not None and (missed := missed_target(about["target_error"], power, total)):
        notes.insert(0, missed)
    study = xr.Dataset(
        {
            **variables,
            "replicate_power": ([*dims, "replicate", "taxel"], replicates, {"units": "W"}),
            **_responsivity(first),
            **_positions(dims, shape, results),
            "seconds": ([*dims, "stage"], seconds, {"units": "s"}),
            **_files("mesh", MESHES, "file of the deformed pad, lengths in mm", dims, shape, results),
            **_files("map", MAPS, "file of the irradiance in W/mm2, a block of pixels per taxel", dims, shape, results),
        },
        coords={
            **coordinates_of(axes, about.get("units", {}), about.get("roles", {})),
            "taxel": ("taxel", first.taxel, {"long_name": "taxel, row by row from (-x, +y)"}),
            "stage": ("stage", stages),
            **_parameters(results),
        },
        attrs={
            **_provenance(about),
            "curve": curve,
            "notes": "\n".join(notes),
            "failures": "\n".join(failure_lines(axes, failures, about.get("roles", {}))),
        },
    )

    # Slopes along forces from curves through readings, and the target of slopes.
    forces = about.get("forces", FORCES)
    study = with_curve_slopes(study, fitted_forces(axes, about.get("derivatives", ()), forces))
    if "derivative_method" in study and (study.derivative_method == BY_CURVE).any():
        study.attrs["notes"] = "\n".join(filter(None, [study.attrs["notes"], FITTED]))
    if about["target_slope"] is not None and (beyond := missed_slopes(study, about["target_slope"], forces)):
        study.attrs["notes"] = "\n".join(filter(None, [*beyond, study.attrs["notes"]]))
    return study


def _provenance(about: Mapping[str, Any]) -> dict[str, Any]:
    """Attributes of a dataset: its scene, settings, parameters, versions and seconds of pilot runs."""
    return {
        **{name: about[name] for name in ("scene", "seed", "points")},
        **{name: about[name] for name in ("target_error", "target_slope", "mesh_size") if about[name] is not None},
        **{name: json.dumps(about[name]) for name in ("parameters", "versions", "pilot_seconds")},
        "units": json.dumps(about.get("units", {})),
        **{name: json.dumps(about[name]) for name in ("forces", "roles") if name in about},
    }


def _files(
    name: str, folder: str, about: str, dims: list[str], shape: tuple[int, ...], results: Mapping[Index, StoredResult]
) -> dict[str, tuple]:
    """The variable ``name`` of a dataset: the names of the files of each result in a subfolder, joined by blanks;
    omitted without files."""
    names = np.full(shape, "", dtype=object)
    for index, result in results.items():
        names[index] = " ".join(file for file in result.files if file.startswith(f"{folder}/"))
    return {name: (dims, names.astype(str), {"long_name": about})} if names.any() else {}


def coordinates_of(
    axes: Sequence[Axis], units: Mapping[str, str], roles: Mapping[str, Sequence[Any]]
) -> dict[str, tuple]:
    """Values along each dimension; parameters taken together are coordinates of ``step``.

    Parameters
    ----------
    axes : Sequence[Axis]
        Dimensions of the study.
    units : Mapping[str, str]
        Units of parameters.
    roles : Mapping[str, Sequence[Any]]
        Role and sign of each parameter.

    Returns
    -------
    dict[str, tuple]
        Coordinates by name, as `xr.Dataset` takes them.
    """
    coordinates: dict[str, tuple] = {}
    for axis in axes:
        for name, words in axis.values.items():
            if roles.get(name, (name,))[0] == HISTORY:  # repeats the earlier steps, and is no coordinate
                continue
            numbers = as_numbers(words)
            unit = {"units": units[name]} if numbers and name in units else {}
            coordinates[name] = (axis.dim, numbers or words, unit)
        if axis.dim == STEP:
            coordinates[STEP] = (STEP, np.arange(1, axis.size + 1))
    return coordinates


def _notes(results: Mapping[Index, StoredResult]) -> list[str]:
    """Distinct remarks of all readings, a note on unequal points, and a summary of the mechanics' errors."""
    remarks = [remark for result in results.values() for remark in result.readings.remarks]
    errors = [error for result in results.values() for error in result.readings.roof_errors]
    points = [result.readings.points for result in results.values()]
    few = sum(count < max(points) for count in points)
    # 0 points are light without random numbers; other scenes of such a study, with mirrors, choose their own points.
    if few and min(points):
        remarks.append(f"{few} of {len(results)} scenes have fewer points: the same command computes the rest")
    computed = not errors or any(result.readings.deviation is not None for result in results.values())
    remarks += finish_notes(merged_finishes(result.readings.finishes for result in results.values()))
    remarks += stretch_notes(largest_stretches(result.readings.exceeded_limits for result in results.values()))
    return [*dict.fromkeys(remarks), *(describe_mechanics(errors) if computed else [NOT_COMPUTED])]


def failure_lines(
    axes: Sequence[Axis], failures: Mapping[Index, Failure], roles: Mapping[str, Sequence[Any]]
) -> list[str]:
    """A line for each failed scene: its values and the reason.

    Parameters
    ----------
    axes : Sequence[Axis]
        Dimensions of the study.
    failures : Mapping[tuple[int, ...], Failure]
        Failures by their indices along the dimensions.
    roles : Mapping[str, Sequence[Any]]
        Role and sign of each parameter.

    Returns
    -------
    list[str]
        The lines.
    """
    values = dict(combinations(axes))
    return [f"{describe(values[index], roles)}: {failure.message}" for index, failure in failures.items()]


def _responsivity(readings: Readings) -> dict[str, tuple]:
    if readings.responsivity is None:
        return {}
    about = {"units": "A/W", "long_name": "photocurrent per optical power"}
    return {"responsivity": ("taxel", readings.responsivity, about)}


def _positions(dims: Sequence[str], shape: Index, results: Mapping[Index, StoredResult]) -> dict[str, tuple]:
    """Positions of the taxels along x and y, over the dimensions of the study only if they change; empty if unknown."""
    stored = {index: result.readings.positions for index, result in results.items()}
    known = {index: positions for index, positions in stored.items() if positions is not None}
    if len(known) < len(stored):
        return {}
    first = next(iter(known.values()))
    along: list[str] = []
    positions = first
    if not all(np.array_equal(other, first) for other in known.values()):
        along, positions = [*dims], np.full((*shape, *first.shape), math.nan)
        for index, other in known.items():
            positions[index] = other
    about = {"units": "mm", "long_name": "centre of the phototransistor"}
    return {f"taxel_{axis}": ([*along, "taxel"], positions[..., number], about) for number, axis in enumerate("xy")}


def _abscissa(axis: Axis) -> np.ndarray:
    """Coordinate (size,) along a dimension with which results between two scenes are interpolated.

    It is the length of the path through the space of the numeric parameters, each relative to its range. If no
    parameter changes, it is the index of the scene. It is not the index otherwise, because errors of the mechanics grow
    with the load, and loads need not be evenly spaced.
    """
    numbers = [np.array(values) for values in map(as_numbers, axis.values.values()) if values]
    ranges = [(values, np.ptp(values)) for values in numbers]
    scaled = [values / width for values, width in ranges if width > 0]
    if not scaled:
        return np.arange(axis.size, dtype=float)
    steps = np.linalg.norm(np.diff(scaled, axis=1), axis=0)
    # Scenes of equal parameters differ slightly, as interpolation needs an increasing abscissa.
    return np.concatenate([[0.0], np.cumsum(np.maximum(steps, 1e-9))])


def _deviation(
    results: Mapping[Index, StoredResult], power: np.ndarray, curve: int, abscissa: np.ndarray
) -> np.ndarray:
    """Change of each reading on coarser finite elements, (..., T) in W; 0 for pads without load."""

    def deviation_of(readings: Readings) -> np.ndarray | None:
        unloaded = readings.deviation is None and not readings.roof_errors
        return np.zeros(len(readings.taxel)) if unloaded else readings.deviation

    deviations = {index: deviation_of(result.readings) for index, result in results.items()}
    return _along_curves(deviations, power, curve, abscissa)


def _facets(results: Mapping[Index, StoredResult], power: np.ndarray, curve: int, abscissa: np.ndarray) -> np.ndarray:
    """Change of each reading by inscribed triangles of curved walls (facets), (..., T) in W; 0 where it was not
    estimated."""
    estimated = {index: result.readings.facets for index, result in results.items()}
    facets = _along_curves(estimated, power, curve, abscissa)
    return np.where(np.isfinite(power), np.nan_to_num(facets), math.nan)


def _along_curves(
    changes: Mapping[Index, np.ndarray | None], power: np.ndarray, curve: int, abscissa: np.ndarray
) -> np.ndarray:
    """Changes of all readings, interpolated between the scenes of a curve at which they were computed.

    Parameters
    ----------
    changes : Mapping[Index, np.ndarray or None]
        Changes (T,) in W by index of the scene; None where they were not computed.
    power : np.ndarray
        Readings (..., T) in W.
    curve : int
        Axis of ``power`` along which the change relative to the power is interpolated linearly.
    abscissa : np.ndarray
        Abscissa (size,) along that axis, increasing.

    Returns
    -------
    np.ndarray
        Changes (..., T) in W; NaN for scenes without a reading and for curves without a computed change.
    """
    relative = np.full(power.shape, math.nan)
    is_open_at = np.zeros(power.shape[:-1], dtype=bool)
    for index, change in changes.items():
        if change is None:
            is_open_at[index] = True
        else:
            relative[index] = np.divide(change, power[index], out=np.zeros_like(change), where=power[index] > 0)
    for line, is_open in zip(_lines_along(relative, curve), _lines_along(is_open_at[..., None], curve), strict=True):
        computed, interpolated = np.isfinite(line).all(axis=1), is_open[:, 0]
        if computed.any() and interpolated.any():
            at, known_at = abscissa[interpolated], abscissa[computed]
            line[interpolated] = np.column_stack([np.interp(at, known_at, taxel[computed]) for taxel in line.T])
    return relative * power


def _lines_along(array: np.ndarray, axis: int) -> Iterator[np.ndarray]:
    """Views (n, T) into an array (..., T): one for each line along ``axis``, with all other indices fixed."""
    lines = np.moveaxis(array, axis, -2)
    for index in np.ndindex(lines.shape[:-2]):
        yield lines[index]


def _shares(change: np.ndarray, power: np.ndarray, error_of: Callable[[np.ndarray, np.ndarray], float]) -> np.ndarray:
    """Relative error of each scene, (..., 1), from the changes of its readings and their power, both (..., T) W."""
    shares = [error_of(change[index], power[index]) for index in np.ndindex(power.shape[:-1])]
    return np.reshape(shares, (*power.shape[:-1], 1))


def _variables(
    dims: list[str],
    shape: tuple[int, ...],
    results: Mapping[Index, StoredResult],
    along: Mapping[str, np.ndarray],
    curve: str,
    abscissa: np.ndarray,
) -> dict[str, xr.DataArray]:
    """The variables of all results in `RESULTS`.

    Parameters
    ----------
    dims, shape : list[str] and tuple[int, ...]
        Dimensions of the study, and their lengths.
    results : Mapping[Index, StoredResult]
        Results by index.
    along : Mapping[str, np.ndarray]
        Power and its errors (..., T) by name, interpolated along curves. Results in `_ALONG` become variables only if
        they are among these.
    curve : str
        Dimension along which other results that change smoothly are interpolated.
    abscissa : np.ndarray
        Abscissa (size,) along that dimension, increasing.

    Returns
    -------
    dict[str, xr.DataArray]
        Variables by name; results without any value are absent.
    """
    variables = {}
    for result in RESULTS:
        if result.name in _ALONG:
            values = along.get(result.name)
        else:
            values = _collected({index: result.of(kept.readings) for index, kept in results.items()}, shape)
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
"""Results that are computed for the whole study: relative errors of mechanics and geometry are common to all taxels of
a scene, and computed at some scenes of a curve only."""


def _collected(values: Mapping[Index, Any], shape: tuple[int, ...]) -> np.ndarray | None:
    """Array of one value for each scene; NaN or empty text for a scene without a value; None if no scene has one."""
    arrays = {index: np.asarray(value) for index, value in values.items() if value is not None}
    if not arrays:
        return None
    own = np.max([value.shape for value in arrays.values()], axis=0).astype(int)  # a contact may lack its derivatives
    is_text = any(value.dtype.kind == "U" for value in arrays.values())
    array = np.full((*shape, *own), "", dtype=object) if is_text else np.full((*shape, *own), math.nan)
    for index, value in arrays.items():
        if value.shape == tuple(own):
            array[index] = value
    return array.astype(str) if is_text else array


def _parameters(results: Mapping[Index, StoredResult]) -> dict[str, tuple]:
    """Coordinates of the dimension ``parameter``, for derivatives: names and units of the parameters; empty without
    derivatives."""
    for derivatives in _derivatives(results).values():
        return {
            "parameter": ("parameter", list(derivatives.parameters)),
            "derivative_unit": ("parameter", list(derivatives.units)),
        }
    return {}


def _derivatives(results: Mapping[Index, StoredResult]) -> dict[Index, Derivatives]:
    """The derivatives of all readings that have them."""
    derivatives = {index: result.readings.derivatives for index, result in results.items()}
    return {index: values for index, values in derivatives.items() if values is not None}


def missed_target(target_error: float, power: np.ndarray, total: np.ndarray) -> str:
    """A note on readings whose total error exceeds the target or is unknown; empty text if there are none.

    Parameters
    ----------
    target_error : float
        Largest relative error.
    power, total : np.ndarray
        Readings (..., T) and their total errors in W; NaN where there is no reading.
    """
    read = np.isfinite(power)
    relative = shares(total[read], power[read])
    beyond = ~(relative <= target_error)
    if not beyond.any():
        return ""
    worst = f"{relative.max():.2g}" if np.isfinite(relative).all() else "unknown"
    return f"target error {target_error:g} not reached: {beyond.sum()} of {beyond.size} readings, the worst {worst}"


def study_error_budget(study: xr.Dataset) -> dict[str, float]:
    """Error budget of the reading with the largest relative error in a study: relative errors by source.

    See `Readings` for the sources. Failed readings are left out.

    Parameters
    ----------
    study : xr.Dataset
        Study of one scene.

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
    """Computing time of a study in s by stage, such as mechanics and light, pilot runs included.

    Parameters
    ----------
    study : xr.Dataset
        Study of one scene.

    Returns
    -------
    dict[str, float]
        Seconds by stage.
    """
    totals = json.loads(study.attrs["pilot_seconds"])
    for stage in study.stage.values:
        totals[str(stage)] = totals.get(str(stage), 0.0) + float(study.seconds.sel(stage=stage).sum())
    return totals
