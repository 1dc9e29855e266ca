"""The canonical path: states at any force, the same to the bit whoever asks, right between the nodes."""

from __future__ import annotations

import dataclasses
import math
import re
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.mechanics import NeoHookean, SpreadForce, Viscoelastic, load_path
from mitsuba_taxel.mechanics.contact.barriers.self_contact import ContactTest
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import LoadedPad
from mitsuba_taxel.mechanics.equilibrium.solution import Rejected
from mitsuba_taxel.mechanics.errors.mesh_sizes import mesh_size_for
from mitsuba_taxel.pads import REGIONS, Pad

PAD = Pad("hemispheric", rows=1, columns=1)
SIZE = 1.2


def states(forces, material=None, pad=PAD, size=SIZE):
    return load_path(pad, material or NeoHookean(), np.array(forces, dtype=float), mesh_size=size)


def same(a, b):
    return (
        np.array_equal(a.displacement, b.displacement)
        and np.array_equal(a.pressure, b.pressure)
        and (a.min_jacobian, a.residual) == (b.min_jacobian, b.residual)
    )


def test_no_force_needs_no_solve(fresh, monkeypatch):
    monkeypatch.setattr(LoadedPad, "solve_symmetric", None)
    (state,) = states([(0, 0, 0)])
    assert not state.displacement.any() and not state.pressure.any()
    assert state.min_jacobian == 1


def test_states_come_in_the_order_of_the_forces_with_honest_figures():
    forces = [(0, 0, -1.0), (0, 0, 0), (0.4, 0.3, -1.0), (0, 0, 0.5), (0.2, 0, 0)]
    for force, state in zip(forces, states(forces), strict=True):
        np.testing.assert_array_equal(state.value, force)
        bottom = np.unique(state.mesh.faces[state.mesh.face_region == REGIONS["bottom"]])
        assert not state.displacement[bottom].any()
        assert state.residual < 1e-4  # of the interpolation
        assert 0 < state.min_jacobian <= 1
        assert state.stability_checked
        assert np.all(np.isfinite(state.displacement)) and np.all(np.isfinite(state.pressure))
        top = state.mesh.points[:, 2] == PAD.height
        mean = state.displacement[top].mean(axis=0)
        pushed = np.nonzero(force)[0]
        np.testing.assert_array_equal(np.sign(mean[pushed]), np.sign(force)[pushed])


@pytest.mark.parametrize(
    "force", [(0, 0, -0.17), (0, 0, -1.23), (0, 0, 0.61), (0.37, 0, -0.9), (0.3, -0.21, -0.9), (0.11, 0.05, 0)]
)
def test_between_the_nodes_the_state_is_that_of_a_direct_solve(force):
    (state,) = states([force])
    pad = LoadedPad(state.mesh, NeoHookean())
    solution, _ = pad.solve(np.zeros(pad.unknowns), np.array(force, dtype=float))
    displacement, pressure = pad.split(solution.unknowns)
    largest = np.abs(displacement).max()
    assert np.abs(state.displacement - displacement).max() < 1e-4 * largest
    assert np.abs(state.pressure - pressure).max() < 1e-3 * np.abs(pressure).max()


def test_a_state_is_the_same_to_the_bit_whoever_asks(fresh):
    forces = [(0, 0, -0.3), (0, 0, -1.1), (0.3, 0.1, -0.7), (0, 0, -1.4), (0.5, 0.0, -0.7)]
    together = states(forces)
    again = states(forces[::-1])[::-1]
    fresh()
    from_disk = [states([force])[0] for force in forces]
    for a, b, c in zip(together, again, from_disk, strict=True):
        assert same(a, b) and same(a, c)


def test_seconds_are_those_of_the_way_there_whoever_solved_it(fresh):
    forces = [(0, 0, 0), (0, 0, -0.3), (0, 0, -1.5), (0.3, 0, -0.3), (0.3, 0, -1.5)]
    solved = [state.seconds for state in states(forces)]
    rest, little, much, little_aside, much_aside = solved
    assert 0 == rest < little <= much < much_aside and little < little_aside
    fresh()
    assert [states([force])[0].seconds for force in forces] == solved


