"""Export of the deformed pads of a scene."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mitsuba_taxel.backend import in_turn
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.files.atomic import replacing
from mitsuba_taxel.kernels.protocols import PadShape
from mitsuba_taxel.sensing import Scene, find_scene
from mitsuba_taxel.sensing.scene.parameter_roles import load_constants, roles_of_parameters
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads
from mitsuba_taxel.studies.plan.files import make_folder
from mitsuba_taxel.studies.plan.histories import histories


@in_turn
def deform(
    source: str | Path,
    defines: Mapping[str, object],
    folder: Path,
    steps: Sequence[Mapping[str, object]] = ({},),
    *,
    vtu: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> list[dict[str, Any]]:
    """Write the surfaces of the deformed pads of a scene as files, one per pad and load step; no light is traced.

    Parameters
    ----------
    source : str or Path
        Path of a scene, or the name of a shipped one.
    defines : Mapping[str, object]
        Values for the scene's parameters.
    folder : Path
        Output folder, created if missing; meshes of the same name are replaced.
    steps : Sequence[Mapping[str, object]]
        Steps of a load path: additional values of the scene's parameters at each.
    vtu : bool
        Whether to write displacement, stress and strain inside the silicone too, for ParaView.
    progress : Callable[[int, int], None], optional
        Called with (steps done, total steps).

    Returns
    -------
    list[dict[str, Any]]
        A row for each pad and step: ``file`` (PLY, mm; a VTU file has the same name), the load's ``quantity``,
        ``value`` and ``unit``, ``triangles``, ``min_jacobian`` (smallest volume ratio det F), ``newton_iterations`` (0
        for a state between solved ones), ``residual`` (norm of the out-of-balance forces, relative to the load),
        ``stable`` (None if not checked), ``buckled_at`` (load at which the pad buckled earlier on the path, or None),
        ``imbalance`` (relative difference of load and reaction of the board), ``board_force_N`` and
        ``board_force_error_N`` (reaction of the board; the error is None if unknown), ``roof_error_mm`` and
        ``slope_error_degrees`` (estimated discretisation error; None if unknown), ``time_s`` and ``time_error`` (of a
        viscoelastic silicone, the latter the relative error of the stress due to time steps; else None).

    Raises
    ------
    InputError
        if the scene is refused, holds no pad, or the folder cannot be written to.
    ComputationError
        if the load path fails.
    """
    make_folder(folder)
    rows = []
    file = find_scene(source)

    # The load history of each step with a time.
    columns = {name: [str(values[name]) for values in steps] for name in steps[0]} if steps else {}
    parameters = Scene(file, {**defines, **(steps[0] if steps else {})}).parameters
    history = histories(columns, parameters, (), roles_of_parameters(file), load_constants(file)) or {}

    # One scene for each step, one file for each of its pads.
    for step, values in enumerate(steps, start=1):
        earlier = {name: words[step - 1] for name, words in history.items()}
        scene = Scene(file, {**defines, **values, **earlier})
        pads = deformed_pads(scene.load())
        if not pads:
            raise InputError(f"{scene.name} holds no deformable_pad: there is nothing to deform.")
        for number, pad in enumerate(pads, start=1):
            name = f"pad_{number}" + (f"_step_{step:0{len(str(len(steps)))}}" if len(steps) > 1 else "")
            rows.append(_written(pad, folder / f"{name}.ply", vtu))
        if progress:
            progress(step, len(steps))
    return rows


def _written(pad: PadShape, file: Path, vtu: bool) -> dict[str, Any]:
    """Write one deformed pad, and return its row of :func:`deform`."""
    from mitsuba_taxel.mechanics import contact_pressure, reactions, write_vtu

    state = pad.state
    board = reactions(state)
    write_mesh(pad, file)
    if vtu:
        overstress = None if state.memory is None else state.memory.overstress
        pressing = None if state.indenter_moved is None else contact_pressure(state)
        fields = state.displacement, state.pressure, state.material, overstress, pressing
        write_vtu(file.with_suffix(".vtu"), state.mesh, *fields)
    return {
        "file": str(file),
        "quantity": state.load.quantity,
        "value": [float(component) for component in state.value[:3]],
        "unit": state.load.unit,
        **({"moment_N_mm": state.value[3:].tolist()} if state.load.tilts else {}),
        "triangles": pad.face_count(),
        "min_jacobian": float(state.min_jacobian),
        "newton_iterations": int(state.newton_iterations),
        "residual": float(state.residual),
        "stable": True if state.stability_checked else None,
        "buckled_at": None if state.buckled_at is None else state.buckled_at.tolist(),
        "imbalance": float(board.imbalance),
        "board_force_N": board.force.tolist(),
        "board_force_error_N": None if np.isnan(board.force_error) else float(board.force_error),
        "time_s": state.memory and state.memory.time,
        "time_error": state.memory.error if state.memory and state.memory.time is not None else None,
        "roof_error_mm": None if state.error is None else state.error.displacement,
        "slope_error_degrees": None if state.error is None else state.error.slope,
    }


def write_mesh(pad: PadShape, file: Path) -> None:
    """Write a deformed pad as PLY (mm), with the region and the cell of each face."""
    with replacing(file) as temporary:
        pad.closed().write_ply(str(temporary))


def mesh_key(pad: PadShape) -> str:
    """Digest of a pad's surface, vertices and faces, in hexadecimal digits."""
    import mitsuba as mi

    parameters = mi.traverse(pad)
    digest = hashlib.sha256()
    for name in ("vertex_positions", "faces"):
        digest.update(np.ascontiguousarray(parameters[name]).tobytes())
    return digest.hexdigest()
