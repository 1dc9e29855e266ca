"""How far the finite elements are from the truth where the light looks: the roofs' displacement and slope.

A pad is solved on a second mesh of twice the element size. Where roofs meet walls, and along the rim on the board, the
stress is singular, and the error falls about in proportion to the size of the elements there, whatever their order
(G. Strang and G. J. Fix, An Analysis of the Finite Element Method, 1973, chapter 8): so the difference of the two
solutions is about the error of the better one. Where walls or curves ask for elements so small that the second mesh
would hardly be coarser, it has elements of half the size, and what twice the size would change is extrapolated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mitsuba_taxel.convergence import COARSENING, ORDER
from mitsuba_taxel.mechanics.locate import PointLocator
from mitsuba_taxel.mechanics.six_node import shape_functions, shape_slopes
from mitsuba_taxel.pads.pad import REGIONS
from mitsuba_taxel.pads.volume_mesh import VolumeMesh

_BARYCENTRIC = np.array([[2 / 3, 1 / 6, 1 / 6], [1 / 6, 2 / 3, 1 / 6], [1 / 6, 1 / 6, 2 / 3]])


@dataclass(frozen=True)
class RoofError:
    """Estimated discretisation error of a deformed pad, seen at the roofs of its cells.

    Attributes
    ----------
    displacement : root mean square over the roofs, in mm
    largest : mm, at the worst place
    relative : ``largest``, relative to the largest displacement of any node
    slope : root mean square of the angle between normals, in degrees
    """

    displacement: float
    largest: float
    relative: float
    slope: float


NO_ERROR = RoofError(0.0, 0.0, 0.0, 0.0)


class RoofComparison:
    """Compares solutions on a mesh with those on another of the same pad, of twice or half its element size."""

    def __init__(self, mesh: VolumeMesh, other: VolumeMesh) -> None:
        # To differences from elements of twice the size: with e(h) = c h^p, e(2 h) - e(h) = 2^p (e(h) - e(h / 2)).
        self._factor = 1.0 if len(other.tets) < len(mesh.tets) else -(COARSENING**ORDER)
        faces = mesh.faces[mesh.face_region == REGIONS["roof"]]
        nodes = mesh.points[faces]
        points = np.einsum("qa,fai->fqi", shape_functions(_BARYCENTRIC), nodes).reshape(-1, 3)
        along = [np.einsum("qa,fai->fqi", slopes, nodes) for slopes in shape_slopes(_BARYCENTRIC)]
        normal = np.cross(*along).reshape(-1, 3)
        area = np.linalg.norm(normal, axis=1)
        self._normal, self._weight = normal / area[:, None], area / area.sum()
        self._here = PointLocator(mesh).locate(points, tolerance=1e-6 * np.ptp(mesh.points))
        self._seen = np.unique(mesh.faces[mesh.face_cell > 0])
        # Curved roofs of two meshes lie beside each other, by less than their elements' size.
        locator, tolerance = PointLocator(other), 0.1 * np.ptp(mesh.points[:, 2])
        self._there = locator.locate(points, tolerance)
        self._nodes_there = locator.locate(mesh.points[self._seen], tolerance)

    def error(self, displacement: np.ndarray, other: np.ndarray) -> RoofError:
        """The error of ``displacement`` (N, 3), from that on the other mesh, in mm."""
        difference = np.linalg.norm(self._here.interpolate(displacement) - self._there.interpolate(other), axis=1)
        difference *= abs(self._factor)
        angle = _angle(self._turned(self._here.gradient(displacement)), self._turned(self._there.gradient(other)))
        angle *= abs(self._factor)
        most = np.linalg.norm(displacement, axis=1).max()
        return RoofError(
            displacement=float(np.sqrt(self._weight @ difference**2)),
            largest=float(difference.max()),
            relative=float(difference.max() / most) if most > 0 else 0.0,
            slope=float(np.rad2deg(np.sqrt(self._weight @ angle**2))),
        )

    def deviation(self, displacement: np.ndarray, other: np.ndarray) -> np.ndarray:
        """(N, 3) by how much twice the element size changes nodes on roofs and sides of cells; 0 elsewhere."""
        difference = np.zeros_like(displacement)
        difference[self._seen] = self._factor * (self._nodes_there.interpolate(other) - displacement[self._seen])
        return difference

    def _turned(self, gradient: np.ndarray) -> np.ndarray:
        """(P, 3) normals of the deformed roof, of no particular length: F^-T N."""
        deformation = gradient + np.eye(3)
        return np.linalg.solve(np.swapaxes(deformation, -1, -2), self._normal[..., None])[..., 0]


def _angle(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    return np.arctan2(np.linalg.norm(np.cross(one, other), axis=1), np.einsum("pi,pi->p", one, other))
