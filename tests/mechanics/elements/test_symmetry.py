"""Solving on a part of a symmetric pad: the same states, the same judgement of stability."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.geometry.mirror import ACROSS_DIAGONAL, ACROSS_SECOND_DIAGONAL, ACROSS_X, ACROSS_Y, MIRRORS
from mitsuba_taxel.mechanics import (
    NeoHookean,
    PatchForce,
    PlateDisplacement,
    PlateForce,
    Pressure,
    SpreadForce,
    load_path,
)
from mitsuba_taxel.mechanics.elements.model import Model
from mitsuba_taxel.mechanics.elements.solvers import make_solver
from mitsuba_taxel.mechanics.elements.symmetry import node_images, part_between, unsymmetric_blocks
from mitsuba_taxel.mechanics.equilibrium import loaded_pad as equilibrium
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import LoadedPad
from mitsuba_taxel.mechanics.equilibrium.solution import Rejected
from mitsuba_taxel.pads import Pad

pytestmark = pytest.mark.usefixtures("mechanics_error_unknown")

LAW = NeoHookean()
SQUARE, OBLONG = Pad(rows=1, columns=1), Pad(rows=1, columns=2)
SIZE = 3.0

HALVES = [[mirror] for mirror in MIRRORS]
QUARTERS = [[ACROSS_X, ACROSS_Y], [ACROSS_SECOND_DIAGONAL, ACROSS_DIAGONAL]]
EIGHTH = [list(MIRRORS)]
GROUPS = HALVES + QUARTERS + EIGHTH


def names(mirrors):
    return "".join(f"({mirror.name})" for mirror in mirrors)


def label(part):
    """A short name of a test's parameter."""
    if isinstance(part, tuple):
        return str(part)
    return "" if isinstance(part, list | bool | float) else type(part).__name__


@pytest.fixture
def mesh(symmetric_block):
    return symmetric_block((3.6, 3.6, 3.0), (2, 2, 3))


@pytest.fixture
def images(mesh):
    return node_images(mesh)


CASES = [
    (SpreadForce(), (0, 0, -2), GROUPS),
    (SpreadForce(), (0.5, 0, -1), [[ACROSS_Y]]),
    (SpreadForce(), (0.3, -0.3, 1), [[ACROSS_SECOND_DIAGONAL]]),
    (PatchForce((0, 0), (1, 1)), (0, 0, -1), EIGHTH),
    (PatchForce((0, 0), (1, 2)), (0, 0, -1), [[ACROSS_X, ACROSS_Y]]),
    (PatchForce((0.5, 0), (1, 1)), (0.1, 0, -1), [[ACROSS_Y]]),
    (PatchForce((0.5, -0.5), (1, 1)), (0, 0, -1), [[ACROSS_SECOND_DIAGONAL]]),
    (PlateForce(), (0, 0, -2), QUARTERS + EIGHTH),
    (PlateForce(), (0, 0.4, -2), [[ACROSS_X]]),
    (PlateForce(), (0.3, 0.3, -1), [[ACROSS_DIAGONAL]]),
    (PlateDisplacement(), (0, 0, -0.1), QUARTERS + EIGHTH),
    (PlateDisplacement(), (0.1, 0, -0.1), [[ACROSS_Y]]),
    (PlateDisplacement(), (0.1, -0.1, 0.1), [[ACROSS_SECOND_DIAGONAL]]),
    (Pressure(), (0.1,), GROUPS),
    (Pressure(), (-0.1,), EIGHTH),
]


@pytest.mark.parametrize(("load", "value", "groups"), CASES, ids=label)
def test_a_part_has_the_state_of_the_whole(load, value, groups, mesh, images, monkeypatch):
    """Displacement, pressure, their rates, and the force on a plate, to rounding once Newton's method goes on to it."""
    monkeypatch.setattr(equilibrium, "RESIDUAL_TOLERANCE", 1e-12)
    value = np.array(value, dtype=float)

    def solved(mirrors):
        pad = LoadedPad(mesh, LAW, load, mirrors, images)
        solution, linearised = pad.solve(np.zeros(pad.unknowns), value)
        assert solution.stability_checked
        state = pad.split(solution.unknowns)
        rates = pad.split(pad.rate(linearised, solution.unknowns, value))
        plate = pad.plate_force(solution.unknowns) if load.bonded_plate else np.zeros(3)
        np.testing.assert_allclose(pad.split(pad.gather(*state))[0], state[0], atol=1e-15)
        return pad.unknowns, [*state, *rates, plate], solution.min_jacobian

    unknowns, whole, least = solved([])
    for mirrors in groups:
        fewer, part, least_of_part = solved(mirrors)
        assert fewer < 1.5 * unknowns / {1: 2, 2: 4, 4: 8}[len(mirrors)]
        for wanted, found in zip(whole, part, strict=True):
            np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-10 * max(np.abs(wanted).max(), 0.1))
        assert least_of_part == pytest.approx(least, abs=1e-10)


