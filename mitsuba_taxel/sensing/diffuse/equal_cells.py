"""Groups of cells that are equal by a symmetry of the pad and its deformation; only the first cell of each group is
solved."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.pads import Pad
from mitsuba_taxel.sensing.diffuse.diffuse_cells import DiffuseCells
from mitsuba_taxel.transport.box import Box
from mitsuba_taxel.transport.laws.ends import End

if TYPE_CHECKING:
    from mitsuba_taxel.mechanics import State

EQUAL, ALIKE = 1e-7, 1e-2
"""Largest difference between a nodal field and its mirror image, relative to the maximum: for displacements, and for
their errors."""
PLACED = 1e-6
"""Largest difference between the positions of equal LEDs or phototransistors in their cells, relative to the cell size.
Positions have single precision."""


def equal_cells(
    cells: DiffuseCells, state: State, fields: Sequence[np.ndarray], errors: Sequence[np.ndarray] = ()
) -> list[int]:
    """For each cell, find the index of the first cell that is its mirror image, so that both have the same reading.

    Parameters
    ----------
    cells : DiffuseCells
        All cells of a scene.
    state : State
        State of the pad, on any mesh.
    fields, errors : Sequence[ndarray]
        Vectors (N, 3) at the N nodes of this mesh on which the results of cells (``fields``) and their errors
        (``errors``) depend, such as displacements.

    Returns
    -------
    list[int]
        Index for each cell; that of the cell itself if no earlier cell is equal.
    """
    from mitsuba_taxel.mechanics.equilibrium.pad_parts import mirror_images

    first = list(range(len(cells.taxels)))
    for mirror, image in mirror_images(state.mesh, state.load).items():
        bounds = [(field, EQUAL) for field in fields] + [(field, ALIKE) for field in errors]
        if not all(_close(mirror.image(field[image]), field, bound) for field, bound in bounds):
            continue
        candidates = _near_images(mirror, [taxel.led.points.mean(axis=0) for taxel in cells.taxels])
        for number, taxel in enumerate(cells.taxels):
            for earlier in (other for other in candidates[number] if other < number):
                equal = cells.taxels[earlier]
                ends = (taxel.led, equal.led), (taxel.phototransistor, equal.phototransistor)
                if (
                    all(_mirrored(mirror, *pair) for pair in ends)
                    and taxel.power == equal.power
                    and _same_size(taxel.body, equal.body)
                    and cells.walls_alike(earlier, number)
                ):
                    first[number] = min(first[number], first[earlier])
    return first


def equal_at_rest(cells: DiffuseCells) -> list[int]:
    """For each cell of an unloaded pad, find the index of the first cell that equals it up to a translation, so that
    both have the same reading.

    Parameters
    ----------
    cells : DiffuseCells
        All cells of a scene.

    Returns
    -------
    list[int]
        Index for each cell; that of the cell itself if no earlier cell is equal.
    """
    first = list(range(len(cells.taxels)))
    if not isinstance(cells.pad.pad, Pad):
        return first
    centres = np.array(cells.pad.pad.cell_centres)
    origins = [centres[np.linalg.norm(centres - taxel.middle, axis=1).argmin()] for taxel in cells.taxels]
    for number, taxel in enumerate(cells.taxels):
        for earlier in range(number):
            equal, shift = cells.taxels[earlier], np.append(origins[number] - origins[earlier], 0.0)
            ends = (taxel.led, equal.led), (taxel.phototransistor, equal.phototransistor)
            scattered, of_equal = (
                np.zeros(0) if package is None else package.fractions for package in (taxel.package, equal.package)
            )
            if (
                all(_shifted(shift, *pair, PLACED * cells.pad.pad.cell_size) for pair in ends)
                and taxel.power == equal.power
                and _same_size(taxel.body, equal.body)
                and np.array_equal(scattered, of_equal)
            ):
                first[number] = first[earlier]
                break
    return first


def _near_images(mirror: Mirror, points: Sequence[np.ndarray]) -> list[list[int]]:
    """For each of n points (3,), the ascending indices of the points whose mirror image is near to it.

    A search in a tree replaces the comparison of all pairs, whose number grows with the square of n.
    """
    images = mirror.image(np.array(points))
    radius = 2 * EQUAL * float(np.abs(images).max())
    return [sorted(near) for near in cKDTree(images).query_ball_point(np.array(points), radius, p=np.inf)]


def _shifted(shift: np.ndarray, end: End, origin: End, bound: float) -> bool:
    """Whether an LED or phototransistor ``end`` is a copy of another, ``origin``, translated by ``shift`` (3,)."""
    if end.law != origin.law or end.points.shape != origin.points.shape:
        return False
    alike = _close(end.weights, origin.weights) and _close(end.normal, origin.normal)
    return alike and bool(np.abs(end.points - shift - origin.points).max() <= bound)


def _mirrored(mirror: Mirror, end: End, origin: End) -> bool:
    """Whether an LED or phototransistor ``end`` is the mirror image of another, ``origin``, judged by mean and spread
    of its quadrature points."""
    image = mirror.image(origin.points)
    if not _close(end.points.mean(axis=0), image.mean(axis=0)):
        return False
    normals = end.normal, mirror.image(origin.normal)
    spreads = np.cov(end.points.T, aweights=end.weights), np.cov(image.T, aweights=origin.weights)
    sums = np.array([[end.weights.sum()], [origin.weights.sum()]])
    return end.law == origin.law and all(_close(*pair) for pair in (normals, spreads, sums))


def _same_size(first: Box | None, second: Box | None) -> bool:
    """Whether two packages have the same size, or both are None; their positions follow from those of their LEDs."""
    return first is second is None or (first is not None and second is not None and _close(first.half, second.half))


def _close(first: np.ndarray, second: np.ndarray, bound: float = EQUAL) -> bool:
    return bool(np.abs(first - second).max() <= bound * np.abs(second).max())
