"""How long a step in time may be after others, for errors that are powers of its length."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.mechanics.path.time_steps import CAUTION, MOST_GROWTH, MOST_TREND, next_length

NOTHING = np.zeros(2)


@pytest.mark.parametrize("longer", [0.5, 1.0, 1.7])
@pytest.mark.parametrize("last", [0.6, 0.9])
def test_errors_that_are_powers_of_the_length_are_as_allowed_but_for_caution(longer, last):
    """Whichever of them is larger, and whether or not the step before is known."""
    for sizes in ((1.0, 0.3), (0.2, 1.0), (0.7, 0.7)):
        ratios, before = (np.array(sizes) * length ** np.array([2, 4]) for length in (last, last / longer))
        expected = CAUTION / (last * max(sizes[0] ** 0.5, sizes[1] ** 0.25))
        assert next_length(ratios, before, longer) == pytest.approx(expected)
        assert next_length(ratios, NOTHING, longer) == pytest.approx(expected)


def test_errors_that_decline_from_step_to_step_are_expected_to_go_on():
    """Their coefficients fall to a share each step: the next one is as long as if they had fallen again, and no longer
    than a limit; coefficients that rise do not count."""
    for share, trend in ((0.5, 0.5**-0.25), (1e-3, MOST_TREND), (2.0, 1.0)):
        ratios = np.array([1e-3, 0.4])
        before = ratios / share / 1.2 ** np.array([2, 4])
        assert next_length(ratios, before, 1.2) == pytest.approx(trend * CAUTION / 0.4**0.25)


def test_small_errors_and_none_allow_the_most():
    assert next_length(NOTHING, NOTHING, 1.0) == MOST_GROWTH
    assert next_length(np.array([0.0, 1e-9]), np.array([0.1, 0.1]), np.inf) == MOST_GROWTH
