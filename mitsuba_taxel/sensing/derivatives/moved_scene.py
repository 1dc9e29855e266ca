"""A scene at neighbouring values of one of its parameters, with walls that move to first order in the parameter.

The walls keep their triangles, and the paths their random numbers and guides. The noise of readings at two values
therefore cancels in their difference.
"""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import mitsuba as mi
import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.kernels.paths.plane_mirrors import without_images
from mitsuba_taxel.kernels.surfaces.mesh_adapter import Places
from mitsuba_taxel.pads.parametric.pad import Pad
from mitsuba_taxel.sensing.derivatives.linearised_pad import LinearisedPad, Nodal
from mitsuba_taxel.sensing.derivatives.scene_rates import Rates, instead_of_derivative
from mitsuba_taxel.sensing.reading.mechanics_error import move
from mitsuba_taxel.sensing.reading.runs import Prepared, Run
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads
from mitsuba_taxel.sensing.scene.taxels import taxels_of
from mitsuba_taxel.sensing.validity.modelled import refuse_unmodelled

if TYPE_CHECKING:
    from mitsuba_taxel.geometry.volume_mesh import VolumeMesh

WALLS_MOVE, PARTS_CHANGE = 0.015, 0.2
"""Largest changes for differences of readings: movement of walls, relative to the height of the pad; and change of a
parameter of another part, relative to its value (to 1 if the value is 0)."""
BESIDE = 0.1
"""Allowed distance of the nodes of one mesh from the elements of another, relative to the height of the pad."""


@dataclass(frozen=True, eq=False)
class MovingWalls:
    """Positions of the walls of a pad, and their rates of change with a parameter.

    Attributes
    ----------
    displacement : (N, 3) ndarray
        Displacement of the N nodes of the scene's pad, in mm.
    nodal : Nodal
        Rates of change of the nodes with the parameter.
    chords : bool
        Whether triangles are inscribed in curved walls (chords).
    bent : bool
        Whether the curvature of mirrors is changed by its typical finite-element error.
    """

    displacement: np.ndarray
    nodal: Nodal
    chords: bool = False
    bent: bool = False


def walls_on(mesh: VolumeMesh, linear: LinearisedPad, nodal: Nodal) -> MovingWalls:
    """The state and rates of a linearised pad, interpolated to the nodes of another mesh of the same pad."""
    from mitsuba_taxel.mechanics.point_locator import PointLocator
    from mitsuba_taxel.pads.parametric.velocities import mesh_velocity

    state = linear.state
    if state.mesh is mesh:
        return MovingWalls(state.displacement, nodal)
    location = PointLocator(state.mesh).locate(mesh.points, BESIDE * np.ptp(mesh.points[:, 2]))
    rate, velocity = location.interpolate(nodal.displacement), np.zeros_like(mesh.points)
    for name, dimension_rate in nodal.dimensions.items():
        assert isinstance(linear.pad.pad, Pad)  # pads from files have no dimensions
        velocity += dimension_rate * mesh_velocity(replace(linear.pad.pad), mesh, name)
    if nodal.dimensions:
        # At the same point, nodes of the two meshes may have different velocities, which convect the displacement.
        relative = velocity - location.interpolate(nodal.velocity)
        rate += np.einsum("nij,nj->ni", location.gradient(state.displacement), relative)
    return MovingWalls(location.interpolate(state.displacement), Nodal(rate, velocity, nodal.dimensions))


