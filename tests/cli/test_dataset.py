"""`taxel dataset`: from a folder of results to tables and back in one line."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner
from taxel_cli.results.dataset import command

from mitsuba_taxel import InputError, sweep
from mitsuba_taxel.studies.run.training import training_set

# A plate stands in for the pad, and nothing is solved: what are called forces here are translations, in mm.
SCENE = """<scene version="3.9.0">
    <default name="fx" value="0"/> <default name="fy" value="0.1"/> <default name="fz" value="0.7"/>
    <shape type="photo_reflector"> <emitter type="annular_led"/> <sensor type="phototransistor"/> </shape>
    <shape type="rectangle">
        <transform name="to_world"><rotate x="1" angle="180"/><translate x="$fx" y="$fy" z="$fz"/></transform>
        <bsdf type="wall"> <string name="scattering" value="lambertian"/> </bsdf>
    </shape>
    <integrator type="taxel_tracer"/>
</scene>"""


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("dataset")
    (folder / "plate.xml").write_text(SCENE)
    vary = {"fx": "-0.1,0,0.1", "fz": "0.6:0.9:0.1"}
    return folder / "study", sweep(folder / "plate.xml", vary, points=16, output=folder / "study")


def run(*words):
    return CliRunner().invoke(command, [str(word) for word in words])


def test_writes_what_the_function_returns(llvm_mono, study, tmp_path):
    folder, result = study
    words = ("--noise", "1%", "--copies", 2, "--split", "0.5,0.25,0.25", "--seed", 3)
    done = run(folder, "-o", tmp_path / "set", *words)
    assert done.exit_code == 0, done.output
    assert done.stdout.splitlines() == ["Rows: train 12, validation 6, test 6", f"Results: {tmp_path / 'set'}"]
    expected = training_set(result, noise="1%", copies=2, split=(0.5, 0.25, 0.25), seed=3)
    for name, table in expected.items():
        read = pd.read_csv(tmp_path / "set" / f"{name}.csv")
        assert list(read) == ["fx_mm", "fy_mm", "fz_mm", "power_1_W", "standard_error_1_W"] == list(table)
        np.testing.assert_allclose(read, table, rtol=1e-12)
        assert set(read.fy_mm) == {0.1}
    assert "plate.xml" in (tmp_path / "set" / "README.md").read_text(encoding="utf-8")


def test_json_is_one_object(llvm_mono, study, tmp_path):
    done = run(study[0], "-o", tmp_path / "set", "--json")
    rows = {"train": 8, "validation": 2, "test": 2}
    assert json.loads(done.stdout) == {"output": str(tmp_path / "set"), "rows": rows}


def test_parquet_comes_beside_csv(llvm_mono, study, tmp_path):
    pytest.importorskip("pyarrow")
    assert run(study[0], "-o", tmp_path / "set", "--parquet").exit_code == 0
    assert len(list((tmp_path / "set").glob("*.parquet"))) == len(list((tmp_path / "set").glob("*.csv"))) == 3


@pytest.mark.parametrize(
    ("words", "culprit"),
    [
        (("--split", "0.7,some,0.1"), "'0.7,some,0.1'"),
        (("--split", "0.7,0.3"), "split"),
        (("--noise", "loud"), "'loud'"),
        (("--copies", 2), "copies = 2"),
        (("--copies", 0), "--copies"),
        (("--seed", -1), "--seed"),
    ],
)
def test_refuses_and_writes_nothing(llvm_mono, study, tmp_path, words, culprit):
    done = run(study[0], "-o", tmp_path / "set", *words)
    assert isinstance(done.exception, InputError) or done.exit_code == 2
    assert culprit in str(done.exception) + done.stderr
    assert not (tmp_path / "set").exists()


def test_a_folder_without_a_study_is_refused(tmp_path):
    done = run(tmp_path, "-o", tmp_path / "set")
    assert isinstance(done.exception, InputError) and str(tmp_path) in str(done.exception)
