"""Results of arrays that were asked for before."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.base.recent import Recent


@pytest.fixture
def asked():
    """A function that asks for the result of an array, of which two are kept, and those that were made."""
    recent, made = Recent(2), []

    def ask(array):
        return recent.of((array, np.zeros(1)), lambda: made.append(array) or len(made))

    return ask, made


def test_what_is_kept_is_that_of_equal_contents(asked):
    ask, made = asked
    assert ask(np.arange(3)) == ask(np.arange(3)) == 1
    others = np.arange(3.0), np.arange(3, dtype=np.int32), np.arange(3)[:, None], np.array([0, 1, 3])
    assert [ask(other) for other in others] == [2, 3, 4, 5] and len(made) == 5


def test_what_was_asked_for_last_is_kept(asked):
    ask, made = asked
    one, other, third = np.array([1]), np.array([2]), np.array([3])
    for array in (one, other, one, third, one):
        ask(array)
    assert made == [one, other, third]
    ask(other)
    assert len(made) == 4
