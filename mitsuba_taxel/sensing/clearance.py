"""Refuse scenes in which a deformed pad touches a package, as that contact is not modelled."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np

from mitsuba_taxel.kernels.protocols import is_package
from mitsuba_taxel.sensing.scene_pads import deformed_pads


def refuse_contact(scene: mi.Scene) -> None:
    """Raise if a `deformable_pad` of the scene touches the body of a `photo_reflector`.

    Raises
    ------
    InputError
        if it does so already undeformed.
    ComputationError
        naming the load at which it first happens.
    """
    bodies = [shape for shape in scene.shapes() if is_package(shape)]
    for pad in deformed_pads(scene) if bodies else ():
        _refuse(pad, np.concatenate([_triangles(body) for body in bodies]))


def _triangles(body: mi.Mesh) -> np.ndarray:
    """(K, 3, 3) corners in the world, in mm."""
    parameters = mi.traverse(body)
    faces = np.array(parameters["faces"]).reshape(-1, 3)
    return np.array(parameters["vertex_positions"], dtype=float).reshape(-1, 3)[faces]


def _refuse(pad: Any, obstacles: np.ndarray) -> None:
    turn, shift = pad.to_world[:3, :3], pad.to_world[:3, 3]
    in_its_frame = np.linalg.solve(turn, (obstacles - shift).reshape(-1, 3).T).T.reshape(-1, 3, 3)
    pad.state_under(pad.value, obstacles=in_its_frame)
