"""Markers on the coat: where the image shows them, and how far they move."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from camera_scene import CLEAR, COAT, DISTANCE, FIELD, HEIGHT, REFLECTANCE, led, scene

from mitsuba_taxel import Block, InputError
from mitsuba_taxel.pads.markers import markers_of
from mitsuba_taxel.sensing import Scene
from mitsuba_taxel.sensing.camera import camera_image
from mitsuba_taxel.sensing.image_file import read_image, write_image
from mitsuba_taxel.sensing.marker_flow import write_markers
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads

import mitsuba as mi  # isort: skip

PIXELS = 160, 120
SIDES = {"width": 20.0, "depth": 15.0, "height": 4.0}
SHEARED = {"load": "plate_displacement", "displacement": [0.6, 0.3, -0.4], "mesh_size": 3.0}
BALL = {"load": "indenter_displacement", "indenter": "sphere", "indenter_radius": 4.0, "indenter_x": 1.0}
PRESSED = BALL | {"displacement": [0.0, 0.0, -0.4], "youngs_modulus": 0.2}


def image_of(words, load, **others):
    return camera_image(scene(led(0.0, 0.0, -3.0), pixels=PIXELS, load=load | {"markers": words}, **others), samples=4)


def projected(points):
    """Columns and rows (M, 2) of points (M, 3) in mm by a pinhole; x runs from right to left, y from top to bottom."""
    scale = PIXELS[0] * DISTANCE / FIELD / (points[:, 2] - (HEIGHT - DISTANCE))
    return np.array(PIXELS) / 2 - scale[:, None] * points[:, :2]


@pytest.mark.parametrize(
    ("words", "load", "count"),
    [("3 3 0.4", SHEARED, 35), ("2.5, 4, 0.3", PRESSED, 21), ("4 4 0.5", PRESSED | {"top_radius": 40.0}, 15)],
)
def test_markers_are_where_a_pinhole_shows_them(llvm_mono, words, load, count):
    flow = image_of(words, load).markers
    assert len(flow.unloaded) == count
    for points, pixel in (
        (flow.unloaded, flow.pixel),
        (flow.unloaded + flow.displacement, flow.pixel + flow.pixel_flow),
    ):
        shown = np.isfinite(pixel).all(axis=1)
        assert shown.sum() > 0.8 * count
        np.testing.assert_allclose(pixel[shown], projected(points)[shown], atol=0.05)


def test_markers_on_a_bonded_plate_move_with_it(llvm_mono):
    flow = image_of("3 3 0.4", SHEARED).markers
    np.testing.assert_allclose(flow.displacement, np.tile([0.6, 0.3, -0.4], (35, 1)), atol=1e-6)
    np.testing.assert_allclose(flow.unloaded[[0, -1]], [[-9, -6, HEIGHT], [9, 6, HEIGHT]])


@pytest.mark.parametrize("load", [{}, SHEARED])
def test_the_image_is_dark_at_the_markers_and_bright_between_them(llvm_mono, load):
    image, plain = (image_of(words, load) for words in ("3 3 0.6", ""))
    assert plain.markers is None
    flow = image.markers
    where = flow.pixel + flow.pixel_flow
    shown = np.isfinite(where).all(axis=1) & (where > 3).all(axis=1) & (where < np.array(PIXELS) - 3).all(axis=1)
    columns, rows = np.floor(where[shown]).astype(int).T
    lit = plain.radiance[rows, columns, 0] > 0
    ratio = (image.radiance[rows, columns, 0] / plain.radiance[rows, columns, 0])[lit]
    # Reflectances 0.03 and 0.5; beside its edge, a marker of 0.6 mm covers a pixel of 0.16 mm.
    assert lit.sum() > 25 and np.abs(ratio - 0.03 / REFLECTANCE).max() < 0.02
    away = np.floor(where[shown] + 0.5 * PIXELS[0] / FIELD * 3).astype(int)  # the middle of four markers
    seen, bare = (own.radiance[away[:, 1], away[:, 0], 0] for own in (image, plain))
    assert np.median(seen[bare > 0] / bare[bare > 0]) == pytest.approx(1, abs=0.02)


def test_the_flow_is_zero_without_a_load_and_is_written_as_a_table(llvm_mono, tmp_path):
    image = image_of("5 5 0.4", {})
    assert np.abs(image.markers.displacement).max() == 0 and np.nanmax(np.abs(image.markers.pixel_flow)) < 1e-6
    write_image(image, tmp_path / "image.exr", {"scene": "own"})
    again, about = read_image(tmp_path / "image.exr")
    assert about == {"scene": "own"}
    for name in ("unloaded", "displacement", "pixel", "pixel_flow"):
        assert np.array_equal(getattr(again.markers, name), getattr(image.markers, name), equal_nan=True)
    write_markers(again.markers, tmp_path / "markers.csv")
    with open(tmp_path / "markers.csv") as file:
        rows = list(csv.DictReader(file))
    assert [row["marker"] for row in rows] == [str(k + 1) for k in range(9)]
    assert float(rows[0]["x_mm"]) == -5 and float(rows[0]["column"]) == pytest.approx(image.markers.pixel[0, 0])


def test_a_map_of_markers_covers_their_area():
    wide, deep = Block(20.0, 15.0, 4.0), Block(7.0, 11.0, 4.0)
    for words, block, bound in (
        ("2 2 0.25", wide, 2e-3),
        ("3 1.5 0.7", deep, 2e-3),
        ("1.37 1.91 0.01", wide, 1e-2),  # just above the radius of a pixel
        ("1.37 1.91 0.006", deep, 1e-2),
    ):
        markers = markers_of(words, block)
        covered = markers.map_on(block).mean(dtype=float) * block.width * block.depth
        assert covered == pytest.approx(len(markers.centres(block)) * np.pi * markers.radius**2, rel=bound)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("2 2", "three numbers above 0"),
        ("2 2 0", "three numbers above 0"),
        ("2 2 one", "three numbers above 0"),
        ("2 2 1", "a radius below half of the distances"),
        ("0.02 0.02 0.001", "at most 10000 markers"),
        ("40 40 9", "not one of them fits"),
        ("2 2 0.0097", "a radius of at least 0.00977 mm is needed"),
        ("2 2 0.001", "a radius of at least 0.00977 mm is needed"),
    ],
)
def test_impossible_markers_are_refused(words, message):
    with pytest.raises(InputError, match=message):
        markers_of(words, Block(20.0, 15.0, 4.0))


def test_markers_need_a_coat(llvm_mono):
    with pytest.raises(InputError, match="markers are not allowed without a coat"):
        Scene({"type": "scene", "pad": {"type": "deformable_pad", "cell": "none", "markers": "2 2 0.3"} | SIDES}).load()


@pytest.mark.parametrize("words", [" ", ","])
def test_blank_markers_are_none(llvm_mono, words):
    image = image_of(words, {})
    assert image.markers is None and np.array_equal(image.radiance, image_of("", {}).radiance)


def coats(*words):
    """The regions of pads side by side that share one, with markers."""
    region = {"type": "region", "top": COAT, "bottom": CLEAR, "outer": CLEAR}
    parts = {"type": "scene", "shared": region}
    for k, own in enumerate(words):
        pad = {"type": "deformable_pad", "cell": "none", "bsdf": {"type": "ref", "id": "shared"}} | SIDES
        pad["to_world"] = mi.ScalarTransform4f().translate([30.0 * k, 0, 0])
        parts[f"pad{k}"] = pad | {"markers": own}
    return [pad.bsdf() for pad in deformed_pads(Scene(parts).load())]


@pytest.mark.parametrize("words", [("2 2 0.25", ""), ("", "2 2 0.25"), ("2 2 0.25", "3 3 0.25", ""), (" ",)])
def test_pads_that_share_a_coat_have_their_own_markers(llvm_mono, words):
    counts = [str(region.walls["top"]).count("BlendBSDF") for region in coats(*words)]
    assert counts == [1 if own.strip() else 0 for own in words]


def test_a_region_with_markers_is_as_smooth_as_they_are(llvm_mono):
    """On a specular coat, light is sampled for the markers, too."""
    region = {"type": "region", "bottom": CLEAR, "top": {"type": "twosided", "bsdf": {"type": "conductor"}}}
    pad = {"type": "deformable_pad", "cell": "none", "markers": "2 2 0.5", "bsdf": region} | SIDES
    (found,) = deformed_pads(Scene({"type": "scene", "pad": pad}).load())
    for bsdf in (found.bsdf(), found.bsdf().walls["top"]):
        assert mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth) and mi.has_flag(bsdf.flags(), mi.BSDFFlags.Delta)
