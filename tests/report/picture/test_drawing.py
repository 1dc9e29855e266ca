"""Pictures of sensors: what they show, how they are written, and that the variant stays."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import OpenEXR
import pytest
from PIL import Image
from taxel_program import run_program

from mitsuba_taxel import InputError, Pad, PadSensor, Scene
from mitsuba_taxel.backend import default_variant
from mitsuba_taxel.geometry.surfaces.triangles import area_normals
from mitsuba_taxel.report.picture.drawing import GLOW, PICTURES, labelled, render_parts, write_picture
from mitsuba_taxel.report.picture.sensor_parts import middle_row, shown_parts
from mitsuba_taxel.studies.plan.files import check_new_file

pytestmark = pytest.mark.usefixtures("mechanics_error_unknown")


@pytest.fixture(scope="module")
def sensor():
    """A loaded sensor of two rows."""
    import mitsuba as mi

    mi.set_variant(default_variant())
    return PadSensor(pad=Pad(cell="hemispheric", rows=2, columns=1)).scene().load()


def materials(parts) -> set[str]:
    return {name for part in parts for name in np.unique(part.material).tolist()}


def test_parts_of_a_cut_sensor(sensor):
    parts, offset = shown_parts(sensor)
    assert offset == -3.55 / 2  # of two rows, the one nearer to the camera
    packages, pad, board = parts  # pads are built last
    inside = {"roof", "side", "bottom", "top", "outer", "cut"}
    assert materials([pad]) == inside and materials([packages]) == {"body", "led", "phototransistor"}
    assert pad.range(1)[0] == pytest.approx(offset, abs=1e-3)
    assert packages.range(1)[0] == pytest.approx(-3.55 / 2 - 0.53, abs=1e-6)  # whole
    diagonal = np.linalg.norm([4.55, 8.1, 4.55])
    assert board.range(2) == pytest.approx((-0.04 * diagonal, 0))
    assert board.range(1) == pytest.approx((-4.05 - 0.06 * diagonal, 4.05 + 0.06 * diagonal), rel=1e-6)
    face = pad.material == "cut"
    length, _, height = Pad(cell="hemispheric", columns=1).extent
    section = 2.55 * 0.5 + np.pi * 1.275**2 / 2
    area = np.linalg.norm(area_normals(pad.vertices, pad.triangles[face]), axis=1).sum()
    assert area == pytest.approx(length * height - section, rel=1e-3)


def test_magnified_deformation(llvm_mono):
    """The pad's top goes down by so many times as much, the bottom stays, and the picture says so."""
    live = PadSensor(pad=Pad(cell="cylindrical", rows=1, columns=1), force=(0, 0, -2)).scene().load()
    heights = [shown_parts(live, "none", factor)[0][1].range(2) for factor in (0, 1, 5)]
    rest, once, magnified = (high for _, high in heights)
    assert rest == pytest.approx(4.55, abs=1e-5) and rest - magnified == pytest.approx(5 * (rest - once), rel=1e-4)
    assert rest - once > 0.01 and all(low == pytest.approx(0, abs=1e-6) for low, _ in heights)
    blank = np.ones((60, 300, 3))
    words = labelled(blank, "deformation shown 5 times")
    assert np.all(words[:30] == 1) and 0.005 < np.mean(words[30:] < 0.5) < 0.2


def test_parts_of_a_whole_sensor(sensor):
    parts, offset = shown_parts(sensor, "none")
    assert offset is None and "cut" not in materials(parts)
    assert parts[1].range(1) == pytest.approx((-4.05, 4.05), abs=1e-5)


@pytest.mark.parametrize(
    "name, shown", [("plate.xml", {"plate", "board"}), ("hexagonal.xml", {"cut", "roof", "board"})]
)
def test_parts_of_shipped_scenes(llvm_mono, name, shown):
    parts, offset = shown_parts(Scene.from_file(name).load())
    assert offset == pytest.approx(0, abs=1e-3)
    assert shown <= materials(parts)


def test_rectangles_that_carry_faces_look_like_them(llvm_mono):
    import mitsuba as mi

    def carrier(x, **face):
        to_world = mi.ScalarTransform4f().translate([x, 0, 0.5]).scale([0.4, 0.4, 1])
        return {"type": "rectangle", "to_world": to_world, "bsdf": {"type": "wall", "reflectance": 0.0}, **face}

    shapes = {
        "plate": {"type": "cube", "to_world": mi.ScalarTransform4f().translate([0, 0, 1])},
        "left": carrier(-0.45, emitter={"type": "annular_led"}),
        "right": carrier(0.45, sensor={"type": "phototransistor"}),
    }
    parts, _ = shown_parts(Scene({"type": "scene", **shapes}).load())
    for part, name, x in zip(parts[1:3], ("led", "phototransistor"), (-0.45, 0.45), strict=True):
        face = part.material == name
        places = part.vertices[part.triangles[face]]
        assert np.count_nonzero(face) == 2 and set(part.material[~face]) == {"body"}
        assert places[..., 2] == pytest.approx(0.5) and places[..., 0].mean() == pytest.approx(x, abs=0.2)


def test_the_row_of_packages_without_a_pad(llvm_mono):
    live = Scene.from_file("plate.xml").load()
    parts, _ = shown_parts(live, "none")
    assert middle_row(parts) == 0


