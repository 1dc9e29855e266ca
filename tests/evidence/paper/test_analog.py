"""The paper's procedure: counts, and the maximum slopes that they give."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel import measure
from mitsuba_taxel.evidence.paper.analog import binomial, counting_test, max_slopes, summary
from mitsuba_taxel.sensing import Scene

PLATE = """
<scene version="3.9.0">
    <default name="z" value="0.7"/>
    <integrator type="analog_tracer"/>
    <shape type="photo_reflector"> <emitter type="annular_led"/> <sensor type="phototransistor"/> </shape>
    <shape type="rectangle">
        <transform name="to_world">
            <rotate x="1" angle="180"/> <scale value="2"/> <translate z="0.5"/> <translate z="$z"/>
        </transform>
        <bsdf type="wall"> <string name="scattering" value="isotropic"/> </bsdf>
    </shape>
</scene>
"""
RAYS = 4096


def test_counted_rays_under_a_plate_scatter_as_binomial_counts(tmp_path):
    (tmp_path / "plate.xml").write_text(PLATE)
    readings = [
        measure(Scene(tmp_path / "plate.xml", {"z": z}), points=RAYS, seed=seed).replicates[:, 0]
        for seed, z in enumerate((0.3, 0.5, 0.7, 1.05, 1.4, 2.0) * 4)
    ]
    samples = np.array(readings)
    assert counting_test(samples, RAYS).p > 1e-4
    for wrong in (0.75, 1.35):
        assert counting_test(samples, round(wrong * RAYS)).p < 1e-4


def test_the_counting_test_keeps_its_false_alarm_rate():
    share = np.full((20, 1), 0.01)
    p = [counting_test(binomial(share, 60_000, 32, seed)[:, :, 0], 60_000).p for seed in range(400)]
    assert 0.02 < np.mean(np.array(p) < 0.05) < 0.09


def test_the_maximum_slope_of_noise_is_that_of_normal_numbers():
    """Over a flat curve: the largest of 40 differences of independent counts, drawn here from normal numbers."""
    force, p, rays = np.arange(0, -20.5, -0.5), 0.01, 60_000
    found = summary(max_slopes(force, binomial(np.full((41, 1), p), rays, 4000)))
    noise = np.sqrt(p * (1 - p) / rays) * np.random.default_rng(9).normal(size=(41, 40_000))
    expected = np.abs(np.diff(noise, axis=0)).max(axis=0) / 0.5
    assert found.mean == pytest.approx(expected.mean(), rel=0.01)
    assert found.spread == pytest.approx(expected.std(), rel=0.05)
    assert found.error == pytest.approx(found.spread / 4000**0.5)


def test_it_goes_with_the_square_root_of_a_flat_reading():
    force = np.arange(0, -20.5, -0.5)
    low, high = (summary(max_slopes(force, binomial(np.full((41, 9), p), 60_000, 1000))).mean for p in (0.004, 0.016))
    assert high / low == pytest.approx(np.sqrt(0.016 * 0.984 / (0.004 * 0.996)), rel=0.02)


def test_without_noise_it_is_the_steepest_step_of_all_taxels():
    power = np.array([[0.0, 1.0], [1.0, 4.0], [3.0, 4.5]])[:, None, :]
    assert max_slopes(np.array([0.0, 0.5, 1.0]), power) == pytest.approx([6.0])
