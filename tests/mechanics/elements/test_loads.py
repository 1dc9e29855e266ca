"""Loads: consistent nodal forces, plates that move but do not turn, pressure that follows the surface."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.mirror import ACROSS_DIAGONAL, ACROSS_X, ACROSS_Y, MIRRORS
from mitsuba_taxel.mechanics import (
    NeoHookean,
    PatchForce,
    PlateDisplacement,
    PlateForce,
    Pressure,
    SpreadForce,
    load_path,
)
from mitsuba_taxel.mechanics.elements.assembly import Assembly
from mitsuba_taxel.mechanics.elements.constraints import number_unknowns
from mitsuba_taxel.mechanics.elements.pressure import pressure_forces
from mitsuba_taxel.mechanics.elements.symmetry import node_images
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import LoadedPad
from mitsuba_taxel.pads import REGIONS, Pad

PAD, SIZE = Pad(rows=1, columns=1), 3.0
LAW = NeoHookean()
BLOCK = (4.0, 4.0, 3.0)


@pytest.fixture
def mesh(symmetric_block):
    return symmetric_block(BLOCK, (2, 2, 3))


def solved(mesh, law, load, value, mirrors=(), images=None):
    pad = LoadedPad(mesh, law, load, mirrors, images)
    solution, linearised = pad.solve(np.zeros(pad.unknowns), np.array(value, dtype=float))
    return pad, solution, linearised


def internal_forces(mesh, law, displacement, pressure):
    free = Assembly(mesh, law, number_unknowns(mesh, np.zeros(len(mesh.points), dtype=bool)))
    residual = free.evaluate(displacement, pressure, with_tangent=False).residual
    return residual[: displacement.size].reshape(-1, 3)


def nodes_of(mesh, region):
    return np.unique(mesh.faces[mesh.face_region == REGIONS[region]])


# A patch


def integrals(patch, of_top):
    """Over the rectangle's part on the top (half-widths ``of_top``): area, moments, second moments."""
    low, high = (np.array(patch.centre) + side * np.array(patch.size) / 2 for side in (-1, 1))
    low, high = np.maximum(low, -of_top), np.minimum(high, of_top)
    length, square, cube = (np.diff([low**k / k, high**k / k], axis=0)[0] for k in (1, 2, 3))
    return [
        length[0] * length[1],
        square[0] * length[1],
        length[0] * square[1],
        cube[0] * length[1],
        square[0] * square[1],
        length[0] * cube[1],
    ]


PATCHES = [
    PatchForce((0, 0), (1, 1)),
    PatchForce((0.31, -0.17), (0.9, 0.5)),
    PatchForce((-1.1, 0.7), (0.03, 2.6)),
    PatchForce((0.6, 0.6), (0.01, 0.01)),
    PatchForce((2.0, -2.1), (1.3, 1.1)),
    PatchForce((0, 0), (10, 0.7)),
]


@pytest.fixture(scope="module")
def pad_mesh():
    return PAD.mesh(1.0)


@pytest.mark.parametrize("patch", PATCHES, ids=str)
def test_nodal_loads_of_a_patch_integrate_quadratics_exactly(patch, pad_mesh):
    """Resultant, centroid and second moments are those of the rectangle, wherever it cuts through elements."""
    mesh = pad_mesh
    nodal = patch.nodal(mesh)
    assert not np.any(np.delete(nodal, nodes_of(mesh, "top")))
    x, y, _ = mesh.points.T
    found = [nodal @ weight for weight in (np.ones_like(x), x, y, x * x, x * y, y * y)]
    wanted = integrals(patch, np.array(PAD.extent[:2]) / 2)
    np.testing.assert_allclose(found, wanted, rtol=1e-12, atol=1e-13)


def test_a_patch_over_all_the_top_is_the_spread_force(pad_mesh):
    everywhere = PatchForce((0.5, 0), (20, 20)).nodal(pad_mesh)
    np.testing.assert_allclose(everywhere, SpreadForce().nodal(pad_mesh), atol=1e-13)
    assert everywhere.sum() == pytest.approx(PAD.extent[0] * PAD.extent[1], rel=1e-13)


@pytest.mark.parametrize("patch", [PatchForce((0.31, -0.17), (0.9, 0.5)), PatchForce((1.8, -1.9), (1.3, 1.1))], ids=str)
def test_the_board_carries_the_force_of_a_patch(patch, mesh):
    """All of it, also where the rectangle hangs over the edge; moments about the deformed places."""
    force = np.array([0.1, -0.05, -0.3])
    pad, solution, _ = solved(mesh, LAW, patch, force)
    displacement, pressure = pad.split(solution.unknowns)
    forces = internal_forces(mesh, LAW, displacement, pressure)
    np.testing.assert_allclose(forces[nodes_of(mesh, "bottom")].sum(axis=0), -force, atol=1e-8)
    np.testing.assert_allclose(np.cross(mesh.points + displacement, forces).sum(axis=0), 0, atol=1e-7)
    under = displacement[nodes_of(mesh, "top")][np.argmin(displacement[nodes_of(mesh, "top"), 2])]
    mean = patch.nodal(mesh) @ displacement / patch.nodal(mesh).sum()
    assert under[2] < 0 and mean[2] < 0


