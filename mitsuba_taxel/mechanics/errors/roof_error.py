"""Discretisation error where it affects light: displacement and slope of the roofs, or of the top without cells.

A pad is solved on a second mesh, and the error is extrapolated from the difference (see
`mitsuba_taxel.base.convergence`) with the actual ratio of element sizes, because thin walls and curves limit the
mesher. Meshes are irregular, and solutions on two meshes may agree by chance: the stated error is at least the typical
error of pads with elements of this size.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np
import scipy.sparse as sparse

from mitsuba_taxel.base.convergence import ERROR_SHARE, LOCAL_ORDER, ORDER
from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.geometry.quadratic_shapes import shape_functions, shape_slopes
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.continuation.state import RoofError
from mitsuba_taxel.mechanics.point_locator import Location, PointLocator
from mitsuba_taxel.pads.regions import REGIONS

_BARYCENTRIC = np.array([[2 / 3, 1 / 6, 1 / 6], [1 / 6, 2 / 3, 1 / 6], [1 / 6, 1 / 6, 2 / 3]])


def size_ratio(mesh: VolumeMesh, other: VolumeMesh) -> float:
    """Size of the elements of another mesh of the same pad, relative to the elements of ``mesh``.

    It is the geometric mean of two ratios, in the solid and on the walls of the cells, because both contribute to the
    error. If roofs are thinner than the elements, both meshes have one layer of elements there, and the coarser mesh
    saves elements elsewhere. Then the mean of the ratios above the roofs and on their faces is returned, if it is
    closer to 1.

    Parameters
    ----------
    mesh, other : VolumeMesh
        Two meshes of the same pad.

    Returns
    -------
    float
        Ratio of the sizes, above 1 if the other mesh is coarser.
    """
    solid = (len(mesh.tets) / len(other.tets)) ** (1 / 3)
    walls = (np.count_nonzero(_seen(mesh)) / np.count_nonzero(_seen(other))) ** (1 / 2)
    ratio = math.sqrt(solid * walls)
    if not _has_thin_roofs(mesh if ratio > 1 else other):
        return ratio
    above = (_elements_above_roofs(mesh) / _elements_above_roofs(other)) ** (1 / 3)
    faces = [np.count_nonzero(of_mesh.face_region == REGIONS["roof"]) for of_mesh in (mesh, other)]
    return min(ratio, math.sqrt(above * math.sqrt(faces[0] / faces[1])), key=lambda value: abs(math.log(value)))


def _seen(mesh: VolumeMesh) -> np.ndarray:
    """Mask (B,) of the B surface faces that reflect light: roofs and sides of cells or, without cells, the top."""
    return mesh.face_cell > 0 if mesh.face_cell.any() else mesh.face_region == REGIONS["top"]


def _has_thin_roofs(mesh: VolumeMesh) -> bool:
    """Whether the silicone above the roofs is thinner than the elements at the top are wide."""
    roofs, top = (mesh.faces[mesh.face_region == REGIONS[name]] for name in ("roof", "top"))
    if not (len(roofs) and len(top)):
        return False
    a, b, c = mesh.points[top[:, :3]].transpose(1, 0, 2)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).mean() / 2
    thickness = mesh.points[top, 2].max() - mesh.points[roofs, 2].max()
    return bool(thickness < math.sqrt(4 / math.sqrt(3) * area))  # side of an equilateral triangle of the mean area


def _elements_above_roofs(mesh: VolumeMesh) -> int:
    """Number of elements with their centroid above the lowest point of a cell's roof, within its bounding rectangle."""
    is_roof = mesh.face_region == REGIONS["roof"]
    centroids, above = mesh.points[mesh.tets[:, :4]].mean(axis=1), np.zeros(len(mesh.tets), dtype=bool)
    for cell in np.unique(mesh.face_cell[is_roof]):
        points = mesh.points[mesh.faces[is_roof & (mesh.face_cell == cell)]].reshape(-1, 3)
        low, high = points.min(axis=0), points.max(axis=0)
        within = (centroids[:, :2] > low[:2]) & (centroids[:, :2] < high[:2])
        above |= within.all(axis=1) & (centroids[:, 2] > low[2])
    return int(np.count_nonzero(above))


