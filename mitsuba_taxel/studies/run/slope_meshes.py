"""Mesh size with which the slopes of a batch's curves reach their target error."""

from __future__ import annotations

import math

import numpy as np

from mitsuba_taxel.backend import in_turn
from mitsuba_taxel.base.convergence import SLOPE_ORDER
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.sensing.reading.derivative_values import Derivatives
from mitsuba_taxel.sensing.reading.runs import prepare
from mitsuba_taxel.sensing.scene.description import Scene
from mitsuba_taxel.sensing.targets import MOST_MESHES, RUNG, finer_mesh, smallest_mesh_size
from mitsuba_taxel.studies.plan.batch import Batch
from mitsuba_taxel.studies.plan.job import describe
from mitsuba_taxel.studies.plan.vary import combinations, curve_dimension

MOST_CURVES = 4
"""Number of curves, spread evenly over a study, whose first and last scene are examined."""


@in_turn
def mesh_size_for_slopes(batch: Batch, mesh_size: float | None) -> float | None:
    """The mesh size with which the slopes by force reach the batch's target at the ends of some curves.

    Parameters
    ----------
    batch : Batch
        Study with a ``target_slope``.
    mesh_size : float or None
        Largest size, mm; None for that of the scene.

    Returns
    -------
    float or None
        ``mesh_size`` or a smaller size, mm.

    Raises
    ------
    InputError, ComputationError
        if there is no derivative, or the load path fails.
    """
    assert batch.target_slope is not None
    forces = [name for name in batch.derivatives if name in batch.forces]
    curve = next(axis for axis in batch.axes if axis.dim == curve_dimension(batch.axes))
    ends = [{name: words[end] for name, words in curve.values.items()} for end in (0, -1)]
    curves = [values for _, values in combinations([axis for axis in batch.axes if axis is not curve])]
    for number in np.unique(np.linspace(0, len(curves) - 1, MOST_CURVES).round().astype(int)):
        for end in ends:
            values = {**curves[number], **end}
            try:
                mesh_size = _mesh_size(batch.scene(values).with_mesh_size(mesh_size), forces, batch.target_slope)
            except (InputError, ComputationError) as error:
                raise type(error)(f"{describe(values, batch.roles)}: {error}") from error
    return mesh_size


def _mesh_size(scene: Scene, forces: list[str], target: float) -> float | None:
    """The mesh size, in mm, with which the slopes of a scene reach the target; the finest that can be computed, if none
    does."""
    from mitsuba_taxel.sensing.derivatives.diffuse_derivatives import derivatives_by
    from mitsuba_taxel.sensing.derivatives.scene_rates import rates

    tried: list[tuple[float, float]] = []  # mesh size in mm, relative error of the slopes
    size, failed = scene.mesh_size, 0.0
    for _ in range(MOST_MESHES):
        # Error of the slopes with the current mesh.
        try:
            ready = prepare(scene)
            derivatives = derivatives_by([rates(scene, name) for name in forces], ready.scene, of_light_alone=True)
        except ComputationError:  # with finer elements, a load path may end at a smaller load
            if not tried:
                raise
            assert scene.mesh_size is not None
            failed = scene.mesh_size
        else:
            size = scene.mesh_size
            tried.append((smallest_mesh_size(ready, loaded=True), slope_share(derivatives)))

        # The next mesh, by extrapolation of the errors, coarser than one that has failed.
        finer = finer_mesh(scene, ready, tried, target, SLOPE_ORDER)
        if finer is not None and finer <= failed:
            finer = _between(tried[-1][0], failed)
        if finer is None:
            break
        scene = scene.with_mesh_size(finer)
    return size


def _between(size: float, failed: float) -> float | None:
    """The mesh size halfway, on the ladder of sizes, between a size that is too coarse and a size that fails.

    None if there is no size in between.
    """
    rungs = round(math.log(failed / size) / math.log(RUNG)) // 2
    return size * RUNG**rungs if rungs else None


def slope_share(derivatives: Derivatives) -> float:
    """Largest error of a derivative, relative to the largest derivative with respect to the same parameter."""
    steepest = np.abs(derivatives.values).max(axis=0)
    errors = derivatives.standard_errors.max(axis=0)
    return float((errors / np.where(steepest > 0, steepest, np.inf)).max(initial=0.0))
