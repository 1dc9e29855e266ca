"""Boundary value problems with closed solutions: homogeneous, Rivlin's torsion, inflated spheres, Lame's tubes.

Where the solution is no polynomial, the error falls as the theory of quadratic elements says: displacements with h^3 in
the mean, forces that work on prescribed displacements, and displacements that forces work on, with h^4.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from mitsuba_taxel.geometry.volume_mesh import TET_EDGES
from mitsuba_taxel.mechanics.elements.elements import QUADRATURE_POINTS
from mitsuba_taxel.mechanics.elements.pressure import pressure_forces
from mitsuba_taxel.mechanics.materials.laws import MooneyRivlin, NeoHookean, Yeoh


def mean_error(body, displacement, exact):
    """Root mean square over the volume of the error, relative to the solution; ``exact``: points -> displacements."""
    corners = np.concatenate([1 - QUADRATURE_POINTS.sum(axis=1, keepdims=True), QUADRATURE_POINTS], axis=1)
    edges = [4 * corners[:, i] * corners[:, j] for i, j in TET_EDGES]
    shapes = np.concatenate([corners * (2 * corners - 1), np.stack(edges, axis=1)], axis=1)
    points, found = (np.einsum("qa,mai->mqi", shapes, v[body.mesh.tets]) for v in (body.mesh.points, displacement))
    wanted = exact(points)
    squares = [np.sum(body.assembly.elements.weight * np.square(v).sum(axis=2)) for v in (found - wanted, wanted)]
    return np.sqrt(squares[0] / squares[1])


def orders(errors):
    """Orders of convergence between meshes of which each has half the element size of the one before."""
    errors = np.abs(errors)
    return np.log2(errors[:-1] / errors[1:])


def faces_of(mesh, nodes):
    return mesh.faces[nodes[mesh.faces].all(axis=1)]


def nodal(mesh, faces):
    """(N, 3) forces of a unit pressure on undeformed faces."""
    forces = np.zeros_like(mesh.points)
    np.add.at(forces, faces, pressure_forces(mesh.points[faces]))
    return forces


# Pure shear, also called planar tension: x stretched, y held, z free.


def principal(law, stretches, pressure):
    """Principal Cauchy stresses times J, from derivatives of the isochoric invariants by the stretches' logarithms."""
    squares, volume = np.square(stretches), np.prod(stretches)
    first, second = volume ** (-2 / 3) * squares.sum(), volume ** (-4 / 3) * np.square(volume / stretches).sum()
    one = 2 * (volume ** (-2 / 3) * squares - first / 3)
    two = 2 * (volume ** (-4 / 3) * (squares.sum() - squares) * squares - 2 * second / 3)
    if isinstance(law, MooneyRivlin):
        w1, w2 = law.c10, law.c01
    else:
        w1, w2 = law.c10 + 2 * law.c20 * (first - 3) + 3 * law.c30 * (first - 3) ** 2, 0.0
    return w1 * one + w2 * two + pressure * volume


def planar(law, stretch):
    """Third stretch, and pressure, that leave z free of stress."""
    if law.poisson_ratio == 0.5:
        return 1 / stretch, -principal(law, np.array([stretch, 1, 1 / stretch]), 0.0)[2]

    def pressure(thickness):
        return (stretch * thickness - 1) / law.compressibility

    def free(thickness):
        return principal(law, np.array([stretch, 1, thickness]), pressure(thickness))[2]

    thickness = brentq(free, 0.5 / stretch, 2 / stretch, xtol=1e-15, rtol=1e-14)
    return thickness, pressure(thickness)


