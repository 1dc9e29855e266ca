"""The whole chain from force to reading: stated and true total errors of a reading, and of its slope over the force,
for several target errors."""

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
    """A scene under a slightly smaller force than the original scene.

    Attributes
    ----------
    scene : Scene
        The scene with the smaller force.
    force : str
        Name of the parameter with the force.
    step : float
        Force of the original scene minus the smaller force, in N.
    """

    scene: Scene
    force: str
    step: float


def near_load(scene: Scene) -> SmallerLoad | None:
    """Make the scene under a slightly smaller force; None if no parameter of the scene is a force other than 0."""
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
    """Compute the slope of readings over the force in the limit of small elements, in W/N, as a difference between two
    loads.

    Parameters
    ----------
    limit, near_limit : FineMeshLimit
        Readings in the limit of small elements, at the load and at the smaller load.
    step : float
        Difference of the two loads in N.
    """
    replicates = (limit.replicates - near_limit.replicates) / step
    return FineMeshLimit(replicates, (limit.change - near_limit.change) / step, limit.size)


def reading_curve(scene: Scene, truth: TruthEstimate, seconds: float, starting: Callable[[str], None]) -> ErrorCurve:
    """Measure the error of readings for several target errors, for a scene whose pads are not loaded.

    Parameters
    ----------
    scene : Scene
        The scene.
    truth : TruthEstimate
        Reference values of the readings.
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
    """Measure the errors of readings, and of their slopes over the force, for several target errors; no caches are
    used.

    A slope needs a second reading, that of ``nearby``, with the mesh and the number of points that were chosen for the
    target error.

    Parameters
    ----------
    scene : Scene
        The scene.
    truth : TruthEstimate
        Reference values of the readings.
    nearby : SmallerLoad or None
        The scene under a slightly smaller load; None to omit slopes.
    slope : TruthEstimate or None
        Reference values of the slopes, in W/N.
    seconds : float
        Time budget of each reading.
    starting : Callable[[str], None]
        Called with the name of each step.

    Returns
    -------
    list[ErrorCurve]
        True and stated errors over the time, one point for each target error: of the readings, then, unless ``nearby``
        is None, of the slopes.
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
    """Compute a reading to a target error without cached light. Returns the reading and its CPU seconds."""
    clear_caches(kept_cell)
    start = now()
    readings = measure(scene, target_error=target, time_budget=seconds)
    return readings, now() - start


def reading_point(
    readings: Readings, exact: np.ndarray, seconds: float, target: float, truth: TruthEstimate
) -> WorkPoint:
    """Compute the true error of a reading, and its parts due to light and mechanics.

    Parameters
    ----------
    readings : Readings
        The reading.
    exact : (T,) ndarray
        Power of T taxels in W with many more points on the same mesh; its error is that of the mechanics alone.
    seconds : float
        CPU seconds of the reading.
    target : float
        Target error of the reading.
    truth : TruthEstimate
        Reference values.
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
    """Point of the diagram for slopes: their true and stated errors. Errors are relative to the root mean square of all
    slopes, because single slopes may be nearly 0."""
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
