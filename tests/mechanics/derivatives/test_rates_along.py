"""Derivatives of many states from few: as those of each, and of no more than it takes."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.mechanics import NeoHookean, linearise, load_path, rates_along
from mitsuba_taxel.mechanics.derivatives import rates_along as module
from mitsuba_taxel.pads import Pad, mesh_velocity

PAD = Pad(rows=1, columns=1)


def states(values):
    return load_path(PAD, NeoHookean(), values, mesh_size=4.0)


@pytest.fixture
def asked(monkeypatch):
    """The states that were linearised."""
    seen = []
    monkeypatch.setattr(module, "linearise", lambda state: seen.append(state) or linearise(state))
    return seen


@pytest.mark.parametrize("line", ["normal", "tangential"])
def test_they_are_those_of_each_state(line, asked):
    shares = np.linspace(0, 1, 9)
    values = [(0, 0, -1.2 * x) if line == "normal" else (0.4 * x, 0, -0.9) for x in shares]
    path = states(values)
    velocity = mesh_velocity(PAD, path[0].mesh, "cell_size")

    def ask(state):
        return [state.by_value((1, 0, 0)), state.by_material("youngs_modulus"), state.by_shape(velocity)]

    found = rates_along(path, ask)
    assert found.shape == (9, 3, *path[0].displacement.shape)
    assert len(asked) <= 5
    largest = np.abs(found).max(axis=(0, 2, 3))
    for state, rates in list(zip(path, found, strict=True))[1::4]:
        error = np.abs(np.array(ask(linearise(state))) - rates).max(axis=(1, 2))
        assert np.all(error < 2e-5 * largest)


def test_order_and_repetition_do_not_matter(asked):
    there = states([(0, 0, -0.2), (0, 0, -1.0), (0, 0, -0.2), (0, 0, -0.6)])
    found = rates_along(there, lambda state: [state.displacement])
    np.testing.assert_array_equal(found[0], found[2])
    np.testing.assert_allclose(found[:, 0], [state.displacement for state in there], atol=1e-5)
    assert len(asked) == 3
    assert rates_along(there[:1], lambda state: [state.displacement]).shape[0] == 1


def test_what_is_nothing_at_rest_is_not_taken_for_nothing(asked):
    there = states([(0, 0, -0.25 * k) for k in range(5)])
    found = rates_along(there, lambda state: [state.by_material("youngs_modulus")])
    assert not found[0].any()
    expected = linearise(there[3]).by_material("youngs_modulus")
    np.testing.assert_allclose(found[3, 0], expected, atol=1e-4 * np.abs(expected).max())


@pytest.mark.parametrize(
    ("values", "message"),
    [([(0, 0, -0.2), (0.1, 0, -0.2), (0.1, 0.1, -0.2)], "straight"), ([], "sequence of at least one State")],
)
def test_other_states_are_refused(values, message):
    with pytest.raises(InputError, match=message):
        rates_along(states(values) if values else [], lambda state: [state.displacement])
