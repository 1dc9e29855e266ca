"""What a box blocks: whole ways, its silhouette, and derivatives by both ends."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.backend.packets import in_packets
from mitsuba_taxel.transport.box import WIDTH, Array3f64, Box, Float64, Passage

pytestmark = pytest.mark.quick

TURN = np.linalg.qr(np.array([[1.0, 0.2, -0.3], [0.1, 1.0, 0.4], [0.3, -0.2, 1.0]]))[0]
BOX = Box(np.array([0.1, -0.2, 0.3]), TURN, np.array([0.7, 0.5, 0.25]))


def places(points):
    """Array3f64 of points (N, 3)."""
    return Array3f64(*(Float64(in_packets(part, np.float64)) for part in np.atleast_2d(points).T))


def passage(start, end):
    """Of ways between points (N, 3) of the world."""
    inside, there = (places(BOX.to_box(points)) for points in (start, end))
    return Passage(BOX, inside, there - inside)


def world(points):
    return BOX.centre + np.array(points) @ BOX.axes


def test_ways_through_the_box_end_there_and_all_others_go_on():
    ends = [((-2, 0, 0), (2, 0, 0)), ((-2, 0, 0.4), (2, 0, 0.4)), ((-2, 0, 0), (-1, 0, 0)), ((0, 2, -2), (0, 2, 2))]
    start, end = (world([pair[k] for pair in ends]) for k in (0, 1))
    assert np.array(passage(start, end).fraction) == pytest.approx([0, 1, 1, 1], abs=1e-12)


def test_half_of_the_light_passes_where_a_way_just_touches_an_edge():
    touching = passage(world([[-1.7, 0.1, -0.75]]), world([[0.3, 0.1, 1.25]]))
    assert np.array(touching.fraction) == pytest.approx(0.5, abs=1e-9)


def test_derivatives_are_differences():
    random = np.random.default_rng(5)
    start = world(random.uniform(-1, 1, (2000, 3)) * (2, 1.5, 0.4) - (3, 0, 0))
    end = world(random.uniform(-1, 1, (2000, 3)) * (2, 1.5, 0.4) + (3, 0, 0.2))
    here = passage(start, end)
    share = np.array(here.fraction)
    partly = (share > 0.02) & (share < 0.98)
    assert 20 < partly.sum() < 1000
    by_end, by_both = (np.array(each).T for each in here.slopes())
    step = 1e-5 * WIDTH
    for axis in np.eye(3):
        for moves_start, found in ((0, by_end), (1, by_both)):
            ahead, behind = (
                np.array(passage(start + moves_start * sign * step * axis, end + sign * step * axis).fraction)
                for sign in (1, -1)
            )
            off = (found @ axis - (ahead - behind) / (2 * step))[partly]
            assert np.quantile(abs(off), 0.98) < 1e-4 * np.abs(found[partly]).max()  # a few ways go by a corner
