"""Bodies hold a block as rigid walls do in closed form, and what they push with has a potential."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from mitsuba_taxel.mechanics import NeoHookean, PlateDisplacement
from mitsuba_taxel.mechanics.contact.barriers import contacts
from mitsuba_taxel.mechanics.contact.barriers.bodies import RigidBodies
from mitsuba_taxel.mechanics.contact.barriers.body_barrier import BodyBarrier
from mitsuba_taxel.mechanics.equilibrium import feet
from mitsuba_taxel.mechanics.equilibrium.self_touching_pad import SelfTouchingPad

pytest.importorskip("ipctk")

GAP = 2e-4
"""mm, between the block and the walls around it."""


def walls(block, low, high):
    """Boxes of 0.5 mm around four sides of a block between two corners, at a distance."""
    boxes = []
    for axis, sign in ((0, -1), (0, 1), (1, -1), (1, 1)):
        sides, centre = np.array(high) - low + (4.0, 4.0, 0.0), (np.array(low) + high) / 2
        sides[axis] = 0.5
        centre[axis] = (low if sign < 0 else high)[axis] + sign * (0.25 + GAP)
        if axis == 1:
            sides[0] = high[0] - low[0]  # or boxes would meet
        boxes.append(trimesh.creation.box(sides, trimesh.transformations.translation_matrix(centre)).triangles)
    return RigidBodies(np.concatenate(boxes).tobytes())


@pytest.mark.parametrize(
    ("strain", "poisson", "longest"), [(0.1, 0.3, 0.1), (0.2, 0.3, 0.1), (0.1, 0.4, 0.1), (0.1, 0.3, 0.012)]
)
def test_a_block_between_walls_is_strained_along_one_axis(block, strain, poisson, longest, monkeypatch):
    """Nominal stresses of the law at diag(1, 1, 1 - strain), by differences of its energy, give all forces, if it is
    that of the feet too; also where each load step of 0.02 of the height takes several steps of Newton's method."""
    monkeypatch.setattr(feet, "RADIUS", 0.0)
    monkeypatch.setattr(contacts, "LONGEST_STEP", longest)
    size, law = (2.0, 2.0, 1.0), NeoHookean(4.16, poisson)
    mesh = block(size, (2, 2, 1))
    load = PlateDisplacement(self_contact=True)
    bodies = walls(block, (0.0, 0.0, 0.0), size)
    pad, barrier = SelfTouchingPad(mesh, law, load, bodies=bodies), BodyBarrier(mesh, law.youngs_modulus, bodies)
    assert barrier.reach == pytest.approx(GAP / 2, rel=1e-6)
    unknowns, steps = np.zeros(pad.unknowns), 5
    for step in range(1, steps + 1):
        unknowns = pad.solve_linearised(unknowns, np.array([0, 0, -strain * size[2] * step / steps]))[0].unknowns

    def energy(x, z):
        gradient = np.diag([1.0 + x, 1.0, 1.0 - strain + z])
        volume = np.linalg.det(gradient)
        return float(law.energy(gradient[None, None])[0, 0]) + (volume - 1) ** 2 / (2 * law.compressibility)

    across, along = ((energy(*d) - energy(*(-np.array(d)))) / 2e-6 for d in ((1e-6, 0.0), (0.0, 1e-6)))
    displacement = pad.split(unknowns)[0]
    assert 0 < barrier.gap(displacement) < barrier.reach
    right = mesh.points[:, 0] > 1
    pushed = barrier.forces(displacement)
    held = 1 - 1 / 3  # of a quadratic face, whose ends are glued: consistent loads are 1/6, 2/3, 1/6
    assert pushed[right, 0].sum() == pytest.approx(held * across * size[1] * size[2], rel=0.01)
    np.testing.assert_allclose(pushed.sum(axis=0), 0, atol=1e-3 * abs(across))
    # The block bulges into the gaps of 2e-4 of its width: as much of its stiffness is not felt.
    assert pad.plate_force(unknowns)[2] == pytest.approx(along * size[0] * size[1], rel=0.01)


def test_forces_have_a_potential(block):
    mesh, rng = block((2.0, 2.0, 1.0), (2, 2, 1)), np.random.default_rng(2)
    barrier = BodyBarrier(mesh, 4.16, walls(block, (0.0, 0.0, 0.0), (2.0, 2.0, 1.0)))
    displacement = 1.5e-4 * (mesh.points - (1, 1, 0)) * (1, 1, 0) + 1e-5 * rng.uniform(size=mesh.points.shape)
    stiffness = barrier.stiffness(displacement)
    assert abs(stiffness).max() > 1 and abs(stiffness - stiffness.T).max() < 1e-9 * abs(stiffness).max()
    way, step = rng.standard_normal(displacement.shape), 1e-9
    ahead, behind = (barrier.forces(displacement + sign * step * way) for sign in (1, -1))
    expected = (stiffness @ way.ravel()).reshape(-1, 3)
    np.testing.assert_allclose((behind - ahead) / (2 * step), expected, atol=1e-4 * np.abs(expected).max())
    steady = barrier.stiffness(displacement, steady=True).toarray()
    assert np.linalg.eigvalsh(steady).min() > -1e-9 * np.abs(steady).max()


def test_steps_end_before_a_body(block):
    mesh = block((2.0, 2.0, 1.0), (2, 2, 1))
    barrier = BodyBarrier(mesh, 4.16, walls(block, (0.0, 0.0, 0.0), (2.0, 2.0, 1.0)))
    at_rest = np.zeros_like(mesh.points)
    assert barrier.free_fraction(at_rest, at_rest + (0, 0, 0.1)) == 1  # along the walls
    wider = 5 * GAP * (mesh.points - (1, 1, 0)) * (1, 1, 0)
    share = barrier.free_fraction(at_rest, wider)
    assert 0.9 * 0.95 / 5 < share < 0.9 / 5 and 0 < barrier.gap(share * wider)


@pytest.mark.parametrize("far", [0.5, 5.0, 500.0])
def test_long_steps_are_cut_before_collisions_are_searched(block, far):
    """Upwards nothing is in the way of a block of 1 mm, sideways walls are at `GAP`, however long the step."""
    mesh = block((2.0, 2.0, 1.0), (2, 2, 1))
    bodies = walls(block, (0.0, 0.0, 0.0), (2.0, 2.0, 1.0))
    both, at_rest = contacts.Contacts(mesh, 4.16, bodies), np.zeros_like(mesh.points)
    assert both.free_fraction(at_rest, at_rest + (0, 0, 0.09)) == 1
    assert far * both.free_fraction(at_rest, at_rest + (0, 0, far)) == pytest.approx(contacts.LONGEST_STEP)
    wider = far * (mesh.points[:, :1] / 2 * (1, 0, 0))  # the left side stays
    assert 0.9 * 0.95 * GAP < far * both.free_fraction(at_rest, wider) < 0.9 * GAP
