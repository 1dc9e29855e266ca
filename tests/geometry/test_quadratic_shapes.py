"""Boxes of curved elements and faces, against their control points."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.geometry.quadratic_shapes import control_points, hull_boxes, shape_functions

pytestmark = pytest.mark.quick


@pytest.mark.parametrize("count", [6, 10])
def test_the_box_is_that_of_the_control_points_and_holds_the_element(count):
    rng = np.random.default_rng(1)
    points = rng.normal(size=(60, 3))
    nodes = np.stack([rng.permutation(60)[:count] for _ in range(40)])
    low, high = hull_boxes(points, nodes)
    hull = control_points(points[nodes])
    np.testing.assert_array_equal(low, hull.min(axis=1))
    np.testing.assert_array_equal(high, hull.max(axis=1))
    places = np.einsum("qa,mai->mqi", shape_functions(rng.dirichlet(np.ones({6: 3, 10: 4}[count]), 200)), points[nodes])
    assert (places > low[:, None] - 1e-12).all() and (places < high[:, None] + 1e-12).all()
