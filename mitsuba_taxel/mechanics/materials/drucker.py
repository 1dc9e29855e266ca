"""Drucker's stability of a law: the stretch up to which the stress rises with the strain in every mode.

An incompressible solid is stable if dt : de > 0 for all changes e of logarithmic strain without change of volume, where
t is the Kirchhoff stress (D. C. Drucker, J. Appl. Mech. 26, 101, 1959; Abaqus Theory Guide, section 4.6.1). In
principal axes, the matrix d2W / (de_a de_b) must be positive on the plane e_1 + e_2 + e_3 = 0.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.base.errors import InputError

LEAST_STRETCH = 1.5
"""Principal stretch up to which every law must be stable; equibiaxial, it is a compression to 0.44 of the height."""
LARGEST_STRETCH = 10.0
"""Largest stretch that is tested."""
MODES = np.linspace(-0.5, 1.0, 13)
"""Logarithm of the second stretch relative to the first: -0.5 uniaxial, 0 planar, 1 equibiaxial."""
ROUNDING = 1e-10
"""Stiffness that counts as rounding, relative to the largest in other directions."""
_STEPS = 120
_PLANE = np.array([[1, -1, 0], [1, 1, -2]]) / np.sqrt([[2], [6]])


class Law(Protocol):
    """Interface of a material law: its isochoric stress and tangent, as in `Material`."""

    def stress(self, gradient: np.ndarray, determinant: np.ndarray, inverse_transpose: np.ndarray) -> np.ndarray: ...

    def tangent(self, gradient: np.ndarray, determinant: np.ndarray, inverse_transpose: np.ndarray) -> np.ndarray: ...


@kept(64)
def stable_stretch(material: Law) -> float:
    """Largest principal stretch up to which a law is stable in all modes.

    Parameters
    ----------
    material : Law
        Material law, taken as incompressible.

    Returns
    -------
    float
        The stretch; infinite if the law is stable up to :data:`LARGEST_STRETCH`.
    """
    stretches = np.geomspace(1, LARGEST_STRETCH, _STEPS)
    unstable = np.flatnonzero(_least_stiffness(material, stretches) <= 0)
    if not len(unstable):
        return np.inf
    low, high = stretches[max(unstable[0] - 1, 0)], stretches[unstable[0]]
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _least_stiffness(material, np.array([middle]))[0] > 0 else (low, middle)
    return float(low)


def require_stable(material: Law, name: str) -> None:
    """Raise `InputError`, naming a constant, if a law is not stable up to :data:`LEAST_STRETCH`."""
    limit = stable_stretch(material)
    if limit < LEAST_STRETCH:
        raise InputError(
            f"{name} = {getattr(material, name)} is not allowed: a law whose stress rises up to a principal stretch of "
            f"{LEAST_STRETCH:g} in all modes is needed; this law's rises up to {limit:.3g}."
        )


def _least_stiffness(material: Law, stretches: np.ndarray) -> np.ndarray:
    """Smallest eigenvalue (n,) of the stiffness at constant volume, over all modes of deformation, at n principal
    ``stretches``."""
    logarithm = np.log(stretches)[:, None] * np.ones_like(MODES)
    strains = np.stack([logarithm, logarithm * MODES, -logarithm * (1 + MODES)], axis=-1)
    principal = np.exp(strains)
    gradient = principal[..., None] * np.eye(3)
    state = gradient, np.ones(gradient.shape[:2]), np.eye(3) / principal[..., None]
    with np.errstate(over="ignore", invalid="ignore"):
        stress, moduli = material.stress(*state), material.tangent(*state)
        normal = np.einsum("...aabb->...ab", moduli) * principal[..., :, None] * principal[..., None, :]
        normal = normal + np.einsum("...aa,...a->...a", stress, principal)[..., None] * np.eye(3)
        stiffness = np.einsum("pa,...ab,qb->...pq", _PLANE, normal, _PLANE)
        least = _smaller_eigenvalue(stiffness) + ROUNDING * np.linalg.norm(stiffness, axis=(-1, -2))
    return np.asarray(np.where(np.isfinite(least), least, np.inf).min(axis=1))


def _smaller_eigenvalue(matrices: np.ndarray) -> np.ndarray:
    """Smaller eigenvalue (...) of symmetric matrices (..., 2, 2)."""
    mean = 0.5 * (matrices[..., 0, 0] + matrices[..., 1, 1])
    return mean - np.hypot(0.5 * (matrices[..., 0, 0] - matrices[..., 1, 1]), matrices[..., 0, 1])