def test_a_narrower_patch_dents_deeper(mesh):
    depths = []
    for size in (20.0, 2.0, 1.0, 0.5):
        pad, solution, _ = solved(mesh, LAW, PatchForce((0, 0), (size, size)), (0, 0, -0.5))
        displacement, _ = pad.split(solution.unknowns)
        nodal = pad.load.nodal(mesh)
        depths.append(-(nodal @ displacement[:, 2]) / nodal.sum())
    assert np.all(np.diff(depths) > 0)


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        (((0, math.nan), (1, 1)), "centre"),
        (((0, 0, 0), (1, 1)), "centre"),
        ((0.0, (1, 1)), "centre"),
        (((0, 0), (1, 0)), "size"),
        (((0, 0), (-1, 1)), "size"),
        (((0, 0), (1, math.inf)), "size"),
        (((0, 0), ("wide", 1)), "size"),
    ],
)
def test_patches_that_are_none_are_refused(arguments, name):
    with pytest.raises(InputError, match=f"^patch {name} = .* is not allowed: .* needed\\.$"):
        PatchForce(*arguments)


# A bonded plate


@pytest.mark.parametrize("force", [(0, 0, -1.5), (0.4, -0.2, -1.0)])
def test_a_plate_moves_as_one_under_its_force(force, mesh):
    pad, solution, _ = solved(mesh, LAW, PlateForce(), force)
    displacement, pressure = pad.split(solution.unknowns)
    top = nodes_of(mesh, "top")
    np.testing.assert_array_equal(displacement[top], np.broadcast_to(displacement[top[0]], (len(top), 3)))
    forces = internal_forces(mesh, LAW, displacement, pressure)
    np.testing.assert_allclose(forces[top].sum(axis=0), force, atol=1e-8)
    np.testing.assert_allclose(forces[nodes_of(mesh, "bottom")].sum(axis=0), -np.array(force), atol=1e-8)
    np.testing.assert_allclose(pad.plate_force(solution.unknowns), force, atol=1e-8)


@pytest.mark.parametrize(
    ("move", "mirrors"),
    [
        ((0, 0, -0.2), ()),
        ((0, 0, -0.2), MIRRORS),
        ((0.1, 0, -0.1), (ACROSS_Y,)),
        ((0.1, 0.1, 0.05), (ACROSS_DIAGONAL,)),
        ((0.1, -0.05, -0.1), ()),
    ],
)
def test_moving_a_plate_and_pushing_it_with_the_reaction_are_the_same(move, mirrors, mesh):
    images = node_images(mesh)
    moved, solution, linearised = solved(mesh, LAW, PlateDisplacement(), move, mirrors, images)
    top = nodes_of(mesh, "top")
    displacement, pressure = moved.split(solution.unknowns)
    np.testing.assert_allclose(displacement[top], np.broadcast_to(move, (len(top), 3)), atol=1e-12)
    reaction = moved.plate_force(solution.unknowns)
    forces = internal_forces(mesh, LAW, displacement, pressure)
    np.testing.assert_allclose(forces[top].sum(axis=0), reaction, atol=1e-9)
    pushed, back, stiffness = solved(mesh, LAW, PlateForce(), reaction, mirrors, images)
    np.testing.assert_allclose(pushed.split(back.unknowns)[0], displacement, atol=1e-8)
    # The rates are inverse to each other: the force rises by K d with the move, the move by 1 / K with the force.
    rate = moved.rate(linearised, solution.unknowns, np.array(move, dtype=float))
    step = 1e-4
    rise = (moved.plate_force(solution.unknowns + step * rate) - moved.plate_force(solution.unknowns - step * rate)) / (
        2 * step
    )
    answer = pushed.split(pushed.rate(stiffness, back.unknowns, rise))[0]
    np.testing.assert_allclose(answer[top], np.broadcast_to(move, (len(top), 3)), atol=1e-6)


@pytest.mark.parametrize("axis", [0, 2])
def test_a_bonded_plate_is_stiffer_than_a_spread_force(axis, mesh):
    """It constrains: by the minimum of potential energy its force does less work, here by a twentieth or more."""
    force = -0.2 * np.eye(3)[axis]
    work = []
    for load in (SpreadForce(), PlateForce()):
        pad, solution, _ = solved(mesh, LAW, load, force)
        nodal = SpreadForce().nodal(mesh) / SpreadForce().nodal(mesh).sum()
        work.append(nodal @ pad.split(solution.unknowns)[0] @ force)
    assert 0 < work[1] < 0.95 * work[0]


# Hydrostatic pressure


def wet_faces(mesh):
    return mesh.faces[np.isin(mesh.face_region, (REGIONS["top"], REGIONS["outer"]))]


