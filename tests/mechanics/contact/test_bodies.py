"""Convex bodies have triangles with their symmetries, whichever they are given with; others keep their own."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from mitsuba_taxel.geometry.mirror import ACROSS_DIAGONAL, ACROSS_X, ACROSS_Y
from mitsuba_taxel.mechanics.contact.barriers.bodies import RigidBodies

SIDES = (1.0, 1.4, 0.5)


def bodies(*meshes):
    return RigidBodies(np.concatenate([mesh.triangles for mesh in meshes]).tobytes())


def box(centre=(0.0, 0.0, 0.0), sides=SIDES):
    return trimesh.creation.box(sides, trimesh.transformations.translation_matrix(centre))


@pytest.mark.parametrize("turn", [(0.0, 0.0, 0.0), (0.1, 0.2, 0.3)])
def test_a_box_is_what_is_between_its_eight_corners(turn):
    turned = box()
    turned.apply_transform(
        np.block([[Rotation.from_rotvec(turn).as_matrix(), np.array([[3.0], [0], [0]])], [0, 0, 0, 1]])
    )
    triangles = turned.subdivide().subdivide().triangles.astype(np.float32).astype(float)  # as a scene has them
    points, fans = RigidBodies(triangles.tobytes()).surface
    assert (len(points), len(fans)) == (8 + 6, 4 * 6)
    surface = trimesh.Trimesh(points, fans, process=False)
    assert surface.is_watertight
    assert surface.volume == pytest.approx(np.prod(SIDES), rel=1e-6)  # and its triangles face outwards


def test_mirrors_that_keep_boxes():
    assert bodies(box()).kept_by(ACROSS_X) and bodies(box()).kept_by(ACROSS_Y)
    assert not bodies(box()).kept_by(ACROSS_DIAGONAL)
    assert bodies(box(sides=(1.0, 1.0, 0.5))).kept_by(ACROSS_DIAGONAL)
    assert not bodies(box((0.01, 0, 0))).kept_by(ACROSS_X) and bodies(box((0.01, 0, 0))).kept_by(ACROSS_Y)
    pair = bodies(box((2.0, 0, 0)), box((-2.0, 0, 0)))
    assert pair.kept_by(ACROSS_X) and pair.surface[1].shape == (48, 3)
    assert not bodies(box((2.0, 0, 0)), box((-2.0, 0, 0), (1.0, 1.4, 0.6))).kept_by(ACROSS_X)


def test_a_body_with_a_hollow_keeps_its_triangles():
    hollow = trimesh.creation.annulus(0.5, 1.0, 1.0)
    points, triangles = bodies(hollow).surface
    assert len(triangles) == len(hollow.faces)
    assert trimesh.Trimesh(points, triangles).volume == pytest.approx(hollow.volume)
    assert not bodies(hollow).kept_by(ACROSS_X)  # which none was looked at for
