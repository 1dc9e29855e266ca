"""Pilot runs along a curve: points that its slopes need, and loads that are too few."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from mitsuba_taxel.studies.run import curve_pilot
from mitsuba_taxel.studies.run.curve_pilot import FIRST_PILOT, LIGHT_PART, CurvePilot

FORCES = [0.0, -2.0, -4.0, -6.0, -8.0]
REPLICATES = 32


@pytest.fixture
def pilot_of(monkeypatch):
    """A pilot whose readings are a curve, with noise that falls with the root of the points."""

    def pilot(curve, noise):
        class Run:
            def __init__(self, force, seed):
                self.force, self.generator = force, np.random.default_rng([seed, int(10 * abs(force))])

            def extend_to(self, points):
                spread = noise * np.sqrt(REPLICATES / points)
                self.powers = curve(self.force) + spread * self.generator.normal(size=(REPLICATES, 1))

        monkeypatch.setattr(curve_pilot, "Run", Run)
        monkeypatch.setattr(CurvePilot, "_prepared", lambda self, force, forces: force)
        return CurvePilot(lambda force: SimpleNamespace(parameters={}), 0)

    return pilot


def test_points_follow_from_the_noise_of_the_slopes(pilot_of):
    """The noise of the mean slope is sqrt(2 / points) of it: a fourth of the target asks for sixteen times the points.
    The error by the fit is of the same order, so that points lie within a factor of 64 above those for the mean."""
    needed = {}
    for target in (0.04, 0.01):
        points = pilot_of(lambda force: -force / 8, 1.0).points_for(FORCES, target)
        assert points & (points - 1) == 0
        assert 2 / points <= (LIGHT_PART * target) ** 2 <= 64 * 2 / points
        needed[target] = points
    assert needed[0.01] > 4 * needed[0.04]


def test_a_slope_without_noise_needs_the_first_pilot_only(pilot_of):
    pilot = pilot_of(lambda force: -force / 8, 1e-9)
    assert pilot.points_for(FORCES, 0.01) == FIRST_PILOT == pilot.points
    assert (pilot.change, pilot.power) == pytest.approx((1, 0), abs=1e-6)


@pytest.mark.parametrize(
    ("curve", "is_bent"), [(lambda force: -force / 8, False), (lambda force: np.tanh(force + 3), True)]
)
def test_a_curve_that_bends_between_its_loads_needs_more_of_them(pilot_of, curve, is_bent):
    assert pilot_of(curve, 1e-3).errors(FORCES, FIRST_PILOT)[2] == is_bent
