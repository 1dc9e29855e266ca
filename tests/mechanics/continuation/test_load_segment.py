"""Where a segment of a load path is solved: steps that are as long as interpolation allows."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from mitsuba_taxel.mechanics.contact.barriers.self_contact import Contact
from mitsuba_taxel.mechanics.continuation.load_segment import LoadSegment
from mitsuba_taxel.mechanics.equilibrium.natural_step import TICKS
from mitsuba_taxel.mechanics.equilibrium.solution import Rejected, Solution

BEND = 384 * 2e-5
"""Fourth derivative of a curve on which cubics over whole steps are off by 2e-5, over halves by a sixteenth of that."""


class Curve:
    """A pad of one unknown that follows a known curve: a step of Newton's method finds it."""

    solves_between = False
    numbering = SimpleNamespace(displacements=1)
    load = SimpleNamespace(self_contact=False)

    def __init__(self, at, slope, end=np.inf):
        self.at, self.slope, self.end, self.solved = at, slope, end, []

    def solve_linearised(self, start, value):
        (s,) = value
        self.solved.append(s)
        if s > self.end:
            raise Rejected("no state")
        return Solution(np.array([self.at(s)]), 1.0, 0.0, 1, True), SimpleNamespace(entries=None)

    def rate(self, linearised, unknowns, direction, value):
        return np.array([self.slope(value[0])])

    def correction(self, linearised, unknowns, value):
        return unknowns - self.at(value[0])

    def towards(self, known, guess):
        return guess

    def ticks(self, response):
        return TICKS

    def split(self, unknowns):
        return unknowns, unknowns

    def find(self, displacement):
        """No contact."""


def bent():
    return Curve(lambda s: s + BEND * s**4 / 24, lambda s: 1 + BEND * s**3 / 6)


def extended(curve, *reaches, **tolerance):
    segment = LoadSegment(np.zeros(1), np.ones(1), 1.0, judged=False, **tolerance)
    for reach in reaches:
        segment.extend(curve, reach, lambda: np.zeros(1), curve, lambda: False)
    return [node.s for node in segment.nodes]


def test_a_cubic_is_followed_in_whole_steps():
    assert extended(Curve(lambda s: s**3, lambda s: 3 * s**2), 2.5) == [0, 1, 2, 3]


def test_a_curve_that_needs_halves_goes_on_in_halves_until_whole_steps_are_accurate():
    """Within 1e-5 of the unknown: on the way from 2 to 3, whole steps are."""
    curve = bent()
    assert extended(curve, 3.5) == [0, 0.5, 1, 1.5, 2, 2.5, 3, 4]
    assert curve.solved == [0, 1, 0.5, 1.5, 2, 2.5, 3, 4]  # nothing beyond what is kept


def test_steps_are_as_long_as_the_tolerance_allows():
    """Cubics are off by 2e-5 over whole steps: of a state near 0.5, where the first begin, by 4e-5 of it."""
    assert extended(bent(), 3.5, tolerance=5e-5) == [0, 1, 2, 3, 4]
    assert extended(bent(), 1.5, tolerance=3e-6) == [0, 0.25, 0.5, 1, 1.5, 2]


def test_the_way_on_does_not_depend_on_where_one_stopped():
    assert extended(bent(), 0.2, 0.7, 1.4, 3.5) == extended(bent(), 3.5)


def test_where_no_state_is_found_halves_lead_to_the_end():
    found = extended(Curve(lambda s: s, lambda s: 1.0, end=1.3), 3.0)
    assert found[:3] == [0, 1, 1.25] and found[-1] == pytest.approx(1.3, abs=1 / 64)


def test_soft_pads_begin_with_short_steps_which_grow():
    """Whose first response tells into how many parts a step may be cut: the first step has as many as of others."""
    soft = Curve(lambda s: np.cbrt(s), lambda s: min(1e9, s ** (-2 / 3) / 3 if s else 1e9))
    soft.ticks = lambda response: TICKS << 12
    segment = LoadSegment(np.zeros(1), np.ones(1), 1.0, judged=False, tolerance=1.0)
    segment.extend(soft, 1.0, lambda: np.zeros(1), soft, lambda: False)
    lengths = np.diff([node.s for node in segment.nodes])
    assert lengths[0] == 2.0**-12 == 64 * segment.tick and lengths.max() >= 0.25
    again = LoadSegment(np.zeros(1), np.ones(1), 1.0, judged=False)
    again.restore(segment.arrays())
    assert again.tick == segment.tick


@pytest.mark.parametrize("interrupt", [KeyboardInterrupt, MemoryError])
@pytest.mark.parametrize("first", [1.3, 2.6])
def test_a_contact_is_found_again_after_its_test_was_interrupted(first, interrupt):
    """The curve s touches something from ``first`` on; the test at the first state beyond is interrupted once."""
    curve, interrupted = Curve(lambda s: s, lambda s: 1.0), []
    segment = LoadSegment(np.zeros(1), np.ones(1), 1.0, judged=False)

    def find(displacement):
        if displacement[0] <= first:
            return None
        if not interrupted:
            interrupted.append(displacement[0])
            raise interrupt
        return Contact("something", (displacement[0], 0.0, 0.0))

    curve.find = find
    with pytest.raises(interrupt):
        segment.extend(curve, 4.0, lambda: np.zeros(1), curve, lambda: False)
    resumed = LoadSegment(np.zeros(1), np.ones(1), 1.0, judged=False)
    resumed.restore(segment.arrays())
    resumed.extend(curve, 4.0, lambda: np.zeros(1), curve, lambda: False)
    assert resumed.limit == pytest.approx(first, abs=1e-3) and not resumed.reaches(first + 0.01)
    assert resumed.reason == "touches something"
