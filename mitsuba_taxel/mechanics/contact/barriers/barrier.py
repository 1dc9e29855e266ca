"""Forces that keep the walls of a pad apart, and off the board, from a barrier potential.

Faces are cut into four flat triangles, between whose points, edges and triangles the potential of incremental potential
contact acts, from a small distance on (M. Li et al., ACM Trans. Graph. 39, 2020), computed by `ipctk`; from points of
the faces to the board, the same function acts. It grows beyond all bounds as a distance goes to zero.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sparse

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.quadratic_shapes import shape_functions
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.contact.barriers.singular_edges import STRIP
from mitsuba_taxel.pads.regions import REGIONS

REACH = 2e-3
"""Distance from which on walls repel each other, relative to the pad's height."""
REACH_AT_REST = 0.5
"""The same, at most, relative to the smallest distance of triangles of the undeformed pad that share no corner."""
APPROACH = 0.9
"""Share of a distance to a collision that a step may go."""
CLOSE = 0.99
"""Share of a distance up to which a collision is looked for: `APPROACH` leaves room enough."""

_QUARTERS = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]])
_FOURTHS = np.array([[4 - i - j, i, j] for i in range(5) for j in range(5 - i)]) / 4
_POINTS = shape_functions(_FOURTHS)
"""(15, 6) at the points of a face that stay above the board."""


