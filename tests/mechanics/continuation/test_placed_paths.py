"""Bodies that are dragged: what must not depend on where, how far, which way, and in which units."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.mechanics import (
    Indenter,
    IndenterDisplacement,
    IndenterForce,
    NeoHookean,
    SpreadForce,
    load_path,
    reactions,
)
from mitsuba_taxel.mechanics.contact.indentation import Indentation
from mitsuba_taxel.mechanics.continuation.load_path_ends import LoadPathEnds, end_of_path
from mitsuba_taxel.mechanics.continuation.pad_path import PadPath, pad_path
from mitsuba_taxel.mechanics.elements.assembly import Assembly
from mitsuba_taxel.mechanics.elements.constraints import number_unknowns
from mitsuba_taxel.mechanics.equilibrium.solution import UNSTABLE
from mitsuba_taxel.mechanics.errors.second_meshes import share_of
from mitsuba_taxel.pads import REGIONS, Pad

SIZES = {"cell_size": 0.4, "cell_height": 0.4, "height": 2.0, "wall": 1.3}
BLOCK, SIZE, LAW = Pad("parallelepiped", 1, 1, **SIZES), 0.8, NeoHookean()


def ball(radius=1.0, at=(0.0, 0.0), friction=0.0):
    return IndenterDisplacement(Indenter("sphere", radius=radius, at=at, friction=friction))


def moved(*values, load, pad=BLOCK, material=LAW, mesh_size=SIZE):
    return load_path(pad, material, values, load=load, mesh_size=mesh_size)


def force_of(state):
    return reactions(state).applied_force


def test_a_dragged_body_is_one_that_starts_there(few_elements_under_bodies):
    """Equal to the bit, with the value and the load that were given."""
    load = ball(4.0)
    dragged, back = moved((0.5, 0.2, -0.05), (0.02, 0, -0.05), load=load)
    (placed,) = moved((0, 0, -0.05), load=ball(4.0, at=(0.5, 0.2)))
    np.testing.assert_array_equal(dragged.displacement, placed.displacement)
    np.testing.assert_array_equal(dragged.value, (0.5, 0.2, -0.05))
    np.testing.assert_array_equal(dragged.indenter_moved, dragged.value)
    assert dragged.load == load
    assert reactions(dragged).imbalance < 1e-8
    assert back.mesh is not dragged.mesh and back.value[0] == 0.02
    (above,) = moved((0.5, 0.2, 0.1), load=load)
    assert not above.displacement.any()


def test_the_end_of_a_path_is_where_the_body_was_dragged(monkeypatch):
    def ends(path, value, obstacles):
        raise end_of_path(path.mesh, path.load, 0.9 * value, "touches the board", np.zeros(3), None)

    monkeypatch.setattr(PadPath, "state", ends)
    said = r"touches the board near .* the load path ends at displacement = \(0\.5, 0\.2, -0\.09\) mm"
    with pytest.raises(LoadPathEnds, match=said) as ended:
        moved((0.5, 0.2, -0.1), load=ball())
    assert ended.value.load == ball() and ended.value.contact is not None
    np.testing.assert_allclose(ended.value.value, (0.5, 0.2, -0.09))


def test_an_unstable_end_under_a_body_says_that_smaller_elements_may_bear_it():
    path = pad_path(BLOCK, LAW, IndenterDisplacement(Indenter("punch", radius=0.5)), SIZE)
    reason, value = f"cannot be loaded further ({UNSTABLE})", np.array([0, 0, -0.1])
    said = str(end_of_path(path.mesh, path.load, value, reason, np.full(3, np.nan), None))
    assert said.endswith(
        "displacement = (0, 0, -0.1) mm. The elements may be too large at the edge of the contact: try a smaller "
        "mesh_size."
    )
    assert "smaller" not in str(end_of_path(path.mesh, SpreadForce(), value, reason, np.full(3, np.nan), None))


def test_larger_elements_are_as_small_under_a_body():
    def under(mesh_size):
        mesh = pad_path(BLOCK, LAW, ball(), mesh_size).mesh
        top = mesh.points[mesh.faces[mesh.face_region == REGIONS["top"]][:, :3]]
        near = np.linalg.norm(top.mean(axis=1)[:, :2], axis=1) < 0.2
        return np.linalg.norm(top - np.roll(top, 1, axis=1), axis=2).max(axis=1)[near].max()

    assert under(1.5) < 1.5 * under(SIZE) < 0.45
    assert under(0.5 * BLOCK.default_mesh_size) < 0.7 * under(SIZE)


def test_a_small_ball_is_felt_on_large_elements():
    """Within the stated error of those of the usual size."""
    pad, load = Pad("parallelepiped", 1, 1), ball(0.4)
    (coarse,) = load_path(pad, LAW, [(1.0, 0, -0.08)], load=load, mesh_size=4.0)
    (usual,) = load_path(pad, LAW, [(1.0, 0, -0.08)], load=load)
    difference = np.linalg.norm(force_of(coarse) - force_of(usual))
    assert difference < 2 * coarse.force_error < 0.1 * np.linalg.norm(force_of(usual))


def test_an_error_of_no_force_is_all_of_it():
    assert share_of(0.2, np.array([0, 0, -4.0])) == 0.05
    assert share_of(0.2, np.zeros(3)) == 1.0
    assert share_of(0.0, np.zeros(3)) == 0.0


@pytest.mark.parametrize("by_force", [False, True])
def test_elements_are_fine_enough_for_a_body_that_is_hardly_in(by_force):
    """By Hertz; the tip of one is between nodes, where faces almost twice half the contact's width are too large."""
    depth = 1e-3
    hertz = 4 / 3 * LAW.youngs_modulus / (1 - LAW.poisson_ratio**2) * depth**1.5
    if by_force:
        (state,) = moved((0, 0, -hertz), load=IndenterForce(ball().indenter))
        assert -state.indenter_moved[2] == pytest.approx(depth, rel=0.06)
    else:
        (state,) = moved((0.3, 0, -depth), load=ball())
        assert -force_of(state)[2] == pytest.approx(hertz, rel=0.03)


