"""Studies of the images of a camera: small ones of `gel.xml`."""

from __future__ import annotations

import json
import math

import numpy as np
import pandas
import pytest
from PIL import Image

from mitsuba_taxel import InputError, open_study, sweep
from mitsuba_taxel.sensing import Scene, find_scene
from mitsuba_taxel.sensing.camera import camera_image
from mitsuba_taxel.sensing.image_file import read_image
from mitsuba_taxel.sensing.reading.pad_results import pad_results
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads
from mitsuba_taxel.studies import run_study
from mitsuba_taxel.studies.store.image_folder import open_images
from mitsuba_taxel.studies.store.status import study_status

import mitsuba as mi  # isort: skip

SMALL = {"width": "32", "height": "24", "uz": "-0.4"}
SIZE = 2.0
"""Size in mm of the finite elements."""
CAMERA, FIELD = 24.0, 40.0
"""Distance in mm of the camera below the window, and its field of view in degrees along x, in `gel.xml`."""


@pytest.fixture(scope="module")
def images(tmp_path_factory):
    folder = tmp_path_factory.mktemp("studies") / "gel"
    done = []
    table = sweep("gel.xml", {"x": "-4:4:4"}, SMALL, points=1, mesh_size=SIZE, output=folder, progress=done.append)
    assert [(at.done, at.failed, at.total) for at in done] == [(1, 0, 3), (2, 0, 3), (3, 0, 3)]
    return table, folder


def times(folder):
    return {file.name: file.stat().st_mtime_ns for file in (folder / "images").glob("*.exr")}


def test_the_print_is_where_the_indenter_is(images):
    table, folder = images
    for x, name in zip(table.x.values, table.image.values, strict=True):
        depth = read_image(folder / name)[0].depth
        # The print is where the coat is nearest to the camera, seen at about its depth; x runs from right to left.
        dent = np.clip(np.nanmedian(depth) - depth, 0.1, None) - 0.1
        column = (dent.sum(axis=0) * np.arange(32)).sum() / dent.sum()
        millimetres = 2 * math.tan(math.radians(FIELD / 2)) * float(depth.min()) / 32
        assert -(column - 15.5) * millimetres == pytest.approx(x, abs=0.6 * millimetres)


