"""Nodal forces of a distorted mesh in homogeneous states, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from mitsuba_taxel.mechanics import NeoHookean
from mitsuba_taxel.mechanics.elements.assembly import Assembly
from mitsuba_taxel.mechanics.elements.constraints import number_unknowns
from mitsuba_taxel.mechanics.materials.laws import MooneyRivlin, Yeoh

pytestmark = pytest.mark.quick


def stress(law, gradient):
    return law.stress(gradient, np.linalg.det(gradient), np.swapaxes(np.linalg.inv(gradient), -1, -2))


MOONEY, YEOH = MooneyRivlin(0.4, 0.15, 0.5), Yeoh(0.5, -0.02, 0.01, 0.5)


def uniaxial(law, stretch):
    """Nominal stress of the incompressible solid: 2 (x - x^-2) (W1 + W2 / x) (L. R. G. Treloar, 1975)."""
    if law is MOONEY:
        slopes = law.c10 + law.c01 / stretch
    else:
        change = stretch**2 + 2 / stretch - 3
        slopes = law.c10 + 2 * law.c20 * change + 3 * law.c30 * change**2
    return 2 * (stretch - stretch**-2) * slopes


@pytest.mark.parametrize("stretch", [0.6, 1.5])
@pytest.mark.parametrize("law", [MOONEY, YEOH], ids=["mooney_rivlin", "yeoh"])
def test_uniaxial_stretch_of_an_incompressible_distorted_block(law, stretch, block):
    """With nu = 0.5 exactly, nodal forces of the mesh are those of the closed form."""
    stretches = np.array([stretch, stretch**-0.5, stretch**-0.5])
    pressure = -stress(law, np.diag(stretches))[2, 2] * stretches[2]
    mesh = block((1.0, 2.0, 1.5), (2, 2, 2), distortion=0.2)
    assembly = Assembly(mesh, law, number_unknowns(mesh, np.zeros(len(mesh.points), bool)))
    state = assembly.evaluate(mesh.points * (stretches - 1), np.full(mesh.corner_count, pressure))
    expected = surface_forces(mesh, np.diag([uniaxial(law, stretch), 0, 0]))
    forces, constraint = np.split(state.residual, [3 * len(mesh.points)])
    np.testing.assert_allclose(forces.reshape(-1, 3), expected, atol=1e-10 * np.abs(expected).max())
    np.testing.assert_allclose(constraint, 0, atol=1e-13)


def principal(law, stretches, pressure):
    """Nominal principal stresses, written from the energy in principal stretches."""
    stretches = np.asarray(stretches, dtype=float)
    volume = stretches.prod()
    first_invariant = np.square(stretches).sum()
    isochoric = law.shear_modulus * volume ** (-2 / 3) * (stretches - first_invariant / (3 * stretches))
    return isochoric + pressure * volume / stretches


def lateral_stretch(law, stretches_of):
    """Lateral stretch that leaves the last principal direction free of stress, for nu < 0.5."""

    def last(lateral):
        stretches = stretches_of(lateral)
        return principal(law, stretches, (np.prod(stretches) - 1) / law.compressibility)[2]

    return brentq(last, 0.2, 3.0, xtol=1e-15, rtol=1e-15)


@pytest.mark.parametrize("nu", [0.3, 0.49, 0.4999])
@pytest.mark.parametrize("stretch", [0.6, 0.9, 1.5])
@pytest.mark.parametrize("axes", [1, 2])
def test_uniaxial_and_biaxial_stretch_of_a_distorted_block(nu, stretch, axes, block):
    """Nodal forces of the mesh at the exact homogeneous state are the exact tractions."""
    law = NeoHookean(4.16, nu)

    def stretches_of(lateral):
        return np.array([stretch, *([lateral] if axes == 1 else [stretch]), lateral])

    lateral = lateral_stretch(law, stretches_of)
    stretches = stretches_of(lateral)
    volume = stretches.prod()
    pressure = (volume - 1) / law.compressibility
    nominal = principal(law, stretches, pressure)
    if nu == 0.4999:  # the incompressible limit: P = mu (l - l^-2), and mu (l - l^-5) for two equal stretches
        limit = stretch - stretch ** (-2 if axes == 1 else -5)
        assert nominal[0] == pytest.approx(law.shear_modulus * limit, rel=2e-3)
    mesh = block((1.0, 2.0, 1.5), (2, 2, 2), distortion=0.2)
    assembly = Assembly(mesh, law, number_unknowns(mesh, np.zeros(len(mesh.points), bool)))
    displacement = mesh.points * (stretches - 1)
    state = assembly.evaluate(displacement, np.full(mesh.corner_count, pressure))
    expected = surface_forces(mesh, np.diag(nominal))
    scale = np.abs(expected).max()
    forces, constraint = np.split(state.residual, [3 * len(mesh.points)])
    np.testing.assert_allclose(forces.reshape(-1, 3), expected, atol=1e-9 * scale)
    np.testing.assert_allclose(constraint, 0, atol=1e-12)
    assert state.min_jacobian == pytest.approx(volume, rel=1e-12)


@pytest.mark.parametrize("nu", [0.3, 0.49, 0.4999, 0.5])
@pytest.mark.parametrize("shear", [0.1, 1.0])
def test_simple_shear_of_a_distorted_block(nu, shear, block):
    """s_12 = mu g; s_11 = 2 mu g^2 / 3, s_22 = s_33 = -mu g^2 / 3 (Cauchy), and no pressure."""
    law = NeoHookean(4.16, nu)
    gradient = np.eye(3) + shear * np.outer([1, 0, 0], [0, 0, 1])
    mu, g2 = law.shear_modulus, shear**2
    cauchy = mu * np.array([[2 * g2 / 3, 0, shear], [0, -g2 / 3, 0], [shear, 0, -g2 / 3]])
    nominal = cauchy @ np.linalg.inv(gradient).T
    mesh = block((1.0, 2.0, 1.5), (2, 2, 2), distortion=0.2)
    assembly = Assembly(mesh, law, number_unknowns(mesh, np.zeros(len(mesh.points), bool)))
    state = assembly.evaluate(mesh.points @ (gradient - np.eye(3)).T, np.zeros(mesh.corner_count))
    forces, constraint = np.split(state.residual, [3 * len(mesh.points)])
    np.testing.assert_allclose(forces.reshape(-1, 3), surface_forces(mesh, nominal), atol=1e-12)
    np.testing.assert_allclose(constraint, 0, atol=1e-13)


def surface_forces(mesh, nominal):
    """Consistent nodal forces of a uniform nominal stress on the block's flat faces."""
    a, b, c = (mesh.points[mesh.faces[:, k]] for k in range(3))
    traction = 0.5 * np.cross(b - a, c - a) @ nominal.T / 3
    forces = np.zeros_like(mesh.points)
    for k in (3, 4, 5):
        np.add.at(forces, mesh.faces[:, k], traction)
    return forces
