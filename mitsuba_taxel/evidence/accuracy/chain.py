"""The whole chain: stated and true total errors of a reading, and of its slope over the force, against the target
error."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from mitsuba_taxel.base.caches import clear_caches
from mitsuba_taxel.base.replicates import standard_error
from mitsuba_taxel.evidence.accuracy.mechanics import POINTS, SEED, FineMeshLimit, from_nothing
from mitsuba_taxel.evidence.rows.work_precision import ErrorCurve, TruthEstimate, WorkPoint, now, relative_rms
from mitsuba_taxel.sensing.diffuse.diffuse_cells import kept_cell
from mitsuba_taxel.sensing.measurement import measure
from mitsuba_taxel.sensing.reading.readings import ERROR_SHARE, Readings
from mitsuba_taxel.sensing.scene.description import Scene

TARGETS = (0.02, 0.01, 0.005, 0.002)
NEAR = 0.95
"""Second load of a slope, relative to that of the scene."""
FORCES = ("fz", "fx", "fy")


class SmallerLoad(NamedTuple):
    """The scene under a slightly smaller load.

    Attributes
    ----------
    scene : Scene
        The scene with that load.
    force : str
        Name of the force's parameter.
    step : float
        Force of the original scene minus that of this one, in N.
    """

    scene: Scene
    force: str
    step: float


def near_load(scene: Scene) -> SmallerLoad | None:
    """The scene under a slightly smaller force, if it declares a force other than 0."""
    for name in FORCES:
        try:
            force = float(scene.parameters.get(name, 0))
        except ValueError:
            continue
        if force:
            nearby = Scene(scene.source, {**scene.parameters, name: NEAR * force}, scene.mesh_size)
            return SmallerLoad(nearby, name, (1 - NEAR) * force)
    return None


def slope_limit(limit: FineMeshLimit, near_limit: FineMeshLimit, step: float) -> FineMeshLimit:
    """Slope of readings in the limit of small elements, in W/N, by the difference of two loads.

    Parameters
    ----------
    limit, near_limit : FineMeshLimit
        Readings in the limit of small elements, at the load and at a nearby load.
    step : float
        Difference of the loads in N.
    """
    replicates = (limit.replicates - near_limit.replicates) / step
    return FineMeshLimit(replicates, (limit.change - near_limit.change) / step, limit.size)


def reading_curve(scene: Scene, truth: TruthEstimate, seconds: float, starting: Callable[[str], None]) -> ErrorCurve:
    """Error of readings by target error, for a scene whose pads are not loaded.

    Parameters
    ----------
    scene : Scene
        The scene.
    truth : TruthEstimate
        Reference of the readings.
    seconds : float
        Time budget of each reading.
    starting : Callable[[str], None]
        Called with the name of each step.
    """
    measure(scene, points=1)  # compiles
    points = []
    for target in TARGETS:
        starting(f"chain: target {target:.1%}")
        readings, elapsed = _timed(scene, target, seconds)
        points.append(reading_point(readings, truth.power, elapsed, target, truth))
    return ErrorCurve("chain", "reading", points, launched=True)


def chain_curves(
    scene: Scene,
    truth: TruthEstimate,
    nearby: SmallerLoad | None,
    slope: TruthEstimate | None,
    seconds: float,
    starting: Callable[[str], None],
) -> list[ErrorCurve]:
    """Errors of readings and, if there is a nearby load, of their slopes, by target error; nothing is cached.

    A slope needs a second reading, with the mesh and the number of points that were chosen for the target error.

    Parameters
    ----------
    scene : Scene
        The scene.
    truth : TruthEstimate
        Reference of the readings.
    near : SmallerLoad or None
        The scene under a load nearby.
    slope : TruthEstimate or None
        Reference of the slopes, in W/N.
    seconds : float
        Time budget of each reading.
    starting : Callable[[str], None]
        Called with the name of each step.
    """
    reading_points, slope_points = [], []
    measure(scene, points=1)  # compiles
    for target in TARGETS:
        starting(f"chain: target {target:.1%}")
        with from_nothing():
            reading, elapsed = _timed(scene, target, seconds)
            if nearby is not None and slope is not None:
                start = now()
                nearby_reading = measure(nearby.scene.with_mesh_size(reading.mesh_size), points=reading.points or None)
                slope_points.append(
                    _slope_point(reading, nearby_reading, nearby.step, elapsed + now() - start, target, slope)
                )
            on_this_mesh = scene.with_mesh_size(reading.mesh_size)
            exact = measure(on_this_mesh, points=POINTS, seed=SEED, mechanics_error=False).power
        reading_points.append(reading_point(reading, exact, elapsed, target, truth))
    curves = [ErrorCurve("chain", "reading", reading_points)]
    return curves if nearby is None else [*curves, ErrorCurve("chain", f"slope over {nearby.force}", slope_points)]


def _timed(scene: Scene, target: float, seconds: float) -> tuple[Readings, float]:
    """A reading to a target error without cached light, and its CPU seconds."""
    clear_caches(kept_cell)
    start = now()
    readings = measure(scene, target_error=target, time_budget=seconds)
    return readings, now() - start


def reading_point(
    readings: Readings, exact: np.ndarray, seconds: float, target: float, truth: TruthEstimate
) -> WorkPoint:
    """Errors of a reading, separated into those of light and of mechanics.

    Parameters
    ----------
    readings : Readings
        The reading.
    exact : (T,) ndarray
        Power in W with many more points on the same mesh, whose error is that of the mechanics alone.
    seconds : float
        CPU seconds of the reading.
    target : float
        Target error of the reading.
    truth : TruthEstimate
        Reference.
    """
    shares = {
        "light_error": relative_rms(readings.power - exact, truth.power),
        "mechanics_error": relative_rms(exact - truth.power, truth.power),
        "stated_light": relative_rms(readings.standard_error, readings.power),
        "stated_mechanics": relative_rms(readings.mechanics_error, readings.power),
        "stated_geometry": relative_rms(readings.geometry_error, readings.power),
    }
    return WorkPoint(
        setting=f"{target:.1%}",
        seconds=seconds,
        error=relative_rms(readings.power - truth.power, truth.power),
        stated=relative_rms(readings.total_error, readings.power),
        floor=truth.floor,
        reference=truth.name,
        runs=1,
        readings=int((truth.power > 0).sum()),
        shares=shares | {f"{stage}_seconds": value for stage, value in readings.seconds.items()},
        remark="; ".join(remark for remark in readings.remarks if "not reached" in remark),
    )


def _slope_point(
    readings: Readings, nearby: Readings, step: float, seconds: float, target: float, slope: TruthEstimate
) -> WorkPoint:
    """Errors of slopes, relative to the root mean square over all taxels, as single slopes may be nearly 0."""
    value = (readings.power - nearby.power) / step
    light = standard_error((readings.replicates - nearby.replicates) / step)
    # The error of the mechanics is nearly the same in both readings, and cancels.
    mechanics = np.zeros_like(value)
    if readings.deviation is not None and nearby.deviation is not None:
        mechanics = ERROR_SHARE * (readings.deviation - nearby.deviation) / step
    size = np.linalg.norm(slope.power)
    stages = {stage: readings.seconds.get(stage, 0.0) + nearby.seconds.get(stage, 0.0) for stage in readings.seconds}
    return WorkPoint(
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
