"""Stability limit of a sharp free corner: the smallest pressure, uniform and of constant direction, under which the
corner is unstable.

A corner of three right-angled sides, one of which is loaded, has no length scale. Its stress is uniaxial, and
displacements that are similar at all distances r from it are r^s f(X / r) (V. A. Kondrat'ev, *Trans. Moscow Math. Soc.*
16, 1967). With s = -1/2 each decade of r contains the same energy. If that energy is negative for some f, the same f
over many decades outweighs any transition at its ends: the corner is unstable in any neighbourhood, however small.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.mechanics.materials.laws import Material

DEGREE = 10
"""Degree of the polynomials f; with degree 6 the limit differs by 1e-3."""
POINTS = 24
"""Quadrature points over the sphere's octant, along each of its angles."""
INCOMPRESSIBLE = 1e-5
"""Least compressibility, relative to one over Young's modulus."""
STRETCHES = np.arange(0.95, 0.25, -0.05)
"""Stretches that are tested in turn for instability."""


@kept(64)
def corner_limit(material: Material) -> float:
    """Nominal pressure at which a corner becomes unstable: 0.70 shear moduli for a neo-Hookean solid.

    Parameters
    ----------
    material : Material
        Law of the silicone.

    Returns
    -------
    float
        Pressure in MPa; infinite if the corner is stable at all tested stretches.
    """
    from scipy.optimize import brentq  # imported here, because only large loads need this module

    last_stable = 1.0
    for stretch in STRETCHES:
        if _least_energy(stretch, material) < 0:
            critical = brentq(lambda trial: _least_energy(trial, material), stretch, last_stable, xtol=1e-6)
            return -_uniaxial(critical, material)[1]
        last_stable = stretch
    return np.inf


def _uniaxial(stretch: float, material: Material) -> tuple[np.ndarray, float, float]:
    """Deformation gradient (3, 3), nominal stress along z [MPa] and pressure [MPa] under uniaxial stress."""
    from scipy.optimize import brentq

    def state(across: float) -> tuple[np.ndarray, np.ndarray, float]:
        """State under uniaxial compression, with the stretch ``across`` the axis: deformation gradient, stress of the
        law, and the pressure at which the stress along x is 0.
        """
        gradient = np.diag([across, across, stretch])
        stress = material.stress(*_with_inverse(gradient))
        return gradient, stress, float(-stress[0, 0] / (gradient[1, 1] * gradient[2, 2]))

    def volume_error(across: float) -> float:
        gradient, _, pressure = state(across)
        return material.compressibility * pressure - (np.linalg.det(gradient) - 1)

    across = brentq(volume_error, stretch**0.5, 1.001 * stretch**-0.5, xtol=1e-12)
    gradient, stress, pressure = state(across)
    return gradient, float(stress[2, 2] + pressure * across**2), pressure


def _with_inverse(gradient: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The deformation gradient F, its determinant, and its inverse transpose F^-T: the arguments of the material laws.
    """
    return gradient, np.array(np.linalg.det(gradient)), np.linalg.inv(gradient).T


def _least_energy(stretch: float, material: Material) -> float:
    """Smallest energy, within one decade of the distance r from a corner, of all displacements r^(-1/2) f of unit size.
    It is negative if the corner is unstable."""
    gradient, _, pressure = _uniaxial(stretch, material)
    state = _with_inverse(gradient)
    moduli = material.moduli(*state, np.array(pressure)).dense()
    weight, slopes, pressures = _functions()
    products = np.einsum("q,aqj,bql->abjl", weight, slopes, slopes, optimize=True)
    energy = np.einsum("ijkl,abjl->aibk", moduli, products, optimize=True)
    volumes = np.einsum("q,pq,aqj,ij->pai", weight, pressures, slopes, state[1] * state[2], optimize=True)
    size = energy.shape[0] * 3
    energy, volumes = energy.reshape(size, size), volumes.reshape(-1, size)
    compressibility = max(material.compressibility, INCOMPRESSIBLE / material.youngs_modulus)
    return float(np.linalg.eigvalsh(energy + volumes.T @ volumes / compressibility)[0])


@kept(1)
def _functions() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Test functions near a corner, on an octant of the unit sphere, for displacements and pressures.

    Returns the weights (q,) of q quadrature points; the gradients (n, q, 3) of n orthonormal functions r^(-1/2) f for
    displacements; and the values (m, q) of m orthonormal functions r^(-3/2) f, of a degree that is lower by two, for
    the pressure.
    """
    nodes, weights = np.polynomial.legendre.leggauss(POINTS)
    angles, node_weights = np.pi / 4 * (nodes + 1), np.pi / 4 * weights
    polar, around = (angle.ravel() for angle in np.meshgrid(angles, angles, indexing="ij"))
    points = np.stack([np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)], axis=1)
    weight = np.outer(node_weights, node_weights).ravel() * np.sin(polar)
    values, slopes = _monomials(points, DEGREE, -0.5)
    basis = _orthonormal(values, weight)
    pressures = _monomials(points, DEGREE - 2, -1.5)[0]
    return weight, np.tensordot(basis, slopes, 1), _orthonormal(pressures, weight) @ pressures


def _monomials(points: np.ndarray, degree: int, power: float) -> tuple[np.ndarray, np.ndarray]:
    """Values (n, q) and gradients (n, q, 3), at r = 1, of n functions: r^power times a monomial of X / r, of the given
    degree or one degree less.
    """
    values, slopes = [], []
    for exponents in product(range(degree + 1), repeat=3):
        if sum(exponents) not in (degree, degree - 1):
            continue
        powers = points ** np.array(exponents)
        value = powers.prod(axis=1)
        slope = (power - sum(exponents)) * value[:, None] * points
        for j, exponent in enumerate(exponents):
            if exponent:
                other_powers = np.delete(powers, j, axis=1).prod(axis=1)
                slope[:, j] += exponent * points[:, j] ** (exponent - 1) * other_powers
        values.append(value)
        slopes.append(slope)
    return np.array(values), np.array(slopes)


def _orthonormal(values: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Coefficients (m, n) of m orthonormal combinations of n functions, which have the values (n, q) at q points with
    weights.
    """
    eigenvalues, vectors = np.linalg.eigh((values * weight) @ values.T)
    significant = eigenvalues > 1e-11 * eigenvalues[-1]
    return (vectors[:, significant] / np.sqrt(eigenvalues[significant])).T
