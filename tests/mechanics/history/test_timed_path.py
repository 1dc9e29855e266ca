"""Pads with a memory: closed solutions, limits, stated errors of the steps of time, the same bits for everybody."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.mechanics import (
    Indenter,
    IndenterDisplacement,
    IndenterForce,
    NeoHookean,
    PatchForce,
    PlateDisplacement,
    PlateForce,
    Pressure,
    SpreadForce,
    Viscoelastic,
    linearise,
    load_path,
    local_mesh,
    nodal_fields,
    reactions,
    state_after,
)
from mitsuba_taxel.mechanics.contact import resolution
from mitsuba_taxel.mechanics.contact.indenters import punch
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import LoadedPad
from mitsuba_taxel.mechanics.history import pushed_path, time_steps, timed_states
from mitsuba_taxel.mechanics.history.timed_path import TimedPath
from mitsuba_taxel.pads import Pad

PAD, SIZE, LARGE = Pad(rows=1, columns=1), 3.0, 9.0
"""The sizes in mm of elements, and of those of pads on which a body sticks, which are smaller below it."""
LAW = NeoHookean(1.0, 0.5)
SOFT = Viscoelastic(LAW, ((0.2, 1.0), (0.3, 10.0)))
PLATE = PlateDisplacement()


def states(values, times, material=SOFT, load=PLATE, pad=PAD, size=SIZE):
    return load_path(pad, material, values, times=times, load=load, mesh_size=size)


def plate_forces(found):
    return np.array([reactions(state).applied_force[2] for state in found])


def test_a_held_plate_is_pushed_as_the_prony_series_says_at_finite_strain():
    times = [0, 0.1, 1, 3, 10, 100, 1e9]
    found = states([(0, 0, -0.5)] * len(times), times)
    forces = plate_forces(found)
    np.testing.assert_allclose(forces / forces[0], SOFT.relaxation(np.array(times)), rtol=1e-7)
    (elastic,) = load_path(PAD, LAW, [(0, 0, -0.5)], load=PLATE, mesh_size=SIZE)
    assert forces[0] == pytest.approx(reactions(elastic).applied_force[2], rel=1e-5)  # which is interpolated
    assert all(state.memory.error < 1e-8 for state in found)
    stresses = [
        nodal_fields(s.mesh, s.displacement, s.pressure, s.material, s.memory.overstress).von_mises_stress
        for s in (found[0], found[-1])
    ]
    np.testing.assert_allclose(stresses[1], 0.5 * stresses[0], rtol=1e-6)


def test_in_the_long_run_a_pressed_pad_is_one_of_the_long_term_modulus():
    soft = Viscoelastic(NeoHookean(2.0, 0.5), SOFT.prony)
    force = (0.1, 0.05, -1.0)
    (lasting,) = states([force], [1e9], soft, PlateForce())
    (elastic,) = load_path(PAD, NeoHookean(1.0, 0.5), [force], load=PlateForce(), mesh_size=SIZE)
    assert np.abs(lasting.displacement - elastic.displacement).max() < 2e-4 * np.abs(elastic.displacement).max()


def creep(times):
    """Compliance over that at once, by the eigenvalues of the equations of both terms."""
    shares, rest = SOFT.shares, 1 - SOFT.shares.sum()
    rates = np.linalg.solve(np.eye(2) + np.outer(shares, np.ones(2)) / rest, -np.diag(1 / SOFT.times))
    values, vectors = np.linalg.eig(rates)
    held = (vectors * np.exp(np.outer(times, values))[:, None, :]) @ np.linalg.solve(vectors, shares)
    return (1 - held.sum(axis=1)) / rest


def test_creep_under_a_small_force():
    times = np.array([0, 0.3, 1, 3, 10, 30, 1e9])
    found = states([(0, 0, -1e-4)] * len(times), times, load=PlateForce())
    sunk = np.array([state.displacement[:, 2].min() for state in found])
    np.testing.assert_allclose(sunk / sunk[0], creep(times), rtol=1e-5)
    assert max(np.abs(state.memory.deviation).max() for state in found) < 1e-5 * np.abs(sunk).max()


def depths(found):
    return np.array([-state.indenter_moved[2] for state in found])


def test_creep_below_a_punch_that_sticks(monkeypatch):
    """Its contact neither grows nor slips, so that very small forces, down and sideways, and its place are proportional
    in time, too; on elements of any size, also large ones at its edge."""
    monkeypatch.setattr(punch, "EDGE_FINENESS", 1.2 / local_mesh.FINENESS)
    monkeypatch.setattr(resolution, "DEEPEST_AT_EDGES", 1.0)
    times, force = [0, 0, 0.5], 1e-5
    load, rows = IndenterForce(Indenter("punch", radius=1.4, friction=2.0)), [(0, 0, -force), *[(force, 0, -force)] * 2]
    found = states(rows, times, load=load, size=LARGE)
    at_once, later = (state.indenter_moved[[0, 2]] for state in found[1:])
    np.testing.assert_allclose(later / at_once, creep(np.array([0.5]))[0], rtol=1e-3)
    for state, asked in zip(found, rows, strict=True):
        np.testing.assert_allclose(reactions(state).applied_force, asked, atol=1e-5 * force)


BALL = IndenterForce(Indenter("sphere", radius=5.0))


def test_a_force_on_a_ball_is_met_by_long_term_and_by_instantaneous_silicone(few_elements_under_bodies):
    soft, force = Viscoelastic(NeoHookean(2.0, 0.5), SOFT.prony), (0, 0, -0.3)
    at_once, lasting = (states([force], [time], soft, BALL) for time in (0, 1e7))
    for found, modulus in ((at_once, 2.0), (lasting, 1.0)):
        (elastic,) = load_path(PAD, NeoHookean(modulus, 0.5), [force], load=BALL, mesh_size=SIZE)
        assert depths(found)[0] == pytest.approx(depths([elastic])[0], rel=5e-4)


def test_forces_with_friction_that_jump_are_those_of_the_elastic_pad(few_elements_under_bodies):
    """And met, also where a sideways force is held while the normal one grows."""
    load, rows = IndenterForce(Indenter("sphere", radius=5.0, friction=0.3)), [(0, 0, -0.3), (0.03, 0, -0.3)]
    rows = [*rows, (0.03, 0, -0.5)]
    elastic = load_path(PAD, LAW, rows, load=load, mesh_size=LARGE)
    for one, other, asked in zip(states(rows, [0, 0, 0], load=load, size=LARGE), elastic, rows, strict=True):
        np.testing.assert_allclose(one.displacement, other.displacement, atol=1e-9)
        np.testing.assert_allclose(reactions(one).applied_force, asked, atol=1e-6)


def test_a_force_that_grows_needs_no_rows_on_its_way(few_elements_under_bodies):
    """The depth with a row between is that without, and the ball is pushed as asked in each."""
    asked = np.array([-0.05, -0.1])
    rows = states([(0, 0, force) for force in asked], [0.4, 0.8], load=BALL)
    (whole,) = states([(0, 0, asked[-1])], [0.8], load=BALL)
    np.testing.assert_allclose(plate_forces(rows), asked, rtol=1e-5)
    assert depths([whole])[0] == pytest.approx(depths(rows)[-1], rel=1e-4)


def test_a_body_that_does_not_settle_is_told(few_elements_under_bodies, monkeypatch):
    monkeypatch.setattr(pushed_path, "POSE_TOLERANCE", 0.0)
    monkeypatch.setattr(pushed_path, "MOST_HALVINGS", 1)
    with pytest.raises(ComputationError, match="the indenter does not settle between 0 and 0.3 s"):
        states([(0, 0, -0.12)], [0.6], load=BALL)


UP, DOWN = np.arange(1, 7) / 6, np.arange(5, -1, -1) / 6
WEAK, STRONG = ((0.2, 1.0), (0.1, 10.0)), ((0.5, 1.0), (0.3, 30.0))
HISTORIES = {
    "loops": (WEAK, np.concatenate([UP, DOWN, UP, DOWN]), 1.5 * np.arange(1, 25)),
    "jumps": (WEAK, np.repeat([1.0, 0.0], [7, 4]), np.append(0.02 * 4.0 ** np.arange(7), 81.92 + np.arange(4))),
    "ramp, hold, back": (STRONG, np.concatenate([UP, np.ones(6), DOWN, np.zeros(4)]), 1.0 * np.arange(1, 23)),
    "cycles": (STRONG, 0.6 + 0.4 * np.sin(2 * np.pi * np.arange(1, 13) / 8), 0.9 * np.arange(1, 13)),
}


@pytest.mark.parametrize("history", HISTORIES)
def test_the_stated_error_of_time_steps_is_at_least_half_the_true_one_in_every_row(history, monkeypatch):
    """Through turns, holds and jumps, at strains of 10 to 50 %, against paths of tolerances a hundredth of these."""
    prony, way, times = HISTORIES[history]
    soft = Viscoelastic(NeoHookean(1.0, 0.49), prony)
    values = way[:, None] * np.array([0, 0, -0.7 if prony is WEAK else -0.4])
    found = states(values, times, soft, SpreadForce())
    for module in (time_steps, timed_states):
        monkeypatch.setattr(module, "TIME_TOLERANCE", 1e-5)
        monkeypatch.setattr(module, "INTERPOLATION_TOLERANCE", 1e-6)
    TimedPath.of.cache_clear()
    exact = states(values, times, soft, SpreadForce())
    TimedPath.of.cache_clear()
    stated, of_exact = (np.array([np.abs(at.memory.deviation).max() for at in path]) for path in (found, exact))
    true = np.array([np.abs(a.displacement - b.displacement).max() for a, b in zip(found, exact, strict=True)])
    largest = max(np.abs(state.displacement).max() for state in exact)
    assert np.all(true <= 2 * stated + of_exact)
    assert true.max() < 5e-4 * largest
    assert stated.max() < 3 * true.max() + 1e-4 * largest


def test_steps_of_a_steady_load_lead_beyond_its_rows(monkeypatch):
    """There and back in 36 rows, against as many that are not quite on a line, each of which is solved."""
    solved = []
    solve = LoadedPad.solve_after
    monkeypatch.setattr(LoadedPad, "solve_after", lambda *given, **named: (solved.append(1), solve(*given, **named))[1])
    way = np.concatenate([np.arange(1, 19), np.arange(17, -1, -1)]) / 18
    values, times = way[:, None] * np.array([0, 0, -1.0]), 0.5 * np.arange(1, 37)
    found, few = states(values, times, load=SpreadForce()), len(solved)
    off = 1 + 1e-7 * np.random.default_rng(0).standard_normal((36, 1))
    each = states(off * values, times, load=SpreadForce())
    assert few < 0.25 * (len(solved) - few)
    largest = max(np.abs(state.displacement).max() for state in each)
    for one, other in zip(found, each, strict=True):
        stated = np.abs(one.memory.deviation).max() + np.abs(other.memory.deviation).max()
        assert np.abs(one.displacement - other.displacement).max() < min(2 * stated, 5e-4 * largest)
    assert max(reactions(state).imbalance for state in found[:-1]) < 1e-4


def test_creep_and_relaxation_at_even_times():
    times = np.arange(33) * 0.5
    sunk = np.array([s.displacement[:, 2].min() for s in states([(0, 0, -1e-4)] * 33, times, load=PlateForce())])
    np.testing.assert_allclose(sunk / sunk[0], creep(times), rtol=2e-3)
    forces = plate_forces(states([(0, 0, -0.5)] * 33, times))
    np.testing.assert_allclose(forces / forces[0], SOFT.relaxation(times), rtol=1e-5)


def test_small_cycles_have_the_storage_and_loss_modulus():
    omega, count = 0.5, 16  # steps of a cycle, between which straight lines have (2 pi / count)^2 / 12 less amplitude
    time = np.arange(1, 2 * count + 1) * 2 * np.pi / omega / count
    found = states([(0, 0, 1e-3 * np.sin(omega * t)) for t in time], time)
    forces = plate_forces(found)[count:]
    stiffness = plate_forces(states([(0, 0, 1e-3)], [0.0]))[0]
    wave = np.exp(-1j * omega * time[count:])
    modulus = 2j * (forces * wave).mean() / stiffness
    x = omega * SOFT.times
    transient = SOFT.shares @ np.exp(-time[count] / SOFT.times)
    exact = 1 - SOFT.shares.sum() + (SOFT.shares * 1j * x / (1 + 1j * x)).sum()
    assert modulus.real == pytest.approx(exact.real, abs=0.01 + 0.3 * transient)
    assert modulus.imag == pytest.approx(exact.imag, abs=0.01 + 0.3 * transient)


def test_quick_and_slow_terms_in_one_series_and_steps_of_any_length():
    wild = Viscoelastic(LAW, ((0.5, 1e-6), (0.4999, 1e6)))
    times = np.array([0, 1e-9, 1e-6, 1.0, 1e6, 1e9])
    forces = plate_forces(states([(0, 0, -0.3)] * len(times), times, wild))
    np.testing.assert_allclose(forces / forces[0], wild.relaxation(times), rtol=1e-6)
    found = states([(0, 0, -1e-6)] * 3, [0, 1.0, 1e12], wild, PlateForce())
    sunk = np.array([state.displacement[:, 2].min() for state in found])
    np.testing.assert_allclose(sunk / sunk[0], [1, 2, 1e4], rtol=1e-3)
    (lasting,) = load_path(PAD, NeoHookean(1e-4, 0.5), [(0, 0, -1e-6)], load=PlateForce(), mesh_size=SIZE)
    assert sunk[-1] == pytest.approx(lasting.displacement[:, 2].min(), rel=2e-5)


@pytest.mark.parametrize(
    ("load", "value"),
    [
        (SpreadForce(), (0.02, 0.01, -0.5)),
        (PatchForce((0.5, 0.2), (2.0, 2.0)), (0, 0, -0.2)),
        (PlateForce(), (0, 0.1, -0.5)),
        (PLATE, (0.1, 0, -0.3)),
        (Pressure(), (0.01,)),
        (IndenterDisplacement(Indenter("sphere", radius=200.0)), (0, 0, -0.05)),
    ],
)
def test_every_load_is_balanced_through_a_loop(load, value):
    value = np.array(value)
    way = [0 * value, value * [0, 0, 1] if len(value) == 3 else value, value, 0.5 * value, 0 * value]
    found = states(way[1:], [1.0, 2.0, 2.5, 4.0], load=load)
    for state in found[:-1]:
        assert reactions(state).imbalance < 1e-6
        assert state.stability_checked
    assert np.abs(found[-1].displacement).max() > 1e-3  # the loop is open
    assert reactions(found[-1]).imbalance < 1e-5


ROWS = [(0, 0, -0.2), (0.05, 0, -0.2), (0, 0, -0.1)]


def same(one, other):
    return np.array_equal(one.displacement, other.displacement) and np.array_equal(one.pressure, other.pressure)


def test_a_state_depends_on_the_rows_before_it_alone():
    together = states(ROWS, [1, 2, 3])
    TimedPath.of.cache_clear()  # what is on disk remains
    for count in (3, 1, 2):
        assert same(
            together[count - 1], state_after(PAD, SOFT, ROWS[:count], [1, 2, 3][:count], load=PLATE, mesh_size=SIZE)
        )
    other = states([ROWS[0], (0, 0, -0.3)], [1, 2])
    assert same(together[0], other[0])
    assert not same(together[1], other[1])


def test_a_state_between_solved_ones_depends_on_the_rows_before_it_alone():
    rows, times = [(0, 0, -0.02 * k) for k in (1, 2, 3, 4, 5, 6, 7, 7, 6)], [1, 2, 3, 4, 5, 6, 7, 8, 9]
    together = states(rows, times)
    TimedPath.of.cache_clear()
    for count in (6, 9, 4, 8, 5):
        alone = state_after(PAD, SOFT, rows[:count], times[:count], load=PLATE, mesh_size=SIZE)
        assert same(together[count - 1], alone)
        np.testing.assert_array_equal(together[count - 1].memory.overstress, alone.memory.overstress)


def test_a_quicker_load_meets_a_stiffer_pad():
    forces = [plate_forces(states([(0, 0, -0.3)], [time]))[0] for time in (1e-3, 1.0, 1e5)]
    assert forces[0] < forces[1] < forces[2] < 0
    assert forces[2] / forces[0] == pytest.approx(0.5, rel=2e-3)


def test_a_second_mesh_tells_the_error():
    (state,) = states([(0, 0, -0.3)], [1.0])
    assert 0 < state.error.relative < 0.5
    assert 0 < state.force_error < abs(reactions(state).applied_force[2])
    assert state.deviations.shape == (2, *state.displacement.shape)


def test_the_error_of_a_path_that_goes_on_includes_the_reach():
    """At once, as much as that of the elastic pad: a twelfth of the whole near the touch."""
    pytest.importorskip("ipctk")
    on, value = PlateDisplacement(self_contact=True), (0, 0, -0.8)
    (state,), (elastic,) = states([value], [0.0], load=on), load_path(PAD, LAW, [value], load=on, mesh_size=SIZE)
    (without,) = states([value], [0.0])
    assert state.force_error == pytest.approx(elastic.force_error, rel=1e-3)
    assert state.force_error > 1.05 * without.force_error
    assert state.error.relative == pytest.approx(elastic.error.relative, rel=1e-3)


def test_a_path_that_ends_says_when():
    with pytest.raises(ComputationError, match=r"the load path ends at displacement = \(0, 0, -.* mm, 0\..* s\."):
        states([(0, 0, -4.5)], [1.0])


def test_a_pad_that_gives_way_under_a_held_load_ends_when_it_does_however_long_it_is_to_be_held():
    """Also where all that happens is a billionth of the way between two rows."""
    ends = []
    for held in (50.0, 1e9):
        with pytest.raises(ComputationError, match="touches itself") as ended:
            states([(0, 0, -0.3)] * 2, [1e-9, held], Viscoelastic(LAW, ((0.99, 1.0),)), SpreadForce())
        ends.append(float(str(ended.value).split()[-2]))
    assert 20 < ends[0] < 30 and ends[1] == pytest.approx(ends[0], rel=0.1)


@pytest.mark.parametrize(
    ("times", "words"),
    [
        (None, "times are missing"),
        ([1], "times"),
        ([1, 0.5], r"times\[1\] = 0.5 s is not allowed: at least 1 s"),
        ([-1, 0], r"times\[0\] = -1 s"),
        ([0, np.inf], "times"),
    ],
)
def test_times_that_no_load_has_are_refused(times, words):
    with pytest.raises(InputError, match=words):
        states([(0, 0, -0.1)] * 2, times)


def test_other_refusals():
    with pytest.raises(InputError, match="does not depend on time"):
        states([(0, 0, -0.1)], [1.0], LAW)
    with pytest.raises(InputError, match="without friction an indenter only pushes"):
        states([(0.1, 0, -0.1)], [1.0], load=BALL)
    with pytest.raises(InputError, match="viscoelastic silicone are not available"):
        linearise(states([(0, 0, -0.3)], [1.0])[0])