@pytest.mark.quick
@pytest.mark.parametrize("stretch", [0.6, 1.2, 2.0])
@pytest.mark.parametrize("nu", [0.3, 0.4999, 0.5])
@pytest.mark.parametrize("law", [MooneyRivlin, Yeoh])
def test_planar_tension_of_a_distorted_block(law, nu, stretch, block, body):
    """Solved for, between rigid smooth walls; at nu = 0.5: P_x = 2 (l - l^-3)(W1 + W2), P_y = 2 (1 - l^-2)(W1 + l² W2).

    (R. S. Rivlin and D. W. Saunders, Phil. Trans. R. Soc. A 243, 251, 1951.)
    """
    law = law(0.4, 0.15, poisson_ratio=nu) if law is MooneyRivlin else law(0.5, -0.02, 0.01, nu)
    size = np.array([1.0, 2.0, 1.5])
    mesh = block(size, (2, 2, 2), distortion=0.2)
    thickness, pressure = planar(law, stretch)
    stretches = np.array([stretch, 1, thickness])
    kirchhoff = principal(law, stretches, pressure)
    if nu == 0.5:
        rise = stretch**2 + stretch**-2 - 2
        w1, w2 = (0.4, 0.15) if isinstance(law, MooneyRivlin) else (0.5 - 0.04 * rise + 0.03 * rise**2, 0)
        assert kirchhoff[0] / stretch == pytest.approx(2 * (stretch - stretch**-3) * (w1 + w2), rel=1e-12)
        assert kirchhoff[1] == pytest.approx(2 * (1 - stretch**-2) * (w1 + stretch**2 * w2), rel=1e-12)
    fixed = (mesh.points == 0) | (mesh.points == size) & [True, True, False]
    exact = mesh.points * (stretches - 1)
    solid = body(mesh, law, fixed)
    displacement, found = solid.solve(np.where(fixed, exact, 0.9 * exact))
    np.testing.assert_allclose(displacement, exact, atol=1e-9)
    np.testing.assert_allclose(found, pressure, atol=1e-8)
    forces = solid.forces(displacement, found)
    for axis in range(3):
        pulled = forces[mesh.points[:, axis] == size[axis], axis].sum()
        assert pulled == pytest.approx(kirchhoff[axis] / stretches[axis] * np.prod(size) / size[axis], abs=1e-9)


# Torsion: every cross-section turns by its height times the twist, and stays plane.

RADIUS, LENGTH = 1.0, 1.5


def cylinder(points):
    """Points of a symmetric block of size (2, 2, 1) moved so that it is a cylinder; squares become circles outwards."""
    across = points[:, :2]
    square = np.abs(across).max(axis=1, keepdims=True)
    circle = np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
    return np.concatenate([RADIUS * across * (1 - square + square**2 / circle), LENGTH * points[:, 2:]], axis=1)


def twisted(points, twist):
    angle = twist * points[..., 2]
    x, y = points[..., 0], points[..., 1]
    cos, sin = np.cos(angle) - 1, np.sin(angle)
    return np.stack([cos * x - sin * y, sin * x + cos * y, np.zeros_like(x)], axis=-1)


def torsion(cells, law, twist, symmetric_block, mapped, body):
    """Relative errors: displacement, torque and axial force of a cylinder whose ends are turned and kept apart."""
    mesh = mapped(symmetric_block((2.0, 2.0, 1.0), (cells, cells, cells)), cylinder)
    ends = (mesh.points[:, 2] == 0) | (mesh.points[:, 2] == LENGTH)
    exact = twisted(mesh.points, twist)
    solid = body(mesh, law, np.repeat(ends[:, None], 3, axis=1))
    displacement, pressure = solid.solve(exact)
    top = mesh.points[:, 2] == LENGTH
    forces, places = solid.forces(displacement, pressure)[top], (mesh.points + displacement)[top]
    torque = (places[:, 0] * forces[:, 1] - places[:, 1] * forces[:, 0]).sum()
    c10, c01 = law.c10, law.c01
    return (
        mean_error(solid, displacement, lambda points: twisted(points, twist)),
        torque / (np.pi * (c10 + c01) * twist * RADIUS**4) - 1,
        forces[:, 2].sum() / (-np.pi / 2 * (c10 + 2 * c01) * twist**2 * RADIUS**4) - 1,
    )


