"""Cells that are equal by a symmetry of pad and deformation: one of them represents the others."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.sensing.diffuse_cells import DiffuseCells
from mitsuba_taxel.transport.box import Box
from mitsuba_taxel.transport.ends import End

if TYPE_CHECKING:
    from mitsuba_taxel.mechanics import State

EQUAL, ALIKE = 1e-7, 1e-2
"""Largest difference, relative to the maximum, of nodal fields from their mirror images; the same for their errors."""


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
    from mitsuba_taxel.mechanics.path.loaded_pads import mirror_images

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


def _close(one: np.ndarray, other: np.ndarray, bound: float = EQUAL) -> bool:
    return bool(np.abs(one - other).max() <= bound * np.abs(other).max())
