"""The stated error of roofs, from displacements whose error is known because it was put there."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from mitsuba_taxel.base.convergence import ERROR_SHARE
from mitsuba_taxel.mechanics import NeoHookean, load_path
from mitsuba_taxel.mechanics.elements.symmetry import node_images
from mitsuba_taxel.mechanics.errors.roof_error import RoofComparison, size_ratio
from mitsuba_taxel.pads import Pad
from mitsuba_taxel.pads.parametric.pad import CELL_SHAPES

THIN, ROUND, THICK = Pad(rows=1, columns=1, wall=0.5), Pad("hemispheric", 1, 1), Pad(rows=1, columns=1)
PAIRS = [(THIN, 1.25, 2.5), (THIN, 1.25, 0.625), (ROUND, 1.25, 0.625), (THICK, 1.0, 2.0)]
"""Pads, and two sizes of elements whose numbers are by far not eight to one."""
ERROR = np.array([0.0, 0.0, -0.003])


def test_eight_times_the_elements_with_four_times_the_faces_are_half_as_large():
    mesh = THICK.mesh(1.25)
    finer = replace(mesh, tets=np.tile(mesh.tets, (8, 1)), face_cell=np.tile(mesh.face_cell, 4))
    assert size_ratio(mesh, finer) == pytest.approx(0.5) and size_ratio(finer, mesh) == pytest.approx(2.0)
    assert 1.1 < size_ratio(*(THIN.mesh(size) for size in (1.25, 2.5))) < 1.5  # and not 2


@pytest.mark.parametrize(("pad", "size", "second"), PAIRS)
def test_an_error_that_goes_with_a_power_of_the_size_is_found(pad, size, second):
    """A uniform displacement, with an error in it."""
    mesh, other = pad.mesh(size), pad.mesh(second)
    here, there = (np.zeros_like(m.points) + [0.0, 0.0, -0.1] for m in (mesh, other))
    comparison, ratio = RoofComparison(mesh, other), size_ratio(mesh, other)
    found = comparison.error(here + ERROR, there + ratio**1.5 * ERROR)
    assert found.displacement == pytest.approx(0.003, rel=1e-9)
    seen = np.unique(mesh.faces[mesh.face_cell > 0])
    along, rest = comparison.deviations(here + ERROR, there + ratio**1.5 * ERROR)[:, seen]
    np.testing.assert_allclose(ERROR_SHARE * along, np.tile(ERROR, (len(seen), 1)), atol=1e-9)
    np.testing.assert_allclose(rest, 0.0, atol=1e-9)
    assert comparison.error(here + ERROR, there + ratio * ERROR).largest == pytest.approx(0.003, rel=1e-9)


@pytest.mark.parametrize("agreement", [0.0, 1e-4, -1e-4])
def test_meshes_that_agree_by_chance_do_not_make_an_error_small(agreement):
    mesh, other = THICK.mesh(1.25), THICK.mesh(2.5)
    here, there = (np.zeros_like(m.points) + [0.05, 0.0, -0.1] for m in (mesh, other))
    comparison, most = RoofComparison(mesh, other, least=0.02), np.hypot(0.05, 0.1)
    found = comparison.error(here, (1 + agreement) * there)
    assert found.displacement == pytest.approx(0.02 * most) and found.relative == pytest.approx(0.02)
    seen = np.unique(mesh.faces[mesh.face_cell > 0])
    along, rest = comparison.deviations(here, (1 + agreement) * there)[:, seen]
    np.testing.assert_allclose(ERROR_SHARE * np.linalg.norm(along, axis=1), 0.02 * most, rtol=1e-9)
    np.testing.assert_allclose(rest, 0.0, atol=1e-9)


def test_the_error_of_a_force_displaces_the_whole_pad_where_a_displacement_is_given():
    """Independently of that of the roofs, here of 2 %; the force's is at least as typical as is said."""
    mesh, other = THICK.mesh(1.25), THICK.mesh(2.5)
    here, there = (np.zeros_like(m.points) + [0.05, 0.0, -0.1] for m in (mesh, other))
    comparison = RoofComparison(mesh, other, least=0.02, least_of_force=0.03)
    force = np.array([0.0, 0.3, 0.4])
    assert comparison.force_error(force, force) == pytest.approx(0.015)
    along, _ = comparison.deviations(here, there, of_force=0.03)
    np.testing.assert_allclose(ERROR_SHARE * np.abs(along), math.hypot(0.02, 0.03) * np.abs(here), rtol=1e-9)


@pytest.mark.parametrize("rows", [2, 3])
def test_nodes_that_mirrors_map_onto_others_have_their_weights(rows):
    """Any linear field is carried from mesh to mesh exactly, whatever its symmetry."""
    pad = Pad("spherical", rows, 3)
    mesh, other = pad.mesh(2.0), pad.mesh(3.0)
    first, second = node_images(mesh), node_images(other)
    assert len(first) == (4 if rows == 3 else 2)
    both = {mirror: (image, second[mirror]) for mirror, image in first.items()}
    linear = np.array([[0.3, 0.1, 0.2], [-0.2, 0.4, 0.1], [0.1, -0.3, 0.5]])
    here, there = mesh.points @ linear, other.points @ (linear + 0.1 * linear.T)
    found, expected = (RoofComparison(mesh, other, images=images).deviations(here, there) for images in (both, None))
    np.testing.assert_allclose(found, expected, atol=1e-9)
    assert np.abs(expected[1]).max() > 0.01


@pytest.mark.parametrize("cell", CELL_SHAPES)
def test_roofs_are_right_within_what_is_stated(cell):
    """Against the error that elements 0.58 to 0.76 times as large tell by the power 1.5 of their size."""
    pad = Pad(cell, 1, 1, wall=0.5)
    force = [(0.0, 0.0, -1.0)]
    (state,) = load_path(pad, NeoHookean(), force)
    (fine,) = load_path(pad, NeoHookean(), force, mesh_size=0.6)
    true = RoofComparison(state.mesh, fine.mesh).error(state.displacement, fine.displacement).displacement
    assert true < state.error.displacement < 0.1 * np.abs(state.displacement).max()


def test_a_roof_of_one_layer_on_both_meshes_is_right_within_twice_what_is_stated():
    """Elements of twice the size save elements beside the roof, not above it: by their number in the entire pad, the
    true error is 2.4 times that stated."""
    pad = Pad(rows=1, columns=1, pitch=4.36, wall=1.2, height=3.38, cell_size=3.16, cell_height=1.96)
    force, size = [(0.0, 0.0, -0.3)], pad.default_mesh_size
    sizes = size_ratio(pad.mesh(size), pad.mesh(2 * size)), size_ratio(pad.mesh(2 * size), pad.mesh(size))
    assert 1.4 < sizes[0] < 1.6 and sizes[1] == pytest.approx(1 / sizes[0])
    (state,) = load_path(pad, NeoHookean(1.1), force)
    (fine,) = load_path(pad, NeoHookean(1.1), force, mesh_size=size / 2.5)
    comparison = RoofComparison(state.mesh, fine.mesh)
    difference = comparison.error(state.displacement, fine.displacement).displacement / abs(comparison._average)
    assert state.error.displacement < difference < 2 * state.error.displacement