class MovedScene:
    """A prepared scene whose readings are computed at neighbouring values of one of its parameters.

    If the scene has no pad, the argument ``walls`` of its methods is None.

    Raises
    ------
    InputError
        if the parameter changes dimensions of a pad with a finish.
    """

    def __init__(self, ready: Prepared, change: Rates) -> None:
        self._ready, self._change = ready, change
        self._pad = next(iter(deformed_pads(ready.scene)), None)
        if change.pad and self._pad is not None and self._pad.finish is not None:
            raise InputError(
                f"{change.name} has no derivative: the pad's cells have a finish, which does not follow dimensions; "
                f"{instead_of_derivative(change.name)}."
            )
        self._moved: tuple[float, Any] = 0.0, ready.scene

    def largest_step(self, walls: MovingWalls | None) -> float:
        """Largest change of the parameter for differences of readings, in the unit of the parameter."""
        steps = [] if walls is None else self._steps_of_walls(walls)
        if self._change.beside or not steps:
            steps.append(PARTS_CHANGE * (abs(self._change.value) or 1.0))
        return min(steps)

    def _steps_of_walls(self, walls: MovingWalls) -> list[float]:
        assert self._pad is not None
        mesh, nodal = self._pad.state.mesh, walls.nodal
        nodes = np.unique(mesh.faces[mesh.face_cell > 0])
        speed = np.linalg.norm((nodal.displacement + nodal.velocity)[nodes], axis=1).max(initial=0.0)
        return [float(WALLS_MOVE * np.ptp(mesh.points[:, 2]) / speed)] if speed else []

    def power(self, offset: float, walls: MovingWalls | None, seed: int, points: int) -> np.ndarray:
        """Readings (R, T) in W of T taxels in R replicates, with the parameter changed by ``offset``. The pad stays
        moved afterwards.

        Raises
        ------
        InputError, RuntimeError
            if the scene is not valid with this value of the parameter.
        """
        live = self._scene(offset)
        if walls is not None:
            move(live, deformed_pads(live), [self._places(offset, walls)])
        run = Run(self._ready._replace(scene=live), seed)
        bends = walls is not None and walls.nodal.displacement.any()
        with without_images(live) if bends else nullcontext():
            run.extend_to(points)
        return run.powers

    def _places(self, offset: float, walls: MovingWalls) -> Places:
        assert self._pad is not None
        nodal, state, pad = walls.nodal, self._pad.state, self._pad.pad
        if nodal.dimensions:
            assert isinstance(pad, Pad)
            pad = replace(pad)  # derived dimensions become independent values
            pad = pad.changed(**{name: pad.dimensions[name] + offset * rate for name, rate in nodal.dimensions.items()})
            state = replace(state, mesh=replace(state.mesh, points=state.mesh.points + offset * nodal.velocity))
        state = replace(state, displacement=walls.displacement + offset * nodal.displacement)
        curvature = self._curvature_errors(offset, walls) if walls.bent else None
        return self._pad.moved_places(state, pad, walls.chords, curvature)

    def _curvature_errors(self, offset: float, walls: MovingWalls) -> np.ndarray:
        """Typical errors of the curvature of walls in 1/mm, with the parameter changed by ``offset``."""
        assert self._pad is not None
        errors, rates, ahead = (
            self._pad.curvature_errors(displacement)
            for displacement in (
                walls.displacement,
                walls.nodal.displacement,
                walls.displacement + walls.nodal.displacement,
            )
        )
        # The sign of the product of displacement and rate, by the law of cosines; positive at rest.
        growing = np.where(ahead**2 >= errors**2 + rates**2, 1.0, -1.0)
        return errors + offset * growing * rates

    def _scene(self, offset: float) -> mi.Scene:
        """The loaded scene with all parts except the pad changed by ``offset``, and with the guides of the unchanged
        scene."""
        if not self._change.beside:
            return self._ready.scene
        if offset != self._moved[0]:
            self._moved = 0.0, self._ready.scene  # frees the last scene: kernels contain the parts of all scenes alive
            live = self._change.at(self._change.value + offset)
            refuse_unmodelled(live, self._ready.integrator)
            for present, changed in zip(taxels_of(self._ready.scene), taxels_of(live), strict=True):
                changed.sensor.guided_emission = present.sensor.guided_emission
                if present.sensor.guide is not None:
                    changed.sensor.guide = (np.empty(0), present.sensor.guide[1])
            self._moved = offset, live
        return self._moved[1]