def test_a_state_does_not_depend_on_what_else_was_solved(fresh, monkeypatch, tmp_path):
    alone = states([(0, 0, -0.4), (0.2, 0.1, -0.4)])
    monkeypatch.setenv("MITSUBA_TAXEL_CACHE", str(tmp_path / "another"))
    fresh()
    states([(0, 0, -1.6), (0.7, 0.35, -0.4), (0, 0, 1.0)])
    among_others = states([(0, 0, -0.4), (0.2, 0.1, -0.4)])
    for a, b in zip(alone, among_others, strict=True):
        assert same(a, b)


def test_threads_share_a_path(fresh):
    forces = [(0, 0, -0.2 * k) for k in range(1, 5)]
    with ThreadPoolExecutor(4) as pool:
        shared = list(pool.map(lambda force: states([force])[0], forces))
    for a, b in zip(shared, states(forces), strict=True):
        assert same(a, b)


def test_many_steps_cost_few_solves(fresh, monkeypatch):
    count = 0
    solve = LoadedPad.solve_symmetric

    def counting(self, *arguments):
        nonlocal count
        count += 1
        return solve(self, *arguments)

    monkeypatch.setattr(LoadedPad, "solve_symmetric", counting)
    states([(0, 0, -0.05 * k) for k in range(41)])
    assert count < 12


def test_a_symmetric_pad_answers_symmetrically():
    """Opposite tangential forces give mirrored states (nodes matched by their mirrored places)."""
    right, left = states([(0.4, 0, -0.8), (-0.4, 0, -0.8)])
    points = np.round(right.mesh.points, 9) + 0.0
    mirrored = points * (-1, 1, 1) + 0.0
    order, image = (np.lexsort(p.T) for p in (points, mirrored))
    np.testing.assert_allclose(
        left.displacement[order], right.displacement[image] * (-1, 1, 1), atol=2e-4 * np.abs(right.displacement).max()
    )


def test_forces_scale_with_young_s_modulus():
    """Twice as stiff under twice the force: the same shape, and twice the pressure."""
    (soft,) = states([(0.1, 0, -0.8)], NeoHookean(2.0, 0.45))
    (stiff,) = states([(1.0, 0, -8.0)], NeoHookean(20.0, 0.45))
    np.testing.assert_allclose(stiff.displacement, soft.displacement, atol=1e-9)
    np.testing.assert_allclose(stiff.pressure, 10 * soft.pressure, atol=1e-8)


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.4999, 0.5])
def test_compressible_and_incompressible_alike(nu):
    (state,) = states([(0.2, 0, -1.0)], NeoHookean(4.16, nu))
    assert state.min_jacobian > 0.6
    pad = LoadedPad(state.mesh, NeoHookean(4.16, nu))
    deformed = pad.model.assembly.evaluate(state.displacement, state.pressure, with_tangent=False)
    assert deformed.min_jacobian >= state.min_jacobian  # that of a state is taken at the nodes as well


def test_a_force_too_large_says_where_the_path_ends(fresh):
    message = r"^the pad cannot be loaded further \(.*\): the load path ends at force = \(0, 0, (-1\d\.\d+)\) N\."
    with pytest.raises(ComputationError, match=message) as caught:
        states([(0, 0, -500.0)])
    assert "\n" not in str(caught.value)
    reached = float(re.match(message, str(caught.value)).group(1))
    (last,) = states([(0, 0, math.floor(10 * reached + 1) / 10)])  # just before: the good states are kept
    assert last.min_jacobian > 0