@pytest.mark.parametrize(
    ("law", "twist"), [(MooneyRivlin(0.5, 0.0, 0.5), 0.5), (MooneyRivlin(0.3, 0.2, 0.5), 1.0)], ids=["neo", "mooney"]
)
def test_torsion_of_a_cylinder(law, twist, symmetric_block, mapped, body):
    """Torque pi (c10 + c01) tau a^4 and thrust pi/2 (c10 + 2 c01) tau² a^4 at fixed length: Poynting's effect.

    (R. S. Rivlin, Phil. Trans. R. Soc. A 242, 173, 1949; G. A. Holzapfel, Nonlinear Solid Mechanics, 2000.)
    """
    errors = np.array([torsion(cells, law, twist, symmetric_block, mapped, body) for cells in (2, 4)])
    displacement, torque, thrust = orders(errors)[0]
    assert displacement > 2.9
    assert min(torque, thrust) > 3.5
    assert np.all(np.abs(errors[1]) < (1.2e-3, 1e-3, 5e-3))


# Spheres and tubes from the inner radius 1 to the outer 2, under a pressure inside.

INNER, OUTER = 1.0, 2.0


def sphere(points):
    """Points of the unit cube moved to the 24th part of a sphere that lies between 0 < x < z and 0 < y < z."""
    ray = np.stack([np.tan(np.pi / 4 * points[:, 0]), np.tan(np.pi / 4 * points[:, 1]), np.ones(len(points))], axis=1)
    return ray / np.linalg.norm(ray, axis=1, keepdims=True) * (INNER + (OUTER - INNER) * points[:, 2:])


def sphere_sector(cells, law, block, mapped, body, clamped_inside=False):
    """The body between planes of symmetry, and which nodes are inside."""
    cube = block(cells=(cells, cells, cells))
    x, y, inside = cube.points[:, 0], cube.points[:, 1], cube.points[:, 2] == 0
    fixed = np.stack([x == 0, y == 0, np.zeros_like(inside)], axis=1) | (clamped_inside & inside)[:, None]
    ties = [(np.flatnonzero(x == 1), 2, 0), (np.flatnonzero(y == 1), 2, 1)]
    mesh = mapped(cube, sphere)
    return body(mesh, law, fixed, ties, pressed=faces_of(mesh, inside)), inside


def inflated(points, inner):
    """Displacement of an incompressible sphere whose inner radius becomes ``inner``: r³ = R³ + a³ - A³."""
    radius = np.linalg.norm(points, axis=-1, keepdims=True)
    return points * (np.cbrt(radius**3 + inner**3 - INNER**3) / radius - 1)


def inflating_pressure(law, inner):
    """P = int dW/dl / (l³ - 1) dl from b / B to a / A, with W of the stretches l^-2, l, l."""
    stretches = inner / INNER, np.cbrt(OUTER**3 + inner**3 - INNER**3) / OUTER

    def integral(stretch):
        return 4 * law.c10 * (-1 / stretch - stretch**-4 / 4) + 4 * law.c01 * (stretch - stretch**-2 / 2)

    return integral(stretches[0]) - integral(stretches[1])


@pytest.mark.quick
@pytest.mark.parametrize(
    ("law", "inner"), [(MooneyRivlin(0.5, 0.0, 0.5), 1.3), (MooneyRivlin(0.4, 0.1, 0.5), 1.8)], ids=["neo", "mooney"]
)
def test_inflation_of_a_thick_walled_sphere(law, inner, block, mapped, body):
    """The pressure that holds a prescribed inner radius (R. W. Ogden, Non-Linear Elastic Deformations, 1997, 5.3.2)."""
    errors = []
    for cells in (2, 4):
        solid, inside = sphere_sector(cells, law, block, mapped, body, clamped_inside=True)
        exact = inflated(solid.mesh.points, inner)
        displacement, pressure = solid.solve(exact)
        normal = (solid.mesh.points + exact)[inside] / inner
        push = (solid.forces(displacement, pressure)[inside] * normal).sum() / (4 * np.pi * inner**2 / 24)
        wrong = mean_error(solid, displacement, lambda points: inflated(points, inner))
        errors.append((wrong, push / inflating_pressure(law, inner) - 1))
    displacement, push = orders(np.array(errors))[0]
    assert displacement > 2.8
    assert push > 3.5
    assert np.all(np.abs(errors[1]) < (1e-3, 2e-4))


