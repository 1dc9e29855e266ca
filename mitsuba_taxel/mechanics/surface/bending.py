"""Typical error of the curvature of walls that finite elements cause, and with it an error of the light from mirrors.

A load bends the walls of cells. On few elements the displacement of a wall is accurate long before its curvature is,
and a curved mirror has a focal length. Two meshes may agree by chance. So the curvature, like the displacement, gets at
least the error that is typical of elements of this size.
"""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.geometry.surfaces.triangles import area_normals, unit
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.surface.tessellation import Surface
from mitsuba_taxel.pads.regions import REGIONS

TYPICAL_CURVATURE_ERROR = 1.0
"""Error of the curvature of a wall on elements of the default size, times this size, relative to the mean displacement
of the wall divided by the height of the pad: 0.4 to 1.0 for the middle of flat roofs (parallelepiped, cylindrical,
frustum; -1 and -4 N) compared with elements of 0.25 mm."""
CURVATURE_ORDER = 3.0
"""Power of the element size to which this error is proportional. The same roofs on elements of half the size have 1/20
to 1/40 of the error."""
LARGEST_RATIO = 2.0
"""Size of elements, relative to the default, above which the mesher cannot make the elements of a roof larger."""


def curvature_errors(mesh: VolumeMesh, displacement: np.ndarray, ratio: float, default_size: float) -> np.ndarray:
    """Typical error of the curvature of the walls of each cell due to the size of the elements.

    Parameters
    ----------
    mesh : VolumeMesh
        Undeformed mesh.
    displacement : (N, 3) ndarray
        Displacement of the nodes, mm.
    ratio : float
        Length of the edges of elements on roofs, relative to the default.
    default_size : float
        Default size of the elements of this pad, mm.

    Returns
    -------
    (K,) ndarray
        One standard deviation in 1/mm for each of K walls, numbered by :func:`wall_numbers`.
    """
    per_strain = TYPICAL_CURVATURE_ERROR * min(ratio, LARGEST_RATIO) ** CURVATURE_ORDER / default_size
    square = (displacement**2).sum(axis=1)[mesh.faces].mean(axis=1)
    number = wall_numbers(mesh.face_cell, mesh.face_region)
    total, count = (np.bincount(number, weight) for weight in (square, np.ones_like(square)))
    return per_strain * np.sqrt(total / np.maximum(count, 1)) / np.ptp(mesh.points[:, 2])


def bent_normals(surface: Surface, curvature: np.ndarray) -> np.ndarray:
    """Normals of the walls of cells after a change of the walls' curvature.

    Each normal tilts away from the middle of its wall, in proportion to its distance from there.

    Parameters
    ----------
    surface : Surface
        The deformed surface.
    curvature : (K,) ndarray
        Change of the curvature in 1/mm, by the number of a wall.

    Returns
    -------
    (T, 3, 3) ndarray
        Unit normals at the corners of the triangles.
    """
    # The centre of area of each wall.
    corners, number = surface.vertices[surface.triangles], wall_numbers(surface.cell, surface.region)
    area = np.linalg.norm(area_normals(surface.vertices, surface.triangles), axis=1)
    moments = [np.bincount(number, area * column, len(curvature)) for column in corners.mean(axis=1).T]
    total = np.bincount(number, area, len(curvature))
    middle = np.stack(moments, axis=1) / np.where(total > 0, total, 1.0)[:, None]

    # Normals tilt by the distance from there, in the plane of the wall.
    change = np.where(surface.cell > 0, curvature[number], 0.0)
    offset = change[:, None, None] * (corners - middle[number][:, None])
    along = np.einsum("tki,tki->tk", offset, surface.normals)[..., None]
    bent = surface.normals + offset - along * surface.normals
    return unit(bent.reshape(-1, 3)).reshape(bent.shape)


def wall_numbers(cell: np.ndarray, region: np.ndarray) -> np.ndarray:
    """Number of the wall to which each face or triangle belongs, from its cell and its region."""
    return np.asarray(cell, dtype=int) * (max(REGIONS.values()) + 1) + region
