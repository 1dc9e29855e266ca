"""Cells that lean: their solids, their meshes, and what is refused."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from mitsuba_taxel import InputError
from mitsuba_taxel.geometry.element_maps import curved_volume, worst_element
from mitsuba_taxel.geometry.mirror import ACROSS_DIAGONAL, ACROSS_Y
from mitsuba_taxel.mechanics.elements.symmetry import node_images
from mitsuba_taxel.pads import CELL_SHAPES, Pad
from mitsuba_taxel.pads.parametric.drawings import solids
from mitsuba_taxel.pads.parametric.lean import leaning, upright_nodes
from mitsuba_taxel.pads.parametric.round_walls import onto_round_walls
from mitsuba_taxel.pads.regions import REGIONS

PROFILE = {"profile": "0.95 0.4; 0.9 0.7; 0.7 1; 0.3 1; 0 0.8"}
PADS = {shape: Pad(shape, 1, 2, top_x=0.5, top_y=-0.3) for shape in CELL_SHAPES}
PADS["profile"] = Pad("profile", 1, 2, top_x=0.5, top_y=-0.3, **PROFILE)
every_shape = pytest.mark.parametrize("shape", PADS)


@every_shape
def test_a_leaning_pad_has_the_volume_of_the_upright_one(shape):
    """By Cavalieri: a shear shifts its sections. So do the meshes, on which all walls are where the shear puts them."""
    pad = PADS[shape]
    upright = replace(pad, top_x=0.0, top_y=0.0)
    mesh = pad.mesh(3.0)
    before = replace(mesh, points=upright_nodes(pad, mesh))
    assert curved_volume(mesh) == pytest.approx(curved_volume(before), rel=1e-12)
    np.testing.assert_allclose(leaning(pad, before).points, mesh.points, atol=1e-14)
    on = mesh.faces[np.isin(mesh.face_region, (REGIONS["roof"], REGIONS["side"]))]
    shift = mesh.points[on] - before.points[on]
    height = mesh.points[on][..., 2] / pad.cell_height
    np.testing.assert_allclose(shift[..., 0], 0.5 * height, atol=1e-14)
    np.testing.assert_allclose(shift[..., 1], -0.3 * height, atol=1e-14)
    for name in ("top", "bottom", "outer"):
        on = mesh.faces[mesh.face_region == REGIONS[name]]
        np.testing.assert_array_equal(mesh.points[on][..., 2], before.points[on][..., 2])
    assert np.abs(mesh.points).max(axis=0) == pytest.approx([*(0.5 * np.array(pad.extent[:2])), pad.height])
    for name, solid in solids(pad).items():
        assert solid.mass == pytest.approx(solids(upright)[name].mass, rel=1e-7)


@pytest.mark.parametrize("shape", ["cylindrical", "spherical", "profile"])
def test_walls_are_put_where_they_are_with_their_derivatives(shape):
    pad = PADS[shape]
    mesh = pad.mesh(3.0)
    chosen = mesh.face_cell > 0
    points = mesh.points[mesh.faces[chosen]].mean(axis=1)
    about = mesh.face_region[chosen], mesh.face_cell[chosen]
    places, gradient = onto_round_walls(pad, points, *about)
    again, _ = onto_round_walls(pad, places, *about)
    np.testing.assert_allclose(again, places, atol=1e-12)
    for axis in range(3):
        step = 1e-5 * np.eye(3)[axis]
        ahead, behind = (onto_round_walls(pad, points + sign * step, *about)[0] for sign in (1, -1))
        np.testing.assert_allclose((ahead - behind) / 2e-5, gradient[:, :, axis], atol=1e-7)


@every_shape
def test_pads_that_lean_to_the_other_side_are_mirror_images(shape):
    pad = PADS[shape]
    one, other = pad.mesh(3.0), replace(pad, top_x=-pad.top_x).mesh(3.0)
    order = [np.lexsort(points.T) for points in (one.points * [-1, 1, 1] + 0.0, other.points)]
    np.testing.assert_array_equal(one.points[order[0]] * [-1, 1, 1] + 0.0, other.points[order[1]])


@pytest.mark.parametrize(("tops", "mirror"), [((0.4, 0.0), ACROSS_Y), ((0.3, 0.3), ACROSS_DIAGONAL)])
def test_symmetries_that_are_left_are_kept_exactly(tops, mirror):
    assert list(node_images(Pad("cylindrical", 2, 2, top_x=tops[0], top_y=tops[1]).mesh(3.0))) == [mirror]


def test_upright_cells_are_as_ever():
    upright = Pad("hemispheric", 1, 1)
    assert upright == Pad("hemispheric", 1, 1, top_x=0.0, top_y=-0.0)
    assert set(upright.identity) == set(json.loads(json.dumps(upright.identity))) and "top_x" not in upright.identity
    assert Pad("hemispheric", 1, 1, top_x=0.1).identity == {**upright.identity, "top_x": 0.1}
    assert upright.thinnest_wall == upright.wall and upright.as_profile().top_x == 0.0
    assert Pad("cylindrical", top_x=0.2).as_profile().top_x == 0.2


@pytest.mark.parametrize(("shape", "most"), [("parallelepiped", 0.5), ("hemispheric", 0.5), ("profile", 0.5148)])
def test_a_wall_is_left(shape, most):
    """Half of it, up to the highest point of the cells; elements there are sound."""
    profile = PROFILE if shape == "profile" else {}
    for name in ("top_x", "top_y"):
        for sign in (1, -1):
            near = Pad(shape, 1, 1, **{name: 0.999 * sign * most}, **profile)
            assert worst_element(near.mesh(2.0))[0] > 0.2
            with pytest.raises(InputError) as refused:
                Pad(shape, 1, 1, **{name: 1.001 * sign * most}, **profile)
            told = re.fullmatch(rf"{name} = .* at most (\S+) mm .* 50% of wall = 1 is left\.", str(refused.value))
            assert float(told[1]) == pytest.approx(most, rel=1e-3)
