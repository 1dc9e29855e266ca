"""Contact between pads and packages: a pad with `self_contact` may rest on a package; any other pad that touches one is
refused."""

from __future__ import annotations

import mitsuba as mi
import numpy as np

from mitsuba_taxel.base.processes import stages
from mitsuba_taxel.kernels.protocols import PadShape, is_package
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads


def heed_packages(scene: mi.Scene) -> None:
    """Treat the packages of a scene as obstacles of pads with `self_contact`, and refuse any other pad that touches a
    package.

    Parameters
    ----------
    scene : mi.Scene
        A loaded scene; the deformation of its pads may change.

    Raises
    ------
    InputError
        if an undeformed pad touches a package.
    ComputationError
        if a loaded pad without `self_contact` touches a package; the message names the load at which a pad first
        touches one, or at which its load path ends.
    """
    pads, bodies = deformed_pads(scene), _bodies(scene)
    if not (pads and bodies):
        return
    triangles = np.concatenate(bodies)
    with stages.stage("mechanics"):
        changed = [pad.heed(_in_its_frame(pad, triangles)) for pad in pads]
    if any(changed):
        scene.parameters_changed([])


def packages(scene: mi.Scene) -> list[np.ndarray]:
    """For each `photo_reflector`, the corners (K, 3, 3) of the K triangles of its packages, in mm, in the frame of the
    scene's only pad."""
    (pad,) = deformed_pads(scene)
    return [_in_its_frame(pad, body) for body in _bodies(scene)]


def _bodies(scene: mi.Scene) -> list[np.ndarray]:
    return [_triangles(shape) for shape in scene.shapes() if is_package(shape)]


def _triangles(body: mi.Mesh) -> np.ndarray:
    """Corners (K, 3, 3) of the K triangles of a mesh in world coordinates, in mm."""
    parameters = mi.traverse(body)
    faces = np.array(parameters["faces"]).reshape(-1, 3)
    return np.array(parameters["vertex_positions"], dtype=float).reshape(-1, 3)[faces]


def _in_its_frame(pad: PadShape, triangles: np.ndarray) -> np.ndarray:
    linear, shift = pad.to_world[:3, :3], pad.to_world[:3, 3]
    return np.linalg.solve(linear, (triangles - shift).reshape(-1, 3).T).T.reshape(-1, 3, 3)
