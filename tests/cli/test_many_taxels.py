"""Results of more than 64 taxels are summarised in a terminal: ends, means and a map, and where the rows are."""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray as xr
from taxel_cli import many_taxels, tables
from taxel_cli.readings import render, sweep

from mitsuba_taxel.base.convergence import ERROR_SHARE
from mitsuba_taxel.electronics import Circuit, shown
from mitsuba_taxel.sensing import find_scene
from mitsuba_taxel.sensing.reading.derivative_values import Derivatives
from mitsuba_taxel.sensing.reading.readings import Readings

COLUMN, ROW = (index.ravel() for index in np.meshgrid(np.arange(10), np.arange(10)))
GRID = np.stack([2.5 * COLUMN, -2.5 * ROW], axis=1) - 7
"""Positions of 10 x 10 taxels, row by row from (-x, +y)."""


def readings_of(power: np.ndarray, **more) -> Readings:
    """Readings whose replicates scatter by 1 % to both sides."""
    return Readings(np.stack([0.99 * power, 1.01 * power]), 64, 7, seconds={"optics": 0.1}, **more)


def shown_lines(capsys) -> list[str]:
    return capsys.readouterr().out.splitlines()


@pytest.mark.quick
def test_a_grid_is_summarised_and_mapped(capsys):
    power = 1e-3 * (1 + COLUMN / 9)
    power[3], power[98] = 0.5e-3, 4e-3
    render.print_summary(readings_of(power, deviation=0.01 * power), GRID)
    lines = shown_lines(capsys)
    assert len(lines) < 30 and lines[0].startswith("Power on 100 phototransistors: 5.000e-04 to 4.000e-03 W, each ±")
    (row,) = [line.split() for line in lines if line.startswith("power [W]")]
    assert row == ["power", "[W]", "0.0005", "(4)", f"{power.mean():.4g}", "0.004", "(99)"]
    (worst,) = [line.split() for line in lines if line.startswith("total error [W]")]
    errors = power * np.hypot(0.01, 0.01 * ERROR_SHARE)
    assert worst[3:] == [f"{errors[3]:.4g}", "(4)", f"{errors.mean():.4g}", f"{errors[98]:.4g}", "(99)"]
    assert "A row for each of the 100 taxels: the same command with --json." in lines
    assert any(line.startswith("Light error: 1 sigma") for line in lines)


@pytest.mark.quick
def test_a_map_has_x_to_the_right_and_y_upwards():
    legend, *rows = many_taxels.map_lines(COLUMN / 9 + 1, GRID, "W")
    assert rows == ["0 1 2 3 4 5 6 7 8 9"] * 10
    assert legend == "Map from 0 = 1 W to 9 = 2 W, x to the right, y upwards:"
    _, *rows = many_taxels.map_lines(-ROW / 9, GRID, "W")
    assert rows == [" ".join(digit * 10) for digit in "9876543210"]


@pytest.mark.parametrize("stretch", [1.0, 3.0])
def test_irregular_taxels_have_digits_at_their_positions(stretch):
    """Of 65 points of a sunflower each has a digit; digits of x grow to the right, digits of y upwards."""
    number = np.arange(65) + 0.5
    angle = np.pi * (3 - np.sqrt(5)) * number
    x, y = stretch * np.sqrt(number) * np.cos(angle), np.sqrt(number) * np.sin(angle)
    by_x, by_y = (many_taxels.map_lines(values, np.stack([x, y], axis=1), "W")[1:] for values in (x, y))
    assert len(by_x) <= many_taxels.MOST_ACROSS and max(map(len, by_x)) < 2 * many_taxels.MOST_ACROSS
    assert len("".join("".join(by_x).split())) == 65
    assert all(row.split() == sorted(row.split()) for row in by_x)
    highest = [max(row.split()) for row in by_y if row]
    assert highest == sorted(highest, reverse=True) and (highest[0], highest[-1]) == ("9", "0")