def test_what_no_elements_resolve_is_refused():
    with pytest.raises(ComputationError, match=r"too large for an indenter 1e-07 mm deep at \(0.5, 0\) mm"):
        moved((0.5, 0, -1e-7), load=ball())
    with pytest.raises(ComputationError, match=r"too large for an indenter 0.0003 mm deep at \(0, 0\) mm"):
        moved((0, 0, -3e-4), load=ball(friction=0.3))


def test_the_force_is_the_same_all_over_a_block_and_without_friction_not_sideways():
    forces = np.array([force_of(*moved((*place, -0.02), load=ball())) for place in ((0, 0), (-0.25, 0.3))])
    np.testing.assert_allclose(forces[:, 2], forces[0, 2], rtol=0.02)
    assert np.hypot(forces[:, 0], forces[:, 1]).max() < 5e-3 * abs(forces[0, 2])


WAY = ((0, 0, -0.06), (0.3, 0, -0.06))


def rubbed(turn=((1, 0), (0, 1)), rows=WAY, lengths=1.0, modulus=1.0):
    """Forces of a ball that is dragged with friction, turned back, in units of the first.

    It is large, so that its contact needs no small elements."""
    turn = np.pad(np.array(turn, dtype=float), (0, 1))
    turn[2, 2] = 1.0
    pad = Pad("parallelepiped", 1, 1, **{name: lengths * size for name, size in SIZES.items()})
    material = LAW.changed(youngs_modulus=modulus * LAW.youngs_modulus)
    load, values = ball(9.0 * lengths, friction=0.3), lengths * np.array(rows) @ turn.T
    states = moved(*values, load=load, pad=pad, material=material, mesh_size=1.5 * lengths)
    return states, np.array([force_of(state) for state in states]) @ turn / (modulus * lengths**2)


def test_friction_is_the_same_which_way_a_body_is_dragged_and_in_which_units(few_elements_under_bodies):
    states, forces = rubbed()
    assert all(reactions(state).imbalance < 1e-7 for state in states)
    assert forces[1, 0] == pytest.approx(-0.3 * forces[1, 2], rel=0.05)  # it slips all over
    assert abs(forces[:, 1]).max() < 1e-9
    for changed in ({"turn": ((-1, 0), (0, 1))}, {"turn": ((0, -1), (1, 0))}):
        np.testing.assert_allclose(rubbed(**changed)[1], forces, atol=0.01 * abs(forces[0, 2]))
    np.testing.assert_allclose(rubbed(lengths=2.0, modulus=3.0)[1], forces, atol=1e-6)


def test_a_state_depends_on_rows_up_to_its_own(few_elements_under_bodies):
    together, _ = rubbed(rows=(WAY[0], (0.8, 0, -0.06)))
    few_elements_under_bodies()
    alone, _ = rubbed(rows=WAY[:1])
    np.testing.assert_array_equal(alone[0].displacement, together[0].displacement)
    assert len(together[1].mesh.tets) > len(together[0].mesh.tets)


def test_work_is_stored_or_rubbed_away(few_elements_under_bodies):
    """By trapezoids along the way, of the body's force and of tractions times slip."""
    rows = [(x, 0, -0.06) for x in np.linspace(0, 0.12, 7)]
    states, forces = rubbed(rows=rows)
    (mesh,) = {state.mesh for state in states}
    load = states[0].load
    body = Indentation(mesh, load.indenter, LAW.youngs_modulus)
    elements = Assembly(mesh, LAW, number_unknowns(mesh, np.zeros(len(mesh.points), bool))).elements

    def energy(state):
        gradient = elements.gradient(slice(None), state.displacement) + np.eye(3)
        pressure = elements.pressures(slice(None), state.pressure)
        density = LAW.energy(gradient) + LAW.compressibility / 2 * pressure**2
        sunk = body.contact_state(state.displacement, state.value)
        return (elements.weight * density).sum() + 0.5 * (body.slack * sunk.pressure**2).sum()

    work = lost = 0.0
    for before, after, first, second in zip(states, states[1:], forces, forces[1:], strict=False):
        way = after.value - before.value
        work += 0.5 * (first + second) @ way
        slip = body.carried @ (after.displacement - before.displacement - way)
        lost -= 0.5 * np.vdot(body.at_nodes(before.traction) + body.at_nodes(after.traction), slip)
    stored = energy(states[-1]) - energy(states[0])
    assert lost > 0.1 * work > 0
    assert work == pytest.approx(stored + lost, rel=0.02)
