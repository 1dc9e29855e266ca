"""Measured tables: what is read, and what is refused in one line that names file, line and column."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel import InputError
from mitsuba_taxel.characterise import read_measurement

ROWS = [f"{0.1 * row:.1f},{row % 7},{1 + 0.1 * row:.3f},{2 - 0.1 * row:.3f}" for row in range(20)]


def write(tmp_path, head, rows=ROWS):
    file = tmp_path / "bench.csv"
    file.write_text("\n".join(["# pad 3", head, *rows]) + "\n", encoding="utf-8")
    return file


@pytest.mark.parametrize(
    "head, name, factors",
    [
        ("time_s,force_N,v1_V,v2_V", "force", (1, 1, 1)),
        ("Time [s], FZ [N], Voltage1 [V], Voltage2 [V]", "fz", (1, 1, 1)),
        ("t (ms),f (mN),V_1 (mV),V_2 (mV)", "force", (1e-3, 1e-3, 1e-3)),
        ("\ufefftime_s,fx_N,v1_mV,v2_mV", "fx", (1, 1, 1e-3)),
    ],
)
def test_headings_and_units(tmp_path, head, name, factors):
    file = tmp_path / "bench.csv"
    file.write_text(
        "\n".join([head, "", *ROWS[:5], "# a pause", *ROWS[5:-1], ROWS[-1] + " # the last"]), encoding="utf-8"
    )
    read = read_measurement(file)
    assert read.force_names == (name,) and list(read.taxel) == [1, 2]
    np.testing.assert_allclose(read.time, 0.1 * np.arange(20) * factors[0])
    np.testing.assert_allclose(read.force[:, 0], np.arange(20) % 7 * factors[1])
    np.testing.assert_allclose(read.voltage[:, 1], (2 - 0.1 * np.arange(20)) * factors[2])


def test_columns_in_any_order_and_three_forces(tmp_path):
    rows = [f"{row},{-row},{10 * row},{2 * row},{row / 10}" for row in range(10)]
    read = read_measurement(write(tmp_path, "fy_N,v12_V,fz_N,fx_N,time_s", rows))
    assert read.force_names == ("fx", "fy", "fz") and list(read.taxel) == [12]
    np.testing.assert_allclose(read.force[3], [6, 3, 30])
    np.testing.assert_allclose(read.voltage[3], -3)


def test_a_table_of_weights_has_no_time(tmp_path):
    """As `fit` reads it: semicolons, decimal commas, millivolts, rows in the order of the record."""
    file = tmp_path / "weights.csv"
    file.write_text("fz_N;v1_mV\n" + "\n".join(f"-0,{row};{100 - row},00" for row in range(10)) + "\n")
    read = read_measurement(file)
    assert read.time is None and read.force_names == ("fz",)
    np.testing.assert_allclose(read.force[:, 0], -0.1 * np.arange(10))
    np.testing.assert_allclose(read.voltage[:, 0], 0.1 - 1e-3 * np.arange(10))


GOOD = "time_s,force_N,v1_V,v2_V"
BAD = {
    "no headings": ((ROWS[0], ROWS), "has no headings: a first line such as time_s,force_N,v1_V,v2_V is needed"),
    "unknown heading": (("time_s,force_N,v1_V,colour", ROWS), "'colour'"),
    "no unit": (("time_s,force_N,v1_V,v2", ROWS), "'v2'"),
    "wrong unit": (("time_s,force_V,v1_V,v2_V", ROWS), "'force_V'"),
    "column twice": (("time_s,force_N,v1_V,v1_mV", ROWS), "once"),
    "two kinds of force": (("fx_N,force_N,v1_V,v2_V", ROWS), "force_N (or fx_N, fy_N, fz_N) and v1_V, ... are"),
    "two of three forces": (("time_s,fx_N,fy_N,v1_V", ROWS), "fx_N, fy_N, fz_N"),
    "no voltage": (("time_s,fx_N,fy_N,fz_N", ROWS), "v1_V"),
    "few rows": ((GOOD, ROWS[:9]), "9 rows"),
    "no rows": ((GOOD, []), "0 rows"),
    "a word": ((GOOD, [*ROWS[:4], "0.4,4,high,1", *ROWS[5:]]), "line 7, column v1_V: 'high'"),
    "not a number": ((GOOD, [*ROWS[:4], "0.4,nan,1,1", *ROWS[5:]]), "line 7, column force_N: 'nan'"),
    "infinite": ((GOOD, [*ROWS[:4], "0.4,4,1,inf", *ROWS[5:]]), "line 7, column v2_V: 'inf'"),
    "a blank": ((GOOD, [*ROWS[:4], "0.4,,1,1", *ROWS[5:]]), "line 7, column force_N: ''"),
    "a value too few": ((GOOD, [*ROWS[:4], "0.4,4,1", *ROWS[5:]]), "line 7: 3 values"),
    "time stands still": ((GOOD, [*ROWS[:4], "0.3,4,1,1", *ROWS[5:]]), "line 7: time_s must be greater"),
    "time goes back": ((GOOD, [*ROWS[:4], "0.2,4,1,1", *ROWS[5:]]), "line 7: time_s must be greater"),
}


@pytest.mark.parametrize("table, culprit", BAD.values(), ids=BAD.keys())
def test_what_is_no_measurement_is_refused(tmp_path, table, culprit):
    with pytest.raises(InputError) as refused:
        read_measurement(write(tmp_path, *table))
    assert culprit in str(refused.value) and "bench.csv" in str(refused.value) and "\n" not in str(refused.value)


def test_what_is_no_text_is_refused(tmp_path):
    (tmp_path / "picture.csv").write_bytes(bytes(range(256)))
    (tmp_path / "empty.csv").write_text("# nothing\n")
    for name in ("picture.csv", "empty.csv", "nowhere.csv", "."):
        with pytest.raises(InputError, match="measurement"):
            read_measurement(tmp_path / name)
