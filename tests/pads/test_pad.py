"""Dimensions of pads: the paper's defaults, and refusal of what cannot be made."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.pads import CELL_SHAPES, Pad

pytestmark = pytest.mark.quick


def test_the_defaults_are_the_paper_s_pad():
    pad = Pad()
    np.testing.assert_allclose(pad.extent, (11.65, 11.65, 4.55), rtol=1e-12)
    assert pad.top_of_cell == 1.55
    # Section 2.2.2: a cylinder of 1.258 mm under a cap of 0.342 mm; a hemisphere of radius 1.275 mm.
    assert Pad("spherical").side_height == pytest.approx(1.258, abs=5e-4)
    assert Pad("spherical").top_of_cell == 1.6
    assert Pad("hemispheric").side_height == pytest.approx(0.5, abs=1e-12)
    assert Pad("hemispheric").top_of_cell == pytest.approx(1.775)


def test_cells_are_numbered_row_by_row_from_minus_x_plus_y():
    pad = Pad(rows=2, columns=3, pitch=4)
    assert pad.cell_centres == [(-4, 2), (0, 2), (4, 2), (-4, -2), (0, -2), (4, -2)]


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        ({"cell": "conical"}, "cell"),
        ({"rows": 0}, "rows"),
        ({"rows": 2.5}, "rows"),
        ({"columns": -3}, "columns"),
        ({"columns": True}, "columns"),
        ({"pitch": math.nan}, "pitch"),
        ({"pitch": 2.55}, "pitch"),
        ({"wall": 0}, "wall"),
        ({"wall": -1}, "wall"),
        ({"height": math.inf}, "height"),
        ({"height": "tall"}, "height"),
        ({"height": 1.5}, "cell_height"),
        ({"cell_size": -1}, "cell_size"),
        ({"cell_size": None}, "cell_size"),
        ({"cell_height": 5}, "cell_height"),
        ({"cell_height": 0}, "cell_height"),
        ({"cell": "hemispheric", "cell_height": 1.2}, "cell_height"),
        ({"cell": "spherical", "cell_height": 0.3}, "cell_height"),
    ],
)
def test_what_cannot_be_made_is_refused_in_one_line(arguments, name):
    with pytest.raises(InputError, match=rf"^{name} = .* is not allowed") as caught:
        Pad(**arguments)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("cell", CELL_SHAPES)
def test_a_single_cell_needs_no_pitch(cell):
    assert Pad(cell, rows=1, columns=1, pitch=0.1).extent[0] == pytest.approx(4.55)


def test_the_default_mesh_follows_scale_and_thin_parts():
    """1.25 mm for the paper's pads; to scale for the same at another scale; finer for thin walls, gaps and roofs."""
    for cell in CELL_SHAPES:
        assert Pad(cell).default_mesh_size == 1.25
    third = Pad(rows=1, columns=1, wall=1 / 3, height=4.55 / 3, cell_size=0.85, cell_height=1.55 / 3)
    assert third.default_mesh_size == pytest.approx(1.25 / 3, rel=1e-2)
    thin = [Pad(wall=0.25), Pad(pitch=2.8), Pad(height=1.8)]
    assert [pad.default_mesh_size for pad in thin] == pytest.approx([0.625] * 3, rel=1e-2)
