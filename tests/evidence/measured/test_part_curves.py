"""Parts beside their datasheets: widths of edges by a closed form, and lit windows by two computations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mitsuba_taxel.evidence.measured.part_curves import (
    PartRow,
    cells,
    edge_width,
    scattered_rays,
)
from mitsuba_taxel.parts import mirror_rays, read_part

VCNT = read_part("vcnt2020")


@pytest.mark.parametrize(("first", "second"), [(0.35, 0.4), (0.2, 0.8)])
def test_the_width_of_an_edge_far_away_is_that_of_the_mean_of_two_dies(first, second):
    """The mean of two uniform numbers has a trapezoidal density: 10 % lie below sqrt(0.2 a b) or a / 2 + b / 10."""
    bare = {"die_depth": 0.0, "window_width": 0.9, "window_length": 1.6, "y": 0.0, "window_y": None}
    part = replace(
        VCNT,
        emitter=replace(VCNT.emitter, **bare, die_width=first, die_length=first),
        detector=replace(VCNT.detector, **bare, die_width=second, die_length=second),
    )
    small, large = sorted((first / 2, second / 2))
    below = np.sqrt(0.2 * small * large)
    below = below if below <= small else small / 2 + 0.1 * large
    for axis in (0, 1):
        assert edge_width(mirror_rays(part, 50.0), axis) == pytest.approx(small + large - 2 * below, rel=5e-3)


def test_windows_lit_from_far_below_are_evenly_lit():
    sides = {
        role: replace(side, y=0.0, die_width=side.window_width, die_length=side.window_length, die_depth=0.0)
        for role, side in (("emitter", VCNT.emitter), ("detector", VCNT.detector))
    }
    even = replace(VCNT, resin_index=1.0, **sides)
    for height in (0.5, 2.0):
        lit, expected = scattered_rays(VCNT, 50.0, height), mirror_rays(even, height)
        for axis in (0, 1):
            assert edge_width(lit, axis) == pytest.approx(edge_width(expected, axis), rel=5e-3)
    ratio = [scattered_rays(VCNT, 50.0, h).power.sum() / mirror_rays(even, h).power.sum() for h in (0.3, 1.0, 4.0)]
    np.testing.assert_allclose(ratio, ratio[0], rtol=5e-3)


def test_the_table_states_the_largest_difference_and_where_nothing_is_known():
    heights, sheet = np.array([1.0, 2.0, 3.0]), np.array([0.5, 1.0, 0.7])
    row = PartRow("x", "mirror", heights, sheet, np.array([0.52, 1.0, 0.6]))
    assert cells(row) == ["x", "mirror", "2", "2", "-10.0", "3"]
    assert "geometry unknown" in cells(replace(row, model=None))