def test_an_image_is_that_of_its_scene_alone(images):
    table, folder = images
    mi.set_variant("llvm_ad_rgb")
    alone = camera_image(Scene.from_file("gel.xml", **SMALL, x="4").with_mesh_size(SIZE), samples=1)
    image, about = read_image(folder / str(table.image.sel(x=4).values))
    np.testing.assert_allclose(image.radiance, alone.radiance, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(image.standard_error, alone.standard_error, rtol=1e-5, atol=1e-9)
    np.testing.assert_array_equal(image.coat, alone.coat)
    assert about["parameters"]["x"] == "4" and table.relative_error.sel(x=4) == pytest.approx(alone.relative_error)


def test_a_study_has_pictures_a_table_and_a_contact_sheet(images):
    table, folder = images
    listed = pandas.read_csv(folder / "images.csv", comment="#")
    assert listed.x_mm.tolist() == [-4, 0, 4] and listed.image.tolist() == table.image.values.tolist()
    # By symmetry the two outer places need the same force, and the one in the middle less than a corner would.
    assert listed.reaction_fz_N[0] == pytest.approx(listed.reaction_fz_N[2], rel=1e-3) and listed.reaction_fz_N[1] < 0
    pictures = [np.array(mi.Bitmap(str((folder / name).with_suffix(".png")))) for name in listed.image]
    assert all(picture.shape == (24, 32, 3) for picture in pictures)
    assert (folder / "contact_sheet.png").is_file()
    with Image.open(folder / "film.png") as film:
        assert (film.n_frames, film.is_animated, film.info["loop"]) == (3, True, 0)
        for number, picture in enumerate(pictures):
            film.seek(number)
            assert np.array_equal(np.array(film.convert("RGB")), picture) and film.info["duration"] == 200
    (state,) = study_status(folder)
    assert (state.done, state.failed, state.total) == (3, 0, 3)
    assert state.error == pytest.approx(float(table.relative_total_error.max()))
    parts = np.hypot(listed.relative_error, listed.relative_mechanics_error)
    assert listed.relative_total_error.tolist() == pytest.approx(parts.tolist())
    # The force is that on finer elements, within twice its stated error.
    (pad,) = deformed_pads(Scene.from_file("gel.xml", **SMALL, x="4").with_mesh_size(1.2).load())
    finer = pad_results([pad.state], with_errors=False)["reaction_fz"].value
    assert 0 < abs(listed.reaction_fz_N[2] - finer) < 2 * listed.reaction_fz_error_N[2] < 0.5 * abs(finer)
    with pytest.raises(InputError, match="holds images of a camera, not readings"):
        open_study(folder)


def test_a_study_resumes_and_grows(images):
    table, folder = images
    before, lost = times(folder), folder / "images" / "000001.exr"
    first, _ = read_image(lost)
    lost.unlink()
    how = {"points": 1, "mesh_size": SIZE, "output": folder}
    assert open_images(folder).attrs["notes"].startswith("1 of 3 scenes have no image yet")
    again = sweep("gel.xml", {"x": "-4:4:4"}, SMALL, **how)
    now = times(folder)
    assert {name for name in now if now[name] != before[name]} == {"000001.exr"}
    assert np.array_equal(read_image(lost)[0].radiance, first.radiance)
    assert again.drop_vars("seconds").identical(table.drop_vars("seconds"))
    # A value between two others: stored images get new numbers, and are not computed again.
    done = []
    grown = sweep("gel.xml", {"x": "-4,0,2,4"}, SMALL, progress=done.append, **how)
    assert grown.x.values.tolist() == [-4, 0, 2, 4] and [at.done for at in done] == [4]
    assert times(folder)["000003.exr"] == now["000002.exr"]
    assert read_image(folder / str(grown.image.sel(x=4).values))[1]["parameters"]["x"] == "4"
    # More samples than stored: computed again.
    assert open_images(folder).samples.values.tolist() == [1] * 4
    more = sweep("gel.xml", {"x": "-4"}, SMALL, **{**how, "points": 3})
    assert more.samples.values.tolist() == [4] * 4


def test_a_scene_that_fails_leaves_the_others(tmp_path):
    study = tmp_path / "study.toml"
    scene = find_scene("gel.xml").read_text("utf-8").replace("0, 0, -24", "0, 0, $z")
    (tmp_path / "own.xml").write_text(scene.replace("<default", '<default name="z" value="-24"/><default', 1), "utf-8")
    small = 'width = 16\nheight = 12\nuz = 0\n'
    study.write_text(f'scene = "own.xml"\npoints = 1\n[define]\n{small}[vary]\nz = [-24, 24]\n', "utf-8")
    table = run_study(study, tmp_path / "out")
    assert table.image.values.tolist() == ["images/000000.exr", ""]
    assert table.attrs["failures"].startswith("z=24: the camera does not see the coat")
    assert len(json.loads((tmp_path / "out" / "failed" / "000001.json").read_text())["message"]) > 10


def test_differences_are_of_images_only(tmp_path):
    vary, small = {"uz": "0,-0.2"}, {"width": "16", "height": "12"}
    table = sweep("gel.xml", vary, small, points=1, mesh_size=SIZE, difference=True, output=tmp_path / "out")
    first, second = (read_image(tmp_path / "out" / name)[0] for name in table.image.values)
    assert not first.difference.any() and second.difference.any()
    # The images of a study share their random numbers.
    np.testing.assert_allclose(second.difference, second.radiance - first.radiance, atol=1e-7)
    with pytest.raises(InputError, match="difference = True is not allowed for readings"):
        sweep("plate.xml", {"z": "0.6,0.7"}, difference=True)


@pytest.mark.parametrize(
    ("vary", "how", "message"),
    [
        ({"uz": "-0.1,-0.2"}, {"maps": True}, "maps = True is not allowed for images"),
        ({"uz": "-0.1,-0.2"}, {"time_budget": 60.0}, "time_budget = 60.0 is not allowed for images"),
        ({"uz": "-0.1,-0.2"}, {"meshes": "last"}, "meshes = 'last' is not allowed for images"),
        ({"uz": "-0.1,-0.2"}, {"parquet": True}, "parquet = True is not allowed for images"),
        ({"uz": "-0.1,-0.2"}, {"output": None}, "output is missing: a folder is needed for images"),
        ({"uz": "-0.1,-0.2", "to_contact": "uz=-1"}, {}, "to_contact"),
    ],
)
def test_settings_of_readings_are_refused_before_anything_is_computed(tmp_path, vary, how, message):
    with pytest.raises(InputError, match=message):
        sweep("gel.xml", vary, {"width": "32"}, **{"output": tmp_path / "out", **how})
    assert not (tmp_path / "out").exists()