def test_a_cut_beside_everything_is_refused(sensor):
    with pytest.raises(InputError, match=r"cut = 4\.1 is not allowed: above -4\.05 and below 4\.05 mm"):
        shown_parts(sensor, 4.1)


def test_a_scene_without_meshes_is_refused(llvm_mono):
    live = Scene({"type": "scene", "sheet": {"type": "rectangle"}}).load()
    with pytest.raises(InputError, match="contains no mesh"):
        shown_parts(live)


@pytest.mark.parametrize("variant", ["llvm_ad_mono", "llvm_ad_rgb"])
def test_leds_are_the_brightest_red(variant):
    """Whatever variant is in force, it stays."""
    import mitsuba as mi

    mi.set_variant(variant)
    told = []
    parts, _ = shown_parts(Scene.from_file("plate.xml", z=3).load())
    pixels = render_parts(parts, width=64, samples=32, progress=lambda *count: told.append(count))
    assert mi.variant() == variant
    assert told == [(1, 2), (2, 2)]
    assert pixels.shape == (40, 64, 3) and np.all(np.isfinite(pixels)) and pixels.min() >= 0
    red, green, blue = pixels.reshape(-1, 3)[pixels[..., 0].argmax()]
    assert 0.3 * GLOW[0] < red <= GLOW[0] * 1.01 and red > 8 * green and red > 8 * blue
    assert 0.9 < np.median(pixels[:4, :4]) < 1.3  # the ground is white
    dark = pixels.sum(axis=2) < 0.6
    assert 0.02 < dark.mean() < 0.6  # the package


def test_a_closed_pad_hides_the_leds(sensor):
    """And cut open it shows them: nothing else is red."""
    whole, opened = (render_parts(shown_parts(sensor, cut)[0], width=64, samples=16) for cut in ("none", "middle"))
    assert (whole[..., 0] - whole[..., 1]).max() < 0.1
    assert (opened[..., 0] - opened[..., 1]).max() > 1
    assert whole.std() > 0.1


def test_more_samples_less_noise(llvm_mono):
    parts, _ = shown_parts(Scene.from_file("plate.xml").load())
    few, many = (render_parts(parts, width=48, samples=samples) for samples in (1, 64))
    noise = [np.abs(np.diff(pixels[:5], axis=1)).mean() for pixels in (few, many)]
    assert noise[1] < 0.5 * noise[0]


@pytest.mark.parametrize("name, value", [("width", 15), ("width", 8193), ("samples", 0)])
def test_sizes_out_of_range_are_refused(name, value):
    with pytest.raises(InputError, match=f"{name} = {value} is not allowed"):
        render_parts([], **{name: value})


def test_files(llvm_mono, tmp_path):
    """OpenEXR holds the numbers themselves, PNG those of the curve of sRGB."""
    pixels = np.random.default_rng(0).uniform(0, 1.5, (10, 16, 3))
    for suffix in (".exr", ".png"):
        check_new_file(tmp_path / f"a{suffix}", *PICTURES)
        write_picture(pixels, tmp_path / f"a{suffix}")
    with OpenEXR.File(str(tmp_path / "a.exr")) as image:
        (kept,) = (channel.pixels for channel in image.channels().values())
    assert kept.shape == pixels.shape and kept == pytest.approx(pixels, rel=1e-6)
    linear = np.clip(pixels, 0, 1)
    srgb = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    with Image.open(tmp_path / "a.png") as image:
        assert np.array(image) == pytest.approx(255 * srgb, abs=1.01)


def test_other_formats_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"a\.jpg must end in \.png or \.exr"):
        check_new_file(tmp_path / "a.jpg", *PICTURES)


def test_program(tmp_path):
    small = ("--width", "32", "--samples", "4")
    done = run_program(tmp_path, "picture", "plate.xml", "-D", "z=1", *small, "--cut", "y=0.1", "--json")
    assert done.returncode == 0, done.stderr
    about = {"width": 32, "height": 20, "samples": 4, "cut": 0.1, "magnify": 1.0, "files": ["picture.png"]}
    assert json.loads(done.stdout) == about
    with Image.open(tmp_path / "picture.png") as image:
        assert image.size == (32, 20)


@pytest.mark.parametrize("words", [("-o", "a.bmp"), ("--width", "8"), ("--cut", "here"), ("--cut", "9")])
def test_program_refuses(tmp_path, words):
    done = run_program(tmp_path, "picture", "plate.xml", *words)
    assert done.returncode == 2 and len(done.stderr.splitlines()) == 1 and not list(tmp_path.iterdir())


@pytest.mark.parametrize("suffix", ["exr", "png"])
def test_files_are_written_by_one_thread(tmp_path, suffix):
    """Mitsuba's own writer of OpenEXR would wait for ever."""
    code = (
        "import sys, drjit as dr, numpy as np, mitsuba_taxel\n"
        "from pathlib import Path\n"
        "from mitsuba_taxel.backend import activate_variant\n"
        "from mitsuba_taxel.report.picture.drawing import write_picture\n"
        "activate_variant(); dr.set_thread_count(1); write_picture(np.ones((10, 16, 3)), Path(sys.argv[1]))\n"
    )
    subprocess.run([sys.executable, "-c", code, str(tmp_path / f"a.{suffix}")], check=True, timeout=60)
    assert (tmp_path / f"a.{suffix}").stat().st_size > 0
