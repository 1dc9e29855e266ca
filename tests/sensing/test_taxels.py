"""LED and phototransistor that overlap, touch, or do not see each other."""

from __future__ import annotations

import numpy as np
import pytest
from plate_scenes import plate, rectangles

from mitsuba_taxel import InputError, Scene, measure


def test_led_and_phototransistor_that_overlap_in_a_package_are_refused(llvm_mono):
    with pytest.raises(InputError, match=r"spacing = 0.3 is not allowed: from 0.385 \(LED and phototransistor touch"):
        plate(spacing=0.3).load()


@pytest.mark.parametrize(
    "change, refused",
    [
        ({"x": 0.38}, "annular_led: the rectangle 'detector' lies in its plane"),
        ({"x": 0.4, "turn": 30}, "annular_led: the rectangle 'detector' lies in its plane"),
        ({"board": 0.0}, "annular_led: the rectangle 'board' lies in its plane"),
        ({"board": 1e-6}, "annular_led: the rectangle 'board' lies in its plane"),
        ({"led_half": 1.0}, "phototransistor: the rectangle 'led' lies in its plane"),
    ],
)
def test_rectangles_that_overlap_in_one_plane_are_refused(llvm_mono, change, refused):
    """A ray hits either of them, as it happens, and readings would be wrong without a word."""
    with pytest.raises(InputError, match=refused + " and overlaps it.*: move or shrink one of them"):
        measure(rectangles(**change), points=256)


@pytest.mark.parametrize("change", [{"x": 0.385 + 1e-5}, {"x": 0.276, "turn": 90}, {"board": -0.01}, {"plate": 0.0}])
def test_rectangles_that_only_touch_are_read(llvm_mono, agree, change):
    """Side by side, one after a quarter turn, on a board beneath, or with the plate on them: as hits alone see it."""
    ours = measure(rectangles(**change), points=1 << 13, seed=1)
    theirs = measure(rectangles(**change, strategy="unidirectional_hits"), points=1 << 14, seed=2)
    if change == {"plate": 0.0}:
        assert ours.power[0] == theirs.power[0] == 0
        assert ours.notes == ["no light found on taxel 1: it may receive 7.0e-06 W (1 sigma)"]
    else:
        agree(ours.power, ours.standard_error, theirs.power, theirs.standard_error)


@pytest.mark.parametrize("where", ["facing away", "behind the body"])
def test_a_phototransistor_that_sees_nothing_reads_nothing_and_says_so(llvm_mono, where):
    """With its back to the plate, or inside an absorbing block."""
    change = {"facing": -1} if where == "facing away" else {"block": True}
    reading = measure(rectangles(**change), points=1 << 12)
    assert np.array_equal(reading.replicates, np.zeros((32, 1)))
    assert reading.notes == ["no light found on taxel 1: it may receive 1.4e-05 W (1 sigma)"]
    assert measure(rectangles(), points=256).power[0] > 0.01


@pytest.mark.parametrize("missing", ["led", "sensor"])
def test_each_phototransistor_needs_its_led(llvm_mono, missing):
    from mitsuba_taxel import measure

    scene = {
        "type": "scene",
        "integrator": {"type": "taxel_tracer"},
        "a": {"type": "rectangle", "led": {"type": "annular_led"}},
        "b": {"type": "rectangle", "sensor": {"type": "phototransistor"}},
        "c": {"type": "rectangle", "sensor": {"type": "phototransistor", "width": 0.4}},
    }
    if missing == "sensor":
        del scene["b"], scene["c"]
    with pytest.raises(InputError, match="LEDs and .* phototransistors|every sensor must be a phototransistor"):
        measure(Scene(scene), points=16)
