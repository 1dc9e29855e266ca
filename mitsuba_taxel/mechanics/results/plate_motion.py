"""Motion of a rigid plate that tilts: the displacement of its point, and its rotation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mitsuba_taxel.base.convergence import ERROR_SHARE
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.mechanics.continuation.state import State
from mitsuba_taxel.mechanics.elements.nodal_forces import nodes_of
from mitsuba_taxel.mechanics.elements.plate_rotation import rotation_matrix, rotation_vector


@dataclass(frozen=True, eq=False)
class PlateMotion:
    """Motion of a plate, with its discretisation error from a second mesh.

    Attributes
    ----------
    displacement : (3,) ndarray
        Displacement in mm of the point on which the force acts.
    rotation : (3,) ndarray
        Rotation vector in degrees: its axis, times the angle.
    state : State
        The deformed pad.
    """

    displacement: np.ndarray
    rotation: np.ndarray
    state: State

    def errors(self) -> tuple[np.ndarray, np.ndarray]:
        """Errors (3,) of displacement in mm and of rotation in degrees, one standard deviation; NaN if unknown.

        They follow from the difference between the solutions on two meshes.
        """
        deviations = self.state.deviations
        if deviations is None:
            return np.full(3, np.nan), np.full(3, np.nan)
        deviated = [_motion(self.state, self.state.displacement + deviation) for deviation in deviations]
        moved, turned = (np.array(parts) for parts in zip(*deviated, strict=True))
        return (
            ERROR_SHARE * np.linalg.norm(moved - self.displacement, axis=0),
            ERROR_SHARE * np.linalg.norm(turned - self.rotation, axis=0),
        )


def plate_motion(state: State) -> PlateMotion:
    """The motion of a plate that tilts.

    Parameters
    ----------
    state : State
        The deformed pad.

    Returns
    -------
    PlateMotion
        Displacement in mm and rotation in degrees.

    Raises
    ------
    InputError
        if the load of the state is no plate that tilts.
    """
    if not state.load.tilts:
        raise InputError(f"load = {state.load.name!r} is not allowed: a load with a tilting plate is needed.")
    return PlateMotion(*_motion(state, state.displacement), state)


def _motion(state: State, displacement: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Displacement (3,) in mm and rotation vector (3,) in degrees of the rigid motion nearest to that of the top."""
    top = nodes_of(state.mesh, "top")
    points, moved = state.mesh.points[top], displacement[top]
    turned = rotation_vector(points, moved)
    arm = state.load.pivot(state.mesh) - points.mean(axis=0)
    return moved.mean(axis=0) + rotation_matrix(turned) @ arm - arm, np.degrees(turned)