# What the parts leave out is not lost: the tangent of the whole falls into blocks.


def surplus(model, displacement, pressure, value):
    """Negative eigenvalues of the tangent beyond those of the pressures, and how many unknowns there are."""
    state = model.evaluate(*model.part.restrict(displacement, pressure), value)
    negative = make_solver().factor(model.assembly.matrix(state.entries)).negative_pivots
    return np.array([negative - model.numbering.pressures, model.numbering.displacements, model.numbering.pressures])


SYMMETRIC_LOADS = [
    (SpreadForce(), (0, 0, -1.0), False),
    (PlateForce(), (0, 0, -1.0), False),
    (PlateDisplacement(), (0, 0, 0), True),
    (Pressure(), (1.0,), False),
    (Pressure(), (-1.0,), False),
]


@pytest.mark.parametrize(("load", "value", "held"), SYMMETRIC_LOADS, ids=label)
def test_the_blocks_have_the_inertia_of_the_whole(load, value, held, symmetric_block):
    """At rest, and at columns compressed far beyond where they buckle in one way after the other."""
    mesh = symmetric_block((1.0, 1.0, 5.0), (1, 1, 4))
    images = node_images(mesh)
    assert set(images) == set(MIRRORS)
    unstable = []
    for strain in (0.0, 0.3, 0.6):
        state = mesh.points * [0.3 * strain, 0.3 * strain, -strain], np.full(mesh.corner_count, -2 * strain)
        state = *state, strain * np.array(value)
        whole = surplus(Model(part_between(mesh, {}, ()), LAW, load, {}, held), *state)
        for mirrors in GROUPS:
            part = part_between(mesh, images, mirrors)
            total = surplus(Model(part, LAW, load, dict.fromkeys(part.walls, 1), held), *state)
            blocks = unsymmetric_blocks(mirrors)
            for index, (group, signs) in enumerate(blocks):
                of_pairs = len(mirrors) == len(MIRRORS) and index == len(blocks) - 1
                model = Model(part_between(mesh, images, group), LAW, load, signs, held)
                total += (2 if of_pairs else 1) * surplus(model, *state)
            np.testing.assert_array_equal(total, whole, err_msg=names(mirrors))
        unstable.append(whole[0])
    assert unstable[0] == 0 < unstable[1] < unstable[2]


# Clamped below; above free, or a plate that slides but does not turn, or that is moved.
EULER = [(SpreadForce(), 0.25), (PlateForce(), 1.0), (PlateDisplacement(), 4.0)]


@pytest.mark.parametrize("mirrors", QUARTERS + EIGHTH, ids=names)
@pytest.mark.parametrize(("load", "factor"), EULER, ids=label)
def test_a_column_that_buckles_out_of_its_symmetry_is_rejected(load, factor, mirrors, symmetric_block):
    """Euler's load, factor pi² E I / L², from the symmetric part, which by itself stays stable."""
    length, law = 12.0, NeoHookean(4.16, 0.3)
    mesh = symmetric_block((1.0, 1.0, length), (1, 1, 12))
    pad = LoadedPad(mesh, law, load, mirrors, node_images(mesh))
    strain = factor * np.pi**2 / 12 / length**2
    euler = strain * length if isinstance(load, PlateDisplacement) else strain * 4.16
    below, linearised = pad.solve(np.zeros(pad.unknowns), np.array([0, 0, -0.8 * euler]))
    assert below.stability_checked
    beyond = np.array([0, 0, -1.2 * euler])
    with pytest.raises(Rejected, match="unstable"):
        pad.solve(below.unknowns, beyond)
    guess = below.unknowns + 0.5 * pad.rate(linearised, below.unknowns, np.array([0, 0, -0.8 * euler]))
    driven = isinstance(load, PlateDisplacement)
    alone = Model(pad.part, law, load, dict.fromkeys(pad.part.walls, 1), driven)
    assert surplus(alone, *pad.split(guess), beyond)[0] == 0


