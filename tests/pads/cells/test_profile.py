"""Profiles: the paper's shapes are points of them, and what they cannot be is refused."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.element_maps import curved_volume
from mitsuba_taxel.mechanics.elements.symmetry import node_images
from mitsuba_taxel.pads import Pad
from mitsuba_taxel.pads.cells.meridian import rim_angle
from mitsuba_taxel.pads.parametric.pad import CELL_SHAPES, LENGTHS
from mitsuba_taxel.pads.parametric.round_walls import onto_round_walls
from mitsuba_taxel.pads.regions import REGIONS

ROUND = CELL_SHAPES[1:]
DIPPED = Pad("profile", 1, 1, profile="0.95 0.4; 0.9 0.7; 0.7 1; 0.3 1; 0 0.8")
"""A drafted side, a smooth shoulder, and a roof that dips."""


@pytest.mark.parametrize("points", [3, 4, 7])
@pytest.mark.parametrize("cell", ROUND)
def test_round_cells_have_a_profile_exactly(cell, points):
    pad = Pad(cell)
    same = pad.as_profile(points)
    r, z = same.shape.outline()[:-1].T
    sphere = pad.shape.roof_radius
    off = np.hypot(r, z - pad.top_of_cell + sphere) - sphere if math.isfinite(sphere) else z - pad.height + 3
    np.testing.assert_allclose(off, 0.0, atol=1e-14)
    np.testing.assert_allclose((same.top_of_cell, same.side_height), (pad.top_of_cell, pad.side_height), rtol=1e-15)
    assert rim_angle(same.shape.side, same.shape.roof) == pytest.approx(
        {"cylindrical": 90.0, "spherical": 60.0, "hemispheric": 0.0}[cell], abs=1e-6
    )
    assert (same.shape.has_sharp_rim, same.default_mesh_size) == (pad.shape.has_sharp_rim, pad.default_mesh_size)
    assert len(same.profile.split(";")) == points


@pytest.mark.parametrize("points", [3, 5])
def test_box_shaped_cells_have_a_profile_of_a_square_section(points):
    pad = Pad(height=4.0)
    same = pad.as_profile(points)
    assert (same.cell, same.section, len(same.profile.split(";"))) == ("profile", "square", points)
    np.testing.assert_allclose(pad.shape.outline()[:-1, 1], 1.55, rtol=1e-15)
    assert pad.shape.outline()[-2:].tolist() == [[1.275, 1.55], [1.275, 0.0]]
    assert (same.shape.has_sharp_rim, same.default_mesh_size) == (pad.shape.has_sharp_rim, pad.default_mesh_size)
    np.testing.assert_allclose(curved_volume(same.mesh(2.0)), curved_volume(pad.mesh(2.0)), rtol=1e-12)


def test_a_square_section_has_four_mirrors_and_its_own_identity():
    pad = replace(DIPPED, section="square")
    assert len(node_images(pad.mesh(3.0))) == 4
    assert pad.identity == {**DIPPED.identity, "section": "square"} and "section" not in DIPPED.identity


def test_a_pyramid_has_the_volume_and_the_normals_of_one():
    """But for a tip of a thousandth of its size, and the curves of its spline there."""
    pad = Pad("profile", 1, 1, profile="1 0.6; 0.001 0.8; 0 1", section="square")
    mesh = pad.mesh(1.5)
    hollow = pad.cell_size**2 * pad.cell_height * (0.6 + 0.4 / 3)
    assert curved_volume(mesh) == pytest.approx(math.prod(pad.extent) - hollow, rel=1e-6)
    face = np.flatnonzero(mesh.face_region == REGIONS["roof"])
    points = mesh.points[mesh.faces[face]]
    middle = points[:, :3].mean(axis=1)
    for node in range(6):  # of a face, which tells the wall of those on an edge
        at = points[:, node]
        off_tip = np.abs(at[:, :2]).max(axis=1) > 0.1
        about = mesh.face_region[face], mesh.face_cell[face], middle
        _, gradient = onto_round_walls(pad, at, *about)
        axis = np.abs(middle[:, :2]).argmax(axis=1)
        normal = np.zeros((len(face), 3))
        normal[np.arange(len(face)), axis] = 0.4 * pad.cell_height * np.sign(middle[np.arange(len(face)), axis])
        normal[:, 2] = 0.5 * pad.cell_size
        tangential = np.einsum("fi,fij->fj", normal, gradient)[off_tip]
        assert off_tip.any() and np.abs(tangential).max() < 1e-5


@pytest.mark.parametrize("cell", ["spherical", "hemispheric"])
def test_points_go_to_the_same_places_on_its_walls(cell):
    pad, rng = Pad(cell, 1, 1), np.random.default_rng(0)
    places = pad.as_profile().shape.outline()[:-1]
    turn = rng.uniform(0, 2 * np.pi, len(places))
    points = np.column_stack([places[:, :1] * np.column_stack([np.cos(turn), np.sin(turn)]), places[:, 1]])
    points += rng.normal(0, 1e-2, points.shape)
    region, number = np.full(len(points), REGIONS["roof"]), np.ones(len(points), dtype=int)
    expected, found = (onto_round_walls(each, points, region, number) for each in (pad, pad.as_profile()))
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-13)


def test_a_profile_is_that_of_its_spline():
    """Its ends are its first and last points, and its tangents there those of the control polygon in (r^2, z)."""
    roof = DIPPED.shape.roof
    (crown, rim), (_, along), _ = roof.at(np.array([0.0, 1.0]))
    np.testing.assert_allclose(crown, (0.0, 0.8 * 1.55), atol=1e-8)
    np.testing.assert_allclose(rim, (0.95 * 1.275, 0.4 * 1.55), rtol=1e-12)
    expected = np.array([1.275**2 * (0.9**2 - 0.95**2) / (2 * rim[0]), 0.3 * 1.55])
    assert along[0] / along[1] == pytest.approx(expected[0] / expected[1], rel=1e-12)
    assert DIPPED.top_of_cell == pytest.approx(DIPPED.shape.outline()[:, 1].max(), rel=1e-4)
    assert DIPPED.top_of_cell < DIPPED.cell_height
    assert DIPPED.side_height == pytest.approx(0.4 * 1.55)


def test_points_of_a_profile_are_dimensions():
    assert [name for name in DIPPED.dimensions if name not in LENGTHS] == [
        f"profile_{of}{k}" for k in range(1, 6) for of in "rz"
    ][:-2] + ["profile_z5"]
    other = DIPPED.changed(profile_z5=0.9, profile_r2=0.85, cell_size=2.5)
    assert other.profile == "0.95 0.4; 0.85 0.7; 0.7 1; 0.3 1; 0 0.9"
    assert other == Pad(
        "profile", 1, 1, cell_size=2.5, profile=[(0.95, 0.4), (0.85, 0.7), (0.7, 1), (0.3, 1), (0, 0.9)]
    )
    assert DIPPED.as_profile() is DIPPED


@pytest.mark.parametrize(
    ("profile", "message"),
    [
        ("1 2 3", "pairs of finite numbers"),
        ("1 nan; 0 1", "pairs of finite numbers"),
        (3, "pairs of finite numbers"),
        ([[1, "a"]], "pairs of finite numbers"),
        ("0 1", "2 to 20 points"),
        ("1 .5; 1.1 .6; 0 1", "r above 0 and up to 1"),
        ("1 .5; .5 .6; .1 1", "0 for the last point alone"),
        ("1 .5; .5 1.1; 0 1", "z above 0 and up to 1"),
        ("1 .5; .5 .6; 0 0", "z above 0 and up to 1"),
        ("1 .5; 1 .5; 0 1", "seen from the middle"),
        ("1 1; .5 .1; 0 .1", "seen from the middle"),
        ("1 .001; 0 1", "z of the first point must be at least 0.0165"),
    ],
)
def test_what_cannot_be_made_is_refused_in_one_line(profile, message):
    with pytest.raises(InputError, match=rf"^profile = .* is not allowed: .*{message}") as caught:
        Pad("profile", profile=profile)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Pad("profile"), "profile is missing: pairs of numbers"),
        (lambda: Pad("cylindrical", profile="1 1; 0 1"), "profile is not allowed for cell = 'cylindrical'"),
        (lambda: Pad("cylindrical", section="square"), "section is not allowed for cell = 'cylindrical'"),
        (lambda: Pad("profile", profile="1 1; 0 1", section="oval"), "section = 'oval' is not allowed: one of round"),
        (lambda: Pad("cylindrical").as_profile(2), "points = 2 is not allowed: a whole number from 3 to 20"),
    ],
)
def test_other_refusals(make, message):
    with pytest.raises(InputError, match=message):
        make()
