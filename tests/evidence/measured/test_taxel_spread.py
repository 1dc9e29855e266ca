"""How far a map of taxels that differ may be from that of taxels that are alike."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from mitsuba_taxel.evidence.measured.taxel_spread import ROUNDING, TaxelBand, band

MOVED = np.exp(-np.add.outer(np.arange(-2, 3) ** 2, (np.arange(-2, 3) + 0.3) ** 2) / 2.0)
MOVED *= 100 / MOVED[2, 2]


def pressed_itself(share):
    here = np.linspace(0.01, 0.2, 9)
    return SimpleNamespace(change_at_force=here, measured=SimpleNamespace(change=share * here))


def test_the_band_of_a_map_is_that_of_taxels_that_differ():
    """Two taxels pressed themselves, of which one changes 1.25 times as much as computed."""
    found = band(SimpleNamespace(taxels={13: pressed_itself(1.0), 5: pressed_itself(1.25)}, moved=MOVED))
    assert found.own == pytest.approx({13: 1.0, 5: 1.25})
    spread = np.log(1.25) / np.sqrt(2)
    assert found.spread == pytest.approx(spread)
    expected = np.hypot(np.sqrt(2) * spread * MOVED, np.sqrt(1 / 12))
    expected[2, 2] = 0
    np.testing.assert_allclose(found.deviation, expected)
    beyond = 1 - 2 / np.pi * np.arctan(5 / expected[expected > 0])  # Student's with one degree is Cauchy's
    assert found.expected_beyond(5.0) == pytest.approx(beyond.sum())


@pytest.mark.parametrize(("taxels", "spread"), [(3, 0.16), (3, 0.02), (25, 0.05)])
def test_the_chance_that_all_are_within_is_that_of_drawn_pads(taxels, spread):
    deviation = np.where(MOVED < MOVED.max(), 1.0, 0.0)
    chance = TaxelBand(dict.fromkeys(range(taxels), 1.0), spread, MOVED, deviation).chance_of_none_beyond(5.0)
    random, count = np.random.default_rng(3), 40_000
    own_spread = spread * np.sqrt((taxels - 1) / random.chisquare(taxels - 1, count))[:, None]
    pressed, others = random.normal(size=(count, 1)), random.normal(size=(count, 24))
    off = MOVED[deviation > 0] * own_spread * (others - pressed) + ROUNDING * random.normal(size=(count, 24))
    share = np.mean(np.all(np.abs(off) < 5.0, axis=1))
    assert abs(share - chance) < 4 * np.sqrt(chance * (1 - chance) / count)
