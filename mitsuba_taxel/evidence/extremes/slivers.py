"""A pad whose mesh contains slivers (very flat elements) on purpose."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from mitsuba_taxel.geometry.element_maps import jacobians
from mitsuba_taxel.geometry.volume_mesh import TET_EDGES, VolumeMesh
from mitsuba_taxel.pads.parametric.pad import Pad

FLATNESS = 0.01
"""Height of a flattened element, relative to the original one."""


@dataclass(frozen=True)
class SliverPad(Pad):
    """A pad whose mesh contains slivers: many inner corners lie almost in the opposite face of one of their elements.

    The mesh has no symmetry, so that the whole pad is solved.
    """

    @property
    def identity(self) -> dict[str, object]:
        """Key of the pad for caches, as JSON values."""
        return super().identity | {"flatness": FLATNESS}

    def mesh(self, mesh_size: float, of_origin: Callable[[Pad, float], VolumeMesh] | None = None) -> VolumeMesh:
        """The volume mesh of the pad, with slivers."""
        return with_slivers(super().mesh(mesh_size, of_origin))


def with_slivers(mesh: VolumeMesh) -> VolumeMesh:
    """Flatten elements of a mesh by moving some of its inner corners, no two of the same element.

    The edges at a moved corner become straight. A corner is not moved if an element would be inverted.
    """
    # Elements by corner: those of corner i are order[begin[i] : begin[i + 1]] // 4.
    points, tets = mesh.points.copy(), mesh.tets
    order = np.argsort(tets[:, :4].ravel(), kind="stable")
    begin = np.searchsorted(tets[:, :4].ravel()[order], np.arange(mesh.corner_count + 1))
    fixed = np.zeros(len(points), dtype=bool)
    fixed[mesh.faces] = True
    for corner in range(mesh.corner_count):
        adjacent = tets[order[begin[corner] : begin[corner + 1]] // 4]
        if not fixed[corner] and _flatten(points, corner, adjacent):
            fixed[adjacent[:, :4]] = True
    return replace(mesh, points=points)


def _flatten(points: np.ndarray, corner: int, tets: np.ndarray) -> bool:
    """Move a corner almost into the opposite face of one of the elements ``tets`` (K, 10) that share it.

    Returns whether all of these elements stay valid; if not, the points are unchanged.
    """
    before = points[tets]
    for tet in tets[:, :4]:
        base = points[tet[tet != corner]].mean(axis=0)
        points[corner] = base + FLATNESS * (points[corner] - base)
        for node, ends in enumerate(TET_EDGES, start=4):
            at_corner = (tets[:, list(ends)] == corner).any(axis=1)
            points[tets[at_corner, node]] = points[tets[at_corner][:, list(ends)]].mean(axis=1)
        if _valid(points, tets):
            return True
        points[tets] = before
    return False


def _valid(points: np.ndarray, tets: np.ndarray) -> bool:
    corners = points[tets[:, :4]]
    volume = np.linalg.det(corners[:, 1:] - corners[:, :1])
    return bool((volume > 0).all() and (jacobians(points, tets) > 0).all())
