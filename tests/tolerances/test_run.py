"""Tolerance studies whose answer is known: the power of an LED goes into readings and slopes as a factor."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pandas
import pytest
from one_cell import one_cell

from mitsuba_taxel import ComputationError, InputError, open_study
from mitsuba_taxel.electronics import total_noise
from mitsuba_taxel.electronics.circuit import circuit_of
from mitsuba_taxel.studies.run import job
from mitsuba_taxel.tolerances import run_tolerance

CELL = one_cell(scattering="isotropic", fz=0, youngs_modulus=4, led_power=1)
STUDY = """
scene = "cell.xml"
points = 64
{circuit}
[vary]
fz = [0, -2]
[tolerance]
samples = 8
[tolerance.of]
led_power = {{ law = "normal", mean = 1, sd = 0.1 }}
youngs_modulus = {{ law = "uniform", low = 3.8, high = 4.2 }}
"""
PLATE = """
scene = "plate.xml"
points = 64
define = { scattering = "lambertian" }
[tolerance]
samples = 16
[tolerance.of]
z = { law = "normal", mean = 0.7, sd = 0.01 }
"""
TABLE = {"supply": 3.3, "load_resistance": 1e4, "transfer": 5e-3, "saturation_voltage": 0}
CIRCUIT = f"circuit = {{ {', '.join(f'{name} = {value}' for name, value in TABLE.items())} }}"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A tolerance study of a cell that was run."""
    folder = tmp_path_factory.mktemp("tolerance")
    (folder / "cell.xml").write_text(CELL)
    (folder / "study.toml").write_text(STUDY.format(circuit=CIRCUIT))
    run_tolerance(folder / "study.toml", folder / "out")
    return folder


@pytest.fixture(scope="module")
def result(folder):
    """What it gave, from the jobs on disk."""
    before = {file: file.stat().st_mtime_ns for file in folder.rglob("*.npz")}
    result = run_tolerance(folder / "study.toml", folder / "out")
    assert {file: file.stat().st_mtime_ns for file in folder.rglob("*.npz")} == before and len(before) == 18
    return result


def test_a_factor_is_linear(result):
    rest = result.spread.set_index("figure").loc["rest"]
    z = (result.samples.led_power - 1) / 0.1
    assert rest.linear_sd / rest.nominal == pytest.approx(0.1, rel=2e-3)
    assert rest.sd / rest.nominal == pytest.approx(0.1 * z.std(), rel=1e-3) and rest.linear_error < 5e-3
    np.testing.assert_allclose(result.samples.rest_1 / rest.nominal, 1 + 0.1 * z, rtol=1e-4)
    assert rest.unit == "V" and rest.low < rest.nominal < rest.high and rest.sd_error < rest.sd


def test_the_sensitivity_goes_with_power_and_compliance(result):
    """Of small loads S = c P / E: variances 0.1 squared, and (0.4 / 4) squared / 12."""
    rows = result.shares.set_index(["figure", "parameter"])
    share = 0.01 / (0.01 + 0.01 / 12)
    assert rows.loc[("sensitivity", "led_power"), "linear"] == pytest.approx(share, abs=0.02)
    assert rows.loc[("sensitivity", "led_power"), "total"] == pytest.approx(share, abs=0.05)
    assert rows.loc[("rest", "youngs_modulus"), "total"] < 1e-3
    assert list(rows.unit)[:2] == ["V per W", "V per MPa"]
    by_parameter = result.parameters.set_index("parameter")
    assert by_parameter.total_rest["led_power"] > 0.99 > by_parameter.total_sensitivity["led_power"] > 0.8


def test_noise_as_a_force_is_that_of_the_circuit(folder, result):
    rows = result.spread.set_index("figure")
    at_rest = open_study(folder / "out")["nominal"].to_dataset().smooth_power.sel(fz=0).item()
    expected = total_noise(circuit_of(TABLE), at_rest) / abs(rows.nominal["sensitivity"])
    assert rows.unit["noise_force"] == "N" and rows.nominal["noise_force"] == pytest.approx(expected, rel=1e-6)
    assert result.notes[-4:-2] == [
        f"one count: {3.3 / 2**12:.4g} V",
        "the output reaches the circuit's limit between 0 and -2 N in none of 8 samples",
    ]
    assert result.notes[-2].startswith("The noise before the converter is less than half of its step of 0.0008057 V")
    total = result.parameters.set_index("parameter").total_noise_force
    assert total["led_power"] > 0.8  # a count's noise does not depend on the light