def top_ratio(mesh: VolumeMesh, other: VolumeMesh) -> float:
    """Size of the elements at the top of another mesh, relative to that of ``mesh``; see :func:`size_ratio`.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of a pad.
    other : VolumeMesh
        Another mesh of the same pad.

    Returns
    -------
    float
        Ratio of the sizes, above 1 if the other mesh is coarser.
    """
    faces = (np.count_nonzero(of_mesh.face_region == REGIONS["top"]) for of_mesh in (mesh, other))
    return math.sqrt(next(faces) / next(faces))


class RoofComparison:
    """Comparison of solutions of one pad on two meshes, one of which is coarser, for the error at the roofs of its
    cells.

    Parameters
    ----------
    mesh, other : VolumeMesh
        Undeformed meshes.
    least : float
        Least stated error of the roofs along their displacement, relative to that displacement.
    least_of_force : float, optional
        Least relative error of a force; by default ``least``.
    images : Mapping[Mirror, tuple[ndarray, ndarray]], optional
        Images of the nodes of both meshes for each common mirror, in the order of `MIRRORS`.
    """

    def __init__(
        self,
        mesh: VolumeMesh,
        other: VolumeMesh,
        least: float = 0.0,
        least_of_force: float | None = None,
        images: Mapping[Mirror, tuple[np.ndarray, np.ndarray]] | None = None,
    ) -> None:
        self._least, self._least_of_force = least, least if least_of_force is None else least_of_force
        self._images = images or {}
        ratio = size_ratio(mesh, other)
        # With e(h) = c h^p, e(r h) - e(h) = (r^p - 1) e(h), whether r is above 1 or below.
        self._average, self._local = (1 / (ratio**order - 1) for order in (ORDER, LOCAL_ORDER))
        seen = _seen(mesh)
        faces = mesh.faces[seen & np.isin(mesh.face_region, (REGIONS["roof"], REGIONS["top"]))]
        nodes = mesh.points[faces]
        points = np.einsum("qa,fai->fqi", shape_functions(_BARYCENTRIC), nodes).reshape(-1, 3)
        along = [np.einsum("qa,fai->fqi", slopes, nodes).reshape(-1, 3) for slopes in shape_slopes(_BARYCENTRIC)]
        area = np.linalg.norm(np.cross(*along), axis=1)
        self._along, self._weight = np.stack(along), area / area.sum()
        # Curved roofs of two meshes do not coincide, but differ by less than their elements' size.
        self._mesh, self._locator, self._tolerance = mesh, PointLocator(other), 0.1 * np.ptp(mesh.points[:, 2])
        self._here = _on_faces(mesh, faces)
        self._there = _on_roofs(self._locator.locate(points, self._tolerance), along)

    @cached_property
    def _walls_there(self) -> tuple[np.ndarray, sparse.csr_array]:
        """Interpolation from the other mesh to this one: the numbers (W,) of this mesh's nodes on walls of cells, and
        the weights (W, N') of the other mesh's N' nodes for the values at these nodes.
        """
        nodes = np.unique(self._mesh.faces[_seen(self._mesh)])
        for mirror in self._images:
            nodes = nodes[mirror.side(self._mesh.points[nodes]) >= 0]
        weights = self._locator.locate(self._mesh.points[nodes], self._tolerance).weights
        for here, there in list(self._images.values())[::-1]:
            beyond = ~np.isin(here[nodes], nodes)
            rows = weights[beyond]
            rows = sparse.csr_array((rows.data, there[rows.indices], rows.indptr), shape=rows.shape)
            nodes, weights = np.concatenate([nodes, here[nodes[beyond]]]), sparse.vstack([weights, rows], format="csr")
        return nodes, weights

    def error(self, displacement: np.ndarray, other: np.ndarray) -> RoofError:
        """Estimated error of a displacement.

        Parameters
        ----------
        displacement : (N, 3) ndarray
            Displacement on the mesh, mm.
        other : (N', 3) ndarray
            Displacement on the other mesh, mm.

        Returns
        -------
        RoofError
            Error at the roofs.
        """
        displaced, *slopes = _parts(self._here, displacement)
        moved_there, *slopes_there = _parts(self._there, other)
        difference = moved_there - displaced
        error = self._average * difference - self._lacking(displaced, difference) * displaced
        angle = _angle(self._normals(slopes), self._normals(slopes_there))
        largest = max(float(np.linalg.norm(e, axis=1).max()) for e in (self._local * difference, error))
        most = float(np.linalg.norm(displacement, axis=1).max())
        return RoofError(
            displacement=float(np.sqrt(self._weight @ (error**2).sum(axis=1))),
            largest=largest,
            relative=largest / most if most > 0 else 0.0,
            slope=abs(self._local) * float(np.rad2deg(np.sqrt(self._weight @ angle**2))),
        )

    def force_error(self, force: np.ndarray, other: np.ndarray) -> float:
        """Estimated error of the reaction to a prescribed displacement.

        As for displacements, it is at least a given fraction of the value: a mesh that moves too little under a force
        resists a displacement too much.

        Parameters
        ----------
        force : (3,) ndarray
            Reaction on the mesh, N.
        other : (3,) ndarray
            Reaction on the other mesh, N.

        Returns
        -------
        float
            Error in N.
        """
        difference = abs(self._average) * float(np.linalg.norm(other - force))
        return max(difference, self._least_of_force * np.linalg.norm(force))

    def deviations(self, displacement: np.ndarray, other: np.ndarray, of_force: float = 0.0) -> np.ndarray:
        """Estimated change of the displacement of the nodes if the elements had twice their size.

        Parameters
        ----------
        displacement : (N, 3) ndarray
            Displacement on the mesh, mm.
        other : (N', 3) ndarray
            Displacement on the other mesh, mm.
        of_force : float
            Relative error of the force under a prescribed displacement, which scales the displacement of the whole pad.

        Returns
        -------
        (2, N, 3) ndarray
            Deviations in mm: the component along the displacement, at least the fraction ``least`` of it, and the
            remainder, which is 0 except on the walls of cells.
        """
        displaced = _parts(self._here, displacement)[0]
        difference = _parts(self._there, other)[0] - displaced
        short = self._short(displaced, difference)
        along = -math.copysign(math.hypot(max(abs(short), self._least), of_force), short) * displacement
        rest, (walls, there) = np.zeros_like(displacement), self._walls_there
        rest[walls] = self._average * (there @ other - displacement[walls]) + short * displacement[walls]
        return np.array([along, rest]) / ERROR_SHARE

    def _lacking(self, moved: np.ndarray, difference: np.ndarray) -> float:
        """Part of the smallest stated error that the difference of the meshes does not show: the smallest stated error
        less the estimated error along the displacement, both relative to the displacement.
        """
        short = self._short(moved, difference)
        return math.copysign(max(self._least - abs(short), 0.0), short)

    def _short(self, moved: np.ndarray, difference: np.ndarray) -> float:
        """Estimated amount by which the mean displacement of the roofs is too small, relative to this displacement."""
        square = self._weight @ (moved**2).sum(axis=1)
        return -self._average * float(self._weight @ (moved * difference).sum(axis=1)) / square if square else 0.0

    def _normals(self, slopes: Sequence[np.ndarray]) -> np.ndarray:
        """Normals (P, 3), not of unit length, of the deformed roof at P points, from the derivatives of the
        displacement along it."""
        return np.cross(*(self._along + slopes))


