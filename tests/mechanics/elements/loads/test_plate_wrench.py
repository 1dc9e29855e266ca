"""A plate that tilts, against closed forms of beams, columns and thin layers, and the balance of its moments."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import simpson

from mitsuba_taxel import Block, Pad
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.mechanics import Mullins, NeoHookean, PlateForce, PlateWrench, Viscoelastic, load_path, reactions
from mitsuba_taxel.mechanics.continuation.load_path_ends import LoadPathEnds
from mitsuba_taxel.mechanics.derivatives.sensitivities import linearise
from mitsuba_taxel.mechanics.elements.nodal_forces import nodes_of
from mitsuba_taxel.mechanics.elements.plate_rotation import rotation_derivatives, rotation_matrix, rotation_vector
from mitsuba_taxel.mechanics.elements.symmetry import node_images
from mitsuba_taxel.mechanics.equilibrium.pad_parts import loaded_pad, mirror_images
from mitsuba_taxel.mechanics.memory_of_pads import symmetric_parts
from mitsuba_taxel.mechanics.meshes import pad_mesh

pytestmark = pytest.mark.usefixtures("mechanics_error_unknown")

COLUMN, LENGTH, BENDING = Block(width=1, depth=1, height=10), 10, 1 / 12
"""A slender column of E = 1 MPa, with E I in N mm2."""
STUB, LAW, SIZE = Block(width=4, depth=4, height=2), NeoHookean(1.0, 0.45), 1.0


def _path(block, law, values, size=SIZE, load=None):
    return load_path(block, law, values, load=load or PlateWrench(), mesh_size=size)


def _motion(state):
    """Rotation vector of the plate, and displacement of the centre of the top."""
    top = nodes_of(state.mesh, "top")
    points, displacement = state.mesh.points[top], state.displacement[top]
    return rotation_vector(points, displacement), displacement.mean(axis=0)


@pytest.fixture(scope="module")
def tilted():
    """A stub under force and moment about all axes, off its centre."""
    return _path(STUB, LAW, [(0.1, 0.05, -0.5, 0.5, 0.8, 0.3)], load=PlateWrench(x=0.3, y=-0.2, height=0.4))[0]


@pytest.mark.parametrize(("angle", "accuracy"), [(0.1, 1e-3), (1.0, 5e-3)])
@pytest.mark.parametrize("axis", [(0.0, 1.0), (0.6, 0.8)])
def test_a_moment_bends_a_column_to_an_arc(angle, accuracy, axis):
    """Euler's elastica under a moment alone: the angle is M L / (E I), however large."""
    moment = angle * BENDING / LENGTH
    (state,) = _path(COLUMN, NeoHookean(1.0, 0.0), [(0, 0, 0, moment * axis[0], moment * axis[1], 0)], size=0.5)
    turned, moved = _motion(state)
    np.testing.assert_allclose(turned, angle * np.array([*axis, 0]), atol=accuracy * angle)
    sideways, shorter = LENGTH / angle * (1 - math.cos(angle)), LENGTH * (math.sin(angle) / angle - 1)
    expected = sideways * axis[1], -sideways * axis[0], shorter
    np.testing.assert_allclose(moved, expected, atol=accuracy * LENGTH * angle)


@pytest.mark.parametrize("force", [-1.0, -0.4, 0.6])
def test_an_axial_force_softens_or_stiffens_a_column_against_a_moment(force):
    """S. P. Timoshenko and J. M. Gere, Theory of Elastic Stability, 1961, chapter 1; without friction to its centre
    line, and shortened by the force."""
    axial, moment = force * BENDING / LENGTH**2, 1e-2 * BENDING / LENGTH
    (state,) = _path(COLUMN, NeoHookean(1.0, 0.0), [(0, 0, axial, 0, moment, 0)], size=0.5)
    phase = math.sqrt(abs(force))
    expected = 1e-2 * (math.tan(phase) if force < 0 else math.tanh(phase)) / phase
    assert _motion(state)[0][1] == pytest.approx(expected, rel=6e-3)


