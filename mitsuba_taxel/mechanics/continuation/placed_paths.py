"""Load paths of an indenter on meshes that are fine wherever the indenter moves, and fine enough for its depth.

Without friction a state does not depend on the path of the body: a dragged body gives the same state as a body that
starts above its final position. With friction, the mesh is fine along the whole path.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mitsuba_taxel.mechanics.contact.resolution import LARGEST, LARGEST_IF_REFINABLE, Unresolved
from mitsuba_taxel.mechanics.continuation.pad_path import PadPath
from mitsuba_taxel.mechanics.continuation.state import State
from mitsuba_taxel.mechanics.local_mesh import CLOSE, SMALL_DEPTH, swept_legs
from mitsuba_taxel.mechanics.meshes import pad_mesh

SHALLOWER, MOST_FINER = 0.25, 3
"""Ratio of successive depths for which elements are made smaller, and the largest number of such refinements."""


def path_along(path: PadPath, values: Sequence[Sequence[float]]) -> PadPath:
    """The load path on a mesh that is fine along the movement of an indenter through a sequence of positions.

    Parameters
    ----------
    values : sequence of sequence of float
        Positions (x, y, z) in mm. A few additional values seldom change the elements; see :func:`swept_legs`.
    """
    reach = _reach(path)
    if math.isinf(reach):
        return path
    legs = swept_legs([(x, y, z) for x, y, z in values], reach)
    return path.like(refinement=replace(path.refinement, legs=legs)) if legs else path


def _reach(path: PadPath) -> float:
    """Half the width in mm of the region around the start of an indenter in which elements are small enough for its
    contact; infinite for a plate or without an indenter."""
    indenter = path.load.moved_indenter
    if indenter is None:
        return math.inf
    height = float(np.ptp(pad_mesh(path.pad, path.mesh_size).points[:, 2]))
    return indenter.body.contact_radius(SMALL_DEPTH * height)


def placed_path(path: PadPath, value: np.ndarray) -> tuple[PadPath, np.ndarray]:
    """The load path of an indenter that starts directly above its final position.

    The given path and value are returned if the position is so close to the start of the indenter that elements are
    small enough there.

    Parameters
    ----------
    path : PadPath
        The path.
    value : (c,) ndarray
        Value of the load, in N, mm or MPa.

    Returns
    -------
    path : PadPath
        Path with elements that are small enough around its start.
    moved : (3,) ndarray
        Displacement of the indenter from its start, mm.
    """
    load: Any = path.load
    if load.moved_indenter is None or math.hypot(*value[:2]) <= CLOSE * _reach(path):
        return path, value
    x, y = (float(start + shift) for start, shift in zip(load.indenter.at, value[:2], strict=True))
    return path.like(replace(load, indenter=replace(load.indenter, at=(x, y)))), np.array([0.0, 0.0, value[2]])


def solved_on(
    path: PadPath, value: np.ndarray, obstacles: np.ndarray | None = None
) -> tuple[PadPath, np.ndarray, State]:
    """State under an indenter, solved on a mesh that resolves the contact. Also returns the load path on this mesh, and
    the value of the load on this path.

    If the contact is small, elements around the tip of the indenter are refined until they resolve it.

    Raises
    ------
    ComputationError
        if the path ends before this load, or elements do not resolve the contact.
    """
    path, there = placed_path(path, value)
    indenter = path.load.indenter
    finer = indenter is not None and indenter.body.finer_when_shallow and not path.load.self_contact
    refinements = MOST_FINER if finer else 0
    while True:
        try:
            largest = LARGEST_IF_REFINABLE if refinements else LARGEST
            path.refuse_unresolved(there, None, largest)
            state = path.state(there, obstacles)
            path.refuse_unresolved(there, state.displacement, largest)
            return path, there, state
        except Unresolved:
            if not refinements:
                raise
        refinements -= 1
        path = path.like(refinement=replace(path.refinement, depth=SHALLOWER * path.refinement.depth))
