"""Pads with Mullins' effect along load paths: first loading, cycles, energy, symmetric parts, friction, the cache."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.mechanics import (
    Indenter,
    IndenterDisplacement,
    IndenterForce,
    MooneyRivlin,
    Mullins,
    NeoHookean,
    PlateDisplacement,
    PlateForce,
    PlateWrench,
    Pressure,
    SpreadForce,
    linearise,
    load_path,
    reactions,
    state_after,
)
from mitsuba_taxel.mechanics.continuation.pad_path import pad_path
from mitsuba_taxel.mechanics.history.timed_path import TimedPath
from mitsuba_taxel.mechanics.history.timed_rows import timed_rows
from mitsuba_taxel.mechanics.load_paths import remembering
from mitsuba_taxel.pads import Pad

PAD, SIZE = Pad(rows=1, columns=1), 3.0
LAW = NeoHookean(1.0, 0.5)
SOFT = Mullins(LAW, 2.0, 0.004, 0.1)
PLATE = PlateDisplacement()
BALL = Indenter(radius=5.0)


def states(values, material=SOFT, load=PLATE):
    return load_path(PAD, material, values, load=load, mesh_size=SIZE)


def plate_forces(found):
    return np.array([reactions(state).applied_force for state in found])


LOADS = [
    (PLATE, [(0, 0, -0.3), (0.2, 0.0, -0.5)], SOFT),
    (PlateForce(), [(0, 0, -1.0), (0.1, 0.05, -1.5)], SOFT),
    (SpreadForce(), [(0, 0, -0.02), (0.005, 0, -0.05)], Mullins(LAW, 2.0, 1e-5, 0.1)),
    (Pressure(), [(0.03,), (0.05,)], SOFT),
]
BALLS = [
    (IndenterDisplacement(BALL), [(0, 0, -0.2), (0, 0, -0.3)]),
    (IndenterForce(BALL), [(0, 0, -0.1), (0, 0, -0.2)]),
]


@pytest.mark.parametrize(("load", "values", "material"), LOADS)
def test_a_first_loading_is_that_of_the_law_and_later_states_are_not(load, values, material, near=3e-4):
    first, *_, again = states([*values, values[0]], material, load)
    elastic, *_ = load_path(PAD, LAW, values[:1], load=load, mesh_size=SIZE)
    largest = np.abs(elastic.displacement).max()
    np.testing.assert_allclose(first.displacement, elastic.displacement, rtol=0, atol=near * largest)
    assert np.abs(again.displacement - elastic.displacement).max() > 5 * near * largest
    assert again.residual < 1e-6
    assert np.isfinite(again.error.displacement)


@pytest.mark.parametrize(("load", "values"), BALLS)
def test_the_same_below_a_ball(load, values, few_elements_under_bodies):
    """Where some strains fall as it moves on."""
    test_a_first_loading_is_that_of_the_law_and_later_states_are_not(load, values, SOFT, near=3e-3)


def test_unloading_and_second_loading_follow_one_softer_curve_and_rejoin_the_first():
    depths = [0.25, 0.5, 0.4, 0.25, 0.0, 0.25, 0.4, 0.5, 0.6]
    forces = -plate_forces(states([(0, 0, -depth) for depth in depths]))[:, 2]
    elastic = -plate_forces(states([(0, 0, -depth) for depth in depths], LAW))[:, 2]
    np.testing.assert_allclose(forces[[0, 1, 8]], elastic[[0, 1, 8]], rtol=1e-5)
    np.testing.assert_allclose(forces[[5, 6, 7]], forces[[3, 2, 1]], rtol=1e-6)
    assert abs(forces[4]) < 1e-8 * forces[1]  # no permanent set
    assert 0.5 * elastic[3] < forces[3] < 0.7 * elastic[3]


def test_the_work_that_a_plate_loses_is_the_energy_dissipated_at_all_points():
    depths = np.concatenate([np.linspace(0, 0.5, 11)[1:], np.linspace(0.5, 0, 21)[1:]])
    values = np.stack([0 * depths, 0 * depths, -depths], axis=1)
    forces = np.append(0.0, -plate_forces(states(values))[:, 2])
    done = np.trapezoid(forces, np.append(0.0, depths))
    path = pad_path(PAD, LAW, PLATE, SIZE)
    timed = TimedPath.of(path, remembering(SOFT))
    rows = timed_rows(SOFT, PLATE, values, None)
    variables, part = timed.reached(rows).variables, timed._pad_for(rows).part
    weight = timed._pad_for(rows).model.assembly.elements.weight
    lost = part.copies * float((weight * SOFT.dissipated(variables.largest_energy)).sum())
    assert done == pytest.approx(lost, rel=4e-3)
    assert lost > 0.1 * np.trapezoid(forces[:11], np.append(0.0, depths[:10]))


@pytest.mark.parametrize("turn", [(0.3, 0.0), (0.2, 0.2)])
def test_a_pad_is_the_same_whole_and_by_its_symmetric_parts(turn):
    """The first rows are solved on an eighth of the pad, the others on a half; and all on the whole pad, whose plate
    moves a trifle to the side."""
    values = [(0, 0, -0.5), (0, 0, -0.2), (*turn, -0.3)]
    aside = np.array([1e-9, 3e-10, 0])
    parts, whole = states(values), states([value + aside for value in values])
    for by_parts, at_once in zip(parts, whole, strict=True):
        np.testing.assert_allclose(by_parts.displacement, at_once.displacement, rtol=0, atol=1e-7)
    np.testing.assert_allclose(plate_forces(parts), plate_forces(whole), rtol=0, atol=1e-6)
    elastic = plate_forces(states(values, LAW))
    assert np.linalg.norm(plate_forces(parts)[2] - elastic[2]) > 0.1 * np.linalg.norm(elastic[2])


def test_board_and_load_balance_with_a_softened_pad():
    for load, values in ((PLATE, [(0, 0, -0.5), (0.1, 0, -0.2)]), (PlateForce(), [(0, 0, -2.0), (0.1, 0, -0.5)])):
        for state in states(values, load=load):
            found = reactions(state)
            np.testing.assert_allclose(found.force, -found.applied_force, atol=1e-7)
            if load is not PLATE:
                np.testing.assert_allclose(found.applied_force, state.value, atol=1e-9)


@pytest.mark.parametrize(
    ("load", "values"),
    [(PLATE, [(0, 0, -0.5), (0.4, 0.0, -0.1)]), (PlateForce(), [(0, 0, -2.0), (0.3, 0, -0.2)])],
)
def test_steps_of_twice_the_length_show_the_error_of_the_steps(load, values):
    """It is small: a strain whose largest energy lies within a step is missed by little."""
    history = timed_rows(SOFT, load, np.array(values), None)
    usual = TimedPath.of(pad_path(PAD, LAW, load, SIZE), remembering(SOFT))
    finer = [values[0], *(tuple(v) for v in np.linspace(values[0], values[1], 17)[1:])]
    reference = state_after(PAD, SOFT, finer, load=load, mesh_size=SIZE).displacement
    here, longer = usual.reached(history).shape.displacement, usual._longer.reached(history).shape.displacement
    missed = np.abs(here - reference).max()
    assert missed < 3 * np.abs(here - longer).max()
    assert missed < 1e-4 * np.abs(reference).max()


def test_friction_and_the_effect_act_together(few_elements_under_bodies):
    """A vanishing effect leaves friction as it is, and vanishing friction the effect."""
    rows = [(0, 0, -0.3), (0.3, 0, -0.3), (0, 0, -0.2)]

    def forces(material, friction):
        return plate_forces(states(rows, material, IndenterDisplacement(Indenter(radius=5.0, friction=friction))))

    rubbed, softened = forces(LAW, 0.4), forces(SOFT, 0.0)
    together = forces(SOFT, 0.4)
    np.testing.assert_allclose(forces(Mullins(LAW, 1e9, 1.0), 0.4), rubbed, rtol=0, atol=1e-6)
    np.testing.assert_allclose(forces(SOFT, 1e-7)[:, 2], softened[:, 2], rtol=3e-3)
    assert np.abs(together[1:] - rubbed[1:]).max() > 0.02 * np.abs(rubbed).max()
    assert abs(together[1, 0]) > 0.02 * abs(together[1, 2])


def test_cached_states_belong_to_their_constants_and_their_rows(fresh):
    rows = [(0, 0, -0.5), (0, 0, -0.2)]
    first = states(rows)[-1].displacement
    fresh()
    assert np.array_equal(states(rows)[-1].displacement, first)  # from disk
    others = [(2.0, 0.004, 0.1), (2.5, 0.004, 0.1), (2.0, 0.005, 0.1), (2.0, 0.004, 0.2)]
    reached = {tuple(plate_forces(states(rows, Mullins(LAW, *constants)))[-1]) for constants in others}
    assert len(reached) == 4
    deeper = states([(0, 0, -0.6), (0, 0, -0.2)])[-1]
    assert abs(plate_forces([deeper])[0, 2]) < 0.99 * abs(plate_forces(states(rows))[-1, 2])


def test_another_law_softens_by_the_same_formula():
    law = MooneyRivlin(0.12, 0.05)
    found, elastic = (plate_forces(states([(0, 0, -0.4), (0, 0, -0.2)], m)) for m in (Mullins(law, 2.0, 0.004), law))
    np.testing.assert_allclose(found[0], elastic[0], atol=1e-5)
    assert 0.5 < found[1, 2] / elastic[1, 2] < 0.8


def test_what_is_not_modelled_is_refused_in_one_line():
    rows = [(0, 0, -0.1)]
    with pytest.raises(InputError, match="does not depend on time, only a Viscoelastic does"):
        load_path(PAD, SOFT, rows, times=[1.0], load=PLATE, mesh_size=SIZE)
    with pytest.raises(InputError, match="'plate_wrench' is not allowed with Mullins' effect"):
        load_path(PAD, SOFT, [(0, 0, -0.1, 0, 0, 0)], load=PlateWrench(), mesh_size=SIZE)
    (state,) = states(rows)
    with pytest.raises(InputError, match="derivatives with Mullins' effect are not available"):
        linearise(state)