def test_a_column_buckles_under_eulers_load():
    critical = math.pi**2 * BENDING / (4 * LENGTH**2)
    assert _path(COLUMN, NeoHookean(1.0, 0.0), [(0, 0, -0.9 * critical, 0, 0, 0)], size=0.5)
    with pytest.raises(LoadPathEnds, match=r"unstable .* force = \(0, 0, -0\.00\d+\) N and moment = \(0, 0, 0\) N mm"):
        _path(COLUMN, NeoHookean(1.0, 0.0), [(0, 0, -1.1 * critical, 0, 0, 0)], size=0.5)


def test_a_thin_incompressible_layer_resists_tilting_by_its_pressure():
    """The pressure p of a thin layer between plates fulfils laplace(p) = 12 mu angle x / h^3, p = 0 at its sides, as in
    lubrication (A. N. Gent and E. A. Meinecke, Polym. Eng. Sci. 10, 48, 1970); the moment of bending alone is added."""
    side, height, shear = 20.0, 1.0, 1 / 3
    orders = np.arange(1, 400)
    # Sine series of x - side/2: only even orders along x, odd ones along y.
    along = np.where(orders % 2 == 0, -(side**2) / (orders * np.pi), 0.0)
    across = np.where(orders % 2 == 1, 2 * side / (orders * np.pi), 0.0)
    squares = np.outer(along**2, across**2) / (np.add.outer(orders**2, orders**2) * (np.pi / side) ** 2)
    stiffness = 12 * shear / height**3 * 4 / side**2 * squares.sum() + 3 * shear * side**4 / 12 / height
    (state,) = _path(Block(width=side, depth=side, height=height), NeoHookean(1.0, 0.4999), [(0, 0, 0, 0, 0.1, 0)])
    assert _motion(state)[0][1] == pytest.approx(0.1 / stiffness, rel=0.02)


def test_the_board_balances_force_and_moment(tilted):
    balance, load = reactions(tilted), tilted.load
    np.testing.assert_allclose(balance.applied_force, tilted.value[:3], atol=1e-9)
    assert balance.imbalance < 1e-5
    turned, _ = _motion(tilted)
    # The moment about the pivot is conjugate to the rotation vector.
    top = nodes_of(tilted.mesh, "top")[0]
    corner = tilted.mesh.points[top]
    at = corner + tilted.displacement[top] + rotation_matrix(turned) @ (load.pivot(tilted.mesh) - corner)
    moment = balance.applied_moment - np.cross(at, balance.applied_force)
    first, _ = rotation_derivatives(tuple(turned))
    spins = [rate @ rotation_matrix(turned).T for rate in first]  # spin of the plate by each component
    axes = np.array([[spin[2, 1], spin[0, 2], spin[1, 0]] for spin in spins])
    np.testing.assert_allclose(axes @ moment, tilted.value[3:], atol=1e-4)


@pytest.mark.parametrize("off", [0.5, 1.5])
def test_a_force_off_the_centre_is_a_force_and_its_moment(off):
    """The arm turns with the plate; about one axis, the moment in space is that of the load."""
    force = np.array([0.2, 0.0, -1.5])
    (state,) = _path(STUB, LAW, [(*force, 0, 0, 0)], load=PlateWrench(x=off))
    turned, _ = _motion(state)
    moment = np.cross(rotation_matrix(turned) @ [off, 0, 0], force)
    (same,) = _path(STUB, LAW, [(*force, *moment)])
    assert turned[1] > 0.02 * off
    difference = linearise(same).displacement - linearise(state).displacement
    assert np.abs(difference).max() < 1e-7 * np.abs(state.displacement).max()


