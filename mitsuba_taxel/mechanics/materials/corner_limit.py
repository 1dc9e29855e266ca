"""What a sharp free corner bears: the least even pressure of constant direction under which it is unstable.

No length belongs to a corner of three right-angled sides, one of which is loaded. Its stress is uniaxial, and
displacements that repeat themselves at all distances r from it are r^s f(X / r) (V. A. Kondrat'ev, *Trans. Moscow Math.
Soc.* 16, 1967). With s = -1/2 each decade of r holds as much energy. Once that of some f is negative, so is that of the
same f over as many decades as it takes to begin and end: the corner is unstable in any neighbourhood, however small.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np

from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.mechanics.materials.laws import Material

DEGREE = 10
"""Of the polynomials f; those of degree 6 change the limit by 1e-3."""
POINTS = 24
"""Of the quadrature over the sphere's octant, along each of its angles."""
INCOMPRESSIBLE = 1e-5
"""Least compressibility, relative to one over Young's modulus."""
STRETCHES = np.arange(0.95, 0.25, -0.05)
"""Tried in turn for the first that is unstable."""


@kept(64)
def corner_limit(material: Material) -> float:
    """Nominal pressure in MPa at which a corner of a material becomes unstable; infinite if it does not.

    0.70 shear moduli of a neo-Hookean solid.
    """
    stable = 1.0
    for stretch in STRETCHES:
        if _least(stretch, material) < 0:
            return -_uniaxial(_root(lambda at: _least(at, material), stretch, stable, 1e-6), material)[1]
        stable = stretch
    return np.inf


def _root(function: Callable[[float], float], low: float, high: float, tolerance: float) -> float:
    from scipy.optimize import brentq  # here, as only large loads need it

    return brentq(function, low, high, xtol=tolerance)


def _uniaxial(stretch: float, material: Material) -> tuple[np.ndarray, float, float]:
    """Deformation gradient (3, 3), nominal stress along z [MPa] and pressure [MPa] under uniaxial stress."""

    def volume_off(across: float) -> float:
        gradient = np.diag([across, across, stretch])
        return material.compressibility * _pressure(gradient, material) - (np.linalg.det(gradient) - 1)

    across = _root(volume_off, stretch**0.5, 1.001 * stretch**-0.5, 1e-12)
    gradient = np.diag([across, across, stretch])
    pressure = _pressure(gradient, material)
    return gradient, float(_stress(gradient, material)[2, 2] + pressure * across**2), pressure


def _pressure(gradient: np.ndarray, material: Material) -> float:
    """MPa, that which leaves no stress along x."""
    return float(-_stress(gradient, material)[0, 0] / (gradient[1, 1] * gradient[2, 2]))


def _stress(gradient: np.ndarray, material: Material) -> np.ndarray:
    return material.stress(*_with_inverse(gradient))


def _with_inverse(gradient: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return gradient, np.array(np.linalg.det(gradient)), np.linalg.inv(gradient).T


def _least(stretch: float, material: Material) -> float:
    """Least energy of a decade of r over all f of one size, with its sign."""
    gradient, _, pressure = _uniaxial(stretch, material)
    state = _with_inverse(gradient)
    moduli = material.moduli(*state, np.array(pressure)).dense()
    weight, slopes, pressures = _functions()
    along = np.einsum("q,aqj,bql->abjl", weight, slopes, slopes, optimize=True)
    energy = np.einsum("ijkl,abjl->aibk", moduli, along, optimize=True)
    volumes = np.einsum("q,pq,aqj,ij->pai", weight, pressures, slopes, state[1] * state[2], optimize=True)
    size = energy.shape[0] * 3
    energy, volumes = energy.reshape(size, size), volumes.reshape(-1, size)
    compressibility = max(material.compressibility, INCOMPRESSIBLE / material.youngs_modulus)
    return float(np.linalg.eigvalsh(energy + volumes.T @ volumes / compressibility)[0])


@kept(1)
def _functions() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Weights (q,) of points of the sphere's octant; gradients there (n, q, 3) of functions r^(-1/2) f, orthonormal on
    it; and orthonormal r^(-3/2) f (m, q) of two degrees less, for the pressure."""
    places, weights = np.polynomial.legendre.leggauss(POINTS)
    angles, parts = np.pi / 4 * (places + 1), np.pi / 4 * weights
    polar, around = (angle.ravel() for angle in np.meshgrid(angles, angles, indexing="ij"))
    points = np.stack([np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)], axis=1)
    weight = np.outer(parts, parts).ravel() * np.sin(polar)
    values, slopes = _monomials(points, DEGREE, -0.5)
    basis = _orthonormal(values, weight)
    pressures = _monomials(points, DEGREE - 2, -1.5)[0]
    return weight, np.tensordot(basis, slopes, 1), _orthonormal(pressures, weight) @ pressures


def _monomials(points: np.ndarray, degree: int, power: float) -> tuple[np.ndarray, np.ndarray]:
    """Values (n, q) and gradients (n, q, 3) at r = 1 of r^power times monomials of X / r, of a degree and one less."""
    values, slopes = [], []
    for exponents in product(range(degree + 1), repeat=3):
        if sum(exponents) not in (degree, degree - 1):
            continue
        powers = points ** np.array(exponents)
        value = powers.prod(axis=1)
        slope = (power - sum(exponents)) * value[:, None] * points
        for j, exponent in enumerate(exponents):
            if exponent:
                others = np.delete(powers, j, axis=1).prod(axis=1)
                slope[:, j] += exponent * points[:, j] ** (exponent - 1) * others
        values.append(value)
        slopes.append(slope)
    return np.array(values), np.array(slopes)


def _orthonormal(values: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """(m, n) combinations of functions (n, q) that are orthonormal."""
    sizes, ways = np.linalg.eigh((values * weight) @ values.T)
    kept = sizes > 1e-11 * sizes[-1]
    return (ways[:, kept] / np.sqrt(sizes[kept])).T
