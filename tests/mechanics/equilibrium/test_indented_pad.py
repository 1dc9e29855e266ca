"""Paths of pads that a rigid body presses on."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.mechanics import (
    Indenter,
    IndenterDisplacement,
    IndenterForce,
    NeoHookean,
    PlateDisplacement,
    SpreadForce,
    contact_pressure,
    linearise,
    load_path,
    reactions,
)
from mitsuba_taxel.mechanics.contact.indentation import Indentation
from mitsuba_taxel.mechanics.continuation.load_path_ends import LoadPathEnds
from mitsuba_taxel.mechanics.continuation.load_segment import LoadSegment
from mitsuba_taxel.mechanics.continuation.pad_path import pad_path
from mitsuba_taxel.mechanics.elements.assembly import Assembly
from mitsuba_taxel.mechanics.elements.constraints import number_unknowns
from mitsuba_taxel.mechanics.elements.nodal_forces import glued_force
from mitsuba_taxel.mechanics.elements.symmetry import node_images
from mitsuba_taxel.mechanics.equilibrium.indented_pad import IndentedPad
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import LoadedPad
from mitsuba_taxel.mechanics.errors.second_meshes import SecondMeshes, carried_to
from mitsuba_taxel.pads import Pad

pytestmark = pytest.mark.usefixtures("mechanics_error_unknown")

PAD, SIZE, LAW = Pad("hemispheric", rows=1, columns=1), 3.0, NeoHookean()
BALL = IndenterDisplacement(Indenter("sphere", radius=2.5))
ASIDE = IndenterDisplacement(Indenter("sphere", radius=2.5, at=(0.8, 0.0)))


def pressed(*values, load=BALL, pad=PAD, material=LAW):
    return load_path(pad, material, values, load=load, mesh_size=SIZE)


def test_bodies_take_few_more_factorisations_than_a_plate(few_elements_under_bodies, monkeypatch):
    """On the same way: a ball at most 1.5 times as many, a punch 2 times, and a dragged ball 10."""
    made, factored = [], LoadedPad._factored
    monkeypatch.setattr(LoadedPad, "_factored", lambda pad, lower: made.append(1) or factored(pad, lower))

    def count(load, *way):
        made.clear()
        pressed(way, load=load)
        return len(made)

    per_mm = count(PlateDisplacement(), 0, 0, -0.8) / 0.8
    assert count(BALL, 0, 0, -0.8) / 0.8 < 1.5 * per_mm
    assert count(IndenterDisplacement(Indenter("punch", radius=1.5)), 0, 0, -0.6) / 0.6 < 2 * per_mm
    assert count(IndenterDisplacement(Indenter("sphere", radius=2.5, friction=0.3)), 0.2, 0, -0.5) <= 10


def test_the_board_holds_what_the_body_does(few_elements_under_bodies):
    shallow, deep = pressed((0, 0, -0.2), (0, 0, -0.5))
    for state in (shallow, deep):
        held = reactions(state)
        assert held.imbalance < 1e-8
        assert held.force[2] > 0.1
    assert reactions(deep).force[2] > 3 * reactions(shallow).force[2]


def test_what_the_body_does_is_stored_in_the_pad():
    """The derivative of the energy by the depth is the force, that of what the body sinks in included."""

    def energy(state):
        mesh = state.mesh
        elements = Assembly(mesh, LAW, number_unknowns(mesh, np.zeros(len(mesh.points), bool))).elements
        here = slice(None)
        gradient = elements.gradient(here, state.displacement) + np.eye(3)
        pressure = elements.pressures(here, state.pressure)
        density = LAW.energy(gradient) + LAW.compressibility / 2 * pressure**2
        body = Indentation(mesh, BALL.indenter, LAW.youngs_modulus)
        sunk = body.contact_state(state.displacement, state.value)
        return (elements.weight * density).sum() + 0.5 * (body.slack * sunk.pressure**2).sum()

    depths = 0.4 + 5e-4 * np.array([-1, 0, 1])
    states = pressed(*((0, 0, -depth) for depth in depths))
    forces = [reactions(state).force[2] for state in states]
    done = (depths[2] - depths[0]) * (forces[0] + 4 * forces[1] + forces[2]) / 6
    assert energy(states[2]) - energy(states[0]) == pytest.approx(done, rel=1e-5)


def test_points_between_nodes_are_inside_by_less_on_smaller_elements():
    """Where means around nodes are bounded by the stiffness of contact."""

    def inside(size):
        (state,) = load_path(PAD, LAW, [(0, 0, -0.3)], load=BALL, mesh_size=size)
        body = Indentation(state.mesh, BALL.indenter, LAW.youngs_modulus)
        here = body.contact_state(state.displacement, state.value)
        pressed = here.pressure[body.numbers] > 0
        assert (-here.gap / body.area).max() < 4e-4 * 0.3
        for faces in (pressed.all(axis=1), pressed.any(axis=1)):  # without and with those at the border of the contact
            depths = np.maximum(-here.gaps.size.reshape(len(body.faces), -1)[faces], 0)
            yield depths.max(), np.sqrt(np.square(depths).mean())

    ((coarse, rough), (border, bent)), ((fine, smooth), (finer_border, straighter)) = inside(3.0), inside(0.9)
    assert fine < 1.3e-3 and coarse > 1.5 * fine
    assert smooth < 8e-4 * 0.3 and rough > 3 * smooth
    assert finer_border < 1.5e-3 and border > 3 * finer_border
    assert straighter < 1.2e-3 * 0.3 and bent > 4 * straighter


def test_a_force_presses_as_deep_as_it_takes(few_elements_under_bodies):
    (moved,) = pressed((0, 0, -0.3), load=ASIDE)
    force = reactions(moved).applied_force[2]
    by_force = IndenterForce(ASIDE.indenter)
    (pushed,) = pressed((0, 0, force), load=by_force)
    np.testing.assert_allclose(pushed.displacement, moved.displacement, atol=1e-8)
    assert reactions(pushed).applied_force[2] == pytest.approx(force)
    assert reactions(pushed).imbalance < 1e-8
    np.testing.assert_allclose(contact_pressure(pushed), contact_pressure(moved), atol=1e-5)
    more, less = pressed((0, 0, force * 1.001), (0, 0, force * 0.999), load=by_force)
    difference = (more.displacement - less.displacement) / (0.002 * abs(force))
    rate = pushed.path_rate()
    np.testing.assert_allclose(rate.displacement, difference, atol=2e-2 * np.abs(difference).max())
    (at_rest,) = pressed((0, 0, 0), load=by_force)
    assert not at_rest.displacement.any()


@pytest.mark.parametrize("force", [-0.05, -0.7, -2.6])
def test_the_depth_under_a_force_takes_few_solves(force, few_elements_under_bodies, monkeypatch):
    """At most six beyond the steps of the path, with three factors of the pad, and the state there is kept."""
    by_force, solve, factor = IndenterForce(ASIDE.indenter), IndentedPad._solved, LoadedPad._factored
    path = pad_path(PAD, LAW, by_force, SIZE)
    path.driven.canonical(np.array([0.0, 0.0, -0.6]), [], None)
    solved, factored = [], []
    monkeypatch.setattr(IndentedPad, "_solved", lambda *all, **more: solved.append(1) or solve(*all, **more))
    monkeypatch.setattr(LoadedPad, "_factored", lambda pad, lower: factored.append(1) or factor(pad, lower))
    moved = path.driven_to(np.array([0.0, 0.0, force]), None)
    assert 0.0 < -moved[2] < 0.6 and 1 < len(solved) <= 6 and len(factored) <= 3
    count = len(solved)
    state = path.canonical(np.array([0.0, 0.0, force]), [], None)
    path.rate_by_depth(np.array([0.0, 0.0, force]))
    assert len(solved) == count
    assert glued_force(path.mesh, LAW, *state[:2])[2] == pytest.approx(-force, rel=1e-6)


def test_a_path_under_a_force_ends_in_newtons(fresh):
    """At the force by which the reactions balance the body that is moved as far."""
    with pytest.raises(LoadPathEnds, match=r"ends at force = \(0, 0, -.*\) N, displacement = \(0, 0, -.*\) mm") as end:
        pressed((0, 0, -100.0), load=IndenterForce(BALL.indenter))
    moved = float(re.search(r"displacement = \(0, 0, (.*)\) mm", str(end.value))[1])
    (state,) = pressed((0, 0, 0.9999 * moved))
    assert end.value.value[2] == pytest.approx(reactions(state).applied_force[2], rel=2e-3)
    assert end.value.load.quantity == "force"


@pytest.mark.parametrize(
    ("value", "at", "said"),
    [
        ((0, 0, 1.0), 0.0, "an indenter only pushes"),
        ((0.1, 0, -1.0), 0.0, "an indenter only pushes"),
        ((0, 0, -1.0), 50.0, "touches nothing"),
    ],
)
def test_a_force_that_no_body_can_bear(value, at, said):
    with pytest.raises(InputError, match=said):
        pressed(value, load=IndenterForce(Indenter("sphere", radius=2.5, at=(at, 0.0))))


def test_the_contact_pressure_adds_up_to_the_force():
    (state,) = pressed((0, 0, -0.4))
    pressure, places = contact_pressure(state), state.mesh.points
    pieces = state.mesh.faces[:, [[0, 3, 5], [1, 4, 3], [2, 5, 4], [3, 4, 5]]].reshape(-1, 3)
    a, b, c = (places[pieces[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    across = np.linalg.norm((places + state.displacement)[:, :2], axis=1) / BALL.indenter.radius
    downwards = pressure * np.sqrt(1 - np.minimum(across, 1) ** 2)
    assert area @ downwards[pieces].mean(axis=1) == pytest.approx(reactions(state).force[2], rel=5e-3)
    assert pressure.min() == 0 and np.linalg.norm(places[pressure.argmax()] - [0, 0, PAD.height]) < 0.5
    (free,) = load_path(PAD, LAW, [(0, 0, -0.1)], mesh_size=SIZE)
    assert not contact_pressure(free).any()


def test_a_symmetric_part_is_the_whole(few_elements_under_bodies):
    (state,) = pressed((0, 0, -0.3), load=ASIDE)
    whole = IndentedPad(state.mesh, LAW, ASIDE)
    unknowns = whole.equilibrium(whole.gather(1.001 * state.displacement, state.pressure), state.value)
    np.testing.assert_allclose(whole.split(unknowns)[0], state.displacement, atol=1e-9)
    assert len(node_images(state.mesh)) == 1
    assert 2 * IndentedPad(state.mesh, LAW, ASIDE, tuple(node_images(state.mesh)), node_images(state.mesh)).unknowns < (
        1.2 * whole.unknowns
    )


def test_a_moved_body_is_one_that_starts_there():
    """Without friction a pad does not know how the body came."""
    (moved,) = pressed((0.4, 0.0, -0.3), load=BALL)
    (placed,) = pressed((0.0, 0.0, -0.3), load=IndenterDisplacement(Indenter("sphere", radius=2.5, at=(0.4, 0.0))))
    np.testing.assert_allclose(reactions(moved).force, reactions(placed).force, rtol=0.02, atol=0.01)


def test_states_are_the_same_in_any_order(few_elements_under_bodies):
    together = pressed((0, 0, -0.25), (0, 0, -0.4))
    kept = pressed((0, 0, -0.25))[0]
    few_elements_under_bodies()
    alone = pressed((0, 0, -0.25))[0]
    for state in (kept, alone):
        np.testing.assert_array_equal(state.displacement, together[0].displacement)


def test_a_body_that_does_not_touch_leaves_the_pad_at_rest(few_elements_under_bodies):
    beside = IndenterDisplacement(Indenter("sphere", radius=1.0, at=(50.0, 0.0)))
    for load, value in ((beside, (0, 0, -0.5)), (BALL, (0, 0, 0.1)), (BALL, (0.2, 0, 0))):
        (state,) = pressed(value, load=load)
        assert not state.displacement.any()


def test_derivatives_are_those_of_differences():
    (state,) = pressed((0, 0, -0.4))
    tangent, step = linearise(state), 1e-4
    ahead, behind = pressed((0, 0, -0.4 + step), (0, 0, -0.4 - step))
    by_depth = (ahead.displacement - behind.displacement) / (2 * step)
    np.testing.assert_allclose(tangent.by_value((0, 0, 1)), by_depth, atol=2e-3)
    sideways = tangent.by_value((1, 0, 0))
    (aside,) = pressed((0.02, 0, -0.4))
    np.testing.assert_allclose(sideways, (aside.displacement - state.displacement) / 0.02, atol=0.05)
    np.testing.assert_array_equal(tangent.by_place((1, 0)), sideways)
    softer, stiffer = (pressed((0, 0, -0.4), material=LAW.changed(youngs_modulus=e))[0] for e in (4.15, 4.17))
    assert np.abs(stiffer.displacement - softer.displacement).max() < 1e-9  # of depth alone
    assert np.abs(tangent.by_material("youngs_modulus")).max() < 1e-7


def test_derivatives_under_a_force_are_those_of_differences(few_elements_under_bodies):
    """The body moves on until the force is as before."""
    by_force, value = IndenterForce(ASIDE.indenter), (0, 0, -2.0)
    (state,) = pressed(value, load=by_force)
    tangent, rng = linearise(state), np.random.default_rng(3)
    rate = state.path_rate()
    np.testing.assert_allclose(tangent.by_value(rate.direction), rate.displacement, atol=1e-7)
    more, less = (pressed(value, load=by_force, material=LAW.changed(youngs_modulus=e))[0] for e in (4.17, 4.15))
    stiffer = tangent.by_material("youngs_modulus")
    np.testing.assert_allclose(
        stiffer, (more.displacement - less.displacement) / 0.02, atol=1e-4 * np.abs(stiffer).max()
    )
    velocity = 0.1 * rng.normal(size=state.mesh.points.shape)
    velocity[np.isclose(state.mesh.points[:, 2], PAD.height), 2] = 0.3  # or another node is the highest

    def under_force(mesh, aside=0.0):
        pad, moved = IndentedPad(mesh, LAW, ASIDE), state.indenter_moved + (aside, 0, 0)
        unknowns = pad.gather(state.displacement, state.pressure)
        for _ in range(2):
            unknowns = pad.equilibrium(unknowns, moved)
            pressing = pad.model.indentation.contact_state(pad.split(unknowns)[0], moved)
            moved = moved - [0, 0, (pressing.force[2] - value[2]) / tangent._stiffness]
        return pad.split(unknowns)[0]

    for changed, found in (
        (lambda step: under_force(replace(state.mesh, points=state.mesh.points + step * velocity)),
         tangent.by_shape(velocity)),
        (lambda step: under_force(state.mesh, step), tangent.by_place((1, 0))),
    ):  # fmt: skip
        expected = (changed(1e-4) - changed(-1e-4)) / 2e-4
        np.testing.assert_allclose(found, expected, atol=1e-3 * np.abs(expected).max())
    gradient = rng.normal(size=velocity.shape)
    pulled = tangent.pull_back(gradient, {"any": velocity})
    assert pulled.value[2] == pytest.approx(np.vdot(gradient, tangent.by_value((0, 0, 1))))
    assert pulled.material["youngs_modulus"] == pytest.approx(np.vdot(gradient, stiffer))
    assert pulled.shape["any"] == pytest.approx(np.vdot(gradient, tangent.by_shape(velocity)))
    with pytest.raises(InputError, match="without friction an indenter only pushes, along z"):
        tangent.by_value((1, 0, 0))


def test_forces_change_with_the_shape_as_differences_say():
    (state,) = pressed((0, 0, -0.4))
    velocity = np.random.default_rng(2).normal(size=state.mesh.points.shape)
    velocity[np.isclose(state.mesh.points[:, 2], PAD.height), 2] = 0.3  # or another node is the highest
    body = Indentation(state.mesh, BALL.indenter, LAW.youngs_modulus)
    rate = body.shape_rate(state.displacement, state.value, velocity)

    def pushed(step):
        mesh = replace(state.mesh, points=state.mesh.points + step * velocity)
        other = Indentation(mesh, BALL.indenter, LAW.youngs_modulus)
        return other.contact_state(state.displacement, state.value).nodal_forces

    step = 1e-9
    np.testing.assert_allclose((pushed(step) - pushed(-step)) / (2 * step), rate, atol=1e-4 * np.abs(rate).max())


def test_a_state_on_another_mesh_needs_no_path_of_its_own(few_elements_under_bodies):
    (state,) = pressed((0, 0, -0.4), load=ASIDE)
    other = pad_path(PAD, LAW, ASIDE, 2.0, judged=False)
    jumped, *_ = carried_to(other, state.mesh, state.value, state.displacement, state.pressure)
    walked, *_ = other.canonical(state.value, [], None)
    np.testing.assert_allclose(jumped, walked, atol=1e-7)


@pytest.mark.parametrize(("load", "force"), [(ASIDE, -1.5), (BALL, -4.0)])
def test_a_state_under_a_force_on_another_mesh_needs_no_path_of_its_own(
    load, force, few_elements_under_bodies, monkeypatch
):
    """The body on it is moved until the pad presses on the board with the force."""
    by_force, value = IndenterForce(load.indenter), np.array([0, 0, force])
    (state,) = pressed(value, load=by_force)
    other, arguments = pad_path(PAD, LAW, by_force, 2.0, judged=False), (state.displacement, state.pressure)
    with monkeypatch.context() as patch:
        patch.setattr(LoadSegment, "extend", None)
        jumped, _, _, moved = carried_to(other, state.mesh, value, *arguments, state.indenter_moved)
    walked, squeezed, _ = other.canonical(value, [], None)
    np.testing.assert_allclose(jumped, walked, atol=1e-7)
    assert 0 < abs(moved[2] - state.indenter_moved[2]) < 0.1 * abs(moved[2])
    assert glued_force(other.mesh, LAW, jumped, squeezed)[2] == pytest.approx(-force, rel=1e-6)


def test_meshes_finer_than_one_whose_path_ends_are_not_tried(monkeypatch):
    class Ends:
        load = SpreadForce()

        def __init__(self, mesh_size):
            self.mesh_size, self.asked = mesh_size, False

        def canonical(self, *state):
            self.asked = True
            raise ComputationError("the load path ends")

    others = [Ends(2 * SIZE), Ends(0.7 * SIZE), Ends(0.5 * SIZE)]
    monkeypatch.setattr(SecondMeshes, "__iter__", lambda meshes: iter([(other, None) for other in others]))
    monkeypatch.setattr(SecondMeshes, "coarsest", lambda meshes: iter(()))
    (state,) = pressed((0, 0, -0.2))
    assert state.error is None and state.deviations is None
    assert [other.asked for other in others] == [True, True, False]


def test_elements_are_small_where_the_body_touches():
    mesh = pad_path(PAD, LAW, ASIDE, PAD.default_mesh_size).mesh
    top = mesh.points[mesh.faces[mesh.faces[:, :3].max(axis=1) >= 0][:, :3]]
    middle = top.mean(axis=1)
    longest = np.linalg.norm(top - np.roll(top, 1, axis=1), axis=2).max(axis=1)
    under = np.linalg.norm(middle - [0.8, 0.0, PAD.height], axis=1) < 0.4
    assert longest[under].max() < 0.5
    assert longest[~under].max() > 0.8


def test_a_ball_that_is_smaller_than_a_usual_step_does_not_go_through_the_surface():
    """By Hertz, within what the finite depth and elements of half the contact's radius make."""
    radius, depth = 0.05, 0.005
    load, values = IndenterDisplacement(Indenter(radius=radius)), [(0, 0, -depth), (0, 0, -radius)]
    shallow, deep = load_path(PAD, LAW, values, load=load, mesh_size=1.25)
    modulus = LAW.youngs_modulus / (1 - LAW.poisson_ratio**2)
    expected = 4 / 3 * modulus * np.sqrt(radius) * depth**1.5
    assert reactions(shallow).force[2] == pytest.approx(expected, rel=0.05)
    assert reactions(deep).force[2] > 15 * expected


def test_a_tilted_plate_presses_wherever_it_is():
    at, elsewhere = (Indenter("plane", tilt=5.0, at=(x, 0.0)) for x in (0.0, 1.0))
    (state,), (other,) = (pressed((0, 0, -0.2), load=IndenterDisplacement(body)) for body in (at, elsewhere))
    np.testing.assert_array_equal(state.displacement, other.displacement)
    held = reactions(state)
    assert held.imbalance < 1e-8 and held.force[2] > 1 and held.moment[1] < -0.5 * held.force[2]
    assert not linearise(state).by_place((1, 0)).any()
