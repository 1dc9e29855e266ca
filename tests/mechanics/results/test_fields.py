"""Strain and stress at nodes, against the closed forms of homogeneous states and of bending."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.geometry.volume_mesh import TET_EDGES
from mitsuba_taxel.mechanics import NeoHookean
from mitsuba_taxel.mechanics.results.fields import nodal_fields

EXACT = {"rtol": 1e-10, "atol": 1e-12}


@pytest.fixture(params=[{}, {"distortion": 0.15, "curvature": 0.04}], ids=["straight", "curved"])
def mesh(request, block):
    return block(size=(1.0, 2.0, 0.5), cells=(2, 3, 2), **request.param)


def homogeneous(mesh, gradient, pressure, material):
    displacement = mesh.points @ (np.array(gradient) - np.eye(3)).T + (0.3, -0.2, 0.1)
    return nodal_fields(mesh, displacement, np.full(mesh.corner_count, pressure), material)


def everywhere(mesh, value):
    return np.broadcast_to(value, (len(mesh.points), *np.shape(value)))


def rotation(seed):
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))


@pytest.mark.parametrize(("along", "across"), [(0.7, 1.15), (1.6, 0.8), (2.0, 0.5**0.5)])
@pytest.mark.parametrize("material", [NeoHookean(4.16, 0.49), NeoHookean(0.35, 0.3), NeoHookean(1.0, 0.5)])
def test_uniaxial(mesh, along, across, material):
    pressure = -0.4
    fields = homogeneous(mesh, np.diag([across, along, across]), pressure, material)
    volume = along * across**2
    deviator = material.shear_modulus * volume ** (-5 / 3) * (along**2 - across**2) / 3
    stress = pressure * np.eye(3) + deviator * np.diag([-1, 2, -1])
    np.testing.assert_allclose(fields.volume_ratio, everywhere(mesh, volume), **EXACT)
    np.testing.assert_allclose(fields.cauchy_stress, everywhere(mesh, stress), **EXACT)
    np.testing.assert_allclose(fields.von_mises_stress, everywhere(mesh, 3 * abs(deviator)), **EXACT)
    stretches = sorted([along, across, across], reverse=True)
    np.testing.assert_allclose(fields.principal_stretches, everywhere(mesh, stretches), **EXACT)
    np.testing.assert_allclose(fields.pressure, everywhere(mesh, pressure), **EXACT)


@pytest.mark.parametrize("shear", [0.1, 0.8, -1.5])
@pytest.mark.parametrize("material", [NeoHookean(4.16, 0.49), NeoHookean(1.0, 0.5)])
def test_simple_shear(mesh, shear, material):
    pressure, mu = 0.25, material.shear_modulus
    fields = homogeneous(mesh, [[1, shear, 0], [0, 1, 0], [0, 0, 1]], pressure, material)
    stress = mu * np.array([[2 * shear**2 / 3, shear, 0], [shear, -(shear**2) / 3, 0], [0, 0, -(shear**2) / 3]])
    np.testing.assert_allclose(fields.volume_ratio, everywhere(mesh, 1.0), **EXACT)
    np.testing.assert_allclose(fields.cauchy_stress, everywhere(mesh, stress + pressure * np.eye(3)), **EXACT)
    von_mises = mu * np.sqrt(shear**4 + 3 * shear**2)
    np.testing.assert_allclose(fields.von_mises_stress, everywhere(mesh, von_mises), **EXACT)
    largest = abs(shear) / 2 + np.sqrt(1 + shear**2 / 4)
    np.testing.assert_allclose(fields.principal_stretches, everywhere(mesh, [largest, 1, 1 / largest]), **EXACT)


@pytest.mark.parametrize("seed", [0, 1])
def test_a_rotation_changes_nothing(mesh, seed):
    fields = homogeneous(mesh, rotation(seed), 0.0, NeoHookean())
    np.testing.assert_allclose(fields.volume_ratio, everywhere(mesh, 1.0), **EXACT)
    np.testing.assert_allclose(fields.principal_stretches, everywhere(mesh, [1.0, 1, 1]), **EXACT)
    np.testing.assert_allclose(fields.cauchy_stress, everywhere(mesh, np.zeros((3, 3))), atol=1e-11)
    np.testing.assert_allclose(fields.von_mises_stress, everywhere(mesh, 0.0), atol=1e-11)


@pytest.mark.parametrize("seed", [0, 1])
def test_a_rotation_on_top_turns_the_stress_with_it(mesh, seed):
    gradient, q = np.eye(3) + 0.2 * np.random.default_rng(seed).normal(size=(3, 3)), rotation(seed)
    before = homogeneous(mesh, gradient, 0.3, NeoHookean())
    after = homogeneous(mesh, q @ gradient, 0.3, NeoHookean())
    np.testing.assert_allclose(after.cauchy_stress, q @ before.cauchy_stress @ q.T, atol=1e-10)
    for name in ("volume_ratio", "principal_stretches", "von_mises_stress"):
        np.testing.assert_allclose(getattr(after, name), getattr(before, name), atol=1e-10)


def test_the_pressure_is_the_mean_stress_and_linear_along_edges(mesh):
    rng = np.random.default_rng(2)
    displacement, pressure = 0.01 * rng.normal(size=mesh.points.shape), rng.normal(size=mesh.corner_count)
    fields = nodal_fields(mesh, displacement, pressure, NeoHookean())
    np.testing.assert_allclose(np.trace(fields.cauchy_stress, axis1=1, axis2=2) / 3, fields.pressure, atol=1e-10)
    np.testing.assert_array_equal(fields.pressure[: mesh.corner_count], pressure)
    for node, (i, j) in enumerate(TET_EDGES, start=4):
        middle = (pressure[mesh.tets[:, i]] + pressure[mesh.tets[:, j]]) / 2
        np.testing.assert_allclose(fields.pressure[mesh.tets[:, node]], middle, atol=1e-15)


@pytest.mark.parametrize("curvature", [0.1, 0.3])
def test_bending(block, curvature):
    """u_x = c x z, u_z = -c x^2 / 2 has J = 1 + c z + c^2 x^2: a quadratic field, exact on straight elements."""
    mesh = block(cells=(2, 2, 2), distortion=0.2)
    x, _, z = mesh.points.T
    displacement = curvature * np.stack([x * z, 0 * x, -(x**2) / 2], axis=1)
    fields = nodal_fields(mesh, displacement, np.zeros(mesh.corner_count), NeoHookean())
    np.testing.assert_allclose(fields.volume_ratio, 1 + curvature * z + curvature**2 * x**2, **EXACT)
    # F^T F is ((a^2 + b^2, b (a - 1)), (b (a - 1), 1 + b^2)) in the plane, with a = 1 + c z and b = c x
    a, b = 1 + curvature * z, curvature * x
    mean, radius = (a**2 + 1) / 2 + b**2, np.hypot((a**2 - 1) / 2, b * (a - 1))
    squares = np.stack([mean + radius, 1 + 0 * x, mean - radius], axis=1)
    expected = np.sort(np.sqrt(squares), axis=1)[:, ::-1]
    np.testing.assert_allclose(fields.principal_stretches, expected, **EXACT)


def test_recovered_gradients_converge(block):
    """Inside, for a smooth field, they are of second order: a third derivative times h^2 / 8."""
    errors, wave = [], np.array([1.0, 2.0, 0.5])
    for n in (4, 8):
        mesh = block(cells=(n, n, n))
        phase = mesh.points @ wave
        displacement = 0.1 * np.stack([np.sin(phase), np.cos(phase), 0 * phase], axis=1)
        fields = nodal_fields(mesh, displacement, np.zeros(mesh.corner_count), NeoHookean())
        expected = 1 + 0.1 * np.cos(phase) - 0.2 * np.sin(phase)
        inner = np.all((mesh.points > 0.2) & (mesh.points < 0.8), axis=1)
        errors.append(np.sqrt(np.mean((fields.volume_ratio - expected)[inner] ** 2)))
    assert errors[1] < errors[0] / 3.5
    assert errors[1] < 0.1 * np.linalg.norm(wave) ** 3 / 8**2 / 8


def test_stresses_of_inverted_nodes_are_not_numbers(block):
    """And what they are elsewhere is not touched."""
    mesh = block(cells=(2, 2, 2))
    displacement = 0.05 * mesh.points
    corner = int(np.argmin(np.linalg.norm(mesh.points, axis=1)))
    displacement[corner] = (0.6, 0.6, 0.6)
    fields = nodal_fields(mesh, displacement, np.zeros(mesh.corner_count), NeoHookean())
    inverted = fields.volume_ratio <= 0
    assert inverted[corner]
    assert np.isnan(fields.von_mises_stress[inverted]).all()
    assert np.isfinite(fields.cauchy_stress[~inverted]).all()
    assert np.isfinite(fields.principal_stretches).all()