def test_the_work_of_force_and_moment_is_stored():
    from tests.mechanics.test_energy import Deformed

    end, start = np.array([0.2, 0.1, -0.5, 0.8, 1.5, 0.6]), np.array([0, 0, -0.5, 0, 0, 0])
    load = PlateWrench(x=0.4)
    states = _path(STUB, LAW, np.linspace(start, end, 9), load=load)
    moves = []
    for state in states:
        turned, _ = _motion(state)
        top = nodes_of(state.mesh, "top")[0]
        arm = load.pivot(state.mesh) - state.mesh.points[top]
        moves.append([*(state.displacement[top] + rotation_matrix(turned) @ arm - arm), *turned])
    moves = np.array(moves)
    # By parts, as the load grows evenly.
    work = end @ moves[-1] - start @ moves[0] - simpson(moves @ (end - start), x=np.linspace(0, 1, 9))
    stored = Deformed(states[-1]).energy - Deformed(states[0]).energy
    assert stored > 0.01
    assert work == pytest.approx(stored, rel=2e-4)


def test_a_plate_that_is_not_tilted_is_a_level_plate():
    (free,), (level,) = (
        _path(STUB, LAW, [value], load=load)
        for value, load in (((0, 0, -2, 0, 0, 0), PlateWrench()), ((0, 0, -2), PlateForce()))
    )
    assert np.abs(free.displacement - level.displacement).max() < 1e-8


def test_a_turn_of_pad_and_load_turns_the_state():
    """A quarter turn maps the block onto itself, but not its mesh: states agree as meshes do."""
    one, other = (_motion(_path(STUB, LAW, [value], size=0.7)[0]) for value in (
        (0.3, 0, -0.5, 0, 0.8, 0.2), (0, 0.3, -0.5, -0.8, 0, 0.2)
    ))  # fmt: skip
    turn = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    for vector, turned in zip(one, other, strict=True):
        np.testing.assert_allclose(turn @ vector, turned, atol=1e-3 * np.linalg.norm(vector))


@pytest.mark.parametrize("turned", [(0.0, 0.0, 0.0), (0.4, -0.9, 0.3), (2.0, 1.0, -1.5)])
def test_derivatives_of_the_rotation_are_those_of_differences(turned):
    first, second = rotation_derivatives(turned)
    for k, step in enumerate(1e-5 * np.eye(3)):
        ahead, behind = np.array(turned) + step, np.array(turned) - step
        rate = (rotation_matrix(ahead) - rotation_matrix(behind)) / 2e-5
        np.testing.assert_allclose(first[k], rate, atol=1e-9)
        rate = (rotation_derivatives(tuple(ahead))[0] - rotation_derivatives(tuple(behind))[0]) / 2e-5
        np.testing.assert_allclose(second[:, k], rate, atol=1e-8)


def test_the_tangent_is_the_derivative_of_the_residual(tilted):
    """Also with the symmetries of a mirror, and away from equilibrium."""
    mesh, generator = pad_mesh(STUB, 1.5), np.random.default_rng(4)
    for load, number in ((PlateWrench(x=0.3, y=0.2, height=0.5), 0), (PlateWrench(x=0.3), 1), (PlateWrench(), 4)):
        images = mirror_images(mesh, load)
        assert len(images) == number
        pad = loaded_pad(mesh, LAW, load, tuple(images))
        value = np.array([0.1, 0.2, -0.3, 0.2, 0.1, 0.3])
        unknowns = 0.01 * generator.normal(size=pad.unknowns)
        rotation = pad.numbering.rotation
        unknowns[rotation.unknowns] *= 20
        state = pad._evaluate(unknowns, value)
        assert state.min_jacobian > 0
        lower = pad.model.assembly.matrix(state.entries).toarray()
        tangent = lower + np.tril(lower, -1).T
        for number in [*rotation.unknowns, *pad.numbering.plate_unknowns, 5, pad.unknowns - 1]:
            step = 1e-6 * np.eye(pad.unknowns)[number]
            ahead, behind = (pad._evaluate(unknowns + s, value, False).residual for s in (step, -step))
            np.testing.assert_allclose(tangent[number], (ahead - behind) / 2e-6, atol=1e-7)
        again = pad.gather(*pad.split(unknowns))
        np.testing.assert_allclose(again, unknowns, atol=1e-14)


