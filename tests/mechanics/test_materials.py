"""The material law against closed forms, its own energy and finite differences."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from mitsuba_taxel.errors import InputError
from mitsuba_taxel.mechanics import NeoHookean

POISSON = [0.0, 0.3, 0.49, 0.4999, 0.5]


@pytest.fixture
def gradients():
    rng = np.random.default_rng(3)
    gradients = np.eye(3) + 0.3 * rng.uniform(-1, 1, (50, 3, 3))
    return gradients[np.linalg.det(gradients) > 0.3]


def stress(law, gradient):
    return law.stress(gradient, np.linalg.det(gradient), np.swapaxes(np.linalg.inv(gradient), -1, -2))


def tangent(law, gradient):
    return law.tangent(gradient, np.linalg.det(gradient), np.swapaxes(np.linalg.inv(gradient), -1, -2))


def differences(function, gradient, step=1e-5):
    columns = []
    for i in range(3):
        for j in range(3):
            offset = np.zeros((3, 3))
            offset[i, j] = step
            columns.append((function(gradient + offset) - function(gradient - offset)) / (2 * step))
    columns = np.stack(columns, axis=-1)
    return columns.reshape(*columns.shape[:-1], 3, 3)


def test_stress_is_the_derivative_of_the_energy(gradients):
    law = NeoHookean()
    np.testing.assert_allclose(stress(law, gradients), differences(law.energy, gradients), atol=1e-8)


def test_tangent_is_the_derivative_of_the_stress_and_symmetric(gradients):
    law = NeoHookean()
    moduli = tangent(law, gradients)
    np.testing.assert_allclose(moduli, differences(lambda f: stress(law, f), gradients), atol=1e-7)
    np.testing.assert_allclose(moduli, moduli.transpose(0, 3, 4, 1, 2), atol=1e-12)


def test_energy_does_not_know_rotations_and_stress_turns_with_them(gradients):
    law = NeoHookean()
    rotation, _ = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))
    rotation *= np.linalg.det(rotation)
    np.testing.assert_allclose(law.energy(rotation @ gradients), law.energy(gradients), rtol=1e-12)
    np.testing.assert_allclose(law.energy(gradients @ rotation), law.energy(gradients), rtol=1e-12)
    turned = rotation @ stress(law, gradients)
    np.testing.assert_allclose(stress(law, rotation @ gradients), turned, atol=1e-12)


def test_volume_changes_alone_store_no_isochoric_energy():
    swollen = np.array([0.7, 1.0, 1.6])[:, None, None] * np.eye(3)
    np.testing.assert_allclose(NeoHookean().energy(swollen), 0, atol=1e-14)


@pytest.mark.parametrize("nu", POISSON)
def test_moduli_at_small_strain_are_those_of_linear_elasticity(nu):
    law = NeoHookean(2.5, nu)
    assert law.shear_modulus == pytest.approx(2.5 / (2 * (1 + nu)))
    assert law.compressibility == pytest.approx(3 * (1 - 2 * nu) / 2.5)
    # Stretched along z, free laterally: 1/E = 1/(9 kappa) + 1/(3 mu).
    assert law.compressibility / 9 + 1 / (3 * law.shear_modulus) == pytest.approx(1 / 2.5)


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        ({"youngs_modulus": 0.0}, "youngs_modulus"),
        ({"youngs_modulus": -1.0}, "youngs_modulus"),
        ({"youngs_modulus": math.nan}, "youngs_modulus"),
        ({"youngs_modulus": math.inf}, "youngs_modulus"),
        ({"youngs_modulus": "soft"}, "youngs_modulus"),
        ({"poisson_ratio": 0.51}, "poisson_ratio"),
        ({"poisson_ratio": -0.1}, "poisson_ratio"),
        ({"poisson_ratio": math.nan}, "poisson_ratio"),
        ({"poisson_ratio": None}, "poisson_ratio"),
    ],
)
def test_moduli_out_of_range_are_refused_in_one_line(arguments, name):
    with pytest.raises(InputError, match=rf"^{name} = .* is not allowed") as caught:
        NeoHookean(**arguments)
    assert "\n" not in str(caught.value)


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
    from mitsuba_taxel.mechanics.assembly import Assembly

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
    assembly = Assembly(mesh, law, np.zeros(len(mesh.points), bool))
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
    from mitsuba_taxel.mechanics.assembly import Assembly

    law = NeoHookean(4.16, nu)
    gradient = np.eye(3) + shear * np.outer([1, 0, 0], [0, 0, 1])
    mu, g2 = law.shear_modulus, shear**2
    cauchy = mu * np.array([[2 * g2 / 3, 0, shear], [0, -g2 / 3, 0], [shear, 0, -g2 / 3]])
    nominal = cauchy @ np.linalg.inv(gradient).T
    mesh = block((1.0, 2.0, 1.5), (2, 2, 2), distortion=0.2)
    assembly = Assembly(mesh, law, np.zeros(len(mesh.points), bool))
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
