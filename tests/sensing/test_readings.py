"""Readings, crosstalk, derivatives and audits as text: what the command line prints."""

from __future__ import annotations

import re
from types import SimpleNamespace

import numpy as np
import pytest
from taxel_program import run_program

from mitsuba_taxel import Scene, crosstalk, energy_audit, measure
from mitsuba_taxel.sensing.reading.readings import readings_answer

pytestmark = pytest.mark.quick

PLATE = ("plate.xml", "-D", "z=1.1")


def without_times(text: str) -> str:
    return re.sub(r"(?m)^Seconds: .*$", "Seconds", text.strip())


def test_printed_readings_are_the_table_of_the_command_line(llvm_mono, tmp_path):
    """With the derivatives, which follow it there."""
    readings = measure(Scene.from_file("plate.xml", z=1.1), points=64, derivatives=["z"])
    printed = run_program(tmp_path, "render", *PLATE, "--points", 64, "--derivatives", "z").stdout
    assert without_times(str(readings)) == without_times(printed)
    answer, table = str(readings).split("\n\n")[:2]
    value, error = re.fullmatch(r"Power on the phototransistor: (\S+) ± (\S+) W \(\d\.\d\d%\)\.", answer).groups()
    assert float(value) == pytest.approx(readings.power[0], rel=1e-4)
    assert float(error) == pytest.approx(readings.total_error[0], rel=0.05)
    assert table.split()[:3] == ["taxel", "power", "[W]"]
    assert f"{readings.power[0]:.6e}" in str(readings) and "z [W/mm]" in str(readings)


def test_printed_crosstalk_and_audits_are_the_tables_of_the_command_line(llvm_mono, tmp_path):
    scene = Scene.from_file("plate.xml", z=1.1)
    printed = run_program(tmp_path, "render", *PLATE, "--points", 64, "--crosstalk", "--audit").stdout
    for answer in (crosstalk(scene, points=64), energy_audit(scene, points=64)):
        assert str(answer) in printed


def test_the_answer_of_several_taxels_holds_the_worst_error():
    power, error = np.array([2e-3, 1e-3, 4e-3]), np.array([1e-5, 2e-5, 1e-5])
    several = SimpleNamespace(power=power, total_error=error)
    assert readings_answer(several) == "Power on 3 phototransistors: 1.000e-03 to 4.000e-03 W, each ± 2.00% or less."
    dark = SimpleNamespace(power=power * [1, 0, 1], total_error=error)
    assert readings_answer(dark) == "Power on 3 phototransistors: 0.000e+00 to 4.000e-03 W, each ± 2.0e-05 W or less."
    one = SimpleNamespace(power=np.zeros(1), total_error=np.array([1e-9]))
    assert readings_answer(one) == "Power on the phototransistor: 0.0000e+00 ± 1.0e-09 W."
    for number in (1, 3):
        unknown = SimpleNamespace(power=power[:number], total_error=np.full(number, np.nan))
        assert readings_answer(unknown).endswith(" W; the error is unknown.")
