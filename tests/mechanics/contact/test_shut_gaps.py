"""Distances from boxes are known in closed form."""

from __future__ import annotations

import numpy as np
import trimesh

from mitsuba_taxel.mechanics.contact.barriers.bodies import RigidBodies
from mitsuba_taxel.mechanics.contact.barriers.shut_gaps import LEAST, kept_off

WIDTH = 0.01
HALF = np.array([0.5, 0.7, 0.25])


def boxes(*shifts):
    """Boxes of twice the half sides, as bodies."""
    made = [trimesh.creation.box(2 * HALF).triangles + np.array(shift) for shift in shifts]
    return RigidBodies(np.concatenate(made).tobytes())


def distance(points):
    """Signed, from a box about the origin."""
    beyond = np.abs(points) - HALF
    outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
    return outside + np.minimum(beyond.max(axis=1), 0.0)


def test_points_around_a_box():
    """Beside faces, edges and corners, on both sides: those within the width touch, and none is closer than the
    least."""
    generator = np.random.default_rng(0)
    points = generator.uniform(-1, 1, (3000, 3)) * (HALF + 3 * WIDTH)
    towards = generator.integers(0, 3, len(points)), np.arange(len(points))
    near = np.where(generator.random(len(points)) < 0.8, 1.0, 0.0)
    offset = generator.uniform(-1, 1, len(points)) * 2 * WIDTH
    axis, number = towards
    points[number, axis] = np.where(near, np.sign(points[number, axis]) * (HALF[axis] + offset), points[number, axis])
    moved, touches = kept_off(points, boxes((0, 0, 0)), WIDTH)
    before, after = distance(points), distance(moved)
    np.testing.assert_array_equal(touches, before < WIDTH)
    assert 300 < touches.sum() < len(points) - 300
    kept = before >= LEAST * WIDTH
    np.testing.assert_array_equal(moved[kept], points[kept])
    np.testing.assert_allclose(after[~kept], LEAST * WIDTH, atol=1e-9)
    np.testing.assert_allclose(
        np.linalg.norm(moved - points, axis=1)[~kept], (LEAST * WIDTH - before)[~kept], atol=1e-9
    )


def test_points_on_a_face_of_one_of_several_boxes():
    """Where the way to the surface has no direction."""
    shift = np.array([3.0, 0.0, 0.0])
    points = shift + np.array([[0.1, 0.2, HALF[2]], [0.1, -0.2, 0.0], [-1.5, 0.0, 0.0]])
    moved, touches = kept_off(points, boxes((0, 0, 0), shift), WIDTH)
    np.testing.assert_array_equal(touches, [True, True, False])
    np.testing.assert_allclose(moved[0] - points[0], [0, 0, LEAST * WIDTH], atol=1e-12)
    np.testing.assert_array_equal(moved[2], points[2])
