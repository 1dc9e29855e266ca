"""Size of the finite elements of a pad, given or chosen by an error target."""

from __future__ import annotations

import math

import numpy as np

from mitsuba_taxel.base.arguments import is_number, refusal
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.mechanics.continuation.pad_path import pad_path
from mitsuba_taxel.mechanics.continuation.path_problem import lock_of
from mitsuba_taxel.mechanics.elements.loads import SPREAD_FORCE, Load
from mitsuba_taxel.mechanics.errors.second_meshes import second_meshes
from mitsuba_taxel.mechanics.materials.laws import Material
from mitsuba_taxel.pads.any_pad import AnyPad
from mitsuba_taxel.pads.parametric.pad import Pad

COARSEST = 0.35
"""Size of the coarsest elements tried by `mesh_size_for`, relative to the pad's height."""
SIZES = 9
"""Number of sizes tried, each 1 / sqrt(2) of the one before."""
MOST_ELEMENTS_TRIED = 100_000
"""Largest mesh tried: without symmetry, its solution takes some 10 GB."""


def mesh_size_for(pad: AnyPad, material: Material, load: Load, tolerance: float) -> float:
    """The coarsest of a sequence of mesh sizes [mm] whose error is within ``tolerance`` under a small load.

    The error is ``relative`` of :class:`RoofError`, for the change from rest under a small normal load and, if the load
    has a direction, under a small tangential load. Under larger loads the error may be larger; it is reported with the
    state.

    Parameters
    ----------
    pad : AnyPad
        The pad.
    material : Material
        Silicone of the pad.
    load : Load
        Kind of load.
    tolerance : float
        Relative error, above 0 and below 1.

    Returns
    -------
    float
        Size of the elements in mm.

    Raises
    ------
    InputError
        if the tolerance is not a number between 0 and 1, or cannot be reached.
    ComputationError
        if the pad cannot be meshed.
    """
    if not 0 < tolerance < 1:
        raise InputError(f"mesh_tolerance = {tolerance:g} is not allowed: above 0 and below 1 is needed.")
    error = math.inf
    with lock_of(pad):
        size = COARSEST * _height(pad)
        for _ in range(SIZES):
            path = pad_path(pad, material, load, size)
            if len(path.mesh.tets) > MOST_ELEMENTS_TRIED:
                break
            error = second_meshes(path).small_load_error
            if error <= tolerance:
                return size
            size /= math.sqrt(2)
    reached = f"the finest mesh tried, of {size * math.sqrt(2):.2g} mm, has an error of {error:.2g}"
    if math.isinf(error):
        reached = f"the error of no mesh of at most {MOST_ELEMENTS_TRIED} elements can be estimated"
    raise InputError(f"mesh_tolerance = {tolerance:g} is not allowed: {reached}.")


def _height(pad: AnyPad) -> float:
    return pad.height if isinstance(pad, Pad) else float(np.ptp(pad.mesh(pad.default_mesh_size).points[:, 2]))


def chosen_size(pad: AnyPad, material: Material, load: Load, size: float | None, tolerance: float | None) -> float:
    """The mesh size: the given size, the size that a tolerance requires, or the pad's default.

    Parameters
    ----------
    pad : AnyPad
        The pad.
    material : Material
        Elastic law of the silicone.
    load : Load
        Kind of load.
    size : float or None
        Requested mesh size in mm.
    tolerance : float or None
        Target for the relative error; see :func:`mesh_size_for`.

    Returns
    -------
    float
        Mesh size in mm.

    Raises
    ------
    InputError
        if the size or the tolerance is not allowed, or both are given.
    """
    for name, value in (("mesh_size", size), ("mesh_tolerance", tolerance)):
        if not (value is None or is_number(value)):
            raise refusal(name, value, "a finite number is needed")
    if size is not None and tolerance is not None:
        raise InputError(f"mesh_size = {size:g} and mesh_tolerance = {tolerance:g} are given: remove one.")
    if tolerance is not None:
        # At rest an indenter touches nothing: the size for a force on the top is used, and refined under the indenter.
        return mesh_size_for(pad, material, load if load.indenter is None else SPREAD_FORCE, tolerance)
    return pad.default_mesh_size if size is None else float(size)
