"""Radii of curved patches do not depend on how they are cut into triangles."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.mechanics.errors.roof_error import size_ratio
from mitsuba_taxel.pads import REGIONS, Pad, PadFile
from mitsuba_taxel.pads.imported.triangles.curvature import radii
from mitsuba_taxel.pads.imported.triangles.snapping import Patches


@pytest.mark.parametrize(("cell", "roof"), [("cylindrical", np.inf), ("spherical", 2.55), ("hemispheric", 1.275)])
def test_walls_have_their_radii_on_triangles_cut_thin_along_edges(cell, roof):
    mesh = Pad(cell, rows=2, columns=2).mesh(1.25)
    vertices, triangles = np.unique(mesh.faces[:, :3], return_inverse=True)
    patches = Patches(mesh.points[vertices], triangles.reshape(-1, 3), mesh.face_region, mesh.face_cell)
    region = mesh.face_region[np.unique(patches.patch, return_index=True)[1]]
    found = radii(patches)
    assert found[region == REGIONS["side"]] == pytest.approx(1.275, rel=0.15)
    assert found[region == REGIONS["roof"]] == pytest.approx(roof, rel=0.25)
    assert np.isinf(found[region == REGIONS["outer"]]).all()


def test_a_file_of_round_walls_can_be_meshed_with_elements_of_twice_the_size(pad_stl):
    """Which tell its error at less cost than smaller ones."""
    pad = PadFile(pad_stl(Pad("cylindrical", rows=2, columns=2).mesh(1.25), 1))
    assert size_ratio(pad.mesh(1.25), pad.mesh(2.5)) > 1.3
