"""States under small tangential forces by the tangent of the normal force, against those that a path leads to."""

from __future__ import annotations

import sys

import numpy as np
import pytest
import trimesh

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.geometry.mirror import ACROSS_SECOND_DIAGONAL
from mitsuba_taxel.mechanics import NeoHookean, PatchForce, PlateForce, SpreadForce, linearise, load_path
from mitsuba_taxel.mechanics.contact.barriers.self_contact import Contact
from mitsuba_taxel.mechanics.continuation import pushed_states
from mitsuba_taxel.mechanics.continuation.load_segment import INTERPOLATION_TOLERANCE
from mitsuba_taxel.mechanics.continuation.pad_path import PadPath, pad_path
from mitsuba_taxel.mechanics.continuation.pushed_states import accelerated
from mitsuba_taxel.mechanics.continuation.solved_states import FURTHEST_BESIDE
from mitsuba_taxel.mechanics.equilibrium.natural_step import natural_step
from mitsuba_taxel.mechanics.equilibrium.solution import Rejected
from mitsuba_taxel.pads import Pad

PAD, LAW, SIZE, LARGER = Pad("hemispheric", rows=1, columns=1), NeoHookean(), 2.0, 3.0
JUDGED = {"mesh_size": SIZE, "judged_on": LARGER}
CASES = [
    (SpreadForce(), (0.5, 0.0, -1.5)),
    (SpreadForce(), (0.4, 0.4, -0.5)),
    (SpreadForce(), (0.4, 0.15, -1.5)),
    (SpreadForce(), (0.5, 0.0, 0.0)),
    (SpreadForce(), (2.1, 0.0, -1.5)),
    (PlateForce(), (0.5, 0.0, -1.5)),
    (PatchForce((0.4, 0.0), (1.5, 1.5)), (0.1, 0.1, -0.5)),
]


@pytest.fixture
def counted(fresh, monkeypatch):
    """The distances along segments that were solved for without following them."""
    solved, state = [], pushed_states.PushedStates.state
    monkeypatch.setattr(
        pushed_states.PushedStates,
        "state",
        lambda self, pad, segment, s: solved.append(s) or state(self, pad, segment, s),
    )
    return solved


@pytest.mark.parametrize(("load", "value"), CASES)
def test_they_are_those_of_a_path(load, value, counted):
    """And they go on as the tangent under both forces says."""
    (followed,) = load_path(PAD, LAW, [value], load=load, mesh_size=SIZE)
    assert not counted
    (state,) = load_path(PAD, LAW, [value], load=load, mesh_size=SIZE, judged_on=LARGER)
    assert len(counted) == 1
    largest = np.abs(followed.displacement).max()
    difference = state.displacement - followed.displacement
    assert np.sqrt(np.square(difference).mean()) < 2 * INTERPOLATION_TOLERANCE * largest
    np.testing.assert_allclose(state.pressure, followed.pressure, atol=1e-3 * np.abs(followed.pressure).max())
    assert state.residual < 1e-3 and followed.min_jacobian - 0.01 < state.min_jacobian < 1  # the lesser at two nodes

    rate = state.path_rate()
    expected = linearise(state).by_value(rate.direction)
    np.testing.assert_allclose(rate.displacement, expected, rtol=0, atol=2e-4 * np.abs(expected).max())


def test_they_are_the_same_whatever_else_is_asked(counted, fresh):
    values = [(0.5, 0.0, -1.5), (0.0, 0.0, -0.5), (0.2, 0.0, -0.5), (0.0, -0.5, -1.5)]
    first = load_path(PAD, LAW, values, **JUDGED)
    assert len(counted) == 2  # the last is a mirror image of the first
    image = pad_path(PAD, LAW, SpreadForce(), SIZE).images[ACROSS_SECOND_DIAGONAL]
    turned = ACROSS_SECOND_DIAGONAL.image(first[0].displacement[image])
    np.testing.assert_array_equal(first[3].displacement, turned)
    fresh()
    kept = [load_path(PAD, LAW, [value], **JUDGED)[0] for value in reversed(values)]
    assert len(counted) == 2
    for state, again in zip(first, reversed(kept), strict=True):
        np.testing.assert_array_equal(state.displacement, again.displacement)


