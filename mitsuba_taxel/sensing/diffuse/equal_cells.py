"""Cells that are equal by a symmetry of pad and deformation: one of them represents the others."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.pads import Pad
from mitsuba_taxel.sensing.diffuse.diffuse_cells import DiffuseCells
from mitsuba_taxel.sensing.diffuse.diffuse_taxels import Taxel
from mitsuba_taxel.transport.box import Box
from mitsuba_taxel.transport.laws.ends import End

if TYPE_CHECKING:
    from mitsuba_taxel.mechanics import State

EQUAL, ALIKE = 1e-7, 1e-2
"""Largest difference, relative to the maximum, of nodal fields from their mirror images; the same for their errors."""
PLACED = 1e-6
"""Largest difference of the places of equal ends in their cells, relative to the cell's size: single precision."""


def equal_cells(
    cells: DiffuseCells, state: State, fields: Sequence[np.ndarray], errors: Sequence[np.ndarray] = ()
) -> list[int]:
    """The number of the first cell that each cell is equal to, its own if there is none.

    Parameters
    ----------
    state : State
        Of the pad, on any elements.
    fields, errors : Sequence[ndarray]
        Vectors (N, 3) at its nodes, on which the results of cells, and their errors, depend.
    """
    from mitsuba_taxel.mechanics.equilibrium.pad_parts import mirror_images

    first = list(range(len(cells.taxels)))
    for mirror, image in mirror_images(state.mesh, state.load).items():
        bounds = [(field, EQUAL) for field in fields] + [(field, ALIKE) for field in errors]
        if not all(_close(mirror.image(field[image]), field, bound) for field, bound in bounds):
            continue
        for number, taxel in enumerate(cells.taxels):
            for other in range(number):
                there = cells.taxels[other]
                ends = (taxel.led, there.led), (taxel.phototransistor, there.phototransistor)
                if (
                    all(_mirrored(mirror, *pair) for pair in ends)
                    and taxel.power == there.power
                    and _same_size(taxel.body, there.body)
                    and cells.walls_alike(other, number)
                ):
                    first[number] = min(first[number], first[other])
    return first


def equal_at_rest(cells: DiffuseCells) -> list[int]:
    """As :func:`equal_cells`, of a pad without a load: built-in cells are equal but for their place."""
    first = list(range(len(cells.taxels)))
    if not isinstance(cells.pad.pad, Pad):
        return first
    centres = np.array(cells.pad.pad.cell_centres)
    places = [centres[np.linalg.norm(centres - taxel.middle, axis=1).argmin()] for taxel in cells.taxels]
    for number, taxel in enumerate(cells.taxels):
        for other in range(number):
            there, shift = cells.taxels[other], np.append(places[number] - places[other], 0.0)
            ends = (taxel.led, there.led), (taxel.phototransistor, there.phototransistor)
            if (
                all(_shifted(shift, *pair, PLACED * cells.pad.pad.cell_size) for pair in ends)
                and taxel.power == there.power
                and _same_size(taxel.body, there.body)
                and _same_shares(taxel, there)
            ):
                first[number] = first[other]
                break
    return first


def _shifted(shift: np.ndarray, end: End, other: End, bound: float) -> bool:
    if end.law != other.law or end.points.shape != other.points.shape:
        return False
    alike = _close(end.weights, other.weights) and _close(end.normal, other.normal)
    return alike and bool(np.abs(end.points - shift - other.points).max() <= bound)


def _mirrored(mirror: Mirror, end: End, other: End) -> bool:
    """Whether an end is the image of another, judged by mean and spread of its points."""
    image = mirror.image(other.points)
    if not _close(end.points.mean(axis=0), image.mean(axis=0)):
        return False
    normals = end.normal, mirror.image(other.normal)
    spreads = (np.cov(points.T, aweights=each.weights) for points, each in ((end.points, end), (image, other)))
    sums = np.array([[end.weights.sum()], [other.weights.sum()]])
    return end.law == other.law and all(_close(*pair) for pair in (normals, spreads, sums))


def _same_size(body: Box | None, other: Box | None) -> bool:
    """Whether packages, which move with their LEDs, have the same size."""
    return body is other is None or (body is not None and other is not None and _close(body.half, other.half))


def _same_shares(taxel: Taxel, other: Taxel) -> bool:
    """Whether the faces of their packages scatter equally."""
    one, there = (np.zeros(0) if each.package is None else each.package.shares for each in (taxel, other))
    return np.array_equal(one, there)


def _close(one: np.ndarray, other: np.ndarray, bound: float = EQUAL) -> bool:
    return bool(np.abs(one - other).max() <= bound * np.abs(other).max())