def test_derivatives_are_those_of_differences(tilted):
    linear, change, step = linearise(tilted), np.array([0.1, 0.2, 0.1, -0.1, 0.2, 0.3]), 1e-3

    def at(value, law=LAW):
        return linearise(_path(STUB, law, [value], load=tilted.load)[0]).displacement

    rate = (at(tilted.value + step * change) - at(tilted.value - step * change)) / (2 * step)
    np.testing.assert_allclose(linear.by_value(change), rate, atol=1e-7)
    softer, stiffer = (at(tilted.value, LAW.changed(youngs_modulus=1 + s)) for s in (-1e-4, 1e-4))
    by_modulus = linear.by_material("youngs_modulus")
    np.testing.assert_allclose(by_modulus, (stiffer - softer) / 2e-4, atol=1e-7)
    gradient = np.random.default_rng(0).normal(size=rate.shape)
    pulled = linear.pull_back(gradient)
    assert pulled.value @ change == pytest.approx(np.vdot(gradient, linear.by_value(change)), rel=1e-9)
    assert pulled.material["youngs_modulus"] == pytest.approx(np.vdot(gradient, by_modulus), rel=1e-9)
    ahead = tilted.path_rate()
    assert np.linalg.norm(ahead.direction) == pytest.approx(1)
    np.testing.assert_allclose(ahead.displacement, linear.by_value(ahead.direction), atol=1e-5)


def test_mirrored_loads_have_mirrored_states():
    (one,), (other,) = (
        _path(STUB, LAW, [value]) for value in ((0.2, 0.1, -0.5, 0.3, 0.8, 0.2), (-0.2, 0.1, -0.5, 0.3, -0.8, -0.2))
    )
    (mirror,) = (m for m in node_images(one.mesh) if m.normal == (1, 0))
    image = node_images(one.mesh)[mirror]
    np.testing.assert_array_equal(other.displacement, mirror.image(one.displacement[image]))


def test_what_is_not_modelled_is_refused(tilted):
    with pytest.raises(InputError, match="self_contact = True is not allowed"):
        PlateWrench(self_contact=True)
    with pytest.raises(InputError, match="memory under a tilting plate is not modelled"):
        load_path(STUB, Viscoelastic(LAW, ((0.3, 1.0),)), [(0, 0, -1, 0, 0, 0)], times=[1.0], load=PlateWrench())
    with pytest.raises(InputError, match="not allowed with Mullins' effect: memory under a tilting plate"):
        load_path(STUB, Mullins(LAW, 2.0, 0.01), [(0, 0, -1, 0, 0, 0)], load=PlateWrench())
    with pytest.raises(InputError, match="derivatives with respect to shapes are not available"):
        linearise(tilted).by_shape(np.zeros_like(tilted.displacement))
    with pytest.raises(InputError, match="six finite numbers are needed"):
        load_path(STUB, LAW, [(0, 0, -1)], load=PlateWrench())


@pytest.mark.parametrize(
    ("value", "point", "copies"),
    [
        ((0, 0, -1, 0, 0, 0), (0, 0), 8),
        ((0, 0, -1, 1, 0, 0), (0, 0), 2),
        ((0, 0, -1, 1, 2, 0), (0, 0), 1),
        ((1, 0, -1, 0, 2, 0), (0, 0), 2),
        ((1, 0, -1, 1, 0, 0), (0, 0), 1),
        ((0, 0, -1, 0, 0, 0), (1, 0.5), 1),
        ((0, 0, -1, 0, 0, 1), (0, 0), 1),
    ],
)
def test_mirrors_keep_the_force_as_a_vector_and_the_moment_as_an_axial_vector(value, point, copies):
    """The memory that a pad needs is estimated with these numbers of equal parts."""
    assert symmetric_parts(Pad(), PlateWrench(x=point[0], y=point[1]), value) == copies


def test_the_rate_by_the_point_of_the_force_is_refused(tilted):
    with pytest.raises(InputError, match="point of the force on a tilting plate"):
        linearise(tilted).by_place((1.0, 0.0))
