"""A study as a labelled array: readings with units, errors, cost and provenance."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import xarray as xr

from mitsuba_taxel.backend import report
from mitsuba_taxel.optics import Readings, Scene
from mitsuba_taxel.optics.readings import describe_mechanics
from mitsuba_taxel.studies.units import PARAMETER_UNITS
from mitsuba_taxel.studies.vary import as_numbers, curve_parameter


class Result(NamedTuple):
    """What one scene of a study gave: readings, seconds by stage, and the files of its pads."""

    readings: Readings
    seconds: dict[str, float]
    meshes: str


def assemble(scene: Scene, varied: Mapping[str, list[str]], results: Mapping[tuple[int, ...], Result]) -> xr.Dataset:
    """Dataset over the varied parameters, ``taxel``, ``replicate`` and ``stage``.

    Parameters
    ----------
    scene : the scene with the values of the parameters that are not varied
    varied : values by parameter, in the order of the dimensions
    results : by index along each varied parameter
    """
    shape = tuple(len(words) for words in varied.values())
    first = next(iter(results.values())).readings
    stages = sorted({stage for result in results.values() for stage in result.seconds})
    replicates = np.zeros(shape + first.replicates.shape)
    seconds = np.zeros((*shape, len(stages)))
    meshes = np.full(shape, "", dtype=object)
    for index, result in results.items():
        replicates[index] = result.readings.replicates
        seconds[index] = [result.seconds.get(stage, 0.0) for stage in stages]
        meshes[index] = result.meshes
    dims = list(varied)
    remarks = [remark for result in results.values() for remark in result.readings.remarks]
    errors = [error for result in results.values() for error in result.readings.roof_errors]
    power = replicates.mean(axis=-2)
    error = replicates.std(axis=-2, ddof=1) / np.sqrt(len(first.replicates))
    study = xr.Dataset(
        {
            "power": ([*dims, "taxel"], power, {"units": "W", "long_name": "optical power"}),
            "standard_error": (
                [*dims, "taxel"],
                error,
                {"units": "W", "long_name": "1 sigma of power (light)"},
            ),
            "replicate_power": ([*dims, "replicate", "taxel"], replicates, {"units": "W"}),
            **_responsivity(first),
            **_roof_errors(dims, shape, results),
            "seconds": ([*dims, "stage"], seconds, {"units": "s"}),
            "mesh": (dims, meshes.astype(str), {"long_name": "file of the deformed pad, lengths in mm"}),
        },
        coords={
            **{name: (name, as_numbers(words) or words, _unit(name, words)) for name, words in varied.items()},
            "taxel": ("taxel", first.taxel, {"long_name": "taxel, row by row from (-x, +y)"}),
            "stage": ("stage", stages),
        },
        attrs={
            "scene": scene.name,
            "curve": curve_parameter(varied),
            "parameters": json.dumps({name: value for name, value in scene.parameters.items() if name not in varied}),
            "versions": json.dumps(report()["versions"]),
            "seed": first.seed,
            "points": first.points,
            "notes": "\n".join(dict.fromkeys([*remarks, *describe_mechanics(errors)])),
        },
    )
    return study if any(result.meshes for result in results.values()) else study.drop_vars("mesh")


def _responsivity(readings: Readings) -> dict[str, tuple]:
    if readings.responsivity is None:
        return {}
    about = {"units": "A/W", "long_name": "photocurrent per optical power"}
    return {"responsivity": ("taxel", readings.responsivity, about)}


def _roof_errors(
    dims: list[str], shape: tuple[int, ...], results: Mapping[tuple[int, ...], Result]
) -> dict[str, tuple]:
    """The worst error of the pads of each scene; not a number where it is unknown."""
    if not any(result.readings.roof_errors for result in results.values()):
        return {}
    displacement, slope = np.zeros(shape), np.zeros(shape)
    for index, result in results.items():
        errors = result.readings.roof_errors
        displacement[index] = max((math.nan if error is None else error.displacement for error in errors), default=0.0)
        slope[index] = max((math.nan if error is None else error.slope for error in errors), default=0.0)
    about = "error of the roofs' {} by finite elements, root mean square"
    return {
        "roof_error": (dims, displacement, {"units": "mm", "long_name": about.format("displacement")}),
        "slope_error": (dims, slope, {"units": "degrees", "long_name": about.format("slope")}),
    }


def stage_totals(study: xr.Dataset) -> dict[str, float]:
    """Seconds that a study took by stage, pilot runs included."""
    totals = json.loads(study.attrs["pilot_seconds"])
    for stage in study.stage.values:
        totals[str(stage)] = totals.get(str(stage), 0.0) + float(study.seconds.sel(stage=stage).sum())
    return totals


def _unit(name: str, words: list[str]) -> dict[str, str]:
    return {"units": PARAMETER_UNITS[name]} if name in PARAMETER_UNITS and as_numbers(words) else {}
