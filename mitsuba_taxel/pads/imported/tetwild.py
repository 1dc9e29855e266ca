"""Second-order tetrahedral mesh of a closed surface by fTetWild."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.geometry.geometry_error import place
from mitsuba_taxel.geometry.second_order import boundary_triangles, positive, second_order
from mitsuba_taxel.geometry.surfaces.triangles import area_normals, half_edges, unit, volume
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.pads.imported.isolated_process import run_isolated
from mitsuba_taxel.pads.imported.surfaces import VOLUME_TOLERANCE
from mitsuba_taxel.pads.imported.triangles.borders import conforming
from mitsuba_taxel.pads.imported.triangles.repair import is_sliver
from mitsuba_taxel.pads.imported.triangles.snapping import Patches, snapped
from mitsuba_taxel.pads.meshers import has_ftetwild, require_netgen

ENVELOPE = 0.02
"""Largest distance of the straight mesh from the surface, relative to the mesh size, before projection onto it."""
LARGEST_ENVELOPE, LARGEST_EDGE = 2e-3, 1 / 6
"""Upper limits of that distance and of the mesh size, relative to the diagonal of the pad.

Far above them fTetWild makes more elements, not fewer: walls are too thin for edges of that length."""


def mesh_by_tetwild(
    vertices: np.ndarray, triangles: np.ndarray, region: np.ndarray, cell: np.ndarray, mesh_size: float
) -> VolumeMesh:
    """Mesh of a closed surface by fTetWild, with boundary nodes on the surface.

    Parameters
    ----------
    vertices : (V, 3) ndarray
        Positions in mm.
    triangles : (T, 3) ndarray of int
        Vertices of each triangle.
    region, cell : (T,) ndarray of int
        Code of the region and number of the cell of each triangle.
    mesh_size : float
        Length of the edges of elements, mm.

    Returns
    -------
    VolumeMesh
        Undeformed quadratic tetrahedra with tagged faces.

    Raises
    ------
    ComputationError
        if meshing fails, or without pytetwild.
    InputError
        without pytetwild and Netgen.
    """
    if not has_ftetwild():
        require_netgen("meshing a pad")
        raise ComputationError(
            "Netgen cannot fill the surface of this pad, and the package pytetwild, which may succeed, is not "
            "installed: pip install pytetwild, or repair the surface."
        )
    diagonal = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    mesh_size = min(mesh_size, LARGEST_EDGE * diagonal)
    envelope = min(ENVELOPE * mesh_size, LARGEST_ENVELOPE * diagonal)
    solid = {"vertices": vertices, "triangles": triangles[~is_sliver(vertices, triangles)]}
    straight = run_isolated("tetrahedralise", {**solid, "mesh_size": mesh_size, "epsilon": envelope})
    patches = Patches(vertices, triangles, region, cell)
    corners, tets = positive(straight["points"], straight["tets"])
    _check_boundary(corners, boundary_triangles(tets))
    points, tets, faces = second_order(*conforming(corners, tets, patches, 3 * envelope))
    normals = unit(area_normals(points, faces[:, :3]))
    followed = patches.nearest_triangle(points[faces[:, :3]].mean(axis=1), normals, 3 * envelope)
    points = snapped(points, tets, faces, patches.patch[followed], patches, mesh_size)
    inside = volume(points, faces[:, :3])
    if abs(inside / volume(vertices, triangles) - 1) > VOLUME_TOLERANCE:
        raise ComputationError(
            f"the mesh fills {inside:.4g} of the {volume(vertices, triangles):.4g} mm3 of the pad: choose a smaller "
            f"mesh_size than {mesh_size:g}."
        )
    return VolumeMesh(points, tets, faces, region[followed], cell[followed])


def _check_boundary(points: np.ndarray, faces: np.ndarray) -> None:
    edges, _ = half_edges(faces)
    edges, count = np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)
    if not len(faces) or np.any(count != 2):
        where = f" near {place(points[edges[np.argmax(count != 2)]].mean(axis=0))}" if len(faces) else ""
        raise ComputationError(f"the mesh does not follow the surface of the pad{where}: choose a smaller mesh_size.")
