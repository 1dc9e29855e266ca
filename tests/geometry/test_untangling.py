from dataclasses import replace

import numpy as np

from mitsuba_taxel.geometry.element_maps import curved_volume, worst_element
from mitsuba_taxel.geometry.second_order import boundary_triangles, edge_ends
from mitsuba_taxel.geometry.untangling import untangled
from mitsuba_taxel.pads import Pad


def test_a_node_beyond_its_neighbours_returns_between_them():
    mesh = Pad(rows=1, columns=1).mesh(2.0)
    inner = np.setdiff1d(np.arange(mesh.corner_count), boundary_triangles(mesh.tets[:, :4]))
    ends = edge_ends(mesh.tets)
    points = mesh.points.copy()
    node = inner[0]
    neighbours = ends[(ends == node).any(axis=1)].ravel()
    points[node] += 1.2 * (points[neighbours[neighbours != node][0]] - points[node])
    points[mesh.corner_count :] = points[ends].mean(axis=1)
    tangled = replace(mesh, points=points)
    assert worst_element(tangled)[0] < 0
    repaired = untangled(tangled, 0.2)
    assert worst_element(repaired)[0] >= 0.2
    assert abs(curved_volume(repaired) - curved_volume(mesh)) < 1e-9
    boundary = np.unique(mesh.faces)
    np.testing.assert_array_equal(repaired.points[boundary], points[boundary])
