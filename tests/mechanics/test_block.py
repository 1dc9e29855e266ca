"""Blocks without cells under loads, against closed forms."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from mitsuba_taxel import Block, Indenter, IndenterDisplacement, NeoHookean, PlateDisplacement, load_path
from mitsuba_taxel.mechanics.results.balance import reactions
from mitsuba_taxel.mechanics.results.contact_pressure import indentation_of

MODULUS, RATIO = 0.5, 0.49
REDUCED = MODULUS / (1 - RATIO**2)


@pytest.mark.parametrize(("block", "modulus"), [(Block(20.0, 15.0, 4.0), 1.0), (Block(6.0, 6.0, 9.0), 0.2)])
def test_a_block_that_does_not_widen_is_compressed_evenly(block, modulus):
    # At Poisson's ratio 0 the glued bottom restrains nothing: the block shortens like a lubricated one, by F H / (E A).
    force = -1e-5 * modulus * block.width * block.depth
    (state,) = load_path(block, NeoHookean(modulus, 0.0), [(0, 0, force)])
    assert state.displacement[:, 2] == pytest.approx(-1e-5 * state.mesh.points[:, 2], rel=2e-5, abs=1e-9)
    assert np.abs(state.displacement[:, :2]).max() < 1e-9


@pytest.mark.parametrize(("width", "height"), [(30.0, 1.0), (20.0, 0.4)])
def test_a_wide_thin_block_under_a_plate_has_the_modulus_of_uniaxial_strain(width, height):
    # E (1 - v) / ((1 + v) (1 - 2 v)), less of it along the rim, over some thickness, where the material bulges.
    block, load = Block(width, width, height), PlateDisplacement()
    (state,) = load_path(block, NeoHookean(MODULUS, 0.3), [(0, 0, -1e-4 * height)], load=load, mesh_size=1.0)
    uniaxial = MODULUS * 0.7 / (1.3 * 0.4) * 1e-4 * width**2
    loss = 1 + reactions(state).applied_force[2] / uniaxial
    assert 0 < loss < height / width


@cache
def pressed(block, radius, depth, mesh_size):
    """Force in N on a ball in a block, and radius of its contact in mm."""
    load = IndenterDisplacement(Indenter("sphere", radius=radius))
    (state,) = load_path(block, NeoHookean(MODULUS, RATIO), [(0, 0, -depth)], load=load, mesh_size=mesh_size)
    body, contact = indentation_of(state)
    squared = ((state.mesh.points + state.displacement)[:, :2] ** 2).sum(axis=1)
    # The mean square distance from the axis, weighted by the pressure of Hertz, is 2/5 of the squared radius.
    radius = np.sqrt(2.5 * (contact.pressure @ (body.carried @ squared)) / (contact.pressure @ body.area))
    return -contact.force[2], radius


CASES = [
    (Block(12.0, 12.0, 6.0), 2.0, 0.06, 2.0),
    (Block(20.0, 15.0, 4.0, top_radius=40.0), 4.0, 0.08, 1 / (1 / 4 + 1 / 40)),
]


@pytest.mark.parametrize(("block", "radius", "depth", "relative"), CASES)
def test_a_ball_makes_the_print_of_hertz(block, radius, depth, relative):
    force, contact_radius = pressed(block, radius, depth, 0.9)
    assert contact_radius == pytest.approx((0.75 * force * relative / REDUCED) ** (1 / 3), rel=0.02)


@pytest.mark.parametrize(("block", "radius", "depth", "relative"), CASES)
def test_a_ball_meets_the_stiffness_of_a_bonded_layer(block, radius, depth, relative):
    # E. K. Dimitriadis et al., Biophys. J. 82, 2002, equation 10, for an incompressible layer.
    force, _ = pressed(block, radius, depth, 0.9)
    x = np.sqrt(relative * depth) / block.height
    series = 1 + 1.133 * x + 1.283 * x**2 + 0.769 * x**3 + 0.0975 * x**4
    assert force == pytest.approx(4 / 3 * REDUCED * np.sqrt(relative) * depth**1.5 * series, rel=0.04)


def test_the_error_of_the_top_is_that_of_smaller_elements():
    block = Block(8.0, 8.0, 4.0)
    coarse, fine = (load_path(block, NeoHookean(MODULUS, RATIO), [(0, 0, -3.0)], mesh_size=h)[0] for h in (1.3, 0.5))
    depth, finer_depth = (state.displacement[:, 2].min() for state in (coarse, fine))
    assert coarse.error.displacement > 0
    assert abs(depth - finer_depth) < 3 * coarse.error.largest
    assert coarse.error.largest < 0.1 * abs(finer_depth)
