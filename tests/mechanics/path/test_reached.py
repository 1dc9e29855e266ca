"""States between two solved ones: polynomials that pass through what is known."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from mitsuba_taxel.mechanics.path.reached import Reached, cubic, passed

QUARTIC = np.polynomial.Polynomial([0.3, -1.0, 2.0, 0.5, -0.7])


def solved(time, midway=0.0):
    """A state of one node and one pressure that follow a polynomial, and its double."""
    shares = np.array([1.0, 2.0, -1.0, 0.5])
    value, rate = QUARTIC(time) * shares, QUARTIC.deriv()(time) * shares
    return SimpleNamespace(
        time=time, displacement=value[None, :3], pressure=value[3:], unknowns=value, velocity=rate,
        midway=midway * shares, deviation=np.full((1, 3), time),
    )  # fmt: skip


def test_a_quartic_is_reproduced_and_its_difference_to_a_cubic_is_stated():
    start, end = solved(1.0), solved(3.0)
    change = end.unknowns[0] - start.unknowns[0]
    missed = start.unknowns[0] + cubic(0.5, 2.0, change, start.velocity[0], end.velocity[0]) - QUARTIC(2.0)
    end = solved(3.0, missed)
    for time in (1.0, 1.3, 2.0, 2.9, 3.0):
        found, exact = passed(start, end, time), solved(time)
        np.testing.assert_allclose(found.displacement, exact.displacement, rtol=1e-13)
        np.testing.assert_allclose(found.pressure, exact.pressure, rtol=1e-13)
        np.testing.assert_allclose(found.velocity, exact.velocity, rtol=1e-12)
    assert passed(start, end, 2.0).deviation[0, 0] == pytest.approx(2.0 + missed)


def test_a_load_is_on_its_way_while_its_rate_does_not_change():
    at = SimpleNamespace(time=2.0, moved=np.array([0.0, 0.2, -1.0]), rate=np.array([0.0, 0.1, -0.5]))
    assert Reached.on_its_way(at, 4.0, np.array([0.0, 0.4, -2.0]))
    assert not Reached.on_its_way(at, 4.0, np.array([0.0, 0.4, -2.0 - 1e-7]))
    at.rate = np.full(3, np.nan)  # after a jump
    assert not Reached.on_its_way(at, 2.0, at.moved)
