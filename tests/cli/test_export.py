"""`taxel export`: a model of a study on disk."""

from __future__ import annotations

import json

import pytest

from mitsuba_taxel import sweep


def test_the_program_exports_a_study(taxel, tmp_path):
    pytest.importorskip("onnx")
    sweep("plate.xml", {"offset_x": "-0.2,0,0.2", "z": "0.6,0.7,0.8,0.9"}, points=256, output=tmp_path / "out")
    done = taxel("export", "out", "-o", "plate.onnx")
    assert done.returncode == 0 and done.stderr == "" and "offset_x: -0.2 to 0.2 mm" in done.stdout
    assert "of full scale" in done.stdout and (tmp_path / "plate.onnx").stat().st_size
    about = json.loads(taxel("export", "out", "-o", "plate.onnx", "--json").stdout)
    assert about["inputs"] == ["offset_x", "z"] and about["high"] == [0.2, 0.9]
    for words in (("nowhere",), ("out", "-o", "plate.pt")):
        done = taxel("export", *words)
        assert done.returncode == 2 and done.stderr.count("\n") == 1
