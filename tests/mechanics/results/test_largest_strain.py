"""The largest strain: of homogeneous states by closed form, and on elements of any size."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel import Pad
from mitsuba_taxel.mechanics import NeoHookean, State, load_path
from mitsuba_taxel.mechanics.elements.loads import SPREAD_FORCE
from mitsuba_taxel.mechanics.results import largest_strain
from mitsuba_taxel.mechanics.results.largest_strain import SHARE, LargestStrain

SILICONE = NeoHookean(4.16, 0.49)


def moved(mesh, displacement):
    none = np.zeros(mesh.corner_count)
    return LargestStrain(State(mesh, SILICONE, SPREAD_FORCE, np.zeros(3), displacement, none, 1.0, 0.0, 0, True))


def test_a_homogeneous_state(block):
    """Sheared by k, the larger stretch s has s - 1 / s = k; a block that is stretched later needs less."""
    mesh = block(size=(1.0, 2.0, 0.5), cells=(2, 3, 2), distortion=0.15, curvature=0.04)
    shear = np.zeros((3, 3))
    shear[0, 2] = 0.6
    sheared = moved(mesh, mesh.points @ shear.T)
    assert sheared.value == pytest.approx(0.3 + np.sqrt(1.09) - 1, rel=1e-12)
    along = np.zeros((3, 3))
    along[1, 1] = 1.0
    stretched, rate = moved(mesh, 0.4 * mesh.points @ along.T), mesh.points @ along.T
    assert stretched.value == pytest.approx(0.4, rel=1e-12)
    assert stretched.rate(rate, 0 * rate) == pytest.approx(1.0, rel=1e-12)
    assert stretched.rate(0 * rate, rate) == pytest.approx(-0.4, rel=1e-12)  # u / Y with Y growing as exp(t)


def test_a_linear_strain_counts_by_its_most_strained_part(block):
    """Of a strain of x / 2 up to x = 1: the mean over the last hundredth."""
    mesh = block(cells=(12, 2, 2))
    displacement = np.zeros_like(mesh.points)
    displacement[:, 0] = mesh.points[:, 0] ** 2 / 4
    found = moved(mesh, displacement)
    assert found.value == pytest.approx((1 - SHARE / 2) / 2, rel=0.02)
    assert found.rate(displacement, 0 * displacement) == pytest.approx(found.value, rel=1e-12)


def test_blocks_of_a_large_mesh_give_the_same(block, monkeypatch):
    """The strain of x / 2 again, with all of its rates, by blocks of which the last is not full."""
    mesh = block(cells=(12, 2, 2))
    displacement = np.zeros_like(mesh.points)
    displacement[:, 0] = mesh.points[:, 0] ** 2 / 4

    def results():
        found = moved(mesh, displacement)
        return found.value, found.rate(displacement, 0 * displacement), found.rate(0 * displacement, mesh.points)

    whole = results()
    monkeypatch.setattr(largest_strain, "BLOCK", len(mesh.tets) // 3 + 1)
    np.testing.assert_allclose(results(), whole, rtol=1e-13)
    assert whole[0] == pytest.approx((1 - SHARE / 2) / 2, rel=0.02)
    assert whole[2] == pytest.approx(-whole[0], rel=1e-12)  # u / X with X growing as exp(t)


def test_smaller_elements_do_not_change_it():
    """While the maximum, at the glued rim, grows."""
    pad, sizes = Pad(rows=1, columns=1), (1.6, 1.25)
    states = [load_path(pad, SILICONE, [(0.5, 0, -1)], mesh_size=size)[0] for size in sizes]
    coarse, fine = (LargestStrain(state).value for state in states)
    assert coarse == pytest.approx(fine, rel=0.03)