def test_a_rate_is_solved_for_once(fresh, monkeypatch):
    solved, rate = [], pushed_states.PushedStates.rate
    monkeypatch.setattr(
        pushed_states.PushedStates, "rate", lambda self, *asked: solved.append(asked[2]) or rate(self, *asked)
    )
    rates = []
    for again in range(3):
        if again == 2:
            fresh()
        (state,) = load_path(PAD, LAW, [(0.5, 0.0, -1.5)], **JUDGED)
        rates.append(state.path_rate().displacement)
    assert solved == [0.5]
    np.testing.assert_array_equal(rates[1:], [rates[0]] * 2)


@pytest.mark.parametrize("reason", ["large", "far", "touching"])
def test_others_are_followed(reason, counted, monkeypatch):
    """Forces of much more than a step, states that few iterations do not lead to, and those that touch something."""
    value = (0.5, 0.0, -1.5)
    if reason == "large":
        value = (1.1 * FURTHEST_BESIDE * natural_step(PAD.mesh(SIZE), LAW, SpreadForce()), 0.0, -1.5)
    elif reason == "far":
        monkeypatch.setattr(pushed_states, "MOST_ITERATIONS", 1)
    else:
        monkeypatch.setattr(PadPath, "contact", NeverFree())
    (followed,) = load_path(PAD, LAW, [value], mesh_size=SIZE)
    (state,) = load_path(PAD, LAW, [value], **JUDGED)
    assert len(counted) == (reason != "large")
    largest = np.abs(followed.displacement).max()
    difference = state.displacement - followed.displacement
    assert np.sqrt(np.square(difference).mean()) < 2 * INTERPOLATION_TOLERANCE * largest
    assert state.residual < 1e-3 and state.path_rate() is not None


class NeverFree:
    """A test of contact that segments pass, and single states do not."""

    at_rest = None
    find_package = staticmethod(lambda displacement: None)

    def __init__(self) -> None:
        self.segments = 0

    def find(self, displacement):
        return None if sys._getframe(1).f_code.co_name == "first_contact" else Contact("itself", (0.0, 0.0, 0.0))


def test_what_stands_beside_the_pad_is_touched_as_on_a_path(counted):
    value, side = (0.5, 0.0, -1.5), PAD.extent[0] / 2
    near, far = (
        trimesh.creation.box(bounds=[(side + gap, -1, 1), (side + gap + 1, 1, 4)]).triangles for gap in (0.1, 1.0)
    )
    ends = []
    for asked in ({"mesh_size": SIZE}, JUDGED):
        with pytest.raises(ComputationError, match="touches") as ended:
            load_path(PAD, LAW, [value], obstacles=near, **asked)
        ends.append(float(str(ended.value).split("force = (")[1].split(",")[0]))
    assert 0 < ends[0] < 0.5 and ends[1] == pytest.approx(ends[0], abs=0.02)
    (free,), (alone,) = (load_path(PAD, LAW, [value], obstacles=o, **JUDGED) for o in (far, None))
    np.testing.assert_array_equal(free.displacement, alone.displacement)
    assert len(counted) == 1


UNKNOWNS, DISPLACEMENTS = 60, 45


@pytest.mark.parametrize("outliers", [(), (0.1, 0.2), (0.3, 0.5, 1.7)])
def test_few_slow_components_take_few_iterations(outliers):
    """Corrections that leave a tenth of most components, but nearly all of few."""
    rng = np.random.default_rng(3)
    kept = 1 + 0.1 * rng.uniform(-1, 1, UNKNOWNS)
    kept[: len(outliers)] = outliers
    basis = np.linalg.qr(rng.standard_normal((UNKNOWNS, UNKNOWNS)))[0]
    applied, wanted = (basis * kept) @ basis.T, rng.standard_normal(UNKNOWNS)
    found, iterations = accelerated(np.zeros(UNKNOWNS), lambda x: applied @ (x - wanted), DISPLACEMENTS, 1e-5)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-4)
    assert iterations <= 9  # where those alone take more than fifty


def test_a_curved_problem():
    wanted = np.linspace(-1, 1, UNKNOWNS)
    found, _ = accelerated(np.zeros(UNKNOWNS), lambda x: np.sinh(x) - np.sinh(wanted), UNKNOWNS, 1e-7)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-6)


@pytest.mark.parametrize("correct", [lambda x: None, lambda x: 3 * (x - 1) + 5 * x**3, lambda x: np.ones_like(x)])
def test_what_leads_no_closer_is_rejected(correct):
    with pytest.raises(Rejected):
        accelerated(np.linspace(2, 3, UNKNOWNS), correct, DISPLACEMENTS, 1e-5)
