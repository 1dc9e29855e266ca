"""The error of a pad by the reach of its barriers."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from touching_pads import (
    ASIDE,
    BEYOND,
    HELD,
    LAW,
    ON,
    PACKAGE,
    PAD,
    SIZE,
    SMALL,
    pressed,
)

from mitsuba_taxel.base.convergence import ERROR_SHARE
from mitsuba_taxel.mechanics import (
    PlateDisplacement,
    load_path,
)
from mitsuba_taxel.mechanics import reactions as reactions_of
from mitsuba_taxel.mechanics.contact.barriers.bodies import RigidBodies
from mitsuba_taxel.mechanics.continuation.pad_path import PadPath, pad_path
from mitsuba_taxel.mechanics.continuation.state import NO_ERROR, StateComparison
from mitsuba_taxel.mechanics.elements.nodal_forces import glued_force
from mitsuba_taxel.mechanics.equilibrium.feet import where_linear
from mitsuba_taxel.mechanics.equilibrium.self_touching_pad import SelfTouchingPad
from mitsuba_taxel.mechanics.errors.shorter_reach import with_reach
from mitsuba_taxel.pads import REGIONS, Pad

pytest.importorskip("ipctk")
pytestmark = pytest.mark.usefixtures("mechanics_error_unknown")


@pytest.fixture(scope="module")
def touching():
    return pressed(BEYOND)[0]


@pytest.fixture(scope="module")
def held():
    return pressed(HELD, obstacles=PACKAGE)[0]


@pytest.mark.parametrize(("name", "bodies"), [("touching", None), ("held", PACKAGE)])
def test_the_error_by_the_reach_is_the_change_with_a_far_shorter_one(name, bodies, request, monkeypatch, fresh):
    """At the same feet."""
    state = request.getfixturevalue(name)
    fresh()
    monkeypatch.setattr(SelfTouchingPad, "_linear", lambda pad: where_linear(pad.whole, pad.load))
    monkeypatch.setattr(sys.modules[PadPath.__module__], "where_linear", lambda mesh, load, _: where_linear(mesh, load))
    bodies = None if bodies is None else RigidBodies(bodies.tobytes())
    path = pad_path(PAD, LAW, ON, SIZE, bodies=bodies)
    nothing = StateComparison(NO_ERROR, lambda: np.zeros((2, *state.displacement.shape)), 0.0)
    found = with_reach(path, nothing, state.value, state.displacement, state.pressure)

    pads = [SelfTouchingPad(state.mesh, LAW, ON, bodies=bodies, fraction=share) for share in (1.0, 0.5, 0.25)]
    unknowns = pads[0].gather(state.displacement, state.pressure)
    for pad in pads:
        unknowns = pad.closer(unknowns, state.value)
    displacement, pressure = pads[0].split(unknowns)  # with an eighth of the reach
    linear = where_linear(state.mesh, ON)
    force = [glued_force(state.mesh, LAW, u, p, region="top", linear=linear)[2] for u, p in
             ((state.displacement, state.pressure), (displacement, pressure))]  # fmt: skip
    assert found.force_error == pytest.approx(8 / 7 * abs(force[1] - force[0]), rel=0.1)
    assert found.force_error > 1e-3 * abs(force[0])
    deviation, expected = found.deviate()[1] * ERROR_SHARE, 8 / 7 * (displacement - state.displacement)
    assert np.linalg.norm(deviation - expected) < 0.2 * np.linalg.norm(expected)


def test_before_anything_touches_the_error_is_that_of_the_feet():
    """What the law of large strains there would change."""
    (state,), (other,) = (pressed(ASIDE, load=load, size=SMALL) for load in (ON, PlateDisplacement()))
    nothing = StateComparison(NO_ERROR, lambda: np.zeros((2, *state.displacement.shape)), 0.0)
    found = with_reach(pad_path(PAD, LAW, ON, SMALL), nothing, state.value, state.displacement, state.pressure)
    roof = np.unique(state.mesh.faces[state.mesh.face_region == REGIONS["roof"]])
    missed = (other.displacement - state.displacement)[roof]
    stated = found.deviate()[1][roof] * ERROR_SHARE
    assert np.linalg.norm(stated - missed) < 0.3 * np.linalg.norm(missed)
    force = [reactions_of(s).applied_force for s in (state, other)]
    assert 1 < found.force_error / np.linalg.norm(force[1] - force[0]) < 1.5


def test_the_force_of_a_pad_whose_feet_are_folded():
    """For any law but the linear one there elements are inverted, and forces are no numbers."""
    flat, value, size = Pad(rows=1, columns=1, cell_height=0.9, height=2.5), np.array([0.0, 0.0, -0.6]), 1.2
    (state,) = load_path(flat, LAW, [value], load=ON, mesh_size=size)
    solved = state.displacement, state.pressure
    assert np.isnan(glued_force(state.mesh, LAW, *solved, region="top")).all()
    path = pad_path(flat, LAW, ON, size)
    force = path.force(value, *solved)
    np.testing.assert_allclose(force, -reactions_of(state).force, atol=1e-6)  # at the bottom, by the balance of forces
    nothing = StateComparison(NO_ERROR, lambda: np.zeros((2, *state.displacement.shape)), 0.0)
    assert 0 < with_reach(path, nothing, value, *solved).force_error < 0.2 * -force[2]
