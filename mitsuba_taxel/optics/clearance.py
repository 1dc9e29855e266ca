"""Refuse scenes in which a deformed pad touches a package: contact is outside the model of the pad."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import mitsuba as mi
import numpy as np

from mitsuba_taxel.errors import ComputationError, InputError

_BISECTIONS = 12


def refuse_contact(scene: mi.Scene) -> None:
    """Raise where a `deformable_pad` of the scene touches the body of a `photo_reflector`.

    Raises
    ------
    InputError
        if it does so already undeformed.
    ComputationError
        naming the load at which it first happens.
    """
    pads = [shape for shape in scene.shapes() if hasattr(shape, "pad") and hasattr(shape, "state")]
    bodies = [shape for shape in scene.shapes() if hasattr(shape, "face_grid")]
    names = tuple(body.ptr for body in bodies)
    for pad in pads:
        if bodies and getattr(pad, "clear_of", None) != names:
            _refuse(pad, np.concatenate([_triangles(body) for body in bodies]))
            pad.clear_of = names


def _triangles(body: mi.Mesh) -> np.ndarray:
    """(K, 3, 3) corners in the world, in mm."""
    parameters = mi.traverse(body)
    faces = np.array(parameters["faces"]).reshape(-1, 3)
    return np.array(parameters["vertex_positions"], dtype=float).reshape(-1, 3)[faces]


def _refuse(pad: Any, obstacles: np.ndarray) -> None:
    turn, shift = pad.to_world[:3, :3], pad.to_world[:3, 3]
    test = _test(pad.state.mesh, np.linalg.solve(turn, (obstacles - shift).reshape(-1, 3).T).T.tobytes())
    # The load path has found the pad clear of itself and the board, if it is at rest.
    found = (test.find if test.at_rest else test.find_package)(pad.state.displacement)
    if found is None:
        return
    place = ", ".join(f"{coordinate:.3g}" for coordinate in (test.at_rest or found).place)
    if test.at_rest:
        raise InputError(
            f"the undeformed pad touches {test.at_rest.what} near ({place}) mm of the pad: move one of them."
        )
    value = ", ".join(f"{component:.4g}" for component in _first(pad, test))
    raise ComputationError(
        f"the pad touches {found.what} near ({place}) mm, which is outside the model: the load path ends at "
        f"{pad.load.quantity} = ({value}) {pad.load.unit}."
    )


@lru_cache(maxsize=4)  # the scenes of a study share their undeformed pads
def _test(mesh: Any, obstacles: bytes) -> Any:
    from mitsuba_taxel.mechanics.contact import ContactTest

    return ContactTest(mesh, np.frombuffer(obstacles).reshape(-1, 3, 3))


def _first(pad: Any, test: Any) -> np.ndarray:
    """The last value without contact on the path to the pad's load: normal first, then tangential."""
    value = np.array(pad.value)
    normal = np.array([0.0, 0.0, value[2]]) if len(value) == 3 else value
    touches_already = test.find_package(pad.states([normal])[0].displacement) is not None
    start, end = (np.zeros_like(value), normal) if touches_already else (normal, value)
    free, touching = 0.0, 1.0
    for _ in range(_BISECTIONS):
        middle = 0.5 * (free + touching)
        contact = test.find_package(pad.states([start + middle * (end - start)])[0].displacement)
        free, touching = (middle, touching) if contact is None else (free, middle)
    return start + free * (end - start)
