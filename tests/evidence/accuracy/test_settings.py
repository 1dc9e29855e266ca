"""Error against time in settings: curves over patches, paths and depths, and what they are compared with."""

from __future__ import annotations

import csv
import math
import os
from functools import partial

import pytest
from click.testing import CliRunner
from PIL import Image

from mitsuba_taxel import InputError, Pad, PadSensor, Wall
from mitsuba_taxel.evidence.accuracy import settings as accuracy_settings
from mitsuba_taxel.evidence.accuracy.settings import PATHS, WITHOUT, settings_accuracy
from mitsuba_taxel.evidence.rows.work_precision import ErrorCurve, WorkPoint

GREY = Wall("lambertian", 0.9)
SECONDS = 0.5


def quiet(step):
    """Nobody is told of steps."""


def within(point, times=4.0):
    """Whether an error is what it is stated to be, and the reference known."""
    return point.error < times * math.hypot(point.stated, point.floor)


@pytest.fixture
def small(monkeypatch):
    """Few sizes and short references."""
    monkeypatch.setattr(accuracy_settings, "PATCHES", (2.0, 1.4))
    monkeypatch.setattr(accuracy_settings, "DEPTHS", (0.2,))
    monkeypatch.setattr(accuracy_settings, "FINE", 0.9)
    monkeypatch.setattr(accuracy_settings, "SLOPE_POINTS", (256,))


def test_light_over_patches_and_paths(llvm_mono, small):
    """A box whose side walls scatter: patches of two sizes differ, and all errors are as stated."""
    scene = PadSensor(Pad("parallelepiped", 1, 1), roof=GREY, side=Wall("lambertian", 0.5)).scene
    paths, patches = accuracy_settings._light(scene, True, SECONDS, quiet)
    assert (paths.method, patches.method) == (PATHS, WITHOUT)
    assert [point.setting for point in patches.points] == ["2.5 mm", "1.8 mm"] and not patches.remark
    large, smaller = patches.points
    assert smaller.error != large.error and smaller.seconds > large.seconds
    assert all(map(within, (*patches.points, *paths.points)))
    assert paths.points[-1].stated < paths.points[0].stated and 0 < large.floor < 0.01
    assert all(point.seconds > 0 for point in patches.points)


def test_patches_that_are_too_many_are_told(llvm_mono, small, monkeypatch):
    monkeypatch.setattr(accuracy_settings, "PATCHES", (2.0, 0.2))
    scene = PadSensor(Pad("parallelepiped", 1, 1), roof=GREY).scene
    _, patches = accuracy_settings._light(scene, True, SECONDS, quiet)
    assert len(patches.points) == 1 and "patches of 0.25 mm: too many" in patches.remark


def test_a_slope_over_patches_and_paths(llvm_mono, small):
    sensor = PadSensor(Pad("parallelepiped", 1, 1), force=(0, 0, -1), roof=GREY)
    paths, patches = accuracy_settings._slope(sensor.scene, True, SECONDS, quiet)
    large, smaller = patches.points
    assert large.error != smaller.error and max(large.floor, large.stated) < 0.5
    assert all(map(within, (*patches.points, *paths.points)))


def test_touch_is_judged_by_smaller_elements(llvm_mono, small):
    (curve,) = accuracy_settings._touch(SECONDS, quiet)
    (point,) = curve.points
    assert point.setting == "0.2 mm" and point.reference == "elements of 0.9 mm"
    assert 0 < point.error < 0.01 and point.stated > point.floor > 0 and within(point, 2.0)


def fake(curves):
    return {"one": lambda seconds, starting: curves, "other": lambda seconds, starting: curves[:1]}


def curves_of_two():
    points = [WorkPoint(f"{n} samples", 0.1 * n, 0.1 / n, 0.2 / n, 0.01, "long", 4, 4) for n in (1, 2, 4)]
    return [ErrorCurve("", PATHS, points), ErrorCurve("", WITHOUT, [], remark="no patches")]


@pytest.mark.usefixtures("painted_figures")
def test_all_settings_are_written_and_printed(monkeypatch, tmp_path):
    from taxel_cli.evidence.bench import command

    monkeypatch.setattr(accuracy_settings, "settings", partial(fake, curves_of_two()))
    done = CliRunner().invoke(command, ["accuracy", "-o", str(tmp_path / "out"), "--seconds", "0.1"])
    assert done.exit_code == 0 and sorted(os.listdir(tmp_path / "out")) == [
        "accuracy.csv",
        "accuracy.png",
        "accuracy.svg",
    ]
    rows = [line.split() for line in done.stdout.splitlines()]
    assert [row[0] for row in rows[1:9]] == ["one"] * 4 + ["other"] * 3 + ["Seconds"]
    assert "no patches" in done.stdout and rows[1][3:5] == ["1", "samples"]
    with (tmp_path / "out" / "accuracy.csv").open(newline="") as stream:
        table = list(csv.DictReader(stream))
    assert [row["part"] for row in table] == ["one"] * 4 + ["other"] * 3 and float(table[1]["error"]) == 0.05
    with Image.open(tmp_path / "out" / "accuracy.png") as image:
        assert image.width > 1.2 * image.height  # two panels beside each other


@pytest.mark.usefixtures("painted_figures")
def test_many_settings_take_several_rows_of_panels(monkeypatch, tmp_path):
    monkeypatch.setattr(
        accuracy_settings, "settings", lambda: {str(n): lambda seconds, starting: curves_of_two() for n in range(9)}
    )
    settings_accuracy(tmp_path, 1.0)
    with Image.open(tmp_path / "accuracy.png") as image:
        assert 0.7 < image.width / image.height < 1.5


def test_every_setting_of_the_page_is_a_scene(llvm_mono):
    from mitsuba_taxel.sensing.reading.runs import prepare

    names = accuracy_settings.settings()
    wanted = {"plate", "box", "dome", "narrow beam", "mirror dome", "rough mirror dome", "printed steps"}
    assert wanted <= set(names) and {"slope of a dome", "ball by depth"} <= set(names)
    for name in wanted - {"printed steps"}:
        assert len(prepare(names[name].args[0]()).scene.sensors()) == 1


def test_no_time_is_refused(tmp_path):
    with pytest.raises(InputError, match="seconds = 0 is not allowed"):
        settings_accuracy(tmp_path, 0)
