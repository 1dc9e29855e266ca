"""Histories of loads: as the lists of their rows, in time and memory that grow as their number."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from mitsuba_taxel import InputError, NeoHookean, SpreadForce, Viscoelastic
from mitsuba_taxel.mechanics.history.timed_rows import LoadHistory, timed_rows

ROWS = [(0.5 * k, (0.0, 0.1 * k, -1.0 * k)) for k in range(6)]


def test_a_history_is_read_as_the_list_of_its_rows():
    history = LoadHistory(ROWS)
    for stop in (None, -1, 4, 1, 0):
        start = history[:stop]
        assert list(start) == ROWS[:stop]
        assert len(start) == len(ROWS[:stop])
        assert bool(start) == bool(ROWS[:stop])
    assert history[:4][-1] == ROWS[3]
    assert history[:4][0] == ROWS[0]
    with pytest.raises(IndexError):
        history[:4][4]  # its row, but of the longer one
    with pytest.raises(IndexError):
        history[1:]


def test_histories_are_equal_if_all_of_their_rows_are():
    history = LoadHistory(ROWS)
    assert history[:4] == LoadHistory(ROWS[:4])
    assert hash(history[:4]) == hash(LoadHistory(ROWS[:4]))
    assert LoadHistory() == history[:0]
    others = [history[:count] for count in range(len(ROWS))]
    for number in range(len(ROWS)):
        for value in ((0.0, 0.0, 7.0), (-0.0, *ROWS[number][1][1:]), np.nextafter(ROWS[number][1], 9.0)):
            others.append(LoadHistory([*ROWS[:number], (ROWS[number][0], tuple(value)), *ROWS[number + 1 :]]))
        others.append(LoadHistory([*ROWS[:number], (ROWS[number][0] + 0.1, ROWS[number][1]), *ROWS[number + 1 :]]))
    others.append(LoadHistory([(0.5 * k, (0.1 * k,)) for k in range(6)]))
    digests = {history.digest, *(other.digest for other in others)}
    assert len(digests) == 1 + len(others)


def test_all_starts_of_a_long_history_take_little_memory():
    """As tuples of rows they took 16 MB."""
    material = Viscoelastic(NeoHookean(1.0), [(0.3, 1.0)])
    times = np.arange(1.0, 2001.0)
    values = np.random.default_rng(1).normal(size=(2000, 3))
    history = timed_rows(material, SpreadForce(), values, times)
    tracemalloc.start()
    counts = {history[:count]: count for count in range(len(history) + 1)}
    size, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert size < 1e6
    assert counts[LoadHistory(history[:1234])] == 1234


def test_the_rows_of_an_elastic_and_of_a_relaxing_silicone():
    law, values = NeoHookean(1.0), np.array([[0.0, 0.0, -1.0], [0.1, 0.0, -1.0]])
    assert not timed_rows(law, SpreadForce(), values, None)
    relaxing = Viscoelastic(law, [(0.3, 1.0)])
    assert list(timed_rows(relaxing, SpreadForce(), values, [0.1, 0.1])) == [
        (0.1, (0.0, 0.0, -1.0)),
        (0.1, (0.1, 0.0, -1.0)),
    ]
    with pytest.raises(InputError, match=r"times\[1\] = 0 s is not allowed"):
        timed_rows(relaxing, SpreadForce(), values, [0.1, 0.0])
