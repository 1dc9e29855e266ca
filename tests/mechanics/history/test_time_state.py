"""States between two solved ones: polynomials that pass through what is known."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from mitsuba_taxel.mechanics.history.time_state import MidStep, Shape, StepCubics, TimeState, shape_within

QUARTIC = np.polynomial.Polynomial([0.3, -1.0, 2.0, 0.5, -0.7])
SHARES = np.array([1.0, 2.0, -1.0, 0.5])


def solved(time, midway=0.0, left=0.0):
    """A state of one node and one pressure that follow a polynomial."""
    value, rate = QUARTIC(time) * SHARES, QUARTIC.deriv()(time) * SHARES
    shape = Shape(value[None, :3], value[3:], velocity=rate, deviation=np.full((1, 3), time))
    mid_step = MidStep(
        np.zeros(0), correction=midway * SHARES, remainder=np.full((1, 3), left), cubic_stress=np.zeros(0)
    )
    return SimpleNamespace(time=time, shape=shape, mid_step=mid_step)


class Clock:
    """Time as the measure of a step."""

    ends, duration = False, 2.0

    def at(self, time):
        return time / self.duration

    def rate(self, time):
        return 1 / self.duration


class Measures:
    """Those of a step, of which time is the only one."""

    main, second = Clock(), None

    def bump(self, time):
        t = self.main.at(time)
        return 16 * t**2 * (1 - t) ** 2, 32 * t * (1 - t) * (1 - 2 * t) * self.main.rate(time)


def way_between(start, end):
    ends = (start.shape.unknowns, end.shape.unknowns, start.shape.velocity, end.shape.velocity)
    return StepCubics(Measures(), 3, *ends)


def test_a_quartic_is_reproduced_and_what_is_left_is_stated():
    start, end = solved(1.0), solved(3.0)
    way = way_between(start, end)
    missed = way.at(1.0)[0] - QUARTIC(2.0)
    end = solved(3.0, missed, left=0.15)
    for time in (1.0, 1.3, 2.0, 2.9, 3.0):
        found, exact = shape_within(start, end, way, time), solved(time).shape
        np.testing.assert_allclose(found.displacement, exact.displacement, rtol=1e-13)
        np.testing.assert_allclose(found.pressure, exact.pressure, rtol=1e-13)
        np.testing.assert_allclose(found.velocity, exact.velocity, rtol=1e-12)
    assert shape_within(start, end, way, 1.5).deviation[0, 0] == pytest.approx(1.5 + 0.15)  # a quarter of the way
    assert shape_within(start, end, way, 3.0).deviation[0, 0] == pytest.approx(3.0)


def test_a_load_is_on_its_way_while_its_rate_does_not_change():
    load = SimpleNamespace(value=np.array([0.0, 0.2, -1.0]), rate=np.array([0.0, 0.1, -0.5]))
    at = SimpleNamespace(time=2.0, load=load)
    assert TimeState.on_its_way(at, 4.0, np.array([0.0, 0.4, -2.0]))
    assert not TimeState.on_its_way(at, 4.0, np.array([0.0, 0.4, -2.0 - 1e-7]))
    load.rate = np.full(3, np.nan)  # after a jump
    assert not TimeState.on_its_way(at, 2.0, load.value)
