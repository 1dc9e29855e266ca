"""Patches cut along a plane: they cover the same surface, and none of them crosses it."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.transport.patch_cuts import cut_at_plane, uncut
from mitsuba_taxel.transport.patches import DEGREE, LATTICE, PatchPoints
from mitsuba_taxel.transport.pieces import Pieces
from mitsuba_taxel.transport.rules import monomials

POINT, NORMAL = np.array([0.0, 0.0, 0.5]), np.array([0.0, 0.0, 1.0])
AT_CORNERS = [int(np.abs(LATTICE - corner).sum(axis=1).argmin()) for corner in ((0, 0), (1, 0), (0, 1))]


@pytest.fixture
def places():
    """(F, 15, 3) upright patches, slightly bent, on both sides of the plane or across it."""
    rng = np.random.default_rng(1)
    corners = rng.uniform([0, 0, 0], [0.1, 1, 1], (40, 3, 3))
    corners[0, :, 2], corners[1, :, 2], corners[2, :, 2] = (0.1, 0.2, 0.4), (0.5, 0.6, 0.9), (0.2, 0.5, 0.8)
    bend = 0.02 * monomials(LATTICE, DEGREE) @ rng.normal(size=(15, 3))
    bend -= np.column_stack([1 - LATTICE.sum(axis=1), LATTICE]) @ bend[AT_CORNERS]
    return np.column_stack([1 - LATTICE.sum(axis=1), LATTICE]) @ corners + bend


def test_triangles_cover_the_patches(places):
    cuts = cut_at_plane(places, POINT, NORMAL)
    areas = Pieces(cuts.parent, cuts.corners).areas()
    np.testing.assert_allclose(np.bincount(cuts.parent, areas), 1.0, atol=1e-5)
    assert np.bincount(cuts.parent)[:2].tolist() == [1, 1] and np.bincount(cuts.parent)[2] == 2
    sides = cuts.corners[:, 1:] - cuts.corners[:, :1]
    assert (np.linalg.det(sides) > 0).all()  # they face the same side


def test_points_are_those_of_the_patches(places):
    cuts = cut_at_plane(places, POINT, NORMAL)
    at = np.random.default_rng(2).dirichlet((1, 1, 1), len(cuts.parent))[:, 1:]
    on_patch = cuts.corners[:, 0] + np.einsum("ci,cij->cj", at, cuts.corners[:, 1:] - cuts.corners[:, :1])
    own = PatchPoints(np.arange(len(cuts.parent)), at).interpolated(cuts.of(places))
    np.testing.assert_allclose(own, PatchPoints(cuts.parent, on_patch).interpolated(places), atol=1e-12)


def test_no_triangle_crosses_the_plane(places):
    heights = (cut_at_plane(places, POINT, NORMAL).of(places)[:, AT_CORNERS] - POINT) @ NORMAL
    before = (places[:, AT_CORNERS] - POINT) @ NORMAL
    assert (np.minimum(before.max(axis=1), -before.min(axis=1)) > 0.1).any()
    assert np.minimum(heights.max(axis=1), -heights.min(axis=1)).max() < 0.05  # by the bend of the sides


def test_uncut_patches_are_as_they_were(places):
    np.testing.assert_allclose(uncut(len(places)).of(places), places, atol=1e-14)
