"""Distances from rigid bodies, and what is refused of them."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.mirror import ACROSS_DIAGONAL, ACROSS_X, ACROSS_Y, MIRRORS
from mitsuba_taxel.mechanics import Indenter

pytestmark = pytest.mark.quick

BODIES = [
    Indenter("sphere", radius=2.0),
    Indenter("cylinder", radius=1.5, angle=30.0),
    Indenter("punch", radius=1.0, edge_radius=0.3),
    Indenter("plane"),
    Indenter("punch", radius=1.0, edge_radius=0.3, angle=30.0, tilt=25.0),
    Indenter("plane", angle=-60.0, tilt=10.0),
]


@pytest.mark.parametrize("body", BODIES, ids=lambda body: f"{body.shape} {body.tilt}")
def test_normal_and_curvature_are_the_derivatives_of_the_distance(body):
    places = np.random.default_rng(1).uniform([-1.5, -1.5, -0.5], [1.5, 1.5, 0.6], (200, 3))
    gap, step = body.body.gap(places), 1e-6
    for axis in range(3):
        ahead, behind = (body.body.gap(places + sign * step * np.eye(3)[axis]) for sign in (1, -1))
        smooth = np.abs(ahead.normal - behind.normal).max(axis=1) < 0.1  # no edge in between
        assert smooth.mean() > 0.95
        slope = (ahead.size - behind.size) / (2 * step)
        np.testing.assert_allclose(slope[smooth], gap.normal[smooth, axis], atol=1e-7)
        bend = ((ahead.normal - behind.normal) / (2 * step))[smooth]
        close = np.abs(bend - gap.curvature[smooth, :, axis]).max(axis=1) < 1e-5
        assert close.mean() > 0.97  # the others are at lines where the curvature jumps


def test_distances_are_those_of_the_solids():
    places = np.array([[0, 0, -1.0], [0, 0, 0.5], [3.0, 0, 2.0]])
    np.testing.assert_allclose(Indenter("sphere", radius=2.0).body.gap(places).size, [1.0, -0.5, 1.0])
    np.testing.assert_allclose(Indenter("cylinder", radius=2.0).body.gap(places).size, [1.0, -0.5, -2.0])
    np.testing.assert_allclose(Indenter("punch", radius=1.0).body.gap(places).size, [1.0, -0.5, 2.0])
    np.testing.assert_allclose(Indenter("plane").body.gap(places).size, [1.0, -0.5, -2.0])
    corner = Indenter("punch", radius=1.0, edge_radius=0.5).body.gap(np.array([[1.0, 0.0, 0.0]]))
    np.testing.assert_allclose(corner.size, 0.5 * (np.sqrt(2) - 1))


def test_a_tilted_body_is_the_body_tilted_whose_lowest_point_is_the_tip():
    upright, tilt = Indenter("punch", radius=1.0, edge_radius=0.3), np.radians(25.0)
    places = np.random.default_rng(2).uniform([-1.5, -1.5, -0.5], [1.5, 1.5, 0.6], (200, 3))
    body = Indenter("punch", radius=1.0, edge_radius=0.3, angle=90.0, tilt=25.0)  # leans towards y
    across, up = np.array([0, np.cos(tilt), -np.sin(tilt)]), np.array([0, np.sin(tilt), np.cos(tilt)])
    lifted = 0.7 * np.sin(tilt) + 0.3 * (1 - np.cos(tilt))
    tilted = places[:, :1] * [-1, 0, 0] + places[:, 1:2] * across + places[:, 2:] * up + [0, 0, lifted]
    np.testing.assert_allclose(body.body.gap(tilted).size, upright.body.gap(places).size, atol=1e-12)
    level = np.stack(np.meshgrid(*[np.linspace(-1.5, 1.5, 301)] * 2, [0.0]), axis=-1).reshape(-1, 3)
    gap = body.body.gap(level).size
    assert 0 <= gap.min() < 1e-4 and level[gap.argmin(), 1] == pytest.approx(
        0.7 * np.cos(tilt) + 0.3 * np.sin(tilt), abs=0.01
    )


def test_a_tilted_plate_starts_where_it_touches_the_pad():
    corners = np.array([[x, y, z] for x in (-2, 2) for y in (-1, 1) for z in (0, 4)], dtype=float)
    body = Indenter("plane", angle=90.0, tilt=10.0)
    start = body.body.start(corners[body.body.highest(corners)])
    gap = body.body.gap(corners - start).size
    np.testing.assert_allclose(
        gap[corners[:, 2] == 4], np.where(corners[corners[:, 2] == 4, 1] > 0, 0, 2 * np.sin(np.radians(10))), atol=1e-12
    )


def test_mirrors_that_leave_a_body_as_it_is():
    def kept(body):
        return [mirror for mirror in MIRRORS if body.body.keeps(mirror)]

    assert kept(Indenter("plane", at=(1, 2))) == list(MIRRORS)
    assert kept(Indenter("sphere", radius=1.0)) == list(MIRRORS)
    assert kept(Indenter("punch", radius=1.0, at=(1, 0))) == [ACROSS_Y]
    assert kept(Indenter("sphere", radius=1.0, at=(2, 2))) == [ACROSS_DIAGONAL]
    assert kept(Indenter("cylinder", radius=1.0, at=(3, 0))) == [ACROSS_X, ACROSS_Y]
    assert kept(Indenter("cylinder", radius=1.0, at=(0, 1), angle=90)) == [ACROSS_X, ACROSS_Y]
    assert kept(Indenter("cylinder", radius=1.0, at=(1, 0), angle=90)) == [ACROSS_Y]
    assert kept(Indenter("plane", tilt=5.0)) == [ACROSS_Y]
    assert kept(Indenter("plane", tilt=5.0, angle=45.0)) == [ACROSS_DIAGONAL]
    assert kept(Indenter("punch", radius=1.0, tilt=-5.0, angle=90.0)) == [ACROSS_X]
    assert kept(Indenter("punch", radius=1.0, tilt=5.0, at=(0, 1))) == []


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (
            {"shape": "cube"},
            "indenter = 'cube' is not allowed: one of sphere, punch, cylinder, plane, file, ellipsoid",
        ),
        ({"shape": "sphere"}, "indenter_radius is missing"),
        ({"shape": "sphere", "radius": 0.0}, "indenter_radius = 0 is not allowed"),
        ({"shape": "plane", "tilt": 90.0}, "indenter_tilt = 90 is not allowed"),
        ({"shape": "cylinder", "radius": 1.0, "tilt": 5.0}, "indenter_tilt is not allowed"),
        ({"shape": "plane", "radius": 1.0}, "indenter_radius is not allowed"),
        ({"radius": 1.0, "at": (0, float("nan"))}, "indenter at"),
        ({"shape": "punch", "radius": 1.0, "edge_radius": 2.0}, "indenter_edge_radius = 2 is not allowed"),
    ],
)
def test_what_is_no_body_is_refused(given, said):
    with pytest.raises(InputError, match=said.replace("(", r"\(")):
        Indenter(**given)
