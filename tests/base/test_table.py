"""Tables as machines, Arduinos and spreadsheets write them: the same numbers, or a refusal that says what was found."""

from __future__ import annotations

import math
import warnings

import numpy as np
import pytest

from mitsuba_taxel import InputError
from mitsuba_taxel.base.files.table import as_parameter, read_table
from mitsuba_taxel.characterise import read_measurement
from mitsuba_taxel.fitting.data import read_data
from mitsuba_taxel.studies import read_steps

pytestmark = pytest.mark.quick

TIME = np.arange(12) * 0.1
FORCE = -0.02 * np.arange(12)
VOLTAGE = 0.8 + 0.001 * np.arange(12) ** 1.5


def written(tmp_path, head, separator=",", mark=".", scales=(1.0, 1.0, 1.0)):
    columns = zip(TIME * scales[0], FORCE * scales[1], VOLTAGE * scales[2], strict=True)
    rows = [separator.join(f"{value:.6f}".replace(".", mark) for value in row) for row in columns]
    (tmp_path / "table.csv").write_text("\n".join([*head, *rows]) + "\n", encoding="utf-8")
    return tmp_path / "table.csv"


DIALECTS = {
    "commas": (["time_s,fz_N,v1_V"], ","),
    "semicolons": (["time_s;fz_N;v1_V"], ";"),
    "tabs": (["time_s\tfz_N\tv1_V"], "\t"),
    "blanks": (["time_s fz_N v1_V"], " "),
    "bars": (["time_s|fz_N|v1_V"], "|"),
    "wide blanks": (["  Time [s]   Force Z [N]   Voltage 1 [V]"], "   "),
    "decimal commas": (["time_s;fz_N;v1_V"], ";", ","),
    "decimal commas and tabs": (["time_s\tfz_N\tv1_V"], "\t", ","),
    "a spreadsheet's mark": (["sep=;", "time_s;fz_N;v1_V"], ";"),
    "units in a line": (["Time,Fz,V1", "(s),(N),(V)"], ","),
    "bare units in a line": (["Time;Fz;V1", "ms;mN;mV"], ";", ",", (1e3, 1e3, 1e3)),
    "a report above": (["Machine 3", "Date: today", "Time [s],Fz [N],V1 [V]"], ","),
    "a clock of milliseconds": (["millis,fz_N,v1_mV"], ",", ".", (1e3, 1, 1e3)),
    "kilonewtons": (["Time (s),Fz (kN),V1 (V)"], ",", ".", (1, 1e-3, 1)),
    "grams": (["Time/s,Fz/g,V1/V"], ",", ".", (1, 1 / 9.80665e-3, 1)),
    "microvolts": (["t [s],F_z [N],Voltage 1 [µV]"], ",", ".", (1, 1, 1e6)),
}


@pytest.mark.parametrize("dialect", DIALECTS.values(), ids=DIALECTS.keys())
def test_every_dialect_has_the_same_numbers(tmp_path, dialect):
    read = read_measurement(written(tmp_path, *dialect))
    assert read.force_names == ("fz",) and list(read.taxel) == [1]
    np.testing.assert_allclose(read.time, TIME, atol=2e-6)
    np.testing.assert_allclose(read.force[:, 0], FORCE, atol=2e-6 if "kN" not in dialect[0][-1] else 1e-3)
    np.testing.assert_allclose(read.voltage[:, 0], VOLTAGE, atol=2e-6)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "latin-1"])
def test_spreadsheets_write_other_encodings(tmp_path, encoding):
    file = written(tmp_path, ["Time (s);Fz (N);Voltage 1 (µV)"], ";", ",", (1, 1, 1e6))
    file.write_bytes(file.read_text("utf-8").encode(encoding))
    np.testing.assert_allclose(read_measurement(file).voltage[:, 0], VOLTAGE, atol=2e-6)
    file.write_bytes("time_s;fz_N;Spannung für v1_V\n".encode("latin-1"))
    with pytest.raises(InputError, match="is not text: a CSV file is needed"):
        read_measurement(file)


@pytest.mark.parametrize("name", ["commas", "decimal commas", "tabs", "bare units in a line", "kilonewtons"])
def test_fits_and_steps_read_the_same_tables(tmp_path, name):
    head, *rest = DIALECTS[name]
    file = written(tmp_path, [line.replace("Fz", "fz").replace("Time", "time") for line in head], *rest)
    read = read_data(file)
    assert read.unit == "V" and read.settings.keys() == {"time", "fz"}
    tolerance = 2e-6 if name != "kilonewtons" else 1e-3
    np.testing.assert_allclose([float(word) for word in read.settings["fz"]], FORCE, atol=tolerance)
    np.testing.assert_allclose(read.readings[:, 0], VOLTAGE, atol=2e-6)
    steps = read_steps(file)
    np.testing.assert_allclose([float(step["fz"]) for step in steps], FORCE, atol=tolerance)


