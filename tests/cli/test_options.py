"""`--circuit` of `taxel render`, `sweep` and `characterise`, and `[circuit]` of study files."""

from __future__ import annotations

import json

import pytest
from plate_scenes import PLATE_FILE

from mitsuba_taxel import open_study, write_template


@pytest.fixture(autouse=True)
def files(tmp_path):
    (tmp_path / "plate.xml").write_text(PLATE_FILE)
    write_template("circuit", tmp_path / "circuit.toml")
    circuit = (tmp_path / "circuit.toml").read_text()
    study = f'scene = "plate.xml"\npoints = 64\n{circuit}\n[vary]\nfz = "0.6:1:0.1"\n'
    (tmp_path / "study.toml").write_text(study)
    (tmp_path / "dead.toml").write_text("load_resistance = 1e3\ntransfer = 1\n")


def test_render(taxel):
    told = taxel("render", "plate.xml", "--points", 64, "--circuit", "circuit.toml")
    assert told.returncode == 0 and "voltage [V]" in told.stdout and "One count: 0.0008057 V" in told.stdout
    answer = json.loads(taxel("render", "plate.xml", "--points", 64, "--circuit", "circuit.toml", "--json").stdout)
    (reading,) = answer["readings"]
    assert reading["voltage_V"] == pytest.approx(22e3 * (8e-3 * reading["power_W"] + 1e-9), rel=1e-3)
    assert reading["counts"] == int(reading["voltage_V"] * 4096 / 3.3) and answer["volts_per_count"] == 3.3 / 4096


def test_render_with_derivatives(taxel):
    """Volts and counts are those of a resistor; the changes that equal the noise and lead to saturation follow."""
    words = ("render", "plate.xml", "--points", 64, "--circuit", "circuit.toml", "--derivatives", "fz", "--json")
    answer = json.loads(taxel(*words).stdout)
    (reading,), (watts,), (volts,) = (answer[name] for name in ("readings", "derivatives", "derivatives_in_volts"))
    assert volts["value"] == pytest.approx(22e3 * 8e-3 * watts["value"], rel=1e-3)
    assert volts["counts"] == pytest.approx(volts["value"] * 4096 / 3.3)
    assert volts["noise_equivalent"] == pytest.approx(reading["noise_V"] / abs(volts["value"]))
    limit = 2 * 3.2 / 22e3
    assert volts["to_saturation"] == pytest.approx(
        (limit - 8e-3 * reading["power_W"]) / 8e-3 / watts["value"], rel=1e-3
    )


def test_a_study_file_and_another_circuit(taxel, tmp_path):
    told = taxel("sweep", "study.toml", "-o", "out")
    assert told.returncode == 0 and "Output of the circuit, fz:" in told.stdout, told.stderr
    study = open_study(tmp_path / "out")
    assert (tmp_path / "out" / "voltage.png").is_file()
    assert study.voltage.dims == ("fz", "taxel") and study.attrs["circuit"]
    lines = (tmp_path / "out" / "readings.csv").read_text().splitlines()
    head = next(line for line in lines if not line.startswith("#"))
    assert {"voltage_V", "voltage_error_V", "counts", "noise_V"} <= set(head.split(","))
    again = taxel("sweep", tmp_path / "out" / "study.toml", "-o", "again", "--json")
    assert again.returncode == 0 and json.loads(again.stdout)["sensitivity"][0]["rest_V"] > 0

    own = json.loads(taxel("characterise", "out", "--json").stdout)
    assert {row["reading"] for row in own["characteristics"]} == {"W", "V"} and own["volts"][0]["saturation_N"] is None
    (tmp_path / "other.toml").write_text("supply = 3.3\nload_resistance = 220e3\ntransfer = 8e-3\n")
    other = taxel("characterise", "out", "--circuit", "other.toml", "-o", "other")
    assert other.returncode == 0 and "Sensitivities of readings in V, fz:" in other.stdout
    assert "Output of the circuit, fz:" in other.stdout and (tmp_path / "other" / "volts.csv").is_file()


@pytest.mark.parametrize(
    ("words", "culprit"),
    [
        (("render", "plate.xml", "--circuit", "none.toml"), "none.toml"),
        (("render", "plate.xml", "--circuit", "dead.toml"), "supply is missing"),
        (("render", "plate.xml", "--circuit", "plate.xml"), "is not valid TOML"),
        (("sweep", "study.toml", "-o", "x", "--circuit", "circuit.toml"), "circuit is not allowed"),
        (("bench", "cells", "--sides", "3,x"), "sides = '3,x' is not allowed"),
        (("sweep", "broken.toml", "-o", "x"), "a table [circuit] of numbers is needed"),
    ],
)
def test_bad_input_is_one_line(taxel, tmp_path, words, culprit):
    (tmp_path / "broken.toml").write_text('scene = "plate.xml"\ncircuit = 5\n[vary]\nfz = [1, 2]\n')
    done = taxel(*words)
    (line,) = done.stderr.splitlines()
    assert done.returncode == 2 and done.stdout == "" and culprit in line


def test_a_variant_is_used_or_refused_in_one_line(taxel_process):
    """By whether this machine has a graphics card."""
    done = taxel_process("--variant", "cuda_ad_mono", "render", "plate.xml", "--points", "64")
    if done.returncode == 0:
        assert "Random paths are followed on the graphics card" in done.stdout
    else:
        assert done.returncode == 1 and done.stderr.count("\n") == 1
        assert done.stderr.startswith("taxel: the variant cuda_ad_mono needs an NVIDIA card and its driver")


def test_a_variant_stands_before_the_command_and_is_a_supported_one(taxel):
    done = taxel("render", "plate.xml", "--variant", "cuda_ad_mono")
    assert done.returncode == 2 and "taxel --variant NAME render ..." in done.stderr
    done = taxel("--variant", "scalar_rgb", "doctor")
    assert done.returncode == 2 and "'scalar_rgb' is not one of 'llvm_ad_mono'" in done.stderr
