"""Circuits for parts: a scene with the part shows the current of the datasheet, as the renderer traces it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from taxel_program import run_program

from mitsuba_taxel import InputError, Scene, measure, read_circuit
from mitsuba_taxel.electronics import respond
from mitsuba_taxel.parts import card_curve, circuit_of_part, read_part
from mitsuba_taxel.parts.part_circuit import standard_resistance

VCNT = read_part("vcnt2020")
MIRROR = """<scene version="3.9.0">
    <shape type="photo_reflector"> <string name="part" value="vcnt2020"/> </shape>
    <shape type="rectangle">
        <transform name="to_world"> <rotate x="1" angle="180"/> <scale value="20"/> <translate z="1.8"/> </transform>
        <bsdf type="wall"> <string name="scattering" value="mirror"/> </bsdf>
    </shape>
</scene>
"""


def test_under_the_mirror_of_the_datasheet_flows_its_current(tmp_path, agree, llvm_mono):
    """1.6 mA at 20 mA, 1 mm above the windows, which lie at 0.8 mm; the load takes 3.5 mA at the brightest place."""
    done = run_program(tmp_path, "new", "circuit", "--part", "vcnt2020")
    assert done.returncode == 0
    circuit = read_circuit(tmp_path / "circuit.toml")
    (tmp_path / "mirror.xml").write_text(MIRROR)
    readings = measure(Scene(tmp_path / "mirror.xml"), points=1024, seed=1)
    per_power = circuit.current_per_power
    agree(readings.power * per_power, readings.standard_error * per_power, 1.6e-3, 5e-3 * 1.6e-3)
    assert (circuit.led_current, circuit.dark_current, circuit.transfer_drift) == (0.02, 1e-9, 0.004)
    most = 3.5e-3 / 0.698
    assert circuit.load_resistance == 560 and 560 * most < circuit.limit < 680 * most
    assert not respond(circuit, most / per_power).saturated


def test_under_a_white_card_too():
    circuit = circuit_of_part(replace(VCNT, distance_reflector="white card"))
    assert circuit.current_per_power * card_curve(VCNT, 1.0)[0] == pytest.approx(1.6e-3, rel=1e-3)


def test_what_a_part_does_not_state_is_left_out_or_refused(tmp_path):
    with pytest.raises(InputError, match="part njl5908ar has no collector_current_typical_A, led_current_A"):
        circuit_of_part(read_part("njl5908ar"))
    assert run_program(tmp_path, "new", "part").returncode == 0
    assert run_program(tmp_path, "new", "circuit", "--part", "part.toml").returncode == 0
    text = (tmp_path / "circuit.toml").read_text()
    assert "\ndark_current = 1e-09" in text and "\n# transfer_drift = " in text
    assert read_circuit(tmp_path / "circuit.toml").transfer_drift == 0
    refused = run_program(tmp_path, "new", "scene", "--part", "vcnt2020")
    assert refused.returncode == 2 and "takes a part, not that of a scene" in refused.stderr


@pytest.mark.parametrize(("resistance", "sold"), [(639.0, 560.0), (1.0, 1.0), (0.99, 0.82), (9.9e5, 8.2e5)])
def test_resistances_that_are_sold(resistance, sold):
    assert np.isclose(standard_resistance(resistance), sold)
