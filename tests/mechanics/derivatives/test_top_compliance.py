"""The compliance of a pad's top: against full solves, reciprocity, total forces, and the theory of a thin layer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.mechanics import (
    Indenter,
    IndenterForce,
    NeoHookean,
    PatchForce,
    PlateDisplacement,
    SpreadForce,
    linearise,
    load_path,
)
from mitsuba_taxel.mechanics.derivatives.top_compliance import MOST_PATCHES, patch_responses, top_grid
from mitsuba_taxel.pads import Block, Pad
from mitsuba_taxel.surrogates.contact_pressures import contact_forces

PAD, SILICONE, SIZE = Pad("parallelepiped", rows=1, columns=1), NeoHookean(0.3, 0.49), 1.5
LOADS = [(SpreadForce(), (0.0, 0.0, -0.05)), (PlateDisplacement(), (0.02, 0.0, -0.05))]


@pytest.fixture(scope="module")
def rest():
    return load_path(PAD, SILICONE, [(0, 0, 0)], mesh_size=SIZE)[0]


@pytest.mark.parametrize("place", [(0.0, 0.0), (1.1, -0.6)])
def test_a_patch_yields_like_the_pad_under_a_small_force_on_it(rest, place):
    load, force = PatchForce(place, (0.7, 0.5)), 1e-4
    areas = load.nodal(rest.mesh)
    forces = np.zeros_like(rest.displacement)
    forces[:, 2] = -areas / areas.sum()
    pushed, pulled = load_path(PAD, SILICONE, [(0, 0, -force), (0, 0, force)], load=load, mesh_size=SIZE)
    assert np.array_equal(pushed.mesh.points, rest.mesh.points)
    expected = (pushed.displacement - pulled.displacement) / (2 * force)
    np.testing.assert_allclose(linearise(rest).by_forces(forces), expected, rtol=0, atol=1e-5 * np.abs(expected).max())


@pytest.mark.parametrize(("load", "value"), LOADS)
def test_forces_like_those_of_the_load_act_like_it(load, value):
    """A force over the top; a plate, whose displacement does not change by forces on it."""
    state = load_path(PAD, SILICONE, [value], load=load, mesh_size=SIZE)[0]
    linear, areas = linearise(state), SpreadForce().nodal(state.mesh)
    direction = np.array([0.6, 0.0, -0.8])
    rate = linear.by_forces(areas[:, None] / areas.sum() * direction)
    expected = 0 * rate if load.moves_plate else linear.by_value(direction)
    np.testing.assert_allclose(rate, expected, rtol=0, atol=1e-9 * np.abs(linear.by_value(direction)).max())


@pytest.mark.parametrize(("load", "value"), LOADS)
def test_many_forces_act_like_each_alone(load, value):
    """At symmetric states and others, beside loads with and without constraints; one set has no forces."""
    state = load_path(PAD, SILICONE, [value], load=load, mesh_size=SIZE)[0]
    linear, random = linearise(state), np.random.default_rng(1)
    forces = random.normal(size=(4, *state.displacement.shape))
    forces[1] = SpreadForce().nodal(state.mesh)[:, None] * [0.0, 0.0, -1.0]
    forces[2] = 0
    together = linear.by_many_forces(forces)
    for own, found in zip(forces[[0, 1, 3]], together[[0, 1, 3]], strict=True):
        expected = linear.by_forces(own)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8 * np.abs(expected).max())
    assert not together[2].any()


def test_patches_share_the_top_and_answer_each_other(rest):
    """Weights sum to 1. Together the patches are the whole top, under the sum of their forces."""
    grid, weights = top_grid(rest.mesh, 0.9)
    assert grid.shape == (5, 5) and grid.covered.all() and grid.height == pytest.approx(PAD.height)
    assert grid.x[0] == pytest.approx(-0.4 * PAD.extent[0]) and grid.y[0] == pytest.approx(0.4 * PAD.extent[1])
    np.testing.assert_allclose(weights.sum(axis=1), 1, rtol=1e-12)
    heights = weights @ (rest.mesh.points[:, 0] + 3 * rest.mesh.points[:, 1])
    np.testing.assert_allclose(heights, (grid.points[..., 0] + 3 * grid.points[..., 1]).ravel(), rtol=1e-12)
    linear = linearise(rest)
    responses = np.array(list(patch_responses(linear, weights)))
    compliance = -np.einsum("mn,kn->mk", weights.toarray(), responses[..., 2])
    np.testing.assert_allclose(compliance, compliance.T, rtol=0, atol=1e-9 * compliance.max())
    assert np.linalg.eigvalsh(compliance).min() > 0
    whole = linear.by_value((0, 0, -1))
    np.testing.assert_allclose(responses.mean(axis=0), whole, rtol=0, atol=1e-9 * np.abs(whole).max())


@pytest.mark.parametrize(("radius", "depth", "height"), [(4.0, 0.15, 2.0), (3.0, 0.2, 3.0)])
def test_a_ball_on_a_block_follows_the_theory_of_a_bonded_layer(radius, depth, height):
    """E. K. Dimitriadis et al., Biophys. J. 82 (2002), eq. 13: an incompressible layer, bonded to its support."""
    block, silicone, spacing = Block(8.0, 8.0, height), NeoHookean(1.0, 0.5), 0.25
    state = load_path(block, silicone, [(0, 0, 0)], mesh_size=0.5)[0]
    grid, weights = top_grid(state.mesh, spacing)
    points = grid.points.reshape(-1, 3)
    near = np.flatnonzero(np.hypot(*points[:, :2].T) < 1.1 * np.sqrt(radius * depth) + spacing)
    weights, points = weights[near], points[near]
    columns = [-(weights @ response[:, 2]) for response in patch_responses(linearise(state), weights)]
    depths = depth - (points[:, 0] ** 2 + points[:, 1] ** 2 + spacing**2 / 6) / (2 * radius)  # means over patches
    force = contact_forces(np.array(columns), depths[None]).sum()
    ratio = np.sqrt(radius * depth) / height
    layer = 1 + 1.133 * ratio + 1.283 * ratio**2 + 0.769 * ratio**3 + 0.0975 * ratio**4
    assert force == pytest.approx(16 / 9 * radius**0.5 * depth**1.5 * layer, rel=0.03)


def test_what_has_no_grid(rest):
    for spacing in (0.0, -1.0, np.nan, "wide"):
        with pytest.raises(InputError, match="spacing = .* a finite length in mm above 0"):
            top_grid(rest.mesh, spacing)
    with pytest.raises(InputError, match=f"at most {MOST_PATCHES}"):
        top_grid(rest.mesh, 0.05)
    points = rest.mesh.points.copy()
    points[np.argmax(points[:, 2]), 2] += 0.1
    with pytest.raises(InputError, match="plane top: the heights of this one differ by 0.1 mm"):
        top_grid(replace(rest.mesh, points=points), 0.9)
    pressed = load_path(PAD, SILICONE, [(0, 0, -0.02)], load=IndenterForce(Indenter(radius=2.0)), mesh_size=2.5)[0]
    with pytest.raises(InputError, match="beside that of an indenter"):
        linearise(pressed).by_forces(0 * pressed.displacement)
    with pytest.raises(InputError, match="beside that of an indenter"):
        linearise(pressed).by_many_forces(0 * pressed.displacement[None])
    with pytest.raises(InputError, match="forces"):
        linearise(rest).by_forces(np.zeros(3))
    with pytest.raises(InputError, match="forces"):
        linearise(rest).by_many_forces(np.zeros((2, 3)))
