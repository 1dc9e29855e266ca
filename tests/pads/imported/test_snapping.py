"""Nodes put onto the surface of a file."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.pads.imported.triangles.snapping import Patches


def test_nodes_find_a_very_fine_surface():
    """Within reach of each of 2000 points lie some 20 000 of its 80 000 triangles."""
    n = 200
    x, y = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1))
    vertices = np.column_stack([x.ravel(), y.ravel(), 0 * x.ravel()])
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    lower = np.column_stack([corner, corner + 1, corner + n + 2])
    triangles = np.concatenate([lower, np.column_stack([corner, corner + n + 2, corner + n + 1])])
    one = np.ones(len(triangles), dtype=int)
    points = np.random.default_rng(0).random((2000, 3)) * [1, 1, 0.004]
    found = Patches(vertices, triangles, one, one).onto_surface(points, np.ones((2000, 1), dtype=bool), 0.2)
    np.testing.assert_allclose(found, points * [1, 1, 0], atol=1e-12)