# Load paths use the symmetry they find.


@pytest.mark.parametrize(
    ("pad", "load", "value"),
    [
        (SQUARE, SpreadForce(), (0.3, 0.1, -0.6)),
        (SQUARE, PlateDisplacement(), (0.02, 0.02, 0)),
        (SQUARE, PlateForce(), (0.3, 0, 0)),
        (SQUARE, PatchForce((0, 0), (1, 1)), (0.05, 0.02, 0)),
        (OBLONG, SpreadForce(), (0.3, 0.1, 0)),
    ],
    ids=label,
)
def test_mirrored_loads_have_mirrored_states_to_the_bit(pad, load, value):
    (state,) = load_path(pad, LAW, [value], load=load, mesh_size=SIZE)
    images = node_images(state.mesh)
    assert set(images) == (set(MIRRORS) if pad is SQUARE else {ACROSS_X, ACROSS_Y})
    for mirror, image in images.items():
        (other,) = load_path(pad, LAW, [mirror.image(np.array(value))], load=load, mesh_size=SIZE)
        np.testing.assert_array_equal(other.displacement, mirror.image(state.displacement[image]))
        np.testing.assert_array_equal(other.pressure, state.pressure[image[: len(state.pressure)]])


@pytest.mark.parametrize(("pad", "shared"), [(SQUARE, True), (OBLONG, False)], ids=["square", "oblong"])
def test_only_a_square_pad_answers_x_and_y_with_one_leg(pad, shared, fresh, monkeypatch):
    load_path(pad, LAW, [(0.2, 0, 0)], mesh_size=SIZE)

    def refuse(*arguments):
        raise AssertionError("solved")

    monkeypatch.setattr(LoadedPad, "solve_symmetric", refuse)
    load_path(pad, LAW, [(-0.2, 0, 0)], mesh_size=SIZE)
    if shared:
        load_path(pad, LAW, [(0, 0.2, 0), (0, -0.2, 0)], mesh_size=SIZE)
    else:
        with pytest.raises(AssertionError, match="solved"):
            load_path(pad, LAW, [(0, 0.2, 0)], mesh_size=SIZE)


PATCHES = [
    (PatchForce((0, 0), (1, 1)), set(MIRRORS)),
    (PatchForce((0, 0), (1, 1.5)), {ACROSS_X, ACROSS_Y}),
    (PatchForce((0.5, 0), (1, 1)), {ACROSS_Y}),
    (PatchForce((0, 0.5), (1, 1.5)), {ACROSS_X}),
    (PatchForce((0.5, 0.5), (1, 1)), {ACROSS_DIAGONAL}),
    (PatchForce((0.5, -0.5), (1, 1)), {ACROSS_SECOND_DIAGONAL}),
    (PatchForce((0.5, 0.5), (1, 1.5)), set()),
    (PatchForce((0.5, 0.1), (1, 1)), set()),
]


@pytest.mark.parametrize(("patch", "mirrors"), PATCHES, ids=[str(patch) for patch, _ in PATCHES])
def test_a_patch_keeps_the_mirrors_that_it_has_itself(patch, mirrors, mesh, images):
    assert {mirror for mirror, image in images.items() if patch.is_symmetric(mesh, mirror, image)} == mirrors


@pytest.mark.parametrize(("patch", "value"), [(PATCHES[2][0], (-0.1, 0, 0)), (PATCHES[-1][0], (0, 0.1, -0.1))])
def test_a_patch_of_little_symmetry_has_the_states_of_a_direct_solve(patch, value):
    (state,) = load_path(SQUARE, LAW, [value], load=patch, mesh_size=SIZE)
    pad = LoadedPad(state.mesh, LAW, patch)
    solution, _ = pad.solve(np.zeros(pad.unknowns), np.array(value))
    displacement, _ = pad.split(solution.unknowns)
    np.testing.assert_allclose(state.displacement, displacement, atol=1e-4 * np.abs(displacement).max())
