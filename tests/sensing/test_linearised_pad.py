"""Rates of the nodes of a pad with a load, which are kept for scenes that are loaded again."""

from __future__ import annotations

import numpy as np
import pytest
from one_cell import one_cell

from mitsuba_taxel import Scene
from mitsuba_taxel.base.caches import Recent
from mitsuba_taxel.mechanics.derivatives.linearised_state import LinearisedState
from mitsuba_taxel.sensing.derivatives import linearised_pad
from mitsuba_taxel.sensing.derivatives.linearised_pad import LinearisedPad
from mitsuba_taxel.sensing.derivatives.scene_rates import rates
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads

pytestmark = pytest.mark.usefixtures("llvm_mono")


@pytest.fixture
def rate(tmp_path, monkeypatch):
    """Loads the scene, and returns the rate (N, 3) of its nodes with a force; ``rate.solved`` counts solutions."""
    (tmp_path / "pad.xml").write_text(one_cell(fx=0, fz=0, youngs_modulus=4))
    by_value = LinearisedState.by_value

    def counted(self, load):
        found.solved += 1
        return by_value(self, load)

    def found(name, **parameters):
        scene = Scene(tmp_path / "pad.xml", parameters)
        (pad,) = deformed_pads(scene.load())
        return LinearisedPad(pad, pad.state).nodal(rates(scene, name)).displacement

    found.solved = 0
    monkeypatch.setattr(LinearisedState, "by_value", counted)
    monkeypatch.setattr(linearised_pad, "_kept", Recent("test", linearised_pad.MOST_KEPT))
    return found


def test_a_rate_across_the_path_is_solved_for_once(rate):
    first, again = (rate("fx", fz=-0.5) for _ in range(2))
    np.testing.assert_array_equal(first, again)
    assert rate.solved == 1 and first.any()


@pytest.mark.parametrize(
    ("name", "other"),
    [("fx", {"fz": -0.6}), ("fx", {"fz": -0.5, "youngs_modulus": 4.1}), ("fx", {"fz": 0}), ("fz", {})],
)
def test_another_rate_is_not_taken_for_it(rate, name, other):
    kept = rate("fx", fz=-0.5)
    found = rate(name, **other)
    assert rate.solved == 2 and np.abs(found - kept).max() > 1e-3 * np.abs(kept).max()


def test_only_the_latest_are_kept(rate, monkeypatch):
    monkeypatch.setattr(linearised_pad, "_kept", Recent("test", 1))
    for force in (-0.5, -0.6, -0.6, -0.5):
        rate("fx", fz=force)
    assert rate.solved == 3
