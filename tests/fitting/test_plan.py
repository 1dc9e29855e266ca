"""Studies and data that describe a fit, and those that do not: one line each."""

from __future__ import annotations

import math

import numpy as np
import pytest
from one_cell import one_cell

from mitsuba_taxel import InputError
from mitsuba_taxel.fitting.data import read_data
from mitsuba_taxel.fitting.plan import read_plan

pytestmark = pytest.mark.quick

HEAD = 'scene = "plate.xml"\npoints = 64\n[fit]\ndata = "data.csv"\n'
UNKNOWNS = "[fit.unknowns]\nspacing = { start = 0.9, low = 0.8, high = 0.93 }\n"
DATA = "z,v1_mV,v1_error_mV\n0.5,10,1\n0.7,8,1\n0.9,6,1\n"
CIRCUIT = "circuit = { supply = 3.3, load_resistance = 1e4, transfer = 0.1 }\n"


@pytest.fixture
def plan(tmp_path):
    def read(study, data=DATA):
        (tmp_path / "study.toml").write_text(study)
        (tmp_path / "data.csv").write_text(data)
        return read_plan(tmp_path / "study.toml")

    return read


def test_a_plan(plan):
    one = plan(HEAD + UNKNOWNS + "gain = 1\n")
    assert one.data.settings == {"z": ["0.5", "0.7", "0.9"]} and one.data.unit == "V"
    np.testing.assert_allclose(one.data.readings[:, 0], [0.01, 0.008, 0.006])
    np.testing.assert_allclose(one.data.errors, 0.001)
    assert [unknown.in_scene for unknown in one.unknowns] == [True, False]
    assert plan(CIRCUIT + HEAD + "[fit.unknowns]\n'circuit.transfer' = 1\n").circuit.transfer == 0.1


def test_unknowns_of_a_circuit_stay_in_its_range(plan):
    """A search that leaves it would end with a circuit that cannot work."""
    table = "'circuit.transfer' = 1\n'circuit.temperature' = { start = 30, low = -1e9 }\n"
    transfer, temperature = plan(CIRCUIT + HEAD + "[fit.unknowns]\n" + table).unknowns
    assert (transfer.low, transfer.high) == (0, math.inf)
    assert (temperature.low, temperature.high) == (-200, 500)


def test_times_and_forces_of_the_data_are_called_as_the_scene_calls_them(plan, tmp_path):
    """Unless it has parameters of these names, whatever they are."""
    scene = one_cell(scattering="isotropic", fz=0, time=0, led_power=1).replace("$fz", "-$press")
    scene = scene.replace('<default name="fz"', '<default name="press"').replace('"time"', '"moment"')
    scene = scene.replace('<vector name="force"', '<float name="time" value="$moment"/> <vector name="force"')
    (tmp_path / "cell.xml").write_text(scene)
    head = HEAD.replace("plate", "cell") + "[fit.unknowns]\nled_power = 1\ngain = 1\n"
    data = "time_s,fz_mN,v1_V\n0,-100,1\n2,-200.5,2\n3,0,3\n"
    assert plan(head, data).data.settings == {"moment": ["0", "2", "3"], "press": ["0.1", "0.2005", "0"]}
    (tmp_path / "cell.xml").write_text(scene.replace("led_power", "fz"))
    other = plan(head.replace("led_power = 1\n", ""), data.replace("fz_mN", "fz")).data.settings
    assert other["fz"] == ["-100", "-200.5", "0"] and "press" not in other


def test_times_of_the_data_have_their_unit(plan):
    """Where the scene has no parameter of that name, they are named and left out."""
    with pytest.warns(UserWarning, match="the scene has no parameter time, so this column is not used"):
        one = plan(HEAD + UNKNOWNS + "gain = 1\n", DATA.replace("z,", "time_s,"))
    assert one.data.settings == {}


@pytest.mark.parametrize(
    ("study", "said"),
    [
        (HEAD, "a table [fit] with data and unknowns"),
        (HEAD.replace("data = ", "date = ") + UNKNOWNS, "a table [fit] with data and unknowns"),
        (HEAD + UNKNOWNS, "or gain, in V/W, as an unknown"),
        ("vary = { z = [1, 2] }\n" + HEAD + UNKNOWNS, "vary is not allowed"),
        (HEAD + "[fit.unknowns]\ngain = 1\nz = 0.5\n", "z is both unknown and given"),
        (HEAD + "[fit.unknowns]\ngain = 'a'\n", "unknown gain = 'a'"),
        (HEAD + "[fit.unknowns]\ngain = { low = 1 }\n", "unknown gain = {'low': 1}"),
        (
            HEAD + "[fit.unknowns]\ngain = { start = 1, low = 2 }\n",
            "must lie between low = 2 and high = inf.",
        ),
        (CIRCUIT + HEAD + "[fit.unknowns]\n'circuit.transfer' = -1\n", "start = -1 must lie between low = 0 and"),
        (HEAD + "[fit.unknowns]\ngain = 1\nspacing = 1\nhole = 0.1\n", "3 readings are not enough for 3 unknowns"),
        (HEAD + "[fit.unknowns]\n'circuit.transfer' = 1\n", "circuit.transfer is not allowed: a number of the table"),
        (CIRCUIT + HEAD + "[fit.unknowns]\n'circuit.adc_bits' = 10\n", "circuit.adc_bits is not allowed: a number"),
        (CIRCUIT + HEAD + "[fit.unknowns]\ngain = 1\n", "gain is not allowed beside a circuit"),
    ],
)
def test_what_is_no_fit_is_refused(plan, study, said):
    with pytest.raises(InputError) as refused:
        plan(study)
    assert said in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("z,a\n1,2\n", "all in volts (v1_V"),
        ("z,v1_V,p1_W\n1,2,3\n", "all in watts (p1_W"),
        ("z,v1_W\n1,2\n", "column v1_W"),
        ("z,v1_V\n1,x\n", "line 2, column v1_V: 'x' is not allowed: a number is needed"),
        ("z,v1_V\n1,inf\n", "line 2, column v1_V: 'inf' is not allowed: a finite number"),
        ("z,v1_V,v2_V,v2_error_V\n1,2,3,4\n", "errors of all readings"),
        ("z,v1_V,v1_error_V\n1,2,0\n", "errors above 0"),
        ("z,v1_V\n1\n", "data.csv"),
    ],
)
def test_what_is_no_data_is_refused(tmp_path, text, said):
    (tmp_path / "data.csv").write_text(text)
    with pytest.raises(InputError) as refused:
        read_data(tmp_path / "data.csv")
    assert said in str(refused.value)


def test_a_missing_table_is_called_data(tmp_path):
    with pytest.raises(InputError, match=r"^data = '.*none.csv' cannot be read"):
        read_data(tmp_path / "none.csv")
