"""Circuits to ask."""

from __future__ import annotations

from functools import partial

import pytest

from mitsuba_taxel import Circuit


@pytest.fixture
def circuit():
    """A circuit with some of its numbers changed: 3.3 V, 22 kOhm, 8 A/W."""
    return partial(Circuit, **{"supply": 3.3, "load_resistance": 22e3, "transfer": 8.0})
