"""The deformed pads of a scene, as meshes on disk."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mitsuba_taxel.errors import InputError
from mitsuba_taxel.optics import Scene, find_scene
from mitsuba_taxel.studies.files import make_folder, replacing


def deform(source: str | Path, defines: Mapping[str, object], folder: Path) -> list[dict[str, Any]]:
    """Write the deformed pads of a scene as ``pad_1.ply``, ... in the order of the scene; no light is traced.

    Parameters
    ----------
    source : path of a scene, or the name of a shipped one
    defines : values for the scene's parameters
    folder : made where it is missing; meshes of the same name are replaced

    Returns
    -------
    Per pad ``file``, ``force_N`` (Fx, Fy, Fz), ``triangles``, ``min_jacobian`` (smallest volume ratio det F),
    ``newton_iterations``.

    Raises
    ------
    InputError
        if the scene is refused, holds no pad, or the folder cannot be written to.
    ComputationError
        if the pad could not be deformed so far.
    """
    scene = Scene(find_scene(source), dict(defines))
    make_folder(folder)
    pads = deformed_pads(scene.load())
    if not pads:
        raise InputError(f"{scene.name} holds no deformable_pad: there is nothing to deform.")
    rows = []
    for number, pad in enumerate(pads, start=1):
        file = folder / f"pad_{number}.ply"
        write_mesh(pad, file)
        rows.append(
            {
                "file": str(file),
                "force_N": [float(component) for component in pad.force],
                "triangles": pad.face_count(),
                "min_jacobian": float(pad.state.min_jacobian),
                "newton_iterations": int(pad.state.newton_iterations),
            }
        )
    return rows


def deformed_pads(scene: Any) -> list[Any]:
    """The ``deformable_pad``s among the shapes of an ``mi.Scene``."""
    return [shape for shape in scene.shapes() if hasattr(shape, "state") and hasattr(shape, "pad")]


def write_mesh(pad: Any, file: Path) -> None:
    """Write a deformed pad as PLY (mm), with region and cell per face."""
    with replacing(file) as temporary:
        pad.write_ply(str(temporary))


def mesh_key(pad: Any) -> str:
    """A key that two pads share only if they are the same surface."""
    import mitsuba as mi

    parameters = mi.traverse(pad)
    digest = hashlib.sha256()
    for name in ("vertex_positions", "faces"):
        digest.update(np.ascontiguousarray(parameters[name]).tobytes())
    return digest.hexdigest()
