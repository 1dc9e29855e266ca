"""The spread at rest of the measured pad."""

from __future__ import annotations

import re

import numpy as np
import pytest

from mitsuba_taxel.evidence.measured import rest_spread
from mitsuba_taxel.evidence.paper.paper_studies import PaperStudies
from mitsuba_taxel.sensing import Scene, measure


def test_spread_of_the_gain_behind_a_spread_is_that_of_a_product():
    random = np.random.default_rng(0)
    gain, rest = 1 + 0.15 * random.normal(size=200_000), 1 + 0.1 * random.normal(size=200_000)
    product = gain * rest
    found = rest_spread.Spread({}, {}, 0.0, 10.0, 0.0, 0.0, 0.0)
    assert found.gain_for(100 * product.std() / product.mean()) == pytest.approx(15, rel=0.01)
    assert found.gain_for(5.0) == 0


def test_the_error_of_a_spread_is_the_scatter_of_spreads():
    samples = 1 + 0.2 * np.random.default_rng(1).normal(size=(400, 64))
    spreads = [rest_spread._relative(row) for row in samples]
    stated = np.mean([rest_spread._error(row) for row in samples])
    assert stated == pytest.approx(np.std(spreads), rel=0.15)


def test_the_samples_spread_as_their_gain_and_the_rest(monkeypatch, tmp_path):
    """The gain alone has the closed form of a triangle; the study is kept."""
    monkeypatch.setattr(rest_spread, "SAMPLES", 8)
    monkeypatch.setattr(rest_spread, "POINTS", 16)
    found = rest_spread.spread(PaperStudies(tmp_path, str))
    again = rest_spread.spread(PaperStudies(tmp_path))
    assert (again.all, again.without_gain) == (found.all, found.without_gain)
    assert set(found.laws) == set(rest_spread.SOURCES)
    assert 5 < found.without_gain < 15
    low, peak, high = 0.3125, 1.0, 2.1875
    triangle = np.sqrt((low**2 + peak**2 + high**2 - low * peak - low * high - peak * high) / 18)
    gain = 100 * triangle / ((low + peak + high) / 3)
    assert found.all == pytest.approx(np.hypot(gain, found.without_gain), rel=0.35)  # eight samples


def test_the_scene_is_that_of_the_part(tmp_path):
    scene, _ = rest_spread._texts()
    package = '<string name="part" value="njl5908ar"/>'
    other = re.sub('<vector name="body".*</sensor>', package, scene, flags=re.DOTALL)
    other = re.sub('<default name="(spacing|gain)".*\n|<translate x="-0.1"/>', "", other)
    powers = []
    for number, text in enumerate((scene, other)):
        file = tmp_path / f"{number}.xml"
        file.write_text(text)
        powers.append(measure(Scene(file), points=16).power)
    assert powers[0] == pytest.approx(powers[1], rel=1e-4)
