"""States under an indenter at positions that are mirror images of each other in planes of symmetry of the pad: only one
of these states is solved.

A ball at (x, y) on a symmetric pad deforms it into the mirror image of the pad under the ball at (-x, y). The position
on the kept side of all planes of symmetry (mirrors) is called canonical, and only its state is solved. The states at
the other positions are mirror images of this state on the mirrored mesh, equal in every bit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.geometry.mirror import MIRRORS, Mirror, mirror_image
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.continuation.load_path_ends import LoadPathEnds
from mitsuba_taxel.mechanics.continuation.pad_path import PadPath
from mitsuba_taxel.mechanics.continuation.state import PathRate, State, StateComparison
from mitsuba_taxel.mechanics.elements.symmetry import node_images
from mitsuba_taxel.mechanics.local_mesh import cells_of_images
from mitsuba_taxel.mechanics.meshes import pad_mesh

Mirrors = tuple[Mirror, ...]


def canonical_place(path: PadPath, value: np.ndarray) -> tuple[PadPath, np.ndarray, Mirrors]:
    """Map the position of an indenter on a symmetric pad to its canonical position. This is the one of all mirror
    images of the position at which the state is solved.

    Parameters
    ----------
    path : PadPath
        Path under an indenter without friction, or under another load.
    value : (c,) ndarray
        Value of the load, in N, mm or MPa.

    Returns
    -------
    path : PadPath
        Path at the canonical place; the same path if the place is canonical, or the load has no place.
    value : (c,) ndarray
        Value of the load there.
    mirrors : tuple of Mirror
        Mirrors that map the place to the canonical place, in this order.
    """
    load: Any = path.load
    if load.indenter is None or not load.has_position:
        return path, value, ()
    place, used = np.array([*load.indenter.at, 0.0]), []
    if all(mirror.side(place) >= 0 for mirror in MIRRORS):
        return path, value, ()
    upright = replace(load.indenter, at=(0.0, 0.0)).body
    images = _images(pad_mesh(path.pad, path.mesh_size))
    for mirror in MIRRORS:
        symmetric = mirror in images and upright.keeps(mirror)
        if symmetric and mirror.side(place) < 0 and (path.bodies is None or path.bodies.kept_by(mirror)):
            place, value = mirror.image(place), mirror.image(value)
            used.append(mirror)
    if not used:
        return path, value, ()
    x, y, _ = place.tolist()
    return path.like(replace(load, indenter=replace(load.indenter, at=(x, y)))), value, tuple(used)


def solved_by_symmetry(
    path: PadPath,
    value: np.ndarray,
    obstacles: np.ndarray | None,
    solve: Callable[[PadPath, np.ndarray, np.ndarray | None], State],
) -> State:
    """State of the pad under an indenter, computed as the mirror image of the state under the same indenter at the
    canonical position.

    If no state exists there, none exists at the requested position, which the error message names. If the message
    cannot be mirrored, the load is solved at the requested position.

    Parameters
    ----------
    path : PadPath
        The path.
    value : (c,) ndarray
        Value of the load, in N, mm or MPa.
    obstacles : (K, 3, 3) ndarray or None
        Corners of the triangles of obstacles, mm.
    solve : Callable
        Function that solves a path under a value between obstacles.

    Returns
    -------
    State
        The state.

    Raises
    ------
    LoadPathEnds
        if the path ends before this load.
    """
    canonical, there, mirrors = canonical_place(path, value)
    if not mirrors:
        return solve(path, value, obstacles)
    images = obstacles
    if images is not None:
        for mirror in mirrors:
            images = mirror.image(images)
    try:
        return mirrored_state(path, solve(canonical, there, images), mirrors)
    except LoadPathEnds as end:
        here = end.mirrored(path.load, tuple(reversed(mirrors)))
        if here is not None:
            raise here from end
    except (ComputationError, InputError):
        pass
    return solve(path, value, obstacles)


def mirrored_state(path: PadPath, state: State, mirrors: Mirrors) -> State:
    """Mirror a state that was solved at the canonical position of an indenter. The result is the state at the requested
    position.

    Parameters
    ----------
    path : PadPath
        The path of the body at its own place.
    state : State
        State at the canonical place, without memory.
    mirrors : tuple of Mirror
        Mirrors that map the place to the canonical place, in this order.

    Returns
    -------
    State
        The mirrored state, of the load of ``path``; the same state without mirrors.
    """
    if not mirrors:
        return state

    def back(vectors: np.ndarray) -> np.ndarray:
        for mirror in reversed(mirrors):
            vectors = mirror.image(vectors)
        return vectors

    def comparison() -> StateComparison:
        compared = state.second_mesh()
        deviate = compared.deviate
        return compared._replace(deviate=deviate and (lambda: back(deviate())))

    def rate() -> PathRate | None:
        along = state.path_rate()
        return along and PathRate(back(along.direction), back(along.displacement))

    moved = state.indenter_moved
    return replace(
        state,
        mesh=mirrored_mesh(state.mesh, pad_mesh(path.pad, path.mesh_size), tuple(reversed(mirrors))),
        load=path.load,
        value=back(state.value),
        displacement=back(state.displacement),
        second_mesh=comparison,
        path_rate=rate,
        indenter_moved=None if moved is None else back(moved),
    )


@kept(8)
def mirrored_mesh(mesh: VolumeMesh, common: VolumeMesh, mirrors: Mirrors) -> VolumeMesh:
    """Reflect a refined mesh in several planes of symmetry, one after the other. Nodes keep their numbers.

    Parameters
    ----------
    mesh : VolumeMesh
        The refined mesh.
    common : VolumeMesh
        Mesh of the same pad that the mirrors map onto itself.
    mirrors : tuple of Mirror
        The mirrors.

    Returns
    -------
    VolumeMesh
        Mirror image, on which a cell has the number of the cell at its position.
    """
    for mirror in mirrors:
        mesh = mirror_image(mesh, mirror, cells_of_images(common, mirror, _images(common)[mirror]))
    return mesh


@kept(16)
def _images(mesh: VolumeMesh) -> dict[Mirror, np.ndarray]:
    return node_images(mesh)
