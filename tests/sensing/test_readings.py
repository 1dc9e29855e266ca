"""Readings, crosstalk, derivatives and audits as text: what the command line prints."""

from __future__ import annotations

import re

import pytest
from taxel_program import run_program

from mitsuba_taxel import Scene, crosstalk, energy_audit, measure

pytestmark = pytest.mark.quick

PLATE = ("plate.xml", "-D", "z=1.1")


def without_times(text: str) -> str:
    return re.sub(r"(?m)^Seconds: .*$", "Seconds", text.strip())


def test_printed_readings_are_the_table_of_the_command_line(llvm_mono, tmp_path):
    """With the derivatives, which follow it there."""
    readings = measure(Scene.from_file("plate.xml", z=1.1), points=64, derivatives=["z"])
    printed = run_program(tmp_path, "render", *PLATE, "--points", 64, "--derivatives", "z").stdout
    assert without_times(str(readings)) == without_times(printed)
    assert str(readings).splitlines()[0].split()[:3] == ["taxel", "power", "[W]"]
    assert f"{readings.power[0]:.6e}" in str(readings) and "z [W/mm]" in str(readings)


def test_printed_crosstalk_and_audits_are_the_tables_of_the_command_line(llvm_mono, tmp_path):
    scene = Scene.from_file("plate.xml", z=1.1)
    printed = run_program(tmp_path, "render", *PLATE, "--points", 64, "--crosstalk", "--audit").stdout
    for answer in (crosstalk(scene, points=64), energy_audit(scene, points=64)):
        assert str(answer) in printed
