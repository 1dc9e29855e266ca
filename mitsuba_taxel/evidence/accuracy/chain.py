"""The whole chain: total error, stated and true, of a reading and of its slope by force, against target error."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from mitsuba_taxel.base.caches import clear_caches
from mitsuba_taxel.base.replicates import standard_error
from mitsuba_taxel.evidence.accuracy.mechanics import POINTS, SEED, FineMeshLimit, from_nothing
from mitsuba_taxel.evidence.rows.work_precision import ErrorCurve, Point, Truth, now, relative_rms
from mitsuba_taxel.sensing.diffuse.diffuse_cells import kept_cell
from mitsuba_taxel.sensing.measurement import measure
from mitsuba_taxel.sensing.reading.readings import ERROR_SHARE, Readings
from mitsuba_taxel.sensing.scene.description import Scene

TARGETS = (0.02, 0.01, 0.005, 0.002)
NEAR = 0.95
"""Second load of a slope, relative to that of the scene."""
FORCES = ("fz", "fx", "fy")


class Near(NamedTuple):
    """The scene under a load nearby.

    Attributes
    ----------
    force : str
        Name of the parameter.
    step : float
        In N, from there to that of the scene.
    """

    scene: Scene
    force: str
    step: float


def near_load(scene: Scene) -> Near | None:
    """The scene under a slightly smaller force, if it declares one that is not 0."""
    for name in FORCES:
        try:
            force = float(scene.parameters.get(name, 0))
        except ValueError:
            continue
        if force:
            near = Scene(scene.source, {**scene.parameters, name: NEAR * force}, scene.mesh_size)
            return Near(near, name, (1 - NEAR) * force)
    return None


def slope_limit(limit: FineMeshLimit, near_limit: FineMeshLimit, step: float) -> FineMeshLimit:
    """Slope of readings in the limit of small elements, in W/N."""
    replicates = (limit.replicates - near_limit.replicates) / step
    return FineMeshLimit(replicates, (limit.change - near_limit.change) / step, limit.size)


def reading_curve(scene: Scene, truth: Truth, seconds: float, starting: Callable[[str], None]) -> ErrorCurve:
    """Curve of the reading alone, for a scene whose pads are not loaded.

    Parameters
    ----------
    seconds : float
        Time budget of each reading.
    """
    measure(scene, points=1)  # compiles
    points = []
    for target in TARGETS:
        starting(f"chain: target {target:.1%}")
        found, spent = _timed(scene, target, seconds)
        points.append(reading_point(found, truth.power, spent, target, truth))
    return ErrorCurve("chain", "reading", points, launched=True)


def chain_curves(
    scene: Scene, truth: Truth, near: Near | None, slope: Truth | None, seconds: float, starting: Callable[[str], None]
) -> list[ErrorCurve]:
    """A curve for the reading, and one for its slope if there is a nearby load; all solved without caches.

    The slope takes another reading, on the mesh and with the points chosen for the target error.
    """
    readings, slopes = [], []
    measure(scene, points=1)  # compiles
    for target in TARGETS:
        starting(f"chain: target {target:.1%}")
        with from_nothing():
            found, spent = _timed(scene, target, seconds)
            if near is not None and slope is not None:
                start = now()
                other = measure(near.scene.with_mesh_size(found.mesh_size), points=found.points or None)
                slopes.append(_slope_point(found, other, near.step, spent + now() - start, target, slope))
            on_this_mesh = scene.with_mesh_size(found.mesh_size)
            long = measure(on_this_mesh, points=POINTS, seed=SEED, mechanics_error=False).power
        readings.append(reading_point(found, long, spent, target, truth))
    curves = [ErrorCurve("chain", "reading", readings)]
    return curves if near is None else [*curves, ErrorCurve("chain", f"slope over {near.force}", slopes)]


def _timed(scene: Scene, target: float, seconds: float) -> tuple[Readings, float]:
    clear_caches(kept_cell)
    start = now()
    found = measure(scene, target_error=target, time_budget=seconds)
    return found, now() - start


def reading_point(found: Readings, long: np.ndarray, seconds: float, target: float, truth: Truth) -> Point:
    """``long`` are readings with many points on the same mesh."""
    shares = {
        "light_error": relative_rms(found.power - long, truth.power),
        "mechanics_error": relative_rms(long - truth.power, truth.power),
        "stated_light": relative_rms(found.standard_error, found.power),
        "stated_mechanics": relative_rms(found.mechanics_error, found.power),
        "stated_geometry": relative_rms(found.geometry_error, found.power),
    }
    return Point(
        setting=f"{target:.1%}",
        seconds=seconds,
        error=relative_rms(found.power - truth.power, truth.power),
        stated=relative_rms(found.total_error, found.power),
        floor=truth.floor,
        reference=truth.name,
        runs=1,
        readings=int((truth.power > 0).sum()),
        shares=shares | {f"{stage}_seconds": value for stage, value in found.seconds.items()},
        remark="; ".join(remark for remark in found.remarks if "not reached" in remark),
    )


def _slope_point(found: Readings, other: Readings, step: float, seconds: float, target: float, slope: Truth) -> Point:
    """Errors are relative to the root mean square of all taxels' slopes, some of which may be nearly 0."""
    value = (found.power - other.power) / step
    light = standard_error((found.replicates - other.replicates) / step)
    # The error of the mechanics is nearly the same in both readings, and cancels.
    mechanics = np.zeros_like(value)
    if found.deviation is not None and other.deviation is not None:
        mechanics = ERROR_SHARE * (found.deviation - other.deviation) / step
    size = np.linalg.norm(slope.power)
    stages = {stage: found.seconds.get(stage, 0.0) + other.seconds.get(stage, 0.0) for stage in found.seconds}
    return Point(
        setting=f"{target:.1%}",
        seconds=seconds,
        error=float(np.linalg.norm(value - slope.power) / size),
        stated=float(np.linalg.norm(np.hypot(light, mechanics)) / size),
        floor=float(np.linalg.norm(slope.error) / size),
        reference=slope.name,
        runs=1,
        readings=len(value),
        shares={
            "stated_light": float(np.linalg.norm(light) / size),
            "stated_mechanics": float(np.linalg.norm(mechanics) / size),
            **{f"{stage}_seconds": value for stage, value in stages.items()},
        },
    )
