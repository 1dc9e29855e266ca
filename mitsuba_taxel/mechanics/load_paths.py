"""The deformed pad at any load, on shared load paths.

The path to a force F is 0 -> (0, 0, Fz) -> F: the normal segment first, then the tangential one, as in the paper's
procedure and on the bench. Its nodes depend only on pad, material, load and mesh, so that a state is bitwise
independent of other requested states and of their order. The mirror image of a load, by a symmetry of the pad, has
bitwise the mirrored state.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from textwrap import shorten

import numpy as np

from mitsuba_taxel.base.arguments import check_progress, floats_of, is_number, refusal, require
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.mechanics.contact.barriers.bodies import RigidBodies
from mitsuba_taxel.mechanics.continuation.load_path_ends import LoadPathEnds
from mitsuba_taxel.mechanics.continuation.load_segment import INTERPOLATION_TOLERANCE
from mitsuba_taxel.mechanics.continuation.mirrored_places import canonical_place, mirrored_state, solved_by_symmetry
from mitsuba_taxel.mechanics.continuation.pad_path import PadPath, pad_path
from mitsuba_taxel.mechanics.continuation.path_problem import lock_of
from mitsuba_taxel.mechanics.continuation.placed_paths import path_along, placed_path, solved_on
from mitsuba_taxel.mechanics.continuation.state import State
from mitsuba_taxel.mechanics.elements.loads import SPREAD_FORCE, Load
from mitsuba_taxel.mechanics.elements.memory import memory_for
from mitsuba_taxel.mechanics.errors.mesh_sizes import chosen_size
from mitsuba_taxel.mechanics.errors.second_ends import end_on_second_mesh
from mitsuba_taxel.mechanics.errors.second_meshes import compared
from mitsuba_taxel.mechanics.history.pushed_path import PushedPath
from mitsuba_taxel.mechanics.history.timed_path import TimedPath
from mitsuba_taxel.mechanics.history.timed_rows import LoadHistory, timed_rows
from mitsuba_taxel.mechanics.materials.laws import Material
from mitsuba_taxel.mechanics.materials.mullins import Mullins
from mitsuba_taxel.mechanics.materials.viscoelastic import Elastic, Viscoelastic
from mitsuba_taxel.mechanics.memory_of_pads import refuse_too_large
from mitsuba_taxel.pads.any_pad import AnyPad
from mitsuba_taxel.pads.block import Block
from mitsuba_taxel.pads.pad_file import PadFile
from mitsuba_taxel.pads.parametric.pad import Pad

NEEDED = "a Material, such as NeoHookean, a Viscoelastic or a Mullins"
FEW_STATES = 100
MOST_BYTES = 4 * 2**30
"""Memory limit of the states returned at once; a few are always allowed."""


def load_path(
    pad: AnyPad,
    material: Material | Viscoelastic | Mullins,
    values: Sequence[Sequence[float]] | np.ndarray,
    *,
    times: Sequence[float] | np.ndarray | None = None,
    load: Load = SPREAD_FORCE,
    mesh_size: float | None = None,
    mesh_tolerance: float | None = None,
    judged_on: float | None = None,
    step_tolerance: float = INTERPOLATION_TOLERANCE,
    obstacles: np.ndarray | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> list[State]:
    """Deformed states of a pad under each of the ``values`` of a load.

    States of an elastic pad without friction depend on their values alone. A `Viscoelastic` silicone is at rest until t
    = 0; its load changes linearly from each value to the next, and jumps where two times are equal. An indenter with
    friction moves in a straight line from each value to the next. To the first value it moves down first, then
    sideways. A silicone with `Mullins` effect takes the same path, under any load; its states depend on the values
    before, in their order.

    Parameters
    ----------
    pad : AnyPad
        The pad, parametric or from a file.
    material : Material or Viscoelastic or Mullins
        Silicone of the pad.
    values : Sequence[Sequence[float]] or ndarray
        (S, 3) forces in N or displacements in mm, compression is z < 0; or (S, 1) pressures in MPa.
    times : (S,) sequence of float, optional
        Non-decreasing times of the values in s: for a viscoelastic silicone only.
    load : Load
        Kind of load, by default a force spread over the top.
    mesh_size : float, optional
        Size of the finite elements in mm; by default the pad's own `default_mesh_size`.
    mesh_tolerance : float, optional
        Instead of a size, the target for the relative error of the roofs' displacement under a small load; see
        :func:`mesh_size_for`.
    judged_on : float, optional
        Element size, in mm, of the mesh on which the stability of an elastic pad is tested. By default it is tested on
        the mesh of the path itself, which takes a third of its time or more. Beyond the largest load of the other mesh,
        it is tested on both.
    step_tolerance : float
        Allowed root mean square error of interpolated displacements of an elastic pad, relative to the largest
        displacement of the state.
    obstacles : (K, 3, 3) ndarray, optional
        Corners, in mm, of the triangles of closed surfaces that do not move, in the frame of the pad. If the load has
        ``self_contact``, contact without friction is modelled; otherwise the pad must not touch them.
    progress : Callable[[int, int], None], optional
        Called with (states done, total states).

    Returns
    -------
    list[State]
        One state for each value.

    Raises
    ------
    InputError
        if values are not finite or too many for memory, a mesh size or tolerance is not allowed, the undeformed pad
        touches obstacles, or times are missing, not needed, negative or decreasing.
    ComputationError
        if the path ends, because the pad cannot be loaded further, or touches itself, the board or an obstacle (the
        message states the last value); or if memory does not suffice. If the load has ``self_contact``, the path
        continues after the contact.
    """
    require("pad", pad, (Pad, PadFile, Block), "a Pad, a PadFile or a Block")
    require("material", material, (Material, Viscoelastic, Mullins), NEEDED)
    require("load", load, Load, "a load, such as SpreadForce,")
    check_progress(progress)
    rows = _checked(values, load)
    if obstacles is not None:
        obstacles = _checked_triangles(obstacles)
    law = remembering(material).law
    if not (judged_on is None or (is_number(judged_on) and judged_on > 0)):
        raise refusal("judged_on", judged_on, "a finite size in mm above 0 is needed")
    if not (is_number(step_tolerance) and step_tolerance > 0):
        raise refusal("step_tolerance", step_tolerance, "a finite number above 0 is needed")
    history = timed_rows(material, load, rows, times)
    earlier = len(history) - len(rows)
    states = []
    with lock_of(pad):
        size = chosen_size(pad, law, load, mesh_size, mesh_tolerance)
        refuse_too_large(pad, size, load, rows)
        bodies = None
        if load.self_contact and obstacles is not None:
            bodies, obstacles = RigidBodies(obstacles.tobytes()), None
        judged_on = None if history else judged_on
        path = pad_path(pad, law, load, size, judged_on=judged_on, bodies=bodies, step_tolerance=step_tolerance)
        _check_room(len(rows), path)
        for done, value in enumerate(rows, start=1):
            with memory_for(f"a pad of finite elements of {path.mesh_size:.3g} mm"):
                if history:
                    states.append(_state_in_time(path, material, history[: earlier + done], obstacles))
                else:
                    states.append(_elastic_state(path, value, obstacles))
            if progress is not None:
                progress(done, len(rows))
    return states


def state_after(
    pad: AnyPad,
    material: Material | Viscoelastic | Mullins,
    values: Sequence[Sequence[float]] | np.ndarray,
    times: Sequence[float] | np.ndarray | None = None,
    *,
    load: Load = SPREAD_FORCE,
    mesh_size: float | None = None,
    mesh_tolerance: float | None = None,
    obstacles: np.ndarray | None = None,
) -> State:
    """The last state of :func:`load_path`, without keeping the earlier states on which it depends in memory.

    Parameters
    ----------
    pad : AnyPad
        The pad.
    material : Material or Viscoelastic or Mullins
        Silicone of the pad.
    values : Sequence[Sequence[float]] or ndarray
        Values (S, 3) or (S, 1), as for :func:`load_path`.
    times : (S,) sequence of float, optional
        Times in s, for a viscoelastic silicone.
    load : Load
        Kind of load.
    mesh_size, mesh_tolerance : float, optional
        Size of the elements in mm, or instead the target for the relative error of the roofs' displacement.
    obstacles : (K, 3, 3) ndarray, optional
        Corners of triangles that the pad must not touch, mm.

    Returns
    -------
    State
        State after the last value.
    """
    rows = _checked(values, load)
    history, law = timed_rows(material, load, rows, times), remembering(material).law
    with lock_of(pad):
        size = chosen_size(pad, law, load, mesh_size, mesh_tolerance)
        refuse_too_large(pad, size, load, rows)
        path = pad_path(pad, law, load, size)
        with memory_for(f"a pad of finite elements of {path.mesh_size:.3g} mm"):
            return _state_in_time(path, material, history, obstacles)


def state_at_rest(
    pad: AnyPad,
    material: Material | Viscoelastic | Mullins,
    values: Sequence[Sequence[float]] | np.ndarray,
    times: Sequence[float] | np.ndarray | None = None,
    *,
    load: Load = SPREAD_FORCE,
    mesh_size: float | None = None,
    mesh_tolerance: float | None = None,
) -> State:
    """The unloaded pad on the elements of the last state of :func:`load_path`.

    A pad whose last state does not fit into memory is refused before it is meshed.

    Parameters
    ----------
    pad : AnyPad
        The pad.
    material : Material or Viscoelastic or Mullins
        Silicone of the pad.
    values : Sequence[Sequence[float]] or ndarray
        Values (S, 3) or (S, 1), as for :func:`load_path`.
    times : (S,) sequence of float, optional
        Times in s, for a viscoelastic silicone.
    load : Load
        Kind of load.
    mesh_size, mesh_tolerance : float, optional
        Size of the elements in mm, or instead the target for the relative error of the roofs' displacement.

    Returns
    -------
    State
        The undeformed pad.
    """
    rows = _checked(values, load)
    history, law = timed_rows(material, load, rows, times), remembering(material).law
    with lock_of(pad):
        size = chosen_size(pad, law, load, mesh_size, mesh_tolerance)
        refuse_too_large(pad, size, load, rows)
        path = pad_path(pad, law, load, size)
        with memory_for(f"a pad of finite elements of {path.mesh_size:.3g} mm"):
            zero = np.zeros(load.components)
            if history:
                path = path_along(path, [row for _, row in history])
                return compared(path, path.state(zero))
            placed = placed_path(path, rows[-1])[0]
            canonical, _, mirrors = canonical_place(placed, zero)
            return mirrored_state(placed, compared(canonical, canonical.state(zero)), mirrors)


def remembering(material: Material | Viscoelastic | Mullins) -> Viscoelastic:
    """Convert a material to a `Viscoelastic` object. An elastic material, or one with Mullins' effect, gets no relaxing
    terms.
    """
    if isinstance(material, Mullins):
        return Elastic(material.law, softening=material)
    return material if isinstance(material, Viscoelastic) else Elastic(material)


def _elastic_state(path: PadPath, value: np.ndarray, obstacles: np.ndarray | None = None) -> State:
    """The deformed pad under a value of a load, without friction. Elements are refined as in :func:`solved_on`."""
    placed, there = placed_path(path, value)
    try:
        state = solved_by_symmetry(placed, there, obstacles, _compared_state)
    except LoadPathEnds as end:
        if end.value is None or end.load == path.load or path.load.moved_indenter is None:
            raise
        raise end.at(path.load, np.array([*value[:2], end.value[2]])) from end
    if placed.load == path.load:
        return state
    return replace(state, load=path.load, value=value, indenter_moved=value)


def _compared_state(path: PadPath, value: np.ndarray, obstacles: np.ndarray | None) -> State:
    try:
        on, _, state = solved_on(path, value, obstacles)
    except LoadPathEnds as end:
        raise end_on_second_mesh(path, value, obstacles, end) from end
    return compared(on, state)


def _state_in_time(
    path: PadPath, material: Material | Viscoelastic | Mullins, history: LoadHistory, obstacles: np.ndarray | None
) -> State:
    """The last state of a load history, for a pad whose states depend on earlier states."""
    kind = PushedPath if path.load.driven is not None else TimedPath
    along = path_along(path, [value for _, value in history])
    return kind.of(along, remembering(material)).state(history, obstacles)


def _check_room(states: int, path: PadPath) -> None:
    """Raise `InputError` if ``states`` deformed pads do not fit into memory at once."""
    if states <= FEW_STATES:
        return
    most = MOST_BYTES // (3 * path.mesh.points.nbytes)  # displacement and deviations
    if states > most:
        raise InputError(
            f"{states} values of a load are not allowed: at most {most} states of this pad fit into memory at once; "
            "compute them one by one."
        )


def _checked(values: Sequence[Sequence[float]] | np.ndarray, load: Load) -> np.ndarray:
    """Convert values of a load to an array (S, components); raises `InputError` if that is not possible."""
    rows = floats_of(values)
    wanted = {1: "one finite number is", 3: "three finite numbers are"}.get(load.components, "six finite numbers are")
    if rows.ndim != 2 or rows.shape[1] != load.components:
        shown = shorten(repr(values), 100, placeholder=" ...]")
        raise InputError(f"{load.quantity} values = {shown} are not allowed: rows of {wanted} needed.")
    wrong = np.flatnonzero(~np.isfinite(rows).all(axis=1))
    if len(wrong):
        shown = f"{load.quantity} values[{wrong[0]}] = {rows[wrong[0]].tolist()}"
        raise InputError(f"{shown} are not allowed: {wanted} needed.")
    return rows


def _checked_triangles(obstacles: object) -> np.ndarray:
    """Convert the corners of triangles to an array (K, 3, 3); raises `InputError` if that is not possible."""
    corners = floats_of(obstacles)
    if corners.ndim != 3 or corners.shape[1:] != (3, 3) or not np.all(np.isfinite(corners)):
        raise refusal("obstacles", obstacles, "an array (K, 3, 3) of finite corners of triangles is needed")
    return corners
