"""Complete a mesh of half a body by its mirror image."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.pads.volume_mesh import VolumeMesh

_TET_SWAP = [0, 2, 1, 3, 6, 5, 4, 7, 9, 8]
_FACE_SWAP = [0, 2, 1, 5, 4, 3]


def mirrored(mesh: VolumeMesh, axis: int) -> VolumeMesh:
    """The mesh and its image in the plane where coordinate ``axis`` is 0, joined in the nodes on that plane."""
    on_plane = mesh.points[:, axis] == 0
    image = np.arange(len(mesh.points))
    image[~on_plane] = len(mesh.points) + np.arange(np.count_nonzero(~on_plane))
    reflected = mesh.points[~on_plane].copy()
    reflected[:, axis] *= -1
    return VolumeMesh(
        np.concatenate([mesh.points, reflected]),
        np.concatenate([mesh.tets, image[mesh.tets[:, _TET_SWAP]]]),
        np.concatenate([mesh.faces, image[mesh.faces[:, _FACE_SWAP]]]),
        np.concatenate([mesh.face_region, mesh.face_region]),
        np.concatenate([mesh.face_cell, mesh.face_cell]),
    )
