"""Studies of images whose error is unknown, or that an older version has written."""

from __future__ import annotations

import json
import math
import shutil

import numpy as np
import OpenEXR
import pytest
from click.testing import CliRunner
from taxel_cli.readings import status
from taxel_cli.readings import sweep as sweep_command

from mitsuba_taxel import sweep
from mitsuba_taxel.sensing.image_file import ABOUT, read_image
from mitsuba_taxel.studies.store.image_folder import open_images, write_images
from mitsuba_taxel.studies.store.status import study_status

SMALL = {"width": "16", "height": "12"}


@pytest.fixture(scope="module")
def original(tmp_path_factory):
    folder = tmp_path_factory.mktemp("studies") / "gel"
    sweep("gel.xml", {"uz": "0,-0.2"}, SMALL, target_error=0.9, output=folder)
    return folder


@pytest.fixture
def study(original, tmp_path_factory):
    """A study of two images that reach their target of 90 %."""
    return shutil.copytree(original, tmp_path_factory.mktemp("copies") / "gel")


def rewrite(file, changes, without=" "):
    """Change facts of an image (None: unknown), and omit the channels that start with a word."""
    with OpenEXR.File(str(file), separate_channels=True) as exr:
        header = exr.header()
        pixels = {name: own.pixels for name, own in exr.channels().items() if not name.startswith(without)}
        header[ABOUT] = json.dumps({**json.loads(header[ABOUT]), **changes})
        header.pop("channels", None)
        with OpenEXR.File(header, pixels) as other:
            other.write(str(file))


def run_again(folder, *others):
    words = ["gel.xml", "--vary", "uz=0,-0.2", "-D", "width=16", "-D", "height=12", "--target-error", "90%"]
    return CliRunner().invoke(sweep_command.command, [*words, "-o", str(folder), *others])


@pytest.mark.parametrize("unknown", [1, 2])
def test_a_target_is_not_reached_if_an_error_is_missing(study, unknown):
    reached = run_again(study)
    assert reached.exit_code == 0 and "unknown" not in reached.output and 0 < study_status(study)[0].error < 0.9
    for number in range(unknown):
        nothing = dict.fromkeys(("relative_mechanics_error", "relative_total_error"))
        rewrite(study / "images" / f"{number:06d}.exr", nothing)
    missed = run_again(study)
    note = f"target error 0.9 not reached: in {unknown} of 2 images, the error by the finite elements is unknown"
    assert missed.exit_code == 3 and note in missed.output and "mechanics unknown, total unknown" in missed.output
    assert open_images(study).attrs["notes"] == note
    figures = json.loads(run_again(study, "--json").stdout)
    assert figures["relative_total_error"] is None and figures["relative_error"] < 0.9
    assert math.isnan(study_status(study)[0].error)
    assert "unknown" in CliRunner().invoke(status.command, [str(study)]).output


def test_a_scene_without_an_image_has_no_unknown_error(study):
    (study / "images" / "000001.exr").unlink()
    assert "unknown" not in open_images(study).attrs["notes"]


def test_an_image_of_an_older_version_has_an_unknown_error(study):
    file = study / "images" / "000001.exr"
    before, _ = read_image(file)
    rewrite(file, {"relative_total_error": None}, without="mechanics_error.")
    image, _ = read_image(file)
    assert np.isnan(image.mechanics_error).all() and image.mechanics_error.shape == image.radiance.shape
    assert np.array_equal(image.radiance, before.radiance) and math.isnan(image.relative_total_error)
    write_images(open_images(study), study)
    assert file.with_suffix(".png").is_file()
