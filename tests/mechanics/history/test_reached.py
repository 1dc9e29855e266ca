"""States between two solved ones: polynomials that pass through what is known."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from mitsuba_taxel.mechanics.history.reached import Reached, Way, passed

QUARTIC = np.polynomial.Polynomial([0.3, -1.0, 2.0, 0.5, -0.7])
SHARES = np.array([1.0, 2.0, -1.0, 0.5])


def solved(time, midway=0.0, left=0.0):
    """A state of one node and one pressure that follow a polynomial."""
    value, rate = QUARTIC(time) * SHARES, QUARTIC.deriv()(time) * SHARES
    return SimpleNamespace(
        time=time, displacement=value[None, :3], pressure=value[3:], unknowns=value, velocity=rate,
        midway=midway * SHARES, left=np.full((1, 3), left), deviation=np.full((1, 3), time),
    )  # fmt: skip


class Clock:
    """Time as the measure of a step."""

    ends, duration = False, 2.0

    def at(self, time):
        return time / self.duration

    def rate(self, time):
        return 1 / self.duration


class Measures:
    """Those of a step, of which time is the only one."""

    main, other = Clock(), None

    def bump(self, time):
        t = self.main.at(time)
        return 16 * t**2 * (1 - t) ** 2, 32 * t * (1 - t) * (1 - 2 * t) * self.main.rate(time)


def way_between(start, end):
    return Way(Measures(), 3, start.unknowns, end.unknowns, start.velocity, end.velocity)


def test_a_quartic_is_reproduced_and_what_is_left_is_stated():
    start, end = solved(1.0), solved(3.0)
    way = way_between(start, end)
    missed = way.at(1.0)[0] - QUARTIC(2.0)
    end = solved(3.0, missed, left=0.15)
    for time in (1.0, 1.3, 2.0, 2.9, 3.0):
        found, exact = passed(start, end, way, time), solved(time)
        np.testing.assert_allclose(found.displacement, exact.displacement, rtol=1e-13)
        np.testing.assert_allclose(found.pressure, exact.pressure, rtol=1e-13)
        np.testing.assert_allclose(found.velocity, exact.velocity, rtol=1e-12)
    assert passed(start, end, way, 1.5).deviation[0, 0] == pytest.approx(1.5 + 0.15)  # a quarter of the way
    assert passed(start, end, way, 3.0).deviation[0, 0] == pytest.approx(3.0)


def test_a_load_is_on_its_way_while_its_rate_does_not_change():
    at = SimpleNamespace(time=2.0, moved=np.array([0.0, 0.2, -1.0]), rate=np.array([0.0, 0.1, -0.5]))
    assert Reached.on_its_way(at, 4.0, np.array([0.0, 0.4, -2.0]))
    assert not Reached.on_its_way(at, 4.0, np.array([0.0, 0.4, -2.0 - 1e-7]))
    at.rate = np.full(3, np.nan)  # after a jump
    assert not Reached.on_its_way(at, 2.0, at.moved)
