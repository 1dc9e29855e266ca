"""Circuits are read from tables, and refuse what cannot work, in one line."""

from __future__ import annotations

import math
import re

import pytest

from mitsuba_taxel import Circuit, InputError, read_circuit, write_template
from mitsuba_taxel.electronics.circuit import circuit_of

pytestmark = pytest.mark.quick

NEEDED = {"supply": 3.3, "load_resistance": 22e3, "transfer": 8.0}


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"supply": None}, "supply is missing: a number above 0 is needed."),
        ({"supply": 0}, "supply = 0"),
        ({"transfer": -1.0}, "transfer = -1"),
        ({"load_resistance": -1.0}, "load_resistance = -1"),
        ({"load_resistance": math.nan}, "load_resistance = nan"),
        ({"supply": math.inf}, "supply = inf"),
        ({"adc_bits": 0}, "adc_bits = 0"),
        ({"adc_bits": 25}, "adc_bits = 25"),
        ({"adc_bits": 12.5}, "adc_bits = 12.5"),
        ({"led_efficiency": 0.2}, "led_efficiency is not allowed without led_current"),
        ({"led_current": 0.02}, "led_efficiency is missing"),
        ({"saturation_voltage": 3.3}, "saturation_voltage = 3.3"),
        ({"transfer_drift": -0.02, "temperature": 80.0}, "transfer_drift = -0.02"),
        ({"led_drift": -0.1, "temperature": 35.0}, "led_drift = -0.1"),
        ({"temperature": -300.0}, "temperature = -300"),
        ({"dark_decade": 0.001, "temperature": 30.0}, "dark_decade = 0.001"),
        ({"bandwidth": 0.0}, "bandwidth = 0"),
        ({"voltage": 5}, "circuit: voltage is not known"),
    ],
    ids=lambda given: next(iter(given)) if isinstance(given, dict) else "",
)
def test_what_cannot_work_is_refused(given, said):
    with pytest.raises(InputError, match=f"^{re.escape(said)}"):
        circuit_of({**NEEDED, **given})


@pytest.mark.parametrize("table", [5, "3.3 V", [1, 2]])
def test_what_is_no_table_is_refused(table):
    with pytest.raises(InputError, match=r"a table \[circuit\] of numbers is needed"):
        circuit_of(table)


@pytest.mark.parametrize("content", [None, "supply = ", "\xff", "[circuit"], ids=["missing", "cut", "text", "open"])
def test_a_file_that_is_none(tmp_path, content):
    if content is not None:
        (tmp_path / "c.toml").write_bytes(content.encode("latin-1"))
    with pytest.raises(InputError, match="c.toml"):
        read_circuit(tmp_path / "c.toml")


def test_a_file_alone_and_as_a_table(tmp_path):
    lines = "supply = 3.3\nload_resistance = inf\ntransfer = 8\n"
    for name, head in (("alone", ""), ("table", "points = 64\n[circuit]\n")):
        (tmp_path / name).write_text(head + lines)
        assert read_circuit(tmp_path / name) == Circuit(3.3, math.inf, 8)


def test_the_template_is_a_circuit_and_goes_round(tmp_path):
    write_template("circuit", tmp_path / "circuit.toml")
    circuit = read_circuit(tmp_path / "circuit.toml")
    assert circuit.load_resistance == 22e3 and circuit.step == 3.3 / 4096 and circuit_of(circuit.as_table()) == circuit


def test_temperature_and_led_current(circuit):
    """Figures of the VCNT2020: 1 nA of dark current at 25 degrees C, tenfold per 23 K; +0.4 % per K."""
    warm = {"temperature": 71.0, "transfer_drift": 0.004}
    one = circuit(dark_current=1e-9, dark_decade=23.0, led_current=0.02, led_efficiency=0.25, **warm)
    assert one.leakage == pytest.approx(1e-7)
    assert one.current_per_power == pytest.approx(0.02 * 0.25 * 8 * (1 + 46 * 0.004))
    assert circuit(led_drift=-0.005, **warm).current_per_power == pytest.approx(8 * (1 - 0.23) * (1 + 46 * 0.004))
    assert circuit(led_current=0.0, led_efficiency=0.25).current_per_power == 0
