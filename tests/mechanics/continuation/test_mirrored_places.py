"""Bodies at places that symmetries of the pad map onto each other, against solutions at each place itself."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.mechanics import (
    Indenter,
    IndenterDisplacement,
    IndenterForce,
    NeoHookean,
    linearise,
    load_path,
    reactions,
    state_at_rest,
)
from mitsuba_taxel.mechanics.contact.barriers.self_contact import Contact
from mitsuba_taxel.mechanics.continuation.load_path_ends import LoadPathEnds, end_of_path
from mitsuba_taxel.mechanics.continuation.mirrored_places import canonical_place, solved_by_symmetry
from mitsuba_taxel.mechanics.continuation.pad_path import pad_path
from mitsuba_taxel.mechanics.errors.second_state import second_state
from mitsuba_taxel.pads import Pad

PAD, LAW, SIZE = Pad("parallelepiped", 2, 2), NeoHookean(4.16), 2.5
DOWN = (0.0, 0.0, -0.18)
PLACES = ((1.2, 0.7), (-1.2, 0.7), (0.7, 1.2), (-0.7, -1.2))


def ball(at, kind=IndenterDisplacement, **of_body):
    return kind(Indenter("sphere", radius=9.0, at=at, **of_body))


def pressed(at, value=DOWN, pad=PAD, **settings):
    return load_path(pad, LAW, [value], load=ball(at), mesh_size=SIZE, **settings)[0]


def roofs(state):
    """Centres, and mean displacements, of the roofs and sides of each cell."""
    of_cells = (state.mesh.faces[state.mesh.face_cell == cell] for cell in range(1, 5))
    nodes = [np.unique(faces) for faces in of_cells]
    return np.array([[field[n].mean(axis=0) for n in nodes] for field in (state.mesh.points, state.displacement)])


@pytest.mark.parametrize("at", [PLACES[1], PLACES[3]])
def test_a_mirrored_state_is_that_of_its_own_place(at):
    """Solved there on elements of its own; cells have the numbers of their positions."""
    state = pressed(at)
    own = pad_path(PAD, LAW, ball(at), SIZE).state(np.array(DOWN))
    force, own_force = (reactions(each).applied_force for each in (state, own))
    assert reactions(state).imbalance < 1e-8
    np.testing.assert_allclose(force, own_force, atol=2e-3 * abs(own_force[2]))
    (centres, moved), (own_centres, own_moved) = roofs(state), roofs(own)
    np.testing.assert_allclose(centres, own_centres, atol=0.1)
    np.testing.assert_allclose(moved, own_moved, atol=0.01 * np.abs(own_moved).max())
    assert state.load == ball(at) and (state.value == DOWN).all() and (state.indenter_moved == DOWN).all()
    assert state.mesh.points[np.abs(state.displacement[:, 2]).argmax(), :2] == pytest.approx(at, abs=0.3)


def test_error_rate_and_derivatives_are_mirrored():
    """The rate along the path, against derivatives by the tangent on the mirrored mesh."""
    here, there = (pressed(at) for at in PLACES[:2])
    assert there.error == here.error and there.force_error == here.force_error
    np.testing.assert_array_equal(there.deviations * (-1, 1, 1), here.deviations)
    rate, tangent = there.path_rate(), linearise(there)
    np.testing.assert_allclose(tangent.by_value(rate.direction), rate.displacement, atol=1e-3)
    shift = tangent.by_place((1.0, 0.0)) * (-1, 1, 1)
    np.testing.assert_allclose(shift, linearise(here).by_place((-1.0, 0.0)), atol=1e-6)
    seconds = [second_state(PAD, LAW, DOWN, load=ball(at), mesh_size=SIZE) for at in PLACES[:2]]
    np.testing.assert_array_equal(seconds[1].state.displacement * (-1, 1, 1), seconds[0].state.displacement)


def test_the_pad_at_rest_is_on_the_same_elements():
    rest = state_at_rest(PAD, LAW, [DOWN], load=ball(PLACES[1]), mesh_size=SIZE)
    assert rest.mesh is pressed(PLACES[1]).mesh and not rest.displacement.any()


def test_by_force_and_dragged_a_place_is_the_same():
    dragged = load_path(PAD, LAW, [(-1.2, 0.7, -0.18)], load=ball((0.0, 0.0)), mesh_size=SIZE)[0]
    np.testing.assert_array_equal(dragged.displacement, pressed(PLACES[1]).displacement)
    np.testing.assert_array_equal(dragged.value, (-1.2, 0.7, -0.18))
    force = (0.0, 0.0, -1.0)
    states = [load_path(PAD, LAW, [force], load=ball(at, IndenterForce), mesh_size=SIZE)[0] for at in PLACES[:2]]
    np.testing.assert_array_equal(states[0].displacement * (-1, 1, 1), states[1].displacement)
    assert reactions(states[1]).applied_force[2] == pytest.approx(-1.0, abs=1e-6)


def test_only_symmetries_of_pad_and_body_are_used():
    def mirrors(indenter, pad=PAD):
        path = pad_path(pad, LAW, IndenterDisplacement(indenter), SIZE)
        return [mirror.name for mirror in canonical_place(path, np.zeros(3))[2]]

    assert mirrors(Indenter("sphere", radius=9.0, at=(-0.7, -1.2))) == ["x", "y", "xy"]
    assert mirrors(Indenter("sphere", radius=9.0, at=(1.2, 0.7))) == []
    oblong = Pad("parallelepiped", 1, 2)
    assert mirrors(Indenter("sphere", radius=9.0, at=(-0.7, -1.2)), oblong) == ["x", "y"]
    assert mirrors(Indenter("cylinder", radius=9.0, at=(-0.7, -1.2))) == ["x", "y"]
    assert mirrors(Indenter("cylinder", radius=9.0, at=(-0.7, -1.2), angle=30)) == []
    assert mirrors(Indenter("punch", radius=1.0, at=(-0.7, -1.2), tilt=5)) == ["y"]


def test_obstacles_are_where_they_are():
    """A block in one cell, 0.03 mm below its roof, which only a ball above that cell touches."""
    low = pressed((1.8, 1.8))
    (cell,) = [c for c in range(1, 5) if roofs(low)[0][c - 1, 0] > 0 and roofs(low)[0][c - 1, 1] > 0]
    roof = low.mesh.points[low.mesh.faces[low.mesh.face_cell == cell]][..., 2].max()
    x, y = roofs(low)[0][cell - 1, :2]
    corners = np.array([[i, j, k] for i in (-0.3, 0.3) for j in (-0.3, 0.3) for k in (-0.4, -0.03)]) + (x, y, roof)
    sides = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    block = np.array([corners[list(t)] for a, b, c, d in sides for t in ((a, b, c), (a, c, d))])
    assert pressed((-1.8, 1.8), obstacles=block).displacement.any()
    with pytest.raises(ComputationError, match=r"touches .* near \(-1\.\d+, 1\.\d+, "):
        pressed((-1.8, 1.8), obstacles=block * (-1, 1, 1))


@pytest.mark.parametrize(
    ("value", "reason", "stated"),
    [
        ((0.0, 0.0, -0.3), "touches the board", "near (-0.7, -1.2, 0.1) mm"),
        ((0.0, 0.0, -0.3), "cannot be loaded further", "ends at displacement = (0, 0, -0.3) mm"),
    ],
)
def test_a_place_that_fails_is_solved_once(value, reason, stated):
    """Its message has the point of contact at its own place: at the canonical one, x = 1.2 and y = 0.7."""
    path, solved = pad_path(PAD, LAW, ball(PLACES[3]), SIZE), []
    touched = np.array([1.2, 0.7, 0.1] if "touches" in reason else [np.nan] * 3)

    def solve(at, there, obstacles):
        solved.append(at.load.indenter.at)
        raise end_of_path(at.mesh, at.load, np.array(value), reason, touched, None)

    with pytest.raises(LoadPathEnds) as end:
        solved_by_symmetry(path, np.array(DOWN), None, solve)
    assert solved == [(1.2, 0.7)] and stated in str(end.value)
    assert end.value.load == path.load and (end.value.value == value).all()
    contact = Contact("the board", (-0.7, -1.2, 0.1)) if "touches" in reason else None
    assert end.value.contact == contact


def test_a_place_is_solved_where_its_message_cannot_be_mirrored():
    """A sideways end, and a fold, whose point no error keeps."""
    path = pad_path(PAD, LAW, ball(PLACES[3]), SIZE)
    for value, fold in (((0.1, 0.0, -0.3), None), ((0.0, 0.0, -0.3), (1.2, 0.7, 0.1))):
        solved = []

        def solve(at, there, obstacles, value=value, fold=fold, solved=solved):
            solved.append(at.load.indenter.at)
            raise end_of_path(at.mesh, at.load, np.array(value), "ends", np.full(3, np.nan), None, fold)

        with pytest.raises(LoadPathEnds):
            solved_by_symmetry(path, np.array(DOWN), None, solve)
        assert solved == [(1.2, 0.7), PLACES[3]]
