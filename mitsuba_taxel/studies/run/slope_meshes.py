"""Choice of the mesh size and of the number of points with which slopes reach their target error."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from mitsuba_taxel.backend import in_turn
from mitsuba_taxel.base.arguments import as_numbers
from mitsuba_taxel.base.convergence import ERROR_SHARE, ORDER, SLOPE_ORDER
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.sensing.reading.derivative_values import Derivatives
from mitsuba_taxel.sensing.reading.paired import paired
from mitsuba_taxel.sensing.reading.prepared_scenes import Settings
from mitsuba_taxel.sensing.reading.runs import Prepared, prepare
from mitsuba_taxel.sensing.scene.description import Scene
from mitsuba_taxel.sensing.targets import (
    MOST_MESHES,
    NEGLIGIBLE,
    RUNG,
    deviation_points,
    finer_mesh,
    mechanics_of,
    smallest_mesh_size,
)
from mitsuba_taxel.studies.plan.batch import Batch
from mitsuba_taxel.studies.plan.job import describe
from mitsuba_taxel.studies.plan.vary import combinations, curve_dimension
from mitsuba_taxel.studies.run.curve_pilot import LIGHT_PART, CurvePilot

MOST_CURVES = 4
"""Number of curves, spread evenly over a study, that are examined."""
SHAPE_PART = math.sqrt(1 - LIGHT_PART**2)
"""Fraction of a target error for the finite elements, where light has noise."""


@in_turn
def settings_for_slopes(batch: Batch, settings: Settings) -> Settings:
    """Choose the mesh size and the number of points with which slopes of readings reach the batch's ``target_slope``.

    Slopes are with respect to the varied forces. They are examined on some curves of the batch. The mesh size follows
    from the derivatives at both ends of a curve or, with random paths, from the effect of the finite elements on the
    change of the readings along the curve. The number of points of random paths follows from pilot runs.

    Parameters
    ----------
    batch : Batch
        Study with a ``target_slope``.
    settings : Settings
        Lower bound of the number of points, and upper bound of the mesh size in mm; None for the scene's mesh size.

    Returns
    -------
    Settings
        The given settings, or more points and a smaller mesh size.

    Raises
    ------
    InputError, ComputationError
        if the load path fails.
    """
    from mitsuba_taxel.sensing.diffuse.diffuse_cells import NotFollowed
    from mitsuba_taxel.sensing.diffuse.diffuse_taxels import NotDiffuse

    assert batch.target_slope is not None
    forces = [name for name in batch.derivatives if name in batch.forces]
    curve = next(axis for axis in batch.axes if axis.dim == curve_dimension(batch.axes))
    ends = [{name: words[end] for name, words in curve.values.items()} for end in (0, -1)]
    curves = [values for _, values in combinations([axis for axis in batch.axes if axis is not curve])]
    for number in np.unique(np.linspace(0, len(curves) - 1, MOST_CURVES).round().astype(int)):
        try:
            for end in ends:
                values = {**curves[number], **end}
                scene = batch.scene(values).with_mesh_size(settings.mesh_size)
                settings = settings._replace(mesh_size=_mesh_size(scene, forces, batch.target_slope))
        except (NotDiffuse, NotFollowed):
            if curve.dim in forces:
                settings = _for_paths(batch, curve.dim, curves[number], settings)
        except (InputError, ComputationError) as error:
            raise type(error)(f"{describe(values, batch.roles)}: {error}") from error
    return settings


def _for_paths(batch: Batch, force: str, fixed: Mapping[str, str], settings: Settings) -> Settings:
    """Settings (points and mesh size) with which the slopes of one curve by random paths reach their target error.
    ``fixed`` contains the values of the other varied parameters."""
    assert batch.target_slope is not None
    axis = next(axis for axis in batch.axes if axis.dim == force)
    loads, words = as_numbers(axis.values[force]) or [], axis.values[force]

    def at(load: float) -> Scene:
        return batch.scene({**fixed, force: words[loads.index(load)]}).with_mesh_size(settings.mesh_size)

    # Points, unless they are given or readings need none.
    pilot = CurvePilot(at, batch.seed)
    points = pilot.points_for(loads, batch.target_slope)
    if not batch.points and settings.points:
        settings = settings._replace(points=max(settings.points, points))

    # The mesh: the error of the reading at the larger load, relative to the change of the steepest taxel.
    change, power = pilot.change, pilot.power
    tolerance = NEGLIGIBLE * batch.target_slope * change / power

    def error_of(scene: Scene, ready: Prepared) -> float:
        deviation = mechanics_of(ready, batch.seed, deviation_points(None, settings.points), tolerance).deviation
        return 0.0 if deviation is None else ERROR_SHARE * float(np.abs(deviation).max()) / change

    if change > 0:
        target = SHAPE_PART * batch.target_slope
        size = _finest(at(max(loads[0], loads[-1], key=abs)), error_of, target, ORDER, by_paths=True)
        settings = settings._replace(mesh_size=size)
    return settings


def _mesh_size(scene: Scene, forces: list[str], target: float) -> float | None:
    """The mesh size, in mm, with which the slopes of a scene reach the target; the finest that can be computed, if none
    does."""
    from mitsuba_taxel.sensing.derivatives.diffuse_derivatives import derivatives_by
    from mitsuba_taxel.sensing.derivatives.scene_rates import rates

    def error_of(scene: Scene, ready: Prepared) -> float:
        changes = [rates(scene, name) for name in forces]
        return slope_share(derivatives_by(changes, ready.scene, of_light_alone=True))

    return _finest(scene, error_of, target, SLOPE_ORDER)


def _finest(
    scene: Scene,
    error_of: Callable[[Scene, Prepared], float],
    target: float,
    order: float,
    by_paths: bool = False,
) -> float | None:
    """The mesh size in mm with which a relative error reaches a target, or the finest that can be computed.

    ``error_of`` computes the relative error of a scene, which falls with the power ``order`` of the mesh size. If it is
    computed ``by_paths``, the random paths go through material points where possible.
    """
    tried: list[tuple[float, float]] = []  # mesh size in mm, relative error
    size, failed = scene.mesh_size, 0.0
    for _ in range(MOST_MESHES):
        # The error with the current mesh.
        try:
            ready = paired(scene, scene) if by_paths else prepare(scene)
            error = error_of(scene, ready)
        except ComputationError:  # with finer elements, a load path may end at a smaller load
            if not tried:
                raise
            assert scene.mesh_size is not None
            failed = scene.mesh_size
        else:
            size = scene.mesh_size
            tried.append((smallest_mesh_size(ready, loaded=True), error))

        # The next mesh, by extrapolation of the errors, coarser than any mesh that has failed.
        finer = finer_mesh(scene, ready, tried, target, order)
        if finer is not None and finer <= failed:
            finer = _between(tried[-1][0], failed)
        if finer is None:
            break
        scene = scene.with_mesh_size(finer)
    return size


def _between(size: float, failed: float) -> float | None:
    """Mesh size on the ladder of sizes, halfway between a size that is too coarse and a size that fails. None if there
    is no size in between.
    """
    rungs = round(math.log(failed / size) / math.log(RUNG)) // 2
    return size * RUNG**rungs if rungs else None


def slope_share(derivatives: Derivatives) -> float:
    """Largest relative error of derivatives: the error of each derivative divided by the largest derivative with
    respect to the same parameter."""
    steepest = np.abs(derivatives.values).max(axis=0)
    errors = derivatives.standard_errors.max(axis=0)
    return float((errors / np.where(steepest > 0, steepest, np.inf)).max(initial=0.0))
