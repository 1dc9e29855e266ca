"""Conical cells, against the closed forms of a cone."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from walls_of_pads import off_the_walls, volume

from mitsuba_taxel import Pad, PadSensor, Scene, measure
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.element_maps import curved_volume
from mitsuba_taxel.pads import REGIONS, mesh_velocity
from mitsuba_taxel.pads.mould import bend_radii, draft_angles
from mitsuba_taxel.pads.parametric.drawings import solids
from mitsuba_taxel.pads.parametric.round_walls import onto_round_walls
from mitsuba_taxel.pads.room import holds

CONE = Pad("frustum", 1, 1, roof_size=1.8)
SLOPE = 0.375 / 1.55
"""By which the side leans inwards, mm per mm of height."""


@pytest.mark.parametrize(("mesh_size", "error"), [(3.0, 1e-4), (1.25, 1e-5)])
def test_meshes_have_the_volume_and_the_walls_of_a_cone(mesh_size, error):
    mesh = CONE.mesh(mesh_size)
    assert off_the_walls(CONE, mesh).max() < 1e-12
    assert curved_volume(mesh) == pytest.approx(volume(CONE), rel=error)


def test_its_drawing_is_exact():
    assert solids(CONE)["pad"].mass == pytest.approx(volume(CONE), rel=1e-12)


def test_points_go_to_the_nearest_place_of_the_cone():
    rng = np.random.default_rng(0)
    z, turn = rng.uniform(0.2, 1.3, 50), rng.uniform(0, 2 * math.pi, 50)
    out = np.column_stack([np.cos(turn), np.sin(turn), 0 * turn])
    normal = (out + [0, 0, SLOPE]) / math.hypot(1.0, SLOPE)
    places = (1.275 - SLOPE * z)[:, None] * out + z[:, None] * [0, 0, 1]
    points = places + rng.uniform(-0.1, 0.1, (50, 1)) * normal
    about = np.full(50, REGIONS["side"]), np.ones(50, dtype=int)
    found, gradient = onto_round_walls(CONE, points, *about)
    np.testing.assert_allclose(found, places, atol=1e-13)
    for k, step in enumerate(1e-5 * np.eye(3)):
        ahead, behind = (onto_round_walls(CONE, points + sign * step, *about)[0] for sign in (1, -1))
        np.testing.assert_allclose(gradient[:, :, k], (ahead - behind) / 2e-5, atol=1e-9)


def test_the_mesh_follows_the_size_of_the_roof():
    """Nodes stay on the cone, and the volume changes as the closed form does."""
    mesh, step = CONE.mesh(3.0), 1e-2
    velocity = mesh_velocity(CONE, mesh, "roof_size")
    moved = replace(mesh, points=mesh.points + step * velocity)
    other = CONE.changed(roof_size=1.8 + step)
    assert other.roof_size == 1.81 and off_the_walls(other, moved).max() < 1e-12
    rate = (curved_volume(moved) - curved_volume(mesh)) / step
    assert rate == pytest.approx((volume(other) - volume(CONE)) / step, rel=1e-3)
    onto = other.moved_from(CONE).mesh(3.0)
    np.testing.assert_allclose(onto.points, moved.points, atol=1e-12)


def test_it_holds_what_is_within_the_cone():
    points = np.random.default_rng(1).uniform([-1.4, -1.4, 0], [1.4, 1.4, 1.7], (500, 3))
    within = (np.hypot(*points.T[:2]) < 1.275 - SLOPE * points[:, 2]) & (points[:, 2] < 1.55)
    assert np.array_equal(holds(CONE, points[:, None]), within) and 0 < within.sum() < 500


def test_its_mould_and_its_profile():
    assert draft_angles(CONE)[0] == pytest.approx(math.degrees(math.atan(SLOPE)))
    assert bend_radii(CONE).size == 0
    same = CONE.as_profile(3)
    assert curved_volume(same.mesh(1.5)) == pytest.approx(volume(CONE), rel=1e-4)
    assert (same.default_mesh_size, same.shape.has_sharp_rim) == (1.25, True)


def test_its_size_is_a_parameter_that_identifies_it():
    assert Pad("frustum").roof_size == 1.5 and Pad().roof_size is None
    assert json.loads(json.dumps(CONE.identity))["roof_size"] == 1.8 and "roof_size" not in Pad().identity
    assert CONE.dimensions["roof_size"] == 1.8
    with pytest.raises(InputError, match="roof_size = 2.6 is not allowed: at most cell_size = 2.55 mm is needed"):
        Pad("frustum", roof_size=2.6)
    with pytest.raises(InputError, match="roof_size is not allowed for cell = 'cylindrical', only for 'frustum'"):
        Pad("cylindrical", roof_size=2.0)


def test_a_scene_reads_it_as_the_same_cell_given_by_a_profile(tmp_path, llvm_mono):
    PadSensor(CONE).scene().write_xml(tmp_path / "cone.xml")
    assert 'name="roof_size"' in (tmp_path / "cone.xml").read_text()
    scenes = Scene(tmp_path / "cone.xml"), PadSensor(CONE.as_profile(3)).scene()
    powers = [measure(scene, mechanics_error=False).power[0] for scene in scenes]
    assert powers[0] == pytest.approx(powers[1], rel=1e-4)
