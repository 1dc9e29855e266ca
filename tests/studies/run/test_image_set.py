"""Training sets of images."""

from __future__ import annotations

import numpy as np
import pandas
import pytest
import xarray as xr
from click.testing import CliRunner
from taxel_cli.results.dataset import command

from mitsuba_taxel import InputError, sweep
from mitsuba_taxel.sensing.image_file import read_image
from mitsuba_taxel.studies.run.image_set import image_set

PARTS = ("train", "validation", "test")


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("studies") / "gel"
    vary = {"uz": "0,-0.2", "x": "-4:4:2", "youngs_modulus": "0.2"}
    small = {"width": "32", "height": "24", "markers": "4 4 0.5"}
    sweep("gel.xml", vary, small, points=1, mesh_size=2.0, output=folder)
    return folder


def test_a_training_set_has_each_image_once_with_its_touch_and_force(study, tmp_path):
    tables = image_set(study, tmp_path / "set", hdf5=True)
    assert [len(tables[name]) for name in PARTS] == [7, 1, 2]
    rows = pandas.concat(tables.values())
    assert sorted(rows.image) == [f"images/{number:06d}.exr" for number in range(10)]
    for row in rows.itertuples():
        image, about = read_image(tmp_path / "set" / row.image)
        assert (float(about["parameters"]["uz"]), float(about["parameters"]["x"])) == (row.uz_mm, row.x_mm)
        # The coat is pressed by as much as the table says, but for the distance of pixels from the middle of the ball.
        assert np.nanmin(image.displacement[..., 2]) == pytest.approx(row.uz_mm, abs=0.05)
        assert (row.reaction_fz_N < -0.01) is (row.uz_mm < 0) and row.y_mm == 0
        assert (tmp_path / "set" / row.image).with_suffix(".png").is_file()
    for name in PARTS:
        assert pandas.read_csv(tmp_path / "set" / f"{name}.csv").image.tolist() == tables[name].image.tolist()
        with xr.open_dataset(tmp_path / "set" / "dataset.h5", group=name, engine="h5netcdf") as group:
            assert group.radiance.shape == (len(tables[name]), 24, 32, 3)
            for number, file in enumerate(tables[name].image):
                image, _ = read_image(study / file)
                assert np.array_equal(group.radiance[number], image.radiance)
                assert np.array_equal(group.displacement[number], image.displacement, equal_nan=True)
                assert (np.nansum(group.contact_pressure[number]) > 0) is (tables[name].uz_mm[number] < 0)
    text = (tmp_path / "set" / "README.md").read_text("utf-8")
    assert "`reaction_fz_N`" in text and "scene gel.xml" in text


def test_the_markers_of_all_images_are_a_table_and_move_towards_the_touch(study, tmp_path):
    table = pandas.concat(image_set(study, tmp_path / "set").values()).set_index("image")
    markers = pandas.read_csv(tmp_path / "set" / "markers.csv")
    assert (markers.groupby("image").size() == 15).all() and len(markers) == 150
    assert markers.equals(pandas.read_csv(study / "markers.csv"))
    for image, own in markers.groupby("image"):
        deepest = own.loc[own.uz_mm.idxmin()]
        if table.uz_mm[image] == 0:
            assert not own[["ux_mm", "uy_mm", "uz_mm"]].any(axis=None)
        elif abs(table.x_mm[image]) % 4 == 0:  # a marker is below the ball
            assert (deepest.x_mm, deepest.y_mm) == (table.x_mm[image], 0)
            assert deepest.uz_mm == pytest.approx(table.uz_mm[image], abs=0.03)


def test_touches_keep_their_part_and_what_images_do_not_have_is_refused(study, tmp_path):
    first, again, other = (image_set(study, tmp_path / str(n), seed=seed) for n, seed in enumerate((0, 0, 3)))
    assert all(first[name].equals(again[name]) for name in PARTS)
    assert first["test"].image.tolist() != other["test"].image.tolist()
    with pytest.raises(InputError, match="split"):
        image_set(study, tmp_path / "wrong", split=(0.5, 0.2, 0.2))
    with pytest.raises(InputError, match="is not empty"):
        image_set(study, tmp_path / "0")
    refused = CliRunner().invoke(command, [str(study), "-o", str(tmp_path / "cli"), "--noise", "1%"])
    assert "--noise is not allowed for images" in str(refused.exception)
    done = CliRunner().invoke(command, [str(study), "-o", str(tmp_path / "cli")])
    assert done.exit_code == 0 and "train 7, validation 1, test 2" in done.output
