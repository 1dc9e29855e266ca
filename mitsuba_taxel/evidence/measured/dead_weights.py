"""Prediction for dead weights on the whole measured pad: slopes of the voltages and tilt of the plate.

The weights stand on a rigid plate that is bonded to the whole top and tilts freely. The pad is the one that was fitted
to taxel 13; nothing else is fitted.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import xarray as xr

from mitsuba_taxel.base.replicates import standard_error
from mitsuba_taxel.evidence.measured import bench_pad, measured
from mitsuba_taxel.evidence.paper.paper_studies import PaperStudies
from mitsuba_taxel.mechanics.results.plate_motion import plate_motion
from mitsuba_taxel.sensing import Scene, measure
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads

POINTS = 256
"""Number of light paths for each taxel and randomisation."""


class WeightPlace(NamedTuple):
    """A weight in N, and the position (x, y) of its centre on the pad in mm."""

    force: float
    x: float
    y: float


PLACES = (WeightPlace(1.2, 0.0, 0.0), WeightPlace(2.4, 0.0, 0.0), WeightPlace(2.4, 3.5, 0.0))
"""Computed weights: half of the largest and the largest in the middle, and the largest off the middle,
whose errors by the elements are computed."""


def weights(store: PaperStudies, height: float, modulus: float) -> xr.Dataset:
    """Compute changes of all taxels, and the motion of the plate, under dead weights.

    Parameters
    ----------
    store : PaperStudies
        Store of results.
    height : float
        Height of the silicone above the dies, mm.
    modulus : float
        Young's modulus, MPa.

    Returns
    -------
    xr.Dataset
        Over ``place``, the items of :data:`PLACES`: the weight ``force`` in N at ``x`` and ``y`` in mm, the
        displacement ``sinking`` of the plate at the weight in mm and its ``tilt`` in degrees, with errors; and over
        ``taxel``, the ``change`` of the reading relative to rest, with its error. Errors are those of elements and
        light; they are NaN but for the last place.
    """
    request = {"height": height, "modulus": modulus, "places": PLACES, "points": POINTS}
    request |= {"mesh_size": bench_pad.MESH_SIZE}
    return store.study("pressed/dead_weights", request, lambda: _computed(store, height, modulus))


def _computed(store: PaperStudies, height: float, modulus: float) -> xr.Dataset:
    file = store.folder / "pressed" / "pad_with_plate.xml"
    bench_pad.write_scene(file, load=bench_pad.PLATE)
    defines = {"height": height - bench_pad.AS_FITTED.collar, "youngs_modulus": modulus}
    defines |= {"mesh_size": bench_pad.MESH_SIZE}
    at_rest = measure(Scene(file, defines), points=POINTS, mechanics_error=False)
    rows = []
    for place in PLACES:
        scene = Scene(file, defines | {"x": place.x, "y": place.y, "uz": -place.force})
        readings = measure(scene, points=POINTS, mechanics_error=place == PLACES[-1])
        motion = plate_motion(deformed_pads(scene.load())[0].state)
        moved, turned = motion.errors() if place == PLACES[-1] else np.full((2, 3), np.nan)
        changes = readings.replicates / at_rest.replicates.mean(axis=0) - at_rest.replicates / at_rest.power
        mesh = np.nan if readings.deviation is None else readings.deviation / at_rest.power
        error = np.hypot(standard_error(changes), mesh)
        angle = np.linalg.norm(motion.rotation)
        rows.append((-motion.displacement[2], moved[2], angle, np.linalg.norm(turned), changes.mean(axis=0), error))
    sinking, sinking_error, tilt, tilt_error, change, change_error = map(np.array, zip(*rows, strict=True))
    force, x, y = np.array(PLACES).T
    return xr.Dataset(
        {
            "sinking": ("place", sinking, {"units": "mm"}),
            "sinking_error": ("place", sinking_error, {"units": "mm"}),
            "tilt": ("place", tilt, {"units": "degree"}),
            "tilt_error": ("place", tilt_error, {"units": "degree"}),
            "change": (("place", "taxel"), change),
            "change_error": (("place", "taxel"), change_error),
            "force": ("place", force, {"units": "N"}),
            "x": ("place", x, {"units": "mm"}),
            "y": ("place", y, {"units": "mm"}),
        },
        coords={"taxel": np.arange(1, bench_pad.SIDE**2 + 1)},
    )


def slopes(study: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Slopes (place, taxel) of the voltages in V/N from rest to each weight, and their errors.

    All taxels have the mean voltage at rest of the measured pad.
    """
    per_change = measured.REST_VOLTAGE / study.force.values[:, None]
    return per_change * study.change.values, per_change * study.change_error.values
