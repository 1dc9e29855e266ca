"""Caches have one owner: names, sizes, and a way to empty them."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from mitsuba_taxel.base.caches import Recent, cache_sizes, clear_caches, kept

pytestmark = pytest.mark.quick


@pytest.fixture
def asked():
    """A function that asks for the result of an array, of which two are kept, and those that were made."""
    recent, made = Recent("test", 2), []

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


def test_all_caches_are_listed_and_emptied():
    calls = []

    @kept(2)
    def square(number):
        calls.append(number)
        return number**2

    name = f"{__name__}.{square.__wrapped__.__qualname__}"
    assert [square(number) for number in (1, 2, 2, 3)] == [1, 4, 4, 9] and calls == [1, 2, 3]
    assert cache_sizes()[name] == (2, 2)
    clear_caches(square)
    assert cache_sizes()[name] == (0, 2)
    recent = Recent("arrays of a test", 3)
    recent.of((np.zeros(2),), lambda: 1)
    square(3)
    clear_caches()
    assert all(size.entries == 0 for size in cache_sizes().values())


def test_no_module_keeps_results_of_its_own():
    """Each goes through the owner, so that memory can be accounted for and freed."""
    root = Path(__file__).parents[2]
    files = [*(root / "mitsuba_taxel").rglob("*.py"), *(root / "plugins").rglob("*.py")]
    own = [file.name for file in files if re.search(r"\b(lru_cache|functools import .*\bcache\b)", file.read_text())]
    assert own == ["caches.py"]
