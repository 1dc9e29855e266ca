"""The linear law beside the feet of a pad's upright edges."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.mechanics import MooneyRivlin, NeoHookean, SpreadForce, Viscoelastic
from mitsuba_taxel.mechanics.contact.barriers.self_contact import Contact
from mitsuba_taxel.mechanics.continuation.pad_path import pad_path
from mitsuba_taxel.mechanics.elements.assembly import Assembly
from mitsuba_taxel.mechanics.elements.constraints import number_unknowns
from mitsuba_taxel.mechanics.elements.elements import Elements, quadrature_places
from mitsuba_taxel.mechanics.elements.nodal_forces import internal_forces
from mitsuba_taxel.mechanics.equilibrium.feet import couple_held, near_feet
from mitsuba_taxel.mechanics.history.step_state import PathEnded
from mitsuba_taxel.mechanics.history.timed_path import TimedPath
from mitsuba_taxel.pads import Pad

LAWS = [NeoHookean(2.0, 0.45), MooneyRivlin(0.3, 0.1, 0.49)]


@pytest.fixture(scope="module")
def mesh():
    return Pad("cylindrical", rows=1, columns=2).mesh(2.5)


def linear_everywhere(mesh, law):
    every = np.ones((len(mesh.tets), 8), dtype=bool)
    return Assembly(mesh, law, number_unknowns(mesh, np.zeros(len(mesh.points), bool)), linear=every)


def test_a_pad_has_four_feet(mesh):
    x, y, height = np.abs(mesh.points).max(axis=0)
    feet = np.array([(i * x, j * y, 0.0) for i in (1, -1) for j in (1, -1)])
    away = np.linalg.norm(quadrature_places(mesh)[:, :, None] - feet, axis=-1).min(axis=-1)
    np.testing.assert_array_equal(near_feet(mesh), away < height / 15)
    assert near_feet(mesh).any(axis=1).sum() >= 4


@pytest.mark.parametrize("law", LAWS)
def test_a_homogeneous_strain_has_the_stress_of_hooke(mesh, law):
    """Forces have the virial V sigma of the isotropic solid with the law's moduli, however large the strain."""
    rng = np.random.default_rng(2)
    gradient, pressure = 2.0 * rng.standard_normal((3, 3)), 0.3
    assembly = linear_everywhere(mesh, law)
    state = assembly.evaluate(mesh.points @ gradient.T, np.full(mesh.corner_count, pressure))
    forces = state.residual[: 3 * len(mesh.points)].reshape(-1, 3)
    strain, volume = (gradient + gradient.T) / 2, assembly.elements.weight.sum()
    deviator = strain - np.trace(strain) / 3 * np.eye(3)
    stress = 2 * law.shear_modulus * deviator + pressure * np.eye(3)
    np.testing.assert_allclose(forces.T @ mesh.points, volume * stress, atol=1e-10 * volume)
    grown = state.residual[3 * len(mesh.points) :].sum()
    assert grown == pytest.approx(volume * (np.trace(gradient) - law.compressibility * pressure), rel=1e-10)


@pytest.mark.parametrize("law", LAWS)
def test_the_couple_that_is_held_is_the_moment_of_its_forces(mesh, law):
    """Of those of all elements, and of those at the feet alone; other laws have none."""
    rng = np.random.default_rng(5)
    displacement = mesh.points @ (0.1 * rng.standard_normal((3, 3))) + 0.01 * mesh.points**2
    pressure = rng.standard_normal(mesh.corner_count)
    places = mesh.points + displacement
    usual = internal_forces(mesh, law, displacement, pressure)
    scale = np.abs(usual).sum()
    np.testing.assert_allclose(np.cross(places, usual).sum(axis=0), 0, atol=1e-12 * scale)
    for linear in (np.ones((len(mesh.tets), 8), dtype=bool), near_feet(mesh)):
        forces = internal_forces(mesh, law, displacement, pressure, linear=linear)
        moment = np.cross(places, forces).sum(axis=0)
        assert np.abs(moment).max() > 1e-7 * scale
        np.testing.assert_allclose(couple_held(mesh, law, linear, displacement, pressure), moment, atol=1e-12 * scale)


@pytest.mark.parametrize("law", LAWS)
def test_forces_are_linear_and_the_tangent_is_theirs(mesh, law):
    assembly = linear_everywhere(mesh, law)
    rng = np.random.default_rng(3)
    displacement, pressure = rng.standard_normal(mesh.points.shape), rng.standard_normal(mesh.corner_count)
    state = assembly.evaluate(displacement, pressure)
    lower = assembly.matrix(state.entries)
    unknowns = np.concatenate([displacement.ravel(), pressure])
    by_tangent = lower @ unknowns + lower.T @ unknowns - lower.diagonal() * unknowns
    np.testing.assert_allclose(by_tangent, state.residual, atol=1e-9 * np.abs(state.residual).max())
    assert state.min_jacobian == 1.0


def test_small_strains_are_those_of_the_law(mesh):
    """To first order; elsewhere nothing changes."""
    law, some = LAWS[1], near_feet(mesh)
    rng = np.random.default_rng(4)
    displacement, pressure = (1e-6 * rng.standard_normal(n) for n in (mesh.points.shape, mesh.corner_count))
    usual, here = (Elements(mesh, law, which).evaluate(displacement, pressure, True) for which in (None, some))
    largest = np.abs(usual.forces).max()
    np.testing.assert_allclose(here.forces, usual.forces, atol=1e-4 * largest)
    apart = ~some.any(axis=1)
    np.testing.assert_array_equal(here.forces[apart], usual.forces[apart])
    np.testing.assert_array_equal(here.matrices.blocks[apart], usual.matrices.blocks[apart])


@pytest.mark.parametrize(("place", "said"), [((1.0, -1.0), True), ((-0.98, 0.98), True), ((1.0, 0.2), False)])
def test_a_path_that_ends_at_a_foot_says_so(mesh, place, said):
    """At a place that is told relative to the corner of the bottom; also one of a viscoelastic silicone."""
    pad = Pad("cylindrical", rows=1, columns=2)
    at = np.array([place[0] * pad.extent[0] / 2, place[1] * pad.extent[1] / 2, 0.0])
    path, value = pad_path(pad, LAWS[0], SpreadForce(), 2.5), np.array([0.0, 0.0, -3.0])
    (message,) = path._end(value, "touches the board", at, []).args
    assert message.endswith("-3) N. " * (not said) + "With self_contact = true the path continues.")
    ended = PathEnded(value, 1.0, "touches the board", Contact("the board", tuple(at)))
    in_time = TimedPath(path, Viscoelastic(LAWS[0], ((0.2, 1.0),)))._end(ended, 0.0, 2.0)
    assert in_time.endswith("-3) N, 2 s.") is not said
    for words in (message, in_time):
        assert ("the foot of an upright edge, which rolls over at a smaller load on smaller elements" in words) is said
