"""Derivatives by the numbers of a finish, and by dimensions of rough cells, are refused in one line that says what to
do instead."""

import pytest

from mitsuba_taxel import Grooves, LayerSteps, Pad, PadSensor, RandomRoughness, Wall, measure
from mitsuba_taxel.base.errors import InputError

ADVICE = "take a difference of readings, which share their random numbers, by --vary {}=FROM,TO."
NUMBERS = [
    (LayerSteps(0.2), "layer_height"),
    (LayerSteps(0.2), "layer_offset"),
    (Grooves(0.4, 0.05), "groove_depth"),
    (Grooves(0.4, 0.05), "groove_pitch"),
    (RandomRoughness(0.01, 0.4), "rms_height"),
    (RandomRoughness(0.01, 0.4), "correlation_length"),
]


def refusal(finish, name):
    sensor = PadSensor(Pad("parallelepiped", 1, 1), roof=Wall("lambertian", 0.9), finish=finish)
    with pytest.raises(InputError) as refused:
        measure(sensor.scene(), points=16, mechanics_error=False, derivatives=[name])
    return str(refused.value)


@pytest.mark.parametrize(("finish", "name"), NUMBERS)
def test_numbers_of_a_finish(llvm_mono, finish, name):
    reason = f"{name} has no derivative: it changes {name} of the deformable_pad, a number of its finish; "
    assert refusal(finish, name) == reason + ADVICE.format(name)


def test_dimensions_of_rough_cells(llvm_mono):
    reason = "cell_height has no derivative: the pad's cells have a finish, which does not follow dimensions; "
    assert refusal(LayerSteps(0.2), "cell_height") == reason + ADVICE.format("cell_height")