def test_what_is_on_disk(folder, result):
    made = {file.name for file in (folder / "out").iterdir()}
    tables = {f"{name}.csv" for name in ("spread", "shares", "parameters", "samples")}
    assert tables | {"notes.txt", "tolerance.png", "tolerance.svg", "study.toml", "nominal", "samples"} == made
    tree = open_study(folder / "out")
    assert tree["samples"].sizes["step"] == 8 and not (folder / "out" / "samples" / "meshes").exists()
    assert json.loads(tree["nominal"].attrs["circuit"])["transfer"] == 5e-3


def test_a_plate_has_no_linear_answer_but_spreads(tmp_path):
    laws = 'z = { law = "normal", mean = 0.7, sd = 0.01 }\n'
    head = 'scene = "plate.xml"\npoints = 64\ndefine = { scattering = "lambertian" }\n'
    (tmp_path / "study.toml").write_text(f"{head}[tolerance]\nsamples = 8\n[tolerance.of]\n{laws}")
    result = run_tolerance(tmp_path / "study.toml", tmp_path / "out")
    assert result.notes[0].startswith("no linear estimate for z: the scene has no pad")
    (row,) = result.spread.itertuples()
    assert row.figure == "rest" and row.sd > 0 and np.isnan(row.linear_sd) and row.explained > 0.95


@pytest.fixture
def run(tmp_path, monkeypatch):
    """A tolerance study of a plate with some number of exact samples, and the places of the plate then computed."""
    calls, really = [], job.measure
    (tmp_path / "study.toml").write_text(PLATE)

    def run(output, exact=None, most=None):
        def measure(ready, **how):
            if len(calls) == most:
                raise KeyboardInterrupt
            calls.append(ready.parameters["z"])
            return really(ready, **how)

        del calls[:]
        monkeypatch.setattr(job, "measure", measure)
        try:
            return run_tolerance(tmp_path / "study.toml", tmp_path / output, exact=exact), list(calls)
        except KeyboardInterrupt:
            return None, list(calls)

    return run


def assert_same(one, other):
    for name in ("spread", "shares", "parameters", "samples"):
        pandas.testing.assert_frame_equal(getattr(one, name), getattr(other, name), check_exact=True)
    assert one.notes == other.notes


def test_few_exact_samples_are_resumed_and_raised(run):
    """Nothing is computed twice, and what was computed before makes no difference, to the bit. With all samples exact,
    it is a study without that number."""
    whole, (nominal, *places) = run("whole")
    assert len(places) == 16 and "exact" not in whole.samples and "mean_error" in whole.spread
    assert run("out", exact=8, most=5) == (None, [nominal, *places[:4]])
    few, computed = run("out", exact=8)
    assert computed == places[4:8] and few.samples.exact.sum() == 8 and len(few.samples) == 16
    raised, computed = run("out", exact=12)
    assert computed == places[8:12]
    fresh, computed = run("fresh", exact=12)
    assert computed == [nominal, *places[:12]]
    assert_same(raised, fresh)
    lowered, computed = run("out", exact=8)
    assert not computed
    assert_same(lowered, few)
    completed, computed = run("out", exact=16)
    assert computed == places[12:]
    assert_same(completed, whole)


def test_what_fails(folder):
    """Samples are left out, up to a number; the mean sensor must not fail."""
    shutil.copytree(folder / "out", folder / "lame")

    def fail(scene, number):
        jobs = folder / "lame" / scene
        (jobs / "jobs" / f"{number:06d}.npz").unlink()
        (jobs / "failed" / f"{number:06d}.json").write_text(json.dumps({"message": "no.", "bad_input": False}))

    fail("samples", 9)
    with pytest.raises(ComputationError, match="only 7 of 8 samples"):
        run_tolerance(folder / "study.toml", folder / "lame")
    fail("nominal", 1)
    with pytest.raises(ComputationError, match="at their mean cannot be read: fz=-2"):
        run_tolerance(folder / "study.toml", folder / "lame")


def test_another_study_is_refused(folder):
    other = (folder / "study.toml").read_text().replace("sd = 0.1", "sd = 0.2")
    (folder / "other.toml").write_text(other)
    with pytest.raises(InputError, match="holds another study"):
        run_tolerance(folder / "other.toml", folder / "out")
