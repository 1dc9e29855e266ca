"""Drawings of a pad and its mould: solids whose volumes are known, that fit together."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import trimesh

from mitsuba_taxel import Pad
from mitsuba_taxel.pads.parametric.drawings import MOULD, solids, write_drawings

HEMISPHERE = 0.5 * math.pi * 1.275**2 + 2 / 3 * math.pi * 1.275**3
"""Of a cylinder of 0.5 mm below half a ball, mm3."""


@pytest.mark.parametrize(
    ("pad", "volume", "error"),
    [
        (Pad(rows=1, columns=2), 2.55**2 * 1.55, 1e-9),
        (Pad("hemispheric", rows=1, columns=2), HEMISPHERE, 1e-9),
        (Pad("hemispheric", rows=1, columns=2).as_profile(), HEMISPHERE, 1e-7),
        (Pad(rows=1, columns=2).as_profile(), 2.55**2 * 1.55, 1e-9),
    ],
    ids=["parallelepiped", "hemispheric", "profile", "square"],
)
def test_pad_and_mould_fill_a_block(pad, volume, error, tmp_path):
    width, depth, height = pad.extent
    around = (width + 2 * MOULD) * (depth + 2 * MOULD)
    shapes = solids(pad)
    assert shapes["pad"].mass == pytest.approx(width * depth * height - 2 * volume, rel=error)
    assert shapes["mould_base"].mass == pytest.approx(around * MOULD + 2 * volume, rel=error)
    assert sum(shape.mass for shape in shapes.values()) == pytest.approx(around * (height + MOULD), rel=1e-9)
    write_drawings(pad, tmp_path)
    for name, shape in shapes.items():
        drawn = trimesh.load(tmp_path / f"{name}.stl")
        assert drawn.is_watertight and drawn.volume == pytest.approx(shape.mass, rel=0.01)
        assert (tmp_path / f"{name}.step").stat().st_size > 1000


def test_a_vault_has_the_volume_of_its_dome_over_that_of_a_circle(tmp_path):
    """Each horizontal section is the square around the circle."""
    vault = replace(Pad("hemispheric", rows=1, columns=1).as_profile(), section="square")
    shapes = solids(vault)
    assert shapes["pad"].mass == pytest.approx(math.prod(vault.extent) - 4 / math.pi * HEMISPHERE, rel=1e-7)
    write_drawings(vault, tmp_path)
    drawn = trimesh.load(tmp_path / "pad.stl")
    assert drawn.is_watertight and drawn.volume == pytest.approx(shapes["pad"].mass, rel=0.01)