class Barrier:
    """The repulsion between the surfaces of a pad in space, except its glued bottom, and from the board.

    Parameters
    ----------
    mesh : VolumeMesh
        Of the whole undeformed pad, which stands on the board.
    modulus : float
        MPa, pressure of the repulsion for its size: that at a third of the reach is about twice it.
    share : float
        Of the usual reach.

    Attributes
    ----------
    reach : float
        In mm.

    Raises
    ------
    InputError
        without `ipctk`.
    """

    def __init__(self, mesh: VolumeMesh, modulus: float, share: float = 1.0) -> None:
        self._ipc = ipc = ipctk_of_one_thread()
        faces = mesh.faces[mesh.face_region != REGIONS["bottom"]]
        self._nodes, number = np.unique(faces, return_inverse=True)
        triangles = number.reshape(-1, 6)[:, _QUARTERS].reshape(-1, 3)
        sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        self._points = mesh.points
        self._mesh = ipc.CollisionMesh(
            *(np.asfortranarray(part) for part in (mesh.points[self._nodes], np.unique(sides, axis=0), triangles))
        )
        height = float(np.ptp(mesh.points[:, 2]))
        self._last: tuple[np.ndarray, Any] = np.empty(0), None
        self.reach = REACH / REACH_AT_REST * height  # how far is looked
        self.reach = share * REACH_AT_REST * self.gap(np.zeros_like(mesh.points))
        self._last = np.empty(0), None  # that was within another reach
        self._potential = ipc.BarrierPotential(self.reach, modulus, True)
        self._ccd = additive_ccd(ipc)

        self._board = float(mesh.points[:, 2].min())
        face, point = np.nonzero(mesh.points[faces, 2] @ _POINTS.T >= self._board + STRIP * height)
        entries = _POINTS[point].ravel(), (np.arange(len(face)).repeat(6), faces[face].ravel())
        self._over = sparse.csr_array(entries, shape=(len(face), len(mesh.points)))
        first, second, third = np.moveaxis(mesh.points[faces[:, :3]], 1, 0)
        area = np.linalg.norm(np.cross(second - first, third - first), axis=1) / 2
        self._weight = modulus * area[face] / len(_POINTS)

    def gap(self, displacement: np.ndarray) -> float:
        """Smallest distance in mm of triangles without a common corner, if below the reach, which else it is."""
        places, near = self._near(displacement)
        return float(np.sqrt(near.compute_minimum_distance(self._mesh, places))) if len(near) else self.reach

    def forces(self, displacement: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(N, 3) nodal forces in N of the pad on itself, and of the board on what does not stand on it."""
        own, board = np.zeros_like(displacement), np.zeros_like(displacement)
        places, near = self._near(displacement)
        own[self._nodes] = -self._potential.gradient(near, self._mesh, places).reshape(-1, 3)
        first, _ = self._repulsion(displacement)
        if first.any():
            board[:, 2] = self._over.T @ (-self._weight * first)
        return own, board

    def stiffness(self, displacement: np.ndarray, steady: bool = False) -> sparse.csr_array:
        """(3 N, 3 N) derivative of the forces by the displacement, with the opposite sign.

        Of a ``steady`` one each pair has no negative eigenvalues, as it has by the turn of a force about a corner.
        """
        places, near = self._near(displacement)
        projection = self._ipc.PSDProjectionMethod.CLAMP if steady else self._ipc.PSDProjectionMethod.NONE
        of_nodes = sparse.coo_array(self._potential.hessian(near, self._mesh, places, projection))
        degrees = (3 * self._nodes[:, None] + np.arange(3)).ravel()
        at_points = self._weight * self._repulsion(displacement)[1]
        if not (at_points.any() or of_nodes.nnz):
            return sparse.csr_array((displacement.size, displacement.size))
        board = sparse.coo_array(self._over.T @ sparse.diags_array(at_points) @ self._over)
        rows = np.concatenate([degrees[of_nodes.row], 3 * board.row + 2])
        columns = np.concatenate([degrees[of_nodes.col], 3 * board.col + 2])
        values = np.concatenate([of_nodes.data, board.data])
        return sparse.csr_array((values, (rows, columns)), shape=(displacement.size, displacement.size))

    def free_share(self, before: np.ndarray, after: np.ndarray) -> float:
        """Share, at most 1, of the way from one displacement (N, 3) to another that meets nothing, with a margin."""
        start, end = self._places(before), self._places(after)
        share = float(self._ipc.compute_collision_free_stepsize(self._mesh, start, end, narrow_phase_ccd=self._ccd))
        high, low = self._height(before), self._height(after)
        down = low <= (1 - APPROACH) * high
        above_board = float((APPROACH * high[down] / (high - low)[down]).min(initial=1.0))
        return min(share if share >= 1 else APPROACH * share, above_board)

    def _repulsion(self, displacement: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """First and second derivative of -(z / r - 1)^2 r log(z / r) by the height z of points below the reach r."""
        z = np.minimum(self._height(displacement) / self.reach, 1.0)
        first = 2 * (1 - z) * np.log(z) - (1 - z) ** 2 / z
        second = -2 * np.log(z) + 4 * (1 - z) / z + (1 - z) ** 2 / z**2
        return first, second / self.reach

    def _height(self, displacement: np.ndarray) -> np.ndarray:
        """(p,) mm above the board of points of the faces."""
        return self._over @ (self._points + displacement)[:, 2] - self._board

    def _places(self, displacement: np.ndarray) -> np.ndarray:
        return np.asfortranarray((self._points + displacement)[self._nodes])

    def _near(self, displacement: np.ndarray) -> tuple[np.ndarray, Any]:
        """Places of the surface, and the pairs of points, edges and triangles within the reach; kept of the last."""
        places, last = self._places(displacement), self._last
        if not np.array_equal(places, last[0]):
            pairs = self._ipc.NormalCollisions()
            pairs.use_area_weighting = True
            pairs.build(self._mesh, places, self.reach)
            last = self._last = places, pairs
        return last


def additive_ccd(ipctk: Any) -> Any:
    """Search for collisions by advancing as far as distances allow: milliseconds, where that by inclusion, which
    `ipctk` has as a default, takes half the time of a step (M. Li, D. M. Kaufman and C. Jiang, ACM Trans. Graph. 40,
    2021)."""
    return ipctk.AdditiveCCD(conservative_rescaling=CLOSE)


def ipctk_of_one_thread() -> Any:
    """The package, whose sums are bitwise the same from now on; raises `InputError` if it is missing."""
    try:
        import ipctk
    except ImportError as missing:
        raise InputError("self_contact needs the package ipctk: pip install ipctk.") from missing
    ipctk.set_num_threads(1)  # those of several threads are not
    return ipctk
