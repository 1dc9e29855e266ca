"""Elements with a memory: their tangent, a stretched block against ordinary differential equations, symmetric parts."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from mitsuba_taxel.geometry.mirror import MIRRORS
from mitsuba_taxel.mechanics import MooneyRivlin, NeoHookean, Viscoelastic
from mitsuba_taxel.mechanics.elements.elements import Elements
from mitsuba_taxel.mechanics.elements.internal_variables import InternalVariables, StressUpdate, expand_stress
from mitsuba_taxel.mechanics.elements.pressure import pressure_forces
from mitsuba_taxel.mechanics.elements.symmetry import node_images, part_between
from mitsuba_taxel.mechanics.materials.creep import CreepResponse

MU, PRONY = 0.7, ((0.25, 0.4), (0.35, 5.0))
SOFT = Viscoelastic(NeoHookean(3 * MU, 0.5), PRONY)
SHARES, TIMES = SOFT.shares, SOFT.times


@pytest.mark.parametrize("law", [NeoHookean(2.0, 0.45), MooneyRivlin(0.2, 0.1)])
def test_tangent_with_a_past_is_the_derivative_of_the_residual(law, block, body):
    rng = np.random.default_rng(2)
    mesh = block(cells=(1, 1, 1), distortion=0.1)
    solid = body(mesh, law, np.zeros((len(mesh.points), 3), bool))
    update = StressUpdate(
        0.4, 0.3 * rng.normal(size=(*solid.assembly.elements.weight.shape, 6)), part_between(mesh, {}, ())
    )
    u, p = 0.1 * np.sin(mesh.points @ rng.normal(size=(3, 3))), rng.normal(size=mesh.corner_count)
    du, dp = rng.normal(size=u.shape), rng.normal(size=p.shape)

    def residual(h):
        return solid.assembly.evaluate(u + h * du, p + h * dp, False, update).residual

    lower = solid.assembly.matrix(solid.assembly.evaluate(u, p, stress_update=update).entries).toarray()
    along = (lower + np.tril(lower, -1).T) @ np.concatenate([du.ravel(), dp])
    np.testing.assert_allclose(along, (residual(1e-5) - residual(-1e-5)) / 2e-5, rtol=0, atol=1e-7)


@pytest.mark.parametrize("creeps", [True, False])
def test_the_stress_at_the_end_of_a_step_ages_with_its_length(block, body, creeps):
    rng = np.random.default_rng(3)
    solid = body(block(cells=(1, 1, 1)), SOFT.law, np.zeros((27, 3), bool))
    stress, slope, end, *held = rng.normal(size=(5, *solid.assembly.elements.weight.shape, 6))
    relaxing = InternalVariables(stress, np.array(held), 0 * np.array(held), 0 * stress, slope)
    to_load, memory, rate = CreepResponse.of(PRONY, creeps), np.array([[0.2], [0.5]]), np.array([0.3])

    def course(step):
        return to_load.measures(memory, rate, step).main

    def total(step):
        update = relaxing.stress_update(SOFT, step, part_between(solid.mesh, {}, ()), course(step))
        return update.factor * end + update.offset

    for step in (1e-3, 1.0, 30.0):
        change = (total(1.0001 * step) - total(0.9999 * step)) / (2e-4 * step)
        np.testing.assert_allclose(relaxing.rate_by_duration(SOFT, course(step), end), change, rtol=1e-5, atol=1e-7)


def stepped(solid, relaxing, step, displacement, pressure, load=0.0):
    """The block at the end of a step: displacement, pressure and internal variables."""
    part = part_between(solid.mesh, {}, ())
    solid.stress_update = relaxing.stress_update(SOFT, step, part)
    displacement, pressure = solid.solve(displacement, pressure, load=load)
    return displacement, pressure, relaxing.after(SOFT, step, solid.assembly.elements.isochoric_stress(displacement))


def at_rest(solid):
    return InternalVariables.at_rest(SOFT, *solid.assembly.elements.weight.shape)


def test_relaxation_of_a_stretched_block_is_the_prony_series(block, body):
    mesh, stretch = block(cells=(1, 1, 1)), 1.6
    top = mesh.points[:, 2] == 1
    solid = body(mesh, SOFT.law, (mesh.points == 0) | (top[:, None] & np.array([False, False, True])))
    u = mesh.points * [stretch**-0.5 - 1, stretch**-0.5 - 1, stretch - 1]
    relaxing, p, time = at_rest(solid), np.zeros(mesh.corner_count), 0.0
    for step in (0.0, 0.1, 0.5, 3.0, 1e9):
        time += step
        u, p, relaxing = stepped(solid, relaxing, step, u, p)
        inside = solid.assembly.elements
        update = StressUpdate(1.0, relaxing.overstress(SOFT), part_between(mesh, {}, ()))
        forces = inside.evaluate(u, p, False, update).forces
        pulled = np.bincount(inside.nodes.ravel(), forces[..., 2].ravel())[top].sum()
        assert pulled == pytest.approx(MU * (stretch - stretch**-2) * SOFT.relaxation(time), rel=1e-10)


def reference_creep(force, times):
    """Stretch of an incompressible block under a dead load, by the equations of the two terms and of the stretch."""

    def isochoric(x):
        first = x**2 + 2 / x
        return MU * np.array([1 - first / (3 * x**2), 1 - first * x / 3])

    def slope(x):
        return (isochoric(x + 1e-6) - isochoric(x - 1e-6)) / 2e-6

    rest = 1 - SHARES.sum()
    at_once = next(root.real for root in np.roots([MU, -force, 0, -MU]) if abs(root.imag) < 1e-12)

    def change(_, y):
        held, x = y[:-1].reshape(2, 2), y[-1]
        axial, lateral = rest * isochoric(x) + held.sum(axis=0)
        fading = -held / TIMES[:, None]
        gained = rest * slope(x) + SHARES.sum() * slope(x)
        by_stretch = axial + x * gained[0] + 2 * lateral / x**3 - gained[1] / x**2
        by_time = x * fading.sum(axis=0)[0] - fading.sum(axis=0)[1] / x**2
        speed = -by_time / by_stretch
        return np.append(fading + SHARES[:, None] * slope(x) * speed, speed)

    start = np.append(SHARES[:, None] * isochoric(at_once), at_once)
    return solve_ivp(change, (0, times[-1]), start, t_eval=times, rtol=1e-9, atol=1e-11).y[-1]


def test_creep_of_a_stretched_block_converges_with_the_square_of_the_steps(block, body):
    mesh, force = block(cells=(1, 1, 1)), 0.5
    top = mesh.faces[(mesh.points[mesh.faces][:, :, 2] == 1).all(axis=1)]
    nodal = np.zeros_like(mesh.points)
    np.add.at(nodal, top, -force * pressure_forces(mesh.points[top]))
    errors = []
    exact = reference_creep(force, np.array([0.0, 2.0]))[-1]
    for count in (8, 16):
        solid = body(mesh, SOFT.law, mesh.points == 0)
        u, p, relaxing = np.zeros_like(mesh.points), None, at_rest(solid)
        for step in (0.0, *[2.0 / count] * count):
            u, p, relaxing = stepped(solid, relaxing, step, u, p, nodal)
        errors.append(abs(u[:, 2].max() + 1 - exact))
    assert exact > 1.5
    assert errors[1] < 1e-3
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.15)


def test_the_rate_of_the_stress_is_that_of_its_differences(block):
    mesh, rng = block(cells=(1, 1, 1), distortion=0.1), np.random.default_rng(5)
    elements, (field, moving) = Elements(mesh, SOFT.law), 0.1 * rng.normal(size=(2, len(mesh.points), 3)) * mesh.points
    rate = elements.isochoric_rate(field, 50 * moving)
    for step in (1e-5, 1e-6):
        ahead, behind = (elements.isochoric_stress(field + 50 * sign * step * moving) for sign in (1, -1))
        np.testing.assert_allclose(rate, (ahead - behind) / (2 * step), rtol=1e-5, atol=1e-5)
    assert not elements.isochoric_rate(field, 0 * moving).any()


@pytest.mark.parametrize("count", [1, 2, 4])
def test_tensors_of_a_part_are_those_of_the_whole(symmetric_block, count):
    mesh = symmetric_block(cells=(1, 1, 2))
    images = node_images(mesh)
    mirrors = {1: MIRRORS[:1], 2: MIRRORS[:2], 4: MIRRORS}[count]
    part = part_between(mesh, images, [mirror for mirror in MIRRORS if mirror in mirrors])
    x, y, z = mesh.points.T
    field = np.column_stack([x * z**2, y * z**2, -0.3 * z + 0.1 * z * (x**2 + y**2)])  # all mirrors keep it
    stress = Elements(mesh, NeoHookean()).isochoric_stress(field)
    of_part = Elements(part.mesh, NeoHookean()).isochoric_stress(field[part.nodes])
    np.testing.assert_allclose(stress[part.elements], of_part, atol=1e-12)
    np.testing.assert_allclose(expand_stress(of_part, part, mesh), stress, atol=1e-12)
