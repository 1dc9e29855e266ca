"""Mirror planes of pads, and meshes completed by their mirror images."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mitsuba_taxel.geometry.volume_mesh import VolumeMesh

_TET_SWAP = [0, 2, 1, 3, 6, 5, 4, 7, 9, 8]
_FACE_SWAP = [0, 2, 1, 5, 4, 3]


@dataclass(frozen=True)
class Mirror:
    """A vertical plane through the origin; every reflection in it is exact in floating point.

    Attributes
    ----------
    normal : tuple[int, int]
        (nx, ny) of the plane, towards the kept side; components are -1, 0 or 1.
    """

    name: str
    normal: tuple[int, int]

    def side(self, points: np.ndarray) -> np.ndarray:
        """Side of the mirror plane on which points (..., 3) lie: an array (...,), positive on the kept side and exactly
        0 on the plane.
        """
        return self.normal[0] * points[..., 0] + self.normal[1] * points[..., 1]

    def image(self, vectors: np.ndarray) -> np.ndarray:
        """Reflect vectors or points (..., 3) in the mirror plane."""
        image = np.array(vectors, dtype=float)
        if self.normal[0] and self.normal[1]:
            sign = -self.normal[0] * self.normal[1]
            image[..., 0], image[..., 1] = sign * vectors[..., 1], sign * vectors[..., 0]
        else:
            image[..., 0 if self.normal[0] else 1] *= -1
        return image + 0.0  # no negative zeros


ACROSS_X = Mirror("x", (1, 0))
ACROSS_Y = Mirror("y", (0, 1))
ACROSS_SECOND_DIAGONAL = Mirror("-xy", (1, 1))
ACROSS_DIAGONAL = Mirror("xy", (1, -1))

MIRRORS = (ACROSS_X, ACROSS_Y, ACROSS_SECOND_DIAGONAL, ACROSS_DIAGONAL)
"""Order of the mirrors: if a point is reflected to the kept side of each plane in this order, it ends on the kept sides
of all planes."""


def mirror_image(mesh: VolumeMesh, mirror: Mirror, cells: np.ndarray) -> VolumeMesh:
    """The mirror image of a mesh, whose nodes, elements and faces keep their numbers.

    Parameters
    ----------
    mesh : VolumeMesh
        The mesh.
    mirror : Mirror
        The plane.
    cells : (cells + 1,) ndarray of int
        Number of the mirror image of each cell; 0 for 0, which is no cell.

    Returns
    -------
    VolumeMesh
        The image.
    """
    return VolumeMesh(
        mirror.image(mesh.points),
        mesh.tets[:, _TET_SWAP],
        mesh.faces[:, _FACE_SWAP],
        mesh.face_region,
        cells[mesh.face_cell],
    )


def mirrored(mesh: VolumeMesh, mirror: Mirror) -> VolumeMesh:
    """A mesh joined with its mirror image; both share the nodes on the plane.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh on one side of the plane.
    mirror : Mirror
        The plane, on which nodes lie exactly.

    Returns
    -------
    VolumeMesh
        Mesh with the nodes of the original mesh first.
    """
    on_plane = mirror.side(mesh.points) == 0
    image = np.arange(len(mesh.points))
    image[~on_plane] = len(mesh.points) + np.arange(np.count_nonzero(~on_plane))
    return VolumeMesh(
        np.concatenate([mesh.points, mirror.image(mesh.points[~on_plane])]),
        np.concatenate([mesh.tets, image[mesh.tets[:, _TET_SWAP]]]),
        np.concatenate([mesh.faces, image[mesh.faces[:, _FACE_SWAP]]]),
        np.concatenate([mesh.face_region, mesh.face_region]),
        np.concatenate([mesh.face_cell, mesh.face_cell]),
    )