@pytest.mark.quick
@pytest.mark.parametrize(
    ("law", "inner"), [(MooneyRivlin(0.5, 0.0, 0.5), 1.3), (MooneyRivlin(0.4, 0.1, 0.5), 1.8)], ids=["neo", "mooney"]
)
def test_a_pressure_that_follows_the_surface_inflates_a_sphere(law, inner, block, mapped, body):
    """The same states, now reached by the pressure on the deformed inner face."""
    errors = []
    for cells in (2, 4):
        solid, _ = sphere_sector(cells, law, block, mapped, body)
        start = inflated(solid.mesh.points, inner)
        displacement, _ = solid.solve(start, pressing=inflating_pressure(law, inner))
        errors.append(mean_error(solid, displacement, lambda points: inflated(points, inner)))
    assert orders(np.array(errors)) > 2.8
    assert errors[1] < 1e-3


def tube_sector(cells, law, block, mapped, body):
    """A quarter of a tube between two planes that it cannot leave, as thin as its elements are wide."""
    thickness = 0.5 / cells
    slab = block((1.0, 1.0, thickness), (cells, 2 * cells, 1))
    x, y, z = slab.points.T
    fixed = np.stack([y == 1, y == 0, (z == 0) | (z == thickness)], axis=1)

    def tube(points):
        radius, angle = INNER + (OUTER - INNER) * points[:, 0], np.pi / 2 * points[:, 1]
        return np.stack([radius * np.cos(angle), radius * np.sin(angle), points[:, 2]], axis=1)

    mesh = mapped(slab, tube)
    return body(mesh, law, fixed, pressed=faces_of(mesh, x == 0)), x == 0


def lame_sphere(law, points):
    """Displacement under a unit pressure (S. P. Timoshenko and J. N. Goodier, Theory of Elasticity, section 136)."""
    radius = np.linalg.norm(points, axis=-1, keepdims=True)
    scale = INNER**3 / (OUTER**3 - INNER**3)
    return scale * (law.compressibility / 3 + OUTER**3 / (4 * law.shear_modulus * radius**3)) * points


def lame_tube(law, points):
    """Displacement of a tube in plane strain under a unit pressure (ibid., section 28)."""
    nu = law.poisson_ratio
    radius = np.linalg.norm(points[..., :2], axis=-1, keepdims=True)
    scale = INNER**2 * (1 + nu) / (law.youngs_modulus * (OUTER**2 - INNER**2))
    return scale * (1 - 2 * nu + OUTER**2 / radius**2) * points * [1, 1, 0]


@pytest.mark.parametrize("nu", [0.3, 0.49, 0.4999, 0.5])
@pytest.mark.parametrize(
    ("sector", "closed_form", "bounds"),
    [(sphere_sector, lame_sphere, (3e-4, 1e-3, 3e-5)), (tube_sector, lame_tube, (6e-5, 2e-4, 4e-6))],
    ids=["sphere", "tube"],
)
def test_small_strain_of_thick_walls_under_pressure(sector, closed_form, bounds, nu, block, mapped, body):
    """Lame's solutions, by the tangent at rest; near nu = 0.5, where elements lock, no worse than at 0.3."""
    law = NeoHookean(4.16, nu)
    errors = []
    for cells in (4, 8):
        solid, _ = sector(cells, law, block, mapped, body)
        load = nodal(solid.mesh, solid.pressed)
        displacement, _, _ = solid.step(np.zeros_like(solid.mesh.points), np.zeros(solid.mesh.corner_count), load)
        exact = closed_form(law, solid.mesh.points)
        mean = mean_error(solid, displacement, lambda points: closed_form(law, points))
        largest = np.abs(displacement - exact).max() / np.abs(exact).max()
        errors.append((mean, largest, (load * displacement).sum() / (load * exact).sum() - 1))
    mean, largest, work = orders(np.array(errors))[0]
    assert mean > 2.85
    assert largest > 2.6
    assert work > 3.7
    assert np.all(np.abs(errors[1]) < bounds)
