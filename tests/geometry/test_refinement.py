"""Elements bisected down to a size."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.geometry.element_maps import curved_volume, worst_element
from mitsuba_taxel.geometry.refinement import refined
from mitsuba_taxel.geometry.volume_mesh import TET_EDGES, TET_FACES
from mitsuba_taxel.pads import Pad

pytestmark = pytest.mark.quick


def test_bisected_elements_fit_and_fill_the_same_solid():
    mesh = Pad("hemispheric", rows=1, columns=1).mesh(3.0)
    place = np.array([1.0, 0.6, 3.0])  # near the dome: curved elements are cut, too

    def size(places):
        return np.maximum(0.2, 0.7 * np.linalg.norm(places - place, axis=1))

    fine = refined(mesh, size)
    ends = fine.points[fine.tets[:, np.array(TET_EDGES)].reshape(-1, 2)]
    assert np.all(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1) <= size(ends.mean(axis=1)) * (1 + 1e-12))
    assert np.isclose(curved_volume(fine), curved_volume(mesh), rtol=1e-12)
    assert worst_element(fine)[0] >= 0.9 * worst_element(mesh)[0]

    faces = np.sort(fine.tets[:, np.array(TET_FACES)].reshape(-1, 6), axis=1)
    single, count = np.unique(faces, axis=0, return_counts=True)
    assert count.max() == 2  # with the same nodes on both sides
    np.testing.assert_array_equal(single[count == 1], np.unique(np.sort(fine.faces, axis=1), axis=0))
    for region in np.unique(mesh.face_region):
        for cell in np.unique(mesh.face_cell):
            chosen = [np.unique(m.faces[(m.face_region == region) & (m.face_cell == cell)]) for m in (mesh, fine)]
            assert (len(chosen[0]) > 0) == (len(chosen[1]) > 0)


def test_what_is_small_enough_stays_as_it_is():
    mesh = Pad(rows=1, columns=1).mesh(3.0)
    assert refined(mesh, lambda places: np.full(len(places), 10.0)) is mesh
