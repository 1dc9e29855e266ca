"""Finishes are named with their numbers wherever readings are shown."""

import pytest

from mitsuba_taxel import Grooves, LayerSteps, Pad, PadSensor, RandomRoughness, measure
from mitsuba_taxel.mechanics import SeparateFinish
from mitsuba_taxel.sensing.reading.finish_notes import finish_notes, finishes_of, merged_finishes

LAYERS = "layer_steps, layer_height = 0.2 mm"
CASES = {
    "layers": (LayerSteps(0.2), [f"finish of roof and side: {LAYERS}"]),
    "turned layers": (
        LayerSteps(0.2, (1.0, 0.0, 0.0), offset=0.05),
        [f"finish of roof and side: {LAYERS}, print_direction = 1, 0, 0, layer_offset = 0.05 mm"],
    ),
    "roof alone": (
        SeparateFinish(roof=Grooves(0.4, 0.05)),
        ["finish of roof: grooves, groove_pitch = 0.4 mm, groove_depth = 0.05 mm"],
    ),
    "both": (
        SeparateFinish(roof=RandomRoughness(0.01, 0.4), side=LayerSteps(0.2, (1.0, 0.0, 0.0))),
        [
            f"finish of side: {LAYERS}, print_direction = 1, 0, 0",
            "finish of roof: random, rms_height = 0.01 mm, correlation_length = 0.4 mm",
        ],
    ),
    "smooth": (None, []),
}


@pytest.mark.parametrize("name", CASES)
def test_readings_name_the_finish_of_roof_and_sides(name):
    finish, lines = CASES[name]
    sensor = PadSensor(Pad("spherical", 1, 1), finish=finish)
    readings = measure(sensor.scene(), points=16, mechanics_error=False)
    assert [note for note in readings.notes if note.startswith("finish")] == lines
    assert finish_notes(finishes_of(sensor.scene().load())) == lines


def test_a_study_has_one_line_for_each_wall():
    steps = [f"layer_steps, layer_height = {height} mm" for height in (0.1, 0.2)]
    both = [{"roof and side": words} for words in steps]
    assert merged_finishes([both[0], {}, both[1], both[0]]) == {"roof and side": "; ".join(steps)}
    many = [{"side": f"layer_steps, layer_height = {height / 100:g} mm"} for height in range(1, 7)]
    assert finish_notes(merged_finishes([*many, {"roof": "random"}])) == [
        "finish of side: 6 in turn, from layer_steps, layer_height = 0.01 mm; to layer_steps, layer_height = 0.06 mm",
        "finish of roof: random",
    ]
    assert merged_finishes([]) == {}
