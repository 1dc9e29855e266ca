"""Surfaces that are damaged, in the formats that other tests leave out, or made to take all memory."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from mitsuba_taxel.geometry.geometry_error import GeometryError
from mitsuba_taxel.geometry.surfaces import box_tree as boxes
from mitsuba_taxel.pads.imported.surfaces import read_surface
from mitsuba_taxel.pads.imported.triangles.repair import repaired

SEED = 20240607


@pytest.mark.parametrize("kind", ["stl_ascii", "ply", "obj"])
@settings(max_examples=40)
@given(data=st.data())
def test_damaged_surfaces_are_read_or_refused(data, kind):
    content = trimesh.creation.cylinder(2.0, 3.0, sections=8).export(file_type=kind)
    content = bytearray(content.encode() if isinstance(content, str) else content)
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(content) - 1))
        new = data.draw(
            st.one_of(st.binary(max_size=3), st.sampled_from([b"nan", b"1e308", b"-1", b"9" * 400, b"\xff"]))
        )
        content[at : at + len(new)] = new
    cut = data.draw(st.one_of(st.just(len(content)), st.integers(0, len(content))))
    try:
        vertices, triangles = repaired(*read_surface(bytes(content[:cut]), "." + kind[:3]))
    except GeometryError as error:
        assert str(error) and "\n" not in str(error)
    else:
        assert np.all(np.isfinite(vertices)) and triangles.max() < len(vertices)


def test_many_vertices_in_one_place_are_refused():
    """Of 10000, each would be joined with each: 50 million pairs."""
    ball = trimesh.creation.icosphere(5)
    vertices = 2e-4 * np.array(ball.vertices)
    vertices[0] = (500, 0, 0)
    with pytest.raises(GeometryError, match=r"too many of its vertices lie within 0.0005 mm of each other"):
        repaired(vertices, np.array(ball.faces))


@pytest.mark.parametrize(
    "compared, message", [(10**9, r"intersects itself at \("), (0, "too many .* lie across each other")]
)
def test_triangles_that_all_cross_each_other_are_refused(monkeypatch, compared, message):
    monkeypatch.setattr(boxes, "MOST_PAIRS", 20_000)
    monkeypatch.setattr("mitsuba_taxel.pads.imported.triangles.repair.MOST_COMPARED", compared)
    ball = trimesh.creation.icosphere(3)
    with pytest.raises(GeometryError, match=message):
        repaired(np.random.default_rng(SEED).uniform(-2, 2, ball.vertices.shape), np.array(ball.faces))


def test_a_surface_is_whole_in_parts_too(monkeypatch):
    """Looked at part by part, as fine fans are, it is the same."""
    drum = trimesh.creation.cylinder(2.0, 3.0, sections=100)
    whole = repaired(np.array(drum.vertices), np.array(drum.faces))
    monkeypatch.setattr(boxes, "MOST_PAIRS", 2000)
    parts = repaired(np.array(drum.vertices), np.array(drum.faces))
    assert all(np.array_equal(*pair) for pair in zip(whole, parts, strict=True))