def test_more_taxels_than_digits_are_averaged():
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(106.0), np.arange(51.0)))
    legend, *rows = many_taxels.map_lines(np.where(x < 52, 1.0, 3.0), np.stack([x, y], axis=1), "W")
    assert legend.endswith("a digit is the mean of up to 9 taxels:")
    assert rows == [" ".join("0" * 17 + "3" + "9" * 18)] * 18


def test_unknown_errors_are_named_and_dark_taxels_counted(capsys):
    power = np.linspace(0, 1e-3, 65)
    positions = np.stack([np.arange(65.0), np.zeros(65)], axis=1)
    render.print_summary(readings_of(power, deviation=np.full(65, np.nan)), positions)
    lines = shown_lines(capsys)
    assert lines[0].endswith("the error is unknown.") and "Taxels without light: 1 of 65" in lines
    (row,) = [line for line in lines if line.startswith("mechanics error [W]")]
    assert row.split()[-3:] == ["unknown"] * 3


def test_some_unknown_values_are_counted():
    ((name, least, mean, most),) = many_taxels.summary_rows([1, 2, 3], {"a [W]": np.array([3.0, np.nan, 1.0])})
    assert (name, least, mean, most) == ("a [W], 1 unknown", "1 (3)", "2", "3 (1)")


@pytest.mark.quick
def test_derivatives_are_summarised_in_watts_volts_and_counts(capsys):
    power, slopes = 1e-6 * (2 + COLUMN), np.stack([-1e-8 * (1 + ROW), np.full(100, 2e-8)], axis=1)
    derivatives = Derivatives(
        ("fz", "x"), ("W/N", "W"), slopes, 0.1 * abs(slopes), power, 0 * power, 0.1, np.ones(2), 0.5, np.ones(2)
    )
    readings = readings_of(power, derivatives=derivatives)
    render.print_summary(readings, GRID)
    volts = shown(Circuit(supply=3.3, load_resistance=22e3, transfer=8), readings)
    tables.print_volts(readings.taxel, volts)
    lines = [" ".join(line.split()) for line in shown_lines(capsys)]
    assert "fz [W/N] -1e-07 (91) -5.5e-08 -1e-08 (1)" in lines
    assert "x, standard error [W] 2e-09 (1) 2e-09 2e-09 (1)" in lines
    counts = volts.derivatives.counts[:, 0]
    least, most = (f"{counts[index]:.4g} ({index + 1})" for index in (counts.argmin(), counts.argmax()))
    assert f"fz [counts/N] {least} {counts.mean():.4g} {most}" in lines
    assert [line for line in lines if line.startswith("fz [V/N]")] and "Saturated: 0 of 100 taxels" in lines


@pytest.mark.parametrize("count", [100, 64])
def test_slopes_and_volts_of_a_sweep_are_summarised_beyond_64_taxels(capsys, tmp_path, count):
    """Power falls from 1 mW by 10 to 19 % over 10 N, by the column."""
    force = np.array([0.0, -10.0])
    power = (1e-3 * (1 - np.abs(force)[:, None] / 10 * (0.1 + 0.01 * COLUMN)))[:, :count]
    circuit = Circuit(supply=3.3, load_resistance=100, transfer=8)
    study = xr.Dataset(
        {
            "replicate_power": (("fz", "replicate", "taxel"), np.repeat(power[:, None], 4, axis=1), {"units": "W"}),
            "power": (("fz", "taxel"), power),
        },
        {"fz": force, "taxel": np.arange(1, count + 1)},
        {"curve": "fz", "notes": "", "circuit": json.dumps(circuit.as_table())},
    )
    sweep.print_slopes(study, tmp_path)
    lines = [" ".join(line.split()) for line in shown_lines(capsys)]
    if count == 64:
        assert len([line for line in lines if line.startswith("64 ")]) == 2
        return
    assert "mean slope, fz [W/N] 1e-05 (1) 1.45e-05 1.9e-05 (10)" in lines
    (rest,) = [line for line in lines if line.startswith("rest, fz [V]")]
    assert "saturation, fz [N] not reached not reached not reached" in lines
    assert rest == "rest, fz [V] 0.8 (1) 0.8 0.8 (1)"
    assert lines[-1] == f"A row for each of the 100 taxels: summary.csv and readings.csv in {tmp_path}."
    assert len(lines) < 40