def test_an_end_in_a_fold_says_how_to_prevent_it(fresh, monkeypatch):
    """Which is looked for in the last state."""
    states([(0, 0, -1.0)])

    def gives_up(*_):
        raise Rejected("said")

    monkeypatch.setattr(LoadedPad, "solve_symmetric", gives_up)
    monkeypatch.setattr(ContactTest, "find_fold", lambda test, moved: (0.4, 0.3, 1.2) if moved.any() else None)
    end = r"\(said\): .* \(0, 0, -1\.\d*\) N\. .* folded .* near \(0.4, 0.3, 1.2\) mm: self_contact = true prevents"
    with pytest.raises(ComputationError, match=end):
        states([(0, 0, -30.0)])


@pytest.mark.parametrize(
    "forces", [[(0, 0, math.nan)], [(0, 0, -math.inf)], [(0, 0)], (0, 0, -1.0), [("a", "b", "c")], [(0, 0, None)]]
)
def test_forces_that_are_none_are_refused(forces):
    with pytest.raises(
        InputError, match=r"^force values(\[0\])? = .* are not allowed: .*three finite numbers are needed"
    ):
        load_path(PAD, NeoHookean(), forces, mesh_size=SIZE)


def test_no_forces_no_states():
    assert load_path(PAD, NeoHookean(), np.zeros((0, 3)), mesh_size=SIZE) == []


def test_progress_counts_the_states():
    calls = []
    load_path(PAD, NeoHookean(), [(0, 0, -0.1), (0, 0, -0.2)], mesh_size=SIZE, progress=lambda *c: calls.append(c))
    assert calls == [(1, 2), (2, 2)]


def test_solving_prints_nothing(fresh, capfd):
    states([(0, 0, -0.1)])
    assert capfd.readouterr() == ("", "")


def test_states_are_values():
    (state,) = states([(0, 0, -0.1)])
    with pytest.raises(dataclasses.FrozenInstanceError):
        state.value = None


def test_more_states_than_can_be_held_are_refused_before_any_is_solved():
    forces = np.linspace([0, 0, 0], [0, 0, -20.0], 1_000_000)
    with pytest.raises(InputError, match=r"^1000000 values of a load are not allowed: at most \d+ states"):
        load_path(PAD, NeoHookean(), forces, mesh_size=SIZE)


REACHED = [(1_000, "the finest mesh tried, of"), (10, "elements can be estimated")]


@pytest.mark.parametrize(("most", "words"), REACHED)
def test_a_mesh_tolerance_out_of_reach_is_refused_before_memory_ends(monkeypatch, most, words):
    monkeypatch.setattr("mitsuba_taxel.mechanics.errors.mesh_sizes.MOST_ELEMENTS_TRIED", most)
    with pytest.raises(InputError, match=f"mesh_tolerance = 1e-09 is not allowed: .*{words}"):
        mesh_size_for(PAD, NeoHookean(), SpreadForce(), 1e-9)


@pytest.mark.parametrize("material", [NeoHookean(), Viscoelastic(NeoHookean(1.0), ((0.3, 1.0),))])
def test_two_threads_solve_two_pads_at_once(material, fresh, monkeypatch, tmp_path):
    """Each waits in its first solve until the other is in one, too, and finds the bits that it finds alone."""
    times = [1.0] if isinstance(material, Viscoelastic) else None
    balanced, met, meeting = LoadedPad._balanced, threading.local(), threading.Barrier(2)

    def solved(wall):
        pad = dataclasses.replace(PAD, wall=wall)
        (state,) = load_path(pad, material, [(0, 0, -0.5)], times=times, mesh_size=3.0)
        return state.displacement

    def together(pad, *start):
        if not hasattr(met, "turn"):
            met.turn = meeting.wait(timeout=60)
        return balanced(pad, *start)

    alone = [solved(wall) for wall in (1.0, 1.2)]
    fresh()
    monkeypatch.setenv("MITSUBA_TAXEL_CACHE", str(tmp_path / "another"))
    monkeypatch.setattr(LoadedPad, "_balanced", together)
    with ThreadPoolExecutor(2) as pool:
        at_once = list(pool.map(solved, (1.0, 1.2)))
    for displacement, expected in zip(at_once, alone, strict=True):
        np.testing.assert_array_equal(displacement, expected)
