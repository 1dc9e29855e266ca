"""Compliance of the top of a pad: a grid of patches over the top, and the displacement of the pad by a force on each
patch.

The matrix of the mean normal displacements of the patches by forces on them is symmetric, because both use the same
weights (J. C. Maxwell, Phil. Mag. 27, 1864).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse

from mitsuba_taxel.base.arguments import is_number, refusal
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.derivatives.linearised_state import LinearisedState
from mitsuba_taxel.mechanics.elements.loads import PatchForce
from mitsuba_taxel.mechanics.elements.loads.load import top_faces

MOST_PATCHES = 2500
"""Largest number of patches: one back-solve each, and a matrix of 50 MB."""
AT_ONCE = 16
"""Number of patches that are solved at once."""
FLAT_TOP = 1e-6
"""Largest difference of heights on a plane top, relative to the height of the pad."""
COVERED = 0.5
"""Smallest fraction of a patch that the top must cover; a patch with less is no part of the model."""


@dataclass(frozen=True, eq=False)
class TopGrid:
    """Rectangular patches in rows and columns over the plane top of a pad.

    Attributes
    ----------
    x : (columns,) ndarray
        Centres of the columns in mm, ascending.
    y : (rows,) ndarray
        Centres of the rows in mm, descending, like the rows of taxels.
    size : (float, float)
        Size of a patch along x and y in mm.
    height : float
        Height of the top above the board in mm.
    covered : (rows, columns) ndarray of bool
        Patches at least half of which lie on the top.
    """

    x: np.ndarray
    y: np.ndarray
    size: tuple[float, float]
    height: float
    covered: np.ndarray

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of rows and columns."""
        return self.covered.shape

    @property
    def points(self) -> np.ndarray:
        """Centres (rows, columns, 3) of the patches in mm."""
        x, y = np.meshgrid(self.x, self.y)
        return np.stack([x, y, np.full_like(x, self.height)], axis=-1)


def top_grid(mesh: VolumeMesh, spacing: float) -> tuple[TopGrid, sparse.csr_array]:
    """Divide the plane top of a pad into patches.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of the undeformed pad.
    spacing : float
        Approximate side of a patch in mm: the sides of the top are divided into equal parts.

    Returns
    -------
    grid : TopGrid
        The grid.
    weights : (m, N) csr_array
        For each of the m covered patches, row by row, the fraction of its force on each of N nodes. They sum to 1, and
        are the weights of the mean displacement of the patch.

    Raises
    ------
    InputError
        if the top is not a plane, or the spacing is not allowed.
    """
    if not (is_number(spacing) and spacing > 0):
        raise refusal("spacing", spacing, "a finite length in mm above 0 is needed")
    top = mesh.points[np.unique(top_faces(mesh))]
    low, high = top.min(axis=0), top.max(axis=0)
    if high[2] - low[2] > FLAT_TOP * np.ptp(mesh.points[:, 2]):
        raise InputError(
            f"a contact model needs a plane top: the heights of this one differ by {high[2] - low[2]:.3g} mm."
        )
    columns, rows = (max(1, round(side / spacing)) for side in (high - low)[:2].tolist())
    if rows * columns > MOST_PATCHES:
        raise refusal(
            "spacing", spacing, f"this top has {rows * columns} patches, at most {MOST_PATCHES} are possible"
        )
    width, depth = ((high - low)[:2] / (columns, rows)).tolist()
    x = low[0] + width * (np.arange(columns) + 0.5)
    y = high[1] - depth * (np.arange(rows) + 0.5)
    kept, covered = [], np.zeros((rows, columns), dtype=bool)
    for row, column in np.ndindex(rows, columns):
        areas = PatchForce((x[column], y[row]), (width, depth)).nodal(mesh)
        covered[row, column] = areas.sum() >= COVERED * width * depth
        if covered[row, column]:
            kept.append(sparse.csr_array(areas / areas.sum()))
    return TopGrid(x, y, (width, depth), float(high[2]), covered), sparse.csr_array(sparse.vstack(kept))


def patch_responses(
    linear: LinearisedState, weights: sparse.csr_array, direction: Sequence[float] | np.ndarray = (0.0, 0.0, -1.0)
) -> Iterator[np.ndarray]:
    """Displacement of the pad, to first order, when 1 N is spread over one patch of the top; for each patch in turn.

    Parameters
    ----------
    linear : LinearisedState
        The linearised pad, whose top is free.
    weights : (m, N) csr_array
        Weights from :func:`top_grid`.
    direction : (3,) array_like
        Unit vector along the forces; by default downwards.

    Yields
    ------
    (N, 3) ndarray
        Displacement of each node, in mm per N.
    """
    for first in range(0, weights.shape[0], AT_ONCE):
        rows = weights[first : first + AT_ONCE].toarray()
        yield from linear.by_many_forces(rows[..., None] * np.asarray(direction))
