"""A second-order tetrahedral mesh with a tagged surface."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

TET_EDGES = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))
"""Corners whose edge carries nodes 4 to 9 of a tetrahedron (the order of VTK)."""

NODES = 4 + len(TET_EDGES)
"""Nodes of a tetrahedron: its corners, and one on each edge."""

TET_FACES = ((0, 2, 1, 6, 5, 4), (0, 1, 3, 4, 8, 7), (1, 2, 3, 5, 9, 8), (0, 3, 2, 7, 9, 6))
"""Nodes of the faces of a tetrahedron, as :class:`VolumeMesh` lists them."""

FACE_EDGES = ((0, 1), (1, 2), (2, 0))
"""Corners whose edge carries nodes 3 to 5 of a triangle."""


@dataclass(frozen=True, eq=False)
class VolumeMesh:
    """Curved tetrahedra and the curved triangles of their surface; the arrays are read-only.

    Attributes
    ----------
    points : (N, 3) ndarray
        Nodes in mm, undeformed; the corners of all elements come first.
    tets : (M, 10) ndarray
        Nodes of each tetrahedron: corners, positively oriented, then edges as in :data:`TET_EDGES`.
    faces : (B, 6) ndarray
        Nodes of each boundary triangle, corners counter-clockwise seen from outside, then edges as in
        :data:`FACE_EDGES`.
    face_region : (B,) ndarray
        Region code.
    face_cell : (B,) ndarray
        Number of the cell that a roof or side belongs to, 0 elsewhere.
    """

    points: np.ndarray
    tets: np.ndarray
    faces: np.ndarray
    face_region: np.ndarray
    face_cell: np.ndarray

    def __post_init__(self) -> None:
        for field in fields(self):
            getattr(self, field.name).setflags(write=False)

    @property
    def corner_count(self) -> int:
        """Number of nodes that are corners of elements."""
        return int(self.tets[:, :4].max()) + 1
