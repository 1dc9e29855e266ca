"""Peaks of curves over a plate's height, and where edges lie."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel import measure
from mitsuba_taxel.evidence.paper import plate
from mitsuba_taxel.sensing import Scene, find_scene

HEIGHT = np.array(plate.PEAK_HEIGHTS)


def curve(top: float, width: float = 0.9) -> np.ndarray:
    """Largest at ``top``; a parabola in logarithms."""
    return 0.02 * np.exp(-((np.log(HEIGHT / top) / width) ** 2))


@pytest.mark.parametrize("top", [0.2, 0.3, 0.41])
def test_the_peak_and_its_error(top):
    random = np.random.default_rng(5)
    scores = []
    for _ in range(60):
        noise = 1 + 0.01 * random.normal(size=(len(HEIGHT), 32))
        found = plate.peak(HEIGHT, curve(top)[:, None] * noise)
        scores.append((found.at - top) / found.error)
    assert abs(np.mean(scores)) < 4 / np.sqrt(60)
    assert 0.7 < np.std(scores) < 1.35


@pytest.mark.parametrize("top", [0.05, 1.5])
def test_a_peak_outside_the_heights_is_none(top):
    assert np.isnan(plate.peak(HEIGHT, np.repeat(curve(top)[:, None], 4, axis=1)).at)


def test_the_spacing_for_a_peak():
    """On peaks that are linear in the spacing, root and error are known."""
    peaks = {spacing: plate.CurveMaximum(0.1 + 0.25 * spacing, 1e-3) for spacing in (0.5, 0.6, 0.7, 0.8, 0.9)}
    found = plate.spacing_for(peaks, 0.28)
    assert found.at == pytest.approx(0.72)
    assert found.error == pytest.approx(4e-3)
    assert np.isnan(plate.spacing_for(peaks, 0.5).at)


@pytest.mark.parametrize(("axis", "reach"), [("x", (0.25 + 0.52) / 4), ("y", (0.25 + 0.3) / 4)])
def test_an_edge_cuts_the_light_where_a_mirror_sends_it(axis, reach):
    """Light meets a mirror half-way between a point of the LED and one of the phototransistor.

    These means lie about the package's centre, as far from it as half the mean of the two faces' sizes.
    """
    before, after = (plate.PACKAGE[axis] / 2 + end for end in (-reach, reach))
    distances = [0.0, before - 0.01, (before + after) / 2, after + 0.01]
    powers = [_power(axis, distance) for distance in distances]
    assert powers[1] == powers[0] > 0
    assert 0.3 < powers[2] / powers[0] < 0.7
    assert powers[3] == 0


def _power(axis: str, distance: float) -> float:
    offset = plate.plate_offset(axis, distance)
    values = {f"offset_{axis}": offset, "width": plate.PLATE, "depth": plate.PLATE, "z": 0.7, "spacing": 0.9}
    return float(measure(Scene(find_scene("plate.xml"), values), points=256, seed=1).power[0])
