"""Forces of a pressure on the deformed surface, and their derivatives.

With x the deformed position, f_a = -p int N_a (x,xi x x,eta) dxi deta over a face (P. Wriggers, Nonlinear Finite
Element Methods, 2008, section 4.2.5). If the rim of the loaded surface is fixed, or moves in a plane of symmetry, these
are the derivatives of -p times the enclosed volume, so that their own derivatives are symmetric.
"""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.geometry.quadratic_shapes import shape_functions, shape_slopes
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.pads.regions import REGIONS

# Six points, exact to degree 4 (D. A. Dunavant, Int. J. Numer. Methods Eng. 21, 1985), the degree of the forces on a
# quadratic face.
_A, _B = 0.445948490915965, 0.091576213509771
_POINTS = np.array([(x, y) for a in (_A, _B) for x, y in ((a, a), (a, 1 - 2 * a), (1 - 2 * a, a))])
_WEIGHTS = np.repeat([0.223381589678011, 0.109951743655322], 3) / 2


_BARYCENTRIC = np.column_stack([1 - _POINTS.sum(axis=1), _POINTS])
_VALUES, (_BY_XI, _BY_ETA) = shape_functions(_BARYCENTRIC), shape_slopes(_BARYCENTRIC)


def wet_faces(mesh: VolumeMesh) -> np.ndarray:
    """Nodes (B, 6) of the B faces on which the pressure acts: top and outside."""
    return np.concatenate([mesh.faces[mesh.face_region == REGIONS[name]] for name in ("top", "outer")])


def pressure_forces(positions: np.ndarray) -> np.ndarray:
    """Nodal forces (B, 6, 3) of a unit pressure on outward-oriented faces with nodes at ``positions`` (B, 6, 3)."""
    normal = np.cross(_BY_XI @ positions, _BY_ETA @ positions)
    return -np.einsum("q,qa,bqi->bai", _WEIGHTS, _VALUES, normal)


def pressure_stiffness(positions: np.ndarray) -> np.ndarray:
    """Symmetric part (B, 18, 18) of the derivative of :func:`pressure_forces` with respect to the positions of the
    nodes."""
    along_xi, along_eta = _BY_XI @ positions, _BY_ETA @ positions
    cross_xi, cross_eta = (_cross_matrices(v) for v in (along_xi, along_eta))
    weighted = _WEIGHTS[:, None] * _VALUES
    # d(x,xi x x,eta) = -[x,eta]x dx,xi + [x,xi]x dx,eta
    stiffness = np.einsum("qa,bqij,qc->baicj", weighted, cross_eta, _BY_XI, optimize=True)
    stiffness -= np.einsum("qa,bqij,qc->baicj", weighted, cross_xi, _BY_ETA, optimize=True)
    stiffness = stiffness.reshape(-1, 18, 18)
    return 0.5 * (stiffness + np.swapaxes(stiffness, 1, 2))


def _cross_matrices(v: np.ndarray) -> np.ndarray:
    """Matrices (..., 3, 3) of the cross product with v."""
    matrices = np.zeros((*v.shape, 3))
    matrices[..., 2, 1], matrices[..., 0, 2], matrices[..., 1, 0] = v[..., 0], v[..., 1], v[..., 2]
    return matrices - np.swapaxes(matrices, -1, -2)
