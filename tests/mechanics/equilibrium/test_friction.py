"""Paths of pads on which a body presses that holds by friction."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.base.convergence import ERROR_SHARE
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.mechanics import (
    Indenter,
    IndenterDisplacement,
    IndenterForce,
    NeoHookean,
    linearise,
    load_path,
    reactions,
)
from mitsuba_taxel.mechanics.continuation.state import NO_ERROR
from mitsuba_taxel.mechanics.errors.second_meshes import SecondMeshes
from mitsuba_taxel.pads import Pad

pytestmark = pytest.mark.usefixtures("mechanics_error_unknown")

PAD, SIZE, LAW = Pad("hemispheric", rows=1, columns=1), 3.0, NeoHookean()
BALL = IndenterDisplacement(Indenter("sphere", radius=2.5))


def pressed(*values, load=BALL, pad=PAD, material=LAW):
    return load_path(pad, material, values, load=load, mesh_size=SIZE)


def dragged(*values, friction=0.3, at=(0.0, 0.0)):
    body = Indenter("sphere", radius=2.5, at=at, friction=friction)
    states = load_path(PAD, LAW, values, load=IndenterDisplacement(body), mesh_size=SIZE)
    return states, np.array([reactions(state).applied_force for state in states])


POSES = [(0, 0, -0.5), (0.2, 0, -0.5), (0.6, 0, -0.5), (0.2, 0, -0.5), (0, 0, -0.2), (0, 0, 0.1)]


def test_friction_holds_until_it_slips_and_remembers_the_way(few_elements_under_bodies):
    states, forces = dragged(*POSES)
    for state, force in zip(states[:-1], forces, strict=False):
        assert reactions(state).imbalance < 1e-7
        assert np.hypot(*force[:2]) <= 0.4 * -force[2]  # on a ball's flank more than the coefficient
    assert forces[2, 0] > 1.5 * forces[1, 0] > 0
    assert forces[3, 0] < 0.5 * forces[1, 0]  # back at the same place
    assert np.abs(states[-1].displacement).max() < 1e-6  # it has let go
    (free,) = pressed(POSES[0])
    assert forces[0, 2] == pytest.approx(reactions(free).applied_force[2], rel=0.05)
    (at_once,), (force,) = dragged((0.2, 0, -0.5))  # down first
    np.testing.assert_array_equal(at_once.displacement, states[1].displacement)
    few_elements_under_bodies()
    again, _ = dragged(*POSES[:2])
    np.testing.assert_array_equal(again[1].displacement, states[1].displacement)


def test_the_length_of_steps_under_friction_is_in_the_stated_error(few_elements_under_bodies, monkeypatch):
    """The error is proportional to their length at worst, and stated as the change from steps of twice the length.

    By steps of a twentieth, on elements of the usual size, it is 0.42 of that for the force, 0.45 root mean square over
    the displacements, and 0.41 for the largest. The latter is an error of single nodes at the edge of contact, which
    are dragged along from the step on in which they touch: 1.4 % of the largest displacement where elements are small,
    with a root mean square of 0.15 %.
    """

    class SameMesh:
        def error(self, displacement, other):
            return NO_ERROR

        def force_error(self, force, other):
            return 0.0

        def deviations(self, displacement, other, of_force):
            assert of_force == 0
            return np.zeros((2, *displacement.shape))

    monkeypatch.setattr(SecondMeshes, "__iter__", lambda meshes: iter([(meshes._path, SameMesh())]))
    down, aside = np.array([0, 0, -0.5]), np.array([0.2, 0, -0.5])
    (_, state), (_, force) = dragged(down, aside)
    shares = np.arange(1, 6)[:, None] / 5
    (*_, fine), (*_, expected) = dragged(*(shares * down), *(down + shares * (aside - down)))
    assert np.linalg.norm(force - expected) < state.force_error < 2e-3 * np.linalg.norm(force)
    missed, stated = fine.displacement - state.displacement, ERROR_SHARE * state.deviations[1]
    assert np.abs(missed).max() < np.abs(stated).max() < 0.01 * np.abs(state.displacement).max()
    assert np.linalg.norm(missed) < np.linalg.norm(stated)


def test_friction_on_a_symmetric_part_is_that_on_the_whole():
    _, halves = dragged((0, 0, -0.2), (0.1, 0, -0.2))
    _, wholes = dragged((0, 0, -0.2), (0.1, 1e-9, -0.2))
    np.testing.assert_allclose(halves, wholes, atol=1e-7)
    assert abs(wholes[1, 1]) < 1e-7


def test_a_force_with_friction_moves_the_body_until_it_slips(few_elements_under_bodies):
    """As a displacement to the poses that it finds, with hysteresis."""
    by_force = IndenterForce(Indenter("sphere", radius=2.5, friction=0.3))
    forces = [(0, 0, -1.0), (0.15, 0, -1.0), (0.25, 0, -1.0), (0.15, 0, -1.0), (0, 0, 0)]
    *states, free = pressed(*forces, load=by_force)
    for state, force in zip(states, forces, strict=False):
        np.testing.assert_allclose(reactions(state).applied_force, force, atol=4e-6)
        assert reactions(state).imbalance < 1e-8
    moved, _ = dragged(*(state.indenter_moved for state in states))
    for state, other in zip(states, moved, strict=True):
        np.testing.assert_allclose(state.displacement, other.displacement, atol=1e-9)
    there, back = states[1].indenter_moved[0], states[3].indenter_moved[0]
    assert 0 < 1.05 * there < back < states[2].indenter_moved[0]
    assert np.abs(free.displacement).max() < 1e-6
    (at_once,) = pressed((0.15, 0, -1.0), load=by_force)  # down first
    np.testing.assert_array_equal(at_once.displacement, states[1].displacement)
    with pytest.raises(ComputationError, match=r"the indenter slips: the load path ends at force = \(0.2"):
        pressed((0.2999, 0, -1.0), load=by_force)  # less than it would hold on a level surface


def test_a_ball_beside_the_middle_is_dragged(few_elements_under_bodies):
    _, forces = dragged((0, 0, -0.5), (0.2, 0, -0.5), at=(1, 0.6))
    assert forces[1, 0] > forces[0, 0] + 0.2


def test_what_friction_refuses():
    (state,), _ = dragged((0, 0, -0.2))
    with pytest.raises(InputError, match="friction = 0.1 the indenter slips sideways beyond 0.1 N"):
        pressed((0.11, 0, -1.0), load=IndenterForce(Indenter("plane", friction=0.1)))
    with pytest.raises(InputError, match=r"\(0, 0, 1\) is not allowed: an indenter only pushes"):
        pressed((0, 0, 1.0), load=IndenterForce(Indenter("plane", friction=0.1)))
    with pytest.raises(InputError, match="derivatives with friction are not available"):
        linearise(state)
    with pytest.raises(InputError, match="friction = -0.1 is not allowed"):
        Indenter("plane", friction=-0.1)