def test_readings_of_a_sweep_are_summarised_with_a_map_of_their_changes(capsys, tmp_path):
    """The worst error is that of any scene; scenes without a reading are left out, unknown errors are named."""
    power = np.stack([np.full(100, 1e-3), 1e-3 * (1.1 + 0.1 * COLUMN), np.full(100, np.nan)])
    error = power * np.array([0.02, 0.01, np.nan])[:, None]
    error[1, 98] = 0.3 * power[1, 98]
    made = {"power": (("fz", "taxel"), power), "total_error": (("fz", "taxel"), error)}
    places = {"taxel_x": ("taxel", GRID[:, 0]), "taxel_y": ("taxel", GRID[:, 1])}
    study = xr.Dataset({**made, **places}, {"fz": [0.0, -1.0, -2.0], "taxel": np.arange(1, 101)})
    sweep.print_readings(study, tmp_path)
    lines = [" ".join(line.split()) for line in shown_lines(capsys)]
    assert "change of the power [W] 0.0001 (1) 0.00055 0.001 (10)" in lines
    assert "worst total error [%] 2 (1) 2.28 30 (99)" in lines
    first = next(number for number, line in enumerate(lines) if line.startswith("Map from 0 = 0.0001 W"))
    assert lines[first + 1 :] == ["0 1 2 3 4 5 6 7 8 9"] * 10
    study.total_error[1, 7] = np.nan
    sweep.print_readings(study.drop_vars("taxel_x"), tmp_path)
    lines = shown_lines(capsys)
    assert any(line.startswith("worst total error [%], 1 unknown") for line in lines)
    assert not any(line.startswith("Map") for line in lines)


def test_the_program_prints_summaries_with_a_map_of_the_board(taxel, tmp_path):
    """A plate above a part of 5 x 13 taxels: dark ones are 0 in the map, where JSON lists them row by row."""
    array = "".join(f'<integer name="{name}" value="{count}"/>' for name, count in (("rows", 5), ("columns", 13)))
    part = '<shape type="photo_reflector">'
    scene = find_scene("plate.xml").read_text()
    scene = scene.replace(part, f'{part}{array}<float name="pitch" value="4"/>')
    (tmp_path / "board.xml").write_text(scene)
    (tmp_path / "circuit.toml").write_text("supply = 3.3\nload_resistance = 22e3\ntransfer = 8\n")
    command = ["render", "board.xml", "-D", "width=30", "-D", "depth=9", "-D", "offset_x=15", "-D", "offset_y=6"]
    command += ["--points", 64, "--circuit", "circuit.toml"]
    power = np.array([row["power_W"] for row in json.loads(taxel(*command, "--json").stdout)["readings"]])
    done = taxel(*command, "--crosstalk")
    assert done.returncode == 0 and done.stderr == ""
    lines = done.stdout.splitlines()
    first = next(number for number, line in enumerate(lines) if line.startswith("Map from 0 = 0 W"))
    digits = np.array([line.split() for line in lines[first + 1 : first + 6]], dtype=int)
    assert digits.shape == (5, 13) and 0 < (power == 0).sum() < 60
    np.testing.assert_array_equal(digits.ravel()[power == 0], 0)
    np.testing.assert_array_equal(digits.ravel(), np.clip(10 * power / power.max(), 0, 9).astype(int))
    assert f"Taxels without light: {(power == 0).sum()} of 65" in lines
    for heading in ("voltage [V]", "counts", "own LED [W]", "all other LEDs [W]"):
        assert [line for line in lines if line.startswith(heading)], heading
    assert len(lines) < 50
