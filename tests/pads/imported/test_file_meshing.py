"""The same pad built in, as STEP and as STL, deforms alike: by the truth, and within what is stated."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.geometry.element_maps import curved_volume
from mitsuba_taxel.geometry.mirror import MIRRORS
from mitsuba_taxel.mechanics import NeoHookean, load_path
from mitsuba_taxel.mechanics.elements.symmetry import node_images
from mitsuba_taxel.pads import REGIONS, Pad, PadFile, Rule
from mitsuba_taxel.pads.imported import step, surface_meshing
from mitsuba_taxel.pads.parametric.meshing import MESHING_LOCK

PAD = Pad(rows=1, columns=1)
LOADS = [(0.0, 0.0, -2.0), (-0.6, 0.0, -2.0)]
TRUTH = np.array([(0, 0, -0.0658), (-0.1086, 0, -0.0662)])
"""Mean displacement of the roof in mm: the built-in pad with elements of 0.4 and 0.3 mm, extrapolated by ORDER."""


def write_step(folder):
    from netgen.occ import Box, Pnt

    width, _, height = PAD.extent
    with MESHING_LOCK:
        hollow = Box(
            Pnt(-PAD.cell_size / 2, -PAD.cell_size / 2, -1), Pnt(PAD.cell_size / 2, PAD.cell_size / 2, PAD.top_of_cell)
        )
        solid = Box(Pnt(-width / 2, -width / 2, 0), Pnt(width / 2, width / 2, height)) - hollow
        solid.WriteStep(str(folder / "pad.step"))
    return PadFile(folder / "pad.step")


def roof_displacement(state):
    """Mean over the roof, on whose flat triangles quadratic functions have the mean of their three mid-edge nodes."""
    faces = state.mesh.faces[state.mesh.face_region == REGIONS["roof"]]
    corners = state.mesh.points[faces[:, :3]]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return area @ state.displacement[faces[:, 3:]].mean(axis=1) / area.sum()


@pytest.fixture(scope="module")
def built_in():
    return np.array([roof_displacement(state) for state in load_path(PAD, NeoHookean(), LOADS)])


@pytest.mark.parametrize("kind", ["step", "stl"])
def test_files_are_as_right_as_built_in_pads_and_within_their_error(kind, built_in, box, write_stl, tmp_path):
    hollow = (PAD.cell_size, PAD.cell_size, PAD.top_of_cell)
    pad = write_step(tmp_path) if kind == "step" else PadFile(write_stl(tmp_path / "pad.stl", box(PAD.extent, hollow)))
    assert pad.default_mesh_size == PAD.default_mesh_size
    for state, truth, other in zip(load_path(pad, NeoHookean(), LOADS), TRUTH, built_in, strict=True):
        off = np.linalg.norm(roof_displacement(state) - truth)
        assert off < 1.3 * np.linalg.norm(other - truth)
        assert off < 2 * state.error.displacement
        assert abs(roof_displacement(state)[1]) < 1e-9


def test_the_default_mesh_follows_scale_and_thin_parts(box, write_stl, tmp_path):
    """As that of the built-in pad with the same dimensions does."""
    for scale, wall in ((1, 1.0), (1 / 3, 1.0), (1, 0.3), (1, 0.05)):
        cell = 2.55 * scale
        pad = Pad(rows=1, columns=1, cell_size=cell, wall=wall * scale, height=4 * scale, cell_height=1.5 * scale)
        path = write_stl(tmp_path / "box.stl", box(pad.extent, (cell, cell, pad.top_of_cell)))
        assert PadFile(path).default_mesh_size == pytest.approx(pad.default_mesh_size, rel=2e-3)


def test_what_netgen_cannot_fill_is_meshed_by_ftetwild(box, write_stl, tmp_path, monkeypatch):
    def fails(*_):
        raise ComputationError("as far as this test goes.")

    monkeypatch.setattr(surface_meshing, "_meshed", fails)
    mesh = PadFile(write_stl(tmp_path / "box.stl", box())).mesh(1.0)
    assert curved_volume(mesh) == pytest.approx(4 * 4 * 3 - 4, rel=1e-9)
    assert set(mesh.face_region) == set(REGIONS.values())


def test_a_body_that_cannot_be_cut_is_meshed_whole(tmp_path, monkeypatch):
    pad, meshed = write_step(tmp_path), step._meshed
    assert set(node_images(pad.mesh(2.0))) == set(MIRRORS)

    def fails_on_parts(path, survey, mirrors, *sizes):
        if mirrors:
            raise ComputationError("as far as this test goes.")
        return meshed(path, survey, mirrors, *sizes)

    monkeypatch.setattr(step, "_meshed", fails_on_parts)
    mesh = pad.mesh(2.0)
    assert not node_images(mesh)
    assert curved_volume(mesh) == pytest.approx(4.55**3 - 2.55**2 * 1.55, rel=1e-9)


def test_a_rule_that_holds_on_one_side_breaks_the_symmetry_of_a_body(tmp_path):
    path = write_step(tmp_path).path
    rule = Rule("outer", normal=(1, 0, 0), within=10, box=((2, -9, 0), (9, 9, 9)))
    assert len(node_images(PadFile(path, [rule]).mesh(2.0))) == len(MIRRORS)  # it is outer anyway
    with_top = Rule("top", normal=(1, 0, 0), within=10, box=((2, -9, 0), (9, 9, 9)))
    above = Rule("top", normal=(0, 0, 1), within=10)
    assert [m.name for m in node_images(PadFile(path, [with_top, above]).mesh(2.0))] == ["y"]