@pytest.mark.parametrize("nu", [0.3, 0.45, 0.49])
@pytest.mark.parametrize("value", [1e-5, 0.3, -0.2])
def test_a_column_under_pressure_shrinks_as_its_bulk_modulus_says(nu, value, symmetric_block):
    """Away from the glued end F = J^(1/3) 1 with p = kappa (1 - J), and Cauchy's stress is the pressure everywhere."""
    mesh = symmetric_block((1.0, 1.0, 6.0), (1, 1, 8))
    law = NeoHookean(4.16, nu)
    pad, solution, _ = solved(mesh, law, Pressure(), (value,), MIRRORS, node_images(mesh))
    displacement, pressure = pad.split(solution.unknowns)
    stretch = (1 - value * law.compressibility) ** (1 / 3)
    far = mesh.points[:, 2] > 4
    np.testing.assert_allclose(pressure[far[: len(pressure)]], -value, rtol=1e-4)
    places = (mesh.points + displacement)[far]
    change = abs(1 - stretch)
    np.testing.assert_allclose(places[:, :2], stretch * mesh.points[far][:, :2], atol=1e-3 * change)
    length = np.ptp(places[:, 2]) / np.ptp(mesh.points[far][:, 2])
    assert length - 1 == pytest.approx(stretch - 1, rel=1e-3)


@pytest.mark.parametrize("value", [0.2, -0.1])
def test_a_pressure_is_work_on_the_volume_inside_the_surface(value, mesh):
    """Forces are -p times the derivative of the volume that the board and the wet surface enclose."""
    pad, solution, _ = solved(mesh, LAW, Pressure(), (value,))
    displacement, pressure = pad.split(solution.unknowns)
    faces = wet_faces(mesh)

    def enclosed(places):
        """By the divergence theorem from exact nodal normals; the bottom at z = 0 adds nothing."""
        return -(pressure_forces(places[faces]) * places[faces]).sum() / 3

    at_rest = enclosed(mesh.points)
    assert at_rest == pytest.approx(np.prod(BLOCK), rel=1e-12)
    forces = internal_forces(mesh, LAW, displacement, pressure)
    forces[nodes_of(mesh, "bottom")] = 0
    places, step = mesh.points + displacement, 1e-5
    direction = np.random.default_rng(6).normal(size=places.shape)
    direction[nodes_of(mesh, "bottom")] = 0
    change = (enclosed(places + step * direction) - enclosed(places - step * direction)) / (2 * step)
    assert (forces * direction).sum() == pytest.approx(-value * change, rel=1e-6)


@pytest.mark.parametrize("mirrors", [(), (ACROSS_X,), (ACROSS_DIAGONAL,), (ACROSS_X, ACROSS_Y), MIRRORS])
@pytest.mark.parametrize("value", [0.2, -0.1])
def test_the_tangent_of_a_pressure_is_the_derivative_of_its_residual(value, mirrors, mesh):
    """On the part as on the whole: the symmetric tangent leaves nothing out."""
    images = node_images(mesh)
    pad, solution, _ = solved(mesh, LAW, Pressure(), (value,), mirrors, images)
    unknowns, rng, step = solution.unknowns, np.random.default_rng(7), 1e-6

    def evaluated(at, **options):
        return pad.model.evaluate(*pad.numbering.split(at), np.array([value]), **options)

    lower = pad.model.assembly.matrix(evaluated(unknowns).entries)
    direction = rng.normal(size=len(unknowns))
    product = lower @ direction + lower.T @ direction - lower.diagonal() * direction
    ahead, behind = (evaluated(unknowns + side * step * direction, with_tangent=False).residual for side in (1, -1))
    np.testing.assert_allclose(product, (ahead - behind) / (2 * step), atol=2e-7 * np.abs(product).max())


@pytest.mark.parametrize("mirrors", [(), MIRRORS])
def test_the_rate_of_a_pressure_is_the_difference_of_states(mirrors, mesh):
    images = node_images(mesh)
    pad, solution, linearised = solved(mesh, LAW, Pressure(), (0.2,), mirrors, images)
    rate = pad.rate(linearised, solution.unknowns, np.ones(1))
    ahead, behind = (pad.solve(solution.unknowns, np.array([value]))[0].unknowns for value in (0.2005, 0.1995))
    np.testing.assert_allclose((ahead - behind) / 1e-3, rate, atol=1e-5 * np.abs(rate).max())


def test_a_path_by_pressure_has_the_states_of_direct_solves():
    values = [[0.0], [0.1], [-0.05]]
    for value, state in zip(values, load_path(PAD, LAW, values, load=Pressure(), mesh_size=SIZE), strict=True):
        np.testing.assert_array_equal(state.value, value)
        pad, solution, _ = solved(state.mesh, LAW, Pressure(), value)
        displacement, _ = pad.split(solution.unknowns)
        np.testing.assert_allclose(state.displacement, displacement, atol=1e-4 * np.abs(displacement).max(initial=0))


@pytest.mark.parametrize("values", [[[math.nan]], [[0.1, 0.2]], [0.1], [[0, 0, -0.1]]])
def test_pressures_that_are_none_are_refused(values):
    with pytest.raises(
        InputError, match=r"^pressure values(\[0\])? = .* are not allowed: .*one finite number is needed"
    ):
        load_path(PAD, LAW, values, load=Pressure(), mesh_size=SIZE)
