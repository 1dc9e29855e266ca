"""`taxel export`: a model of a study on disk."""

from __future__ import annotations

import json

import numpy as np
import pytest
from made_up_contact import linear_model, made_up
from pages import assert_on_its_page

from mitsuba_taxel import sweep
from mitsuba_taxel.surrogates import contact_export, read_contact_model, write_contact_model


def test_the_program_exports_a_study(taxel, tmp_path):
    pytest.importorskip("onnx")
    sweep("plate.xml", {"offset_x": "-0.2,0,0.2", "z": "0.6,0.7,0.8,0.9"}, points=256, output=tmp_path / "out")
    done = taxel("export", "out", "-o", "plate.onnx")
    assert done.returncode == 0 and done.stderr == "" and "offset_x: -0.2 to 0.2 mm" in done.stdout
    assert_on_its_page(done, tmp_path)
    assert "of full scale" in done.stdout and (tmp_path / "plate.onnx").stat().st_size
    about = json.loads(taxel("export", "out", "-o", "plate.onnx", "--json").stdout)
    assert about["inputs"] == ["offset_x", "z"] and about["high"] == [0.2, 0.9]
    for words in (("nowhere",), ("out", "-o", "plate.pt")):
        done = taxel("export", *words)
        assert done.returncode == 2 and done.stderr.count("\n") == 1


def test_the_program_exports_the_contact_of_a_pad(taxel, tmp_path, monkeypatch):
    """Solutions are made up, with a second order and an error of 2 %; they are kept for the next call."""
    linear, calls = linear_model(), []
    solved = {one.touch: one for one in made_up(linear, 40, (0.0, 0.8, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0), noise=0.02)}

    def solve(touch):
        calls.append(touch)
        return solved[touch]

    monkeypatch.setattr(contact_export, "contact_model", lambda scene, depth, **options: linear)
    monkeypatch.setattr(contact_export, "_solver", lambda scene: solve)
    done = taxel("export", "--contact", "--depth", "0.4", "--error", "2%", "pad.xml")
    assert done.returncode == 0 and done.stderr == "" and "11 x 11 patches of 0.4 x 0.4 mm" in done.stdout
    model, first = read_contact_model(tmp_path / "contact.npz"), len(calls)
    assert model.errors.bodies == first >= 8 and model.errors.reading_rms <= 0.02
    done = taxel("export", "--contact", "--depth", "0.4", "--error", "0.01%", "pad.xml", "-o", "contact.npz", "--json")
    about = json.loads(done.stdout)
    assert done.returncode == 3 and about["errors"]["bodies"] == len(calls) == 40
    assert any("target of 0.01% is not reached" in note for note in about["notes"])
    for words in (
        ("--contact", "pad.xml"),
        ("--depth", "0.4", "out"),
        ("--contact", "--depth", "0.4", "pad.xml", "-o", "pad.pt"),
        ("--contact", "--depth", "0.4", "contact.npz", "-o", "pad.onnx"),
        ("--contact", "contact.npz"),
        ("--contact", "--depth", "0.4", "--friction", "pad.xml", "-o", "pad.onnx"),
        ("--contact", "--friction", "contact.npz", "-o", "pad.onnx"),
        ("--friction", "out"),
        ("--contact", "none.npz", "-o", "pad.onnx"),
        ("out", "-o", "model.py"),
        ("-D", "fz=1", "out"),
    ):
        done = taxel("export", *words)
        assert done.returncode == 2 and done.stderr.count("\n") == 1


def test_a_contact_model_is_written_in_other_forms(taxel, tmp_path):
    onnx = pytest.importorskip("onnx")
    write_contact_model(linear_model(), tmp_path / "contact.npz", {"scene": "own.xml", "parameters": {"wall": "0.4"}})
    for ending in ("onnx", "py"):
        done = taxel("export", "--contact", "contact.npz", "-o", f"pad.{ending}")
        assert done.returncode == 0 and done.stderr == "" and (tmp_path / f"pad.{ending}").stat().st_size > 1e5
    assert b"def read(depth)" in (tmp_path / "pad.py").read_bytes()
    about = {one.key: one.value for one in onnx.load(tmp_path / "pad.onnx").metadata_props}
    assert about["scene"] == "own.xml" and "0.4" in about["parameters"]


def test_the_program_calibrates_a_study_and_a_bench(taxel, tmp_path):
    pytest.importorskip("onnx")
    time = np.arange(0, 200, 0.1)
    force = -5 * (1 - np.cos(time / 8))
    table = np.stack([time, force, 1 - 0.05 * force + 1e-3 * np.random.default_rng(0).normal(size=len(time))], axis=1)
    np.savetxt(tmp_path / "bench.csv", table, delimiter=",", header="time_s,fz_N,v1_V", comments="")
    done = taxel("calibrate", "bench.csv", "--coverage", "80%")
    assert_on_its_page(done, tmp_path)
    assert done.returncode == 0 and done.stderr == "" and "contains the force with a probability of 80%" in done.stdout
    assert (tmp_path / "calibration.onnx").stat().st_size
    about = json.loads(taxel("calibrate", "bench.csv", "--coverage", "80%", "--json").stdout)
    # Noise is white here; of the 6.4 other runs on average, and a new one.
    assert abs(about["covered"] - 0.8 * 7.4 / 6.4) < 0.02 and set(about["half_width_N"]) == {"fz"}
    assert about["paths"] == 8 and about["paths_needed"] == 4
    few = taxel("calibrate", "bench.csv", "--over", "force").stdout
    assert "is meant to contain the force" in few and "8 paths are too few for 90% by ranks of paths: at least 9" in few
    for words in (("nowhere",), ("nowhere.csv",), ("bench.csv", "--coverage", "2"), ("bench.csv", "--over", "place")):
        done = taxel("calibrate", *words)
        assert done.returncode == 2 and done.stderr.count("\n") == 1