def _on_roofs(location: Location, along: Sequence[np.ndarray]) -> sparse.csr_array:
    """Interpolation weights (3 P, N) from N nodes to P points: for the values at the points, then for their derivatives
    ``along`` two tangents.
    """
    return sparse.vstack([location.weights, *(location.slope_weights(tangent) for tangent in along)], format="csr")


def _on_faces(mesh: VolumeMesh, faces: np.ndarray) -> sparse.csr_array:
    """Interpolation weights, like those of :func:`_on_roofs`, for the quadrature points of the faces (F, 6) of the same
    mesh."""
    weights = np.stack([shape_functions(_BARYCENTRIC), *shape_slopes(_BARYCENTRIC)])
    shape = (len(weights), len(faces), len(_BARYCENTRIC), faces.shape[1])
    nodes = np.broadcast_to(faces[:, None], shape).ravel()
    ends = np.arange(0, nodes.size + 1, shape[-1])
    data = np.broadcast_to(weights[:, None], shape).ravel()
    return sparse.csr_array((data, nodes, ends), shape=(len(ends) - 1, len(mesh.points)))


def _parts(weights: sparse.csr_array, displacement: np.ndarray) -> np.ndarray:
    """Displacement in mm at P points of the roofs, and its derivatives along two tangents, in one array (3, P, 3)."""
    return (weights @ displacement).reshape(3, -1, 3)


def _angle(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    return np.arctan2(np.linalg.norm(np.cross(one, other), axis=1), np.einsum("pi,pi->p", one, other))
