"""Blocks without cells: solid, regions, symmetry and refusals."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import dblquad

from mitsuba_taxel import Block, InputError
from mitsuba_taxel.check import check_scene
from mitsuba_taxel.geometry.element_maps import curved_volume, worst_element
from mitsuba_taxel.mechanics.elements.symmetry import node_images
from mitsuba_taxel.pads import REGIONS
from mitsuba_taxel.sensing import Scene, measure

import mitsuba as mi  # isort: skip

PLANE, SQUARE, DOME = Block(20.0, 15.0, 4.0), Block(8.0, 8.0, 5.0), Block(20.0, 15.0, 4.0, top_radius=40.0)
SQUARE_DOME = Block(8.0, 8.0, 5.0, top_radius=10.0)


def area(mesh, region):
    a, b, c = mesh.points[mesh.faces[mesh.face_region == REGIONS[region], :3]].transpose(1, 0, 2)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


@pytest.mark.parametrize("size", [2.5, 1.3])
@pytest.mark.parametrize("block", [PLANE, SQUARE])
def test_a_plane_block_has_the_volume_and_the_faces_of_a_box(block, size):
    mesh = block.mesh(size)
    width, depth, height = block.extent
    assert curved_volume(mesh) == pytest.approx(width * depth * height, rel=1e-12)
    assert area(mesh, "top") == pytest.approx(width * depth, rel=1e-12)
    assert area(mesh, "bottom") == pytest.approx(width * depth, rel=1e-12)
    assert area(mesh, "outer") == pytest.approx(2 * (width + depth) * height, rel=1e-12)
    assert not mesh.face_cell.any()


@pytest.mark.parametrize("block", [DOME, SQUARE_DOME])
def test_a_domed_block_has_the_volume_below_the_sphere(block):
    radius = block.top_radius

    def top(y, x):
        return block.height - radius + math.sqrt(radius**2 - x**2 - y**2)

    volume = 4 * dblquad(top, 0, 0.5 * block.width, 0, 0.5 * block.depth, epsabs=1e-10)[0]
    mesh = block.mesh(1.0)
    assert curved_volume(mesh) == pytest.approx(volume, rel=2e-6)
    on_top = np.unique(mesh.faces[mesh.face_region == REGIONS["top"]])
    centre = np.array([0.0, 0.0, block.height - radius])
    assert np.linalg.norm(mesh.points[on_top] - centre, axis=1) == pytest.approx(radius, rel=1e-12)
    assert worst_element(mesh)[0] > 0.2


@pytest.mark.parametrize(("block", "mirrors"), [(PLANE, 2), (SQUARE, 4), (DOME, 2), (SQUARE_DOME, 4)])
def test_a_mesh_has_the_symmetry_of_its_block(block, mirrors):
    mesh = block.mesh(1.5)
    images = node_images(mesh)
    assert len(images) == mirrors
    tets = np.unique(np.sort(mesh.tets, axis=1), axis=0)
    for mirror, image in images.items():
        assert np.array_equal(mesh.points[image], mirror.image(mesh.points))
        assert np.array_equal(np.unique(np.sort(image[mesh.tets], axis=1), axis=0), tets)


def test_elements_are_thin_at_the_glued_edges_alone():
    mesh = PLANE.mesh(1.2)
    levels = np.unique(mesh.points[:, 2])
    assert np.isclose(levels, 0.2, atol=1e-12).any()  # a cut at 0.2 of the lowest bricks, 1 mm high
    assert not np.isclose(levels, 3.8, atol=1e-12).any()


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"width": 0.0}, "width = 0 is not allowed"),
        ({"depth": math.nan}, "depth = nan is not allowed"),
        ({"top_radius": 5.0}, "top_radius = 5 is not allowed: at least 23.5 mm is needed for a block of 20 x 15 mm"),
    ],
)
def test_impossible_blocks_are_refused(values, message):
    with pytest.raises(InputError, match=message):
        Block(**({"width": 20.0, "depth": 15.0, "height": 4.0} | values))


def test_the_least_radius_of_a_dome_leaves_a_tenth_of_the_height_at_the_corners():
    with pytest.raises(InputError) as refused:
        Block(20.0, 15.0, 4.0, top_radius=12.0)
    least = float(str(refused.value).split("at least ")[1].split(" mm")[0])
    lowest = Block(20.0, 15.0, 4.0, top_radius=1.001 * least).top_at(np.array([10.0]), np.array([7.5]))
    assert lowest == pytest.approx(0.4, abs=0.01)


def test_blocks_of_too_many_elements_are_refused():
    with pytest.raises(InputError, match="mesh_size = 0.01 is not allowed: at least "):
        PLANE.mesh(0.01)
    with pytest.raises(InputError, match="a block of 1e.03 x 1e.03 x 0.5 mm is not allowed"):
        thin = Block(1000.0, 1000.0, 0.5)
        thin.mesh(thin.default_mesh_size)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({}, "width is missing"),
        ({"width": 20.0, "depth": 15.0, "rows": 2}, "rows and width exclude each other"),
        ({"width": 20.0, "depth": 15.0, "read_cells": "2"}, "read_cells = '2' is not allowed for cell = 'none'"),
        ({"width": 20.0, "depth": 15.0, "finish": "random", "rms_height": 0.01, "correlation_length": 0.1}, "a finish"),
    ],
)
def test_a_scene_names_what_a_block_cannot_have(values, message):
    with pytest.raises(InputError, match=message):
        Scene({"type": "scene", "pad": {"type": "deformable_pad", "cell": "none", **values}}).load()


def test_dimensions_of_a_block_are_refused_for_cells():
    with pytest.raises(InputError, match="width is not allowed for cell = 'cylindrical', only for 'none'"):
        Scene({"type": "scene", "pad": {"type": "deformable_pad", "cell": "cylindrical", "width": 20.0}}).load()


SCENE = """<scene version="3.0.0">
    <integrator type="taxel_tracer"/>
    <shape type="deformable_pad">
        <string name="cell" value="none"/> <float name="width" value="20"/> <float name="depth" value="15"/>
    </shape>
    <shape type="photo_reflector"> <emitter type="annular_led"/> <sensor type="phototransistor"/> </shape>
</scene>"""


def test_readings_refuse_a_block(tmp_path):
    file = tmp_path / "block.xml"
    file.write_text(SCENE)
    with pytest.raises(InputError, match="cell = 'none' is not allowed with photo-reflectors"):
        measure(Scene(file))
    assert any("photo-reflectors" in finding.message for finding in check_scene(file) if finding.severity == "error")


def test_a_pad_of_a_scene_is_drawn_and_seen(llvm_mono):
    pad = mi.load_dict({"type": "deformable_pad", "cell": "none", "width": 6.0, "depth": 5.0, "height": 3.0})
    assert isinstance(pad.pad, Block)
    box = pad.bbox()
    assert np.array(box.min) == pytest.approx([-3, -2.5, 0]) and np.array(box.max) == pytest.approx([3, 2.5, 3])
    top = pad.surface.region == REGIONS["top"]
    assert top.sum() > 3 * (pad.surface.region == REGIONS["bottom"]).sum()  # the coat has the fine triangles
    assert "block without cells" in pad.pad._repr_html_()