def test_units_of_steps_are_converted_exactly_and_words_stay(tmp_path):
    (tmp_path / "steps.csv").write_text("fz_mN,turn (rad),cell,plate_mm\n-100,1,none,0.5\n-2.5e3,2,cylindrical,1\n")
    first, second = read_steps(tmp_path / "steps.csv", known=["plate_mm"])
    assert first == {"fz": "-0.1", "turn": first["turn"], "cell": "none", "plate_mm": "0.5"}
    assert float(first["turn"]) == pytest.approx(math.degrees(1)) and second["fz"] == "-2.5"


REFUSED = {
    "decimal commas between commas": ("fz_N,v1_mV\n-0,0,100,00\n-0,1,98,05\n", "2 headings and 4 values .* semicolons"),
    "decimal commas but for the time": ("time_s,fz_N,v1_V\n0,-0,2,1,5\n1,-0,4,1,6\n", "3 headings and 5 values"),
    "both marks": ("a;b\n1.5;2,5\n1,5;2.5\n", "'1,5' is ambiguous: one decimal mark"),
    "thousands": ("a;b\n950;1\n1,050;2\n", "'1,050' is ambiguous"),
    "thousands with a fraction": ("a;b\n1.050,5;1\n", r"'1\.050,5' is ambiguous"),
    "a short row": ("a;b\n1;2\n3\n4;5\n6;7\n", "line 3: 1 values .* separated by semicolons"),
}


@pytest.mark.parametrize(("text", "said"), REFUSED.values(), ids=REFUSED.keys())
def test_what_is_ambiguous_is_refused_with_what_was_found(tmp_path, text, said):
    (tmp_path / "table.csv").write_text(text)
    with pytest.raises(InputError, match=said) as refused:
        read_table("table", tmp_path / "table.csv")
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("head", "said"),
    [
        ("time_s,fz_N,v1_counts", "'v1_counts' contains counts of a converter: volts are needed"),
        ("time_s,fz_N,v1 [µA]", "contains a current: volts are needed, which are the current times"),
        ("time_s,fz,v1_V", "'fz' is without a unit: N, mN, kN or g is needed, as in fz_N"),
        ("time_s,fz_mm,v1_V", "'fz_mm' is in mm: N"),
        ("time_s,voltage,v1_V", "'voltage'"),
    ],
)
def test_what_a_bench_needs_is_named(tmp_path, head, said):
    with pytest.raises(InputError, match=said):
        read_measurement(written(tmp_path, [head]))


def test_one_column_may_have_decimal_commas(tmp_path):
    (tmp_path / "table.csv").write_text("fz_N\n-0,1\n-0,2\n-0,3\n")
    (column,) = read_table("table", tmp_path / "table.csv").columns
    assert as_parameter(column) == ("fz", ["-0.1", "-0.2", "-0.3"])


@pytest.mark.parametrize(("forces", "asked"), [
    ("0 100 200 500", True), ("0 -5 -15 -65", True), ("0 1 2 5", False), ("0 99.7 200.2 499.9", False),
    ("0 60", False),
])  # fmt: skip
@pytest.mark.parametrize("heading", ["fz_N", "fz"])
def test_weights_in_grams_under_newtons_are_asked_about(tmp_path, forces, asked, heading):
    """Of fits and of benches; a heading in g is not asked."""
    levels = forces.split()
    (tmp_path / "a.csv").write_text(f"{heading},v1_V\n" + "".join(f"{level},1\n" for level in levels))
    rows = "".join(f"{number},{level},1\n" for number, level in enumerate(levels * 6))
    (tmp_path / "b.csv").write_text(f"t_s,fz_N,v1_V\n{rows}")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        read_data(tmp_path / "a.csv", {"fz"})
        read_measurement(tmp_path / "b.csv")
    assert len(caught) == 2 * asked and all("the heading 'fz [g]' is needed" in str(each.message) for each in caught)
    (tmp_path / "a.csv").write_text("fz [g],v1_V\n" + "".join(f"{level},1\n" for level in levels))
    assert float(read_data(tmp_path / "a.csv", {"fz"}).settings["fz"][1]) == pytest.approx(
        9.80665e-3 * float(levels[1])
    )
