"""Mullins' effect: closed pseudo-elastic curves in three modes, lost energy, exact tangents, refusals."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.mirror import MIRRORS
from mitsuba_taxel.mechanics import MooneyRivlin, Mullins, NeoHookean, Ogden, Viscoelastic
from mitsuba_taxel.mechanics.elements.elements import Elements
from mitsuba_taxel.mechanics.elements.internal_variables import InternalVariables, Softening, expand_scalar
from mitsuba_taxel.mechanics.elements.symmetry import node_images, part_between
from mitsuba_taxel.mechanics.materials.mullins import mullins_of
from mitsuba_taxel.mechanics.materials.viscoelastic import Elastic

LAWS = {
    "neo-Hookean": (NeoHookean(1.2, 0.5), [(0.4, 2.0)]),
    "Ogden": (Ogden(0.3, 1.5, 0.02, 6.0, poisson_ratio=0.5), [(0.3, 1.5), (0.02, 6.0)]),
}
"""Laws, and the moduli and exponents of their terms."""
CYCLES = (0.25, 0.5, 0.2, 0.0, 0.2, 0.5, 0.8, 0.3, 0.0, 0.6)
"""Strains in the order of loading: away from rest and back, and again, beyond the first turn."""


def uniaxial(terms, strain):
    """Energy density and nominal stress of an incompressible solid, whose stretch is 1 + strain."""
    x = 1 + strain
    energy = sum(2 * mu / a**2 * (x**a + 2 * x ** (-a / 2) - 3) for mu, a in terms)
    return energy, sum(2 * mu / a * (x ** (a - 1) - x ** (-a / 2 - 1)) for mu, a in terms)


def equibiaxial(terms, strain):
    x = 1 + strain
    energy = sum(2 * mu / a**2 * (2 * x**a + x ** (-2 * a) - 3) for mu, a in terms)
    return energy, sum(2 * mu / a * (x ** (a - 1) - x ** (-2 * a - 1)) for mu, a in terms)


def shear(terms, strain):
    """Of simple shear by ``strain``, whose principal stretches are x, 1 / x and 1 with x - 1 / x = strain."""
    x = (strain + math.hypot(strain, 2)) / 2
    energy = sum(2 * mu / a**2 * (x**a + x**-a - 2) for mu, a in terms)
    return energy, sum(2 * mu / a * (x ** (a - 1) - x ** (-a - 1)) for mu, a in terms) / (1 + x**-2)


def deformed(mode, points, strain):
    """Displacement of the block, and the mask of the prescribed components."""
    x, y, z = points.T
    zero, on = 0 * x, points == 1
    lateral, thickness = points == 0, (1 + strain) ** -2 - 1
    if mode is uniaxial:
        narrower = (1 + strain) ** -0.5 - 1
        return np.stack([narrower * x, narrower * y, strain * z], axis=1), lateral | (on & [False, False, True])
    if mode is equibiaxial:
        return np.stack([strain * x, strain * y, thickness * z], axis=1), lateral | (on & [True, True, False])
    boundary = (on | lateral).any(axis=1)
    return np.stack([strain * z, zero, zero], axis=1), np.repeat(boundary[:, None], 3, axis=1)


def component(mode):
    """The loaded face's normal and the component of its force."""
    return {uniaxial: (2, 2), equibiaxial: (0, 0), shear: (2, 0)}[mode]


@pytest.mark.parametrize("mode", [uniaxial, equibiaxial, shear])
@pytest.mark.parametrize("kind", LAWS)
@pytest.mark.parametrize("constants", [(1.5, 0.05, 0.0), (3.0, 0.004, 0.3)])
def test_cycles_of_a_block_are_the_closed_pseudo_elastic_curve(mode, kind, constants, block, body):
    """Solved by Newton's method with free sides; the expected stress uses `math.erf` and nothing of the package."""
    (law, terms), (r, m, beta) = LAWS[kind], constants
    if mode is shear:  # all of the surface is held, which leaves the pressure of an incompressible solid open
        shares = {"youngs_modulus": 2.9 * law.shear_modulus} if kind == "neo-Hookean" else {}
        law = law.changed(poisson_ratio=0.45, **shares)
    mesh, material = block(cells=(1, 1, 1)), Elastic(law, softening=Mullins(law, *constants))
    solid = body(mesh, law, deformed(mode, mesh.points, 0.0)[1])
    elements, part = solid.assembly.elements, part_between(mesh, {}, ())
    variables, pressure = InternalVariables.at_rest(material, *elements.weight.shape), np.zeros(mesh.corner_count)
    largest, face = 0.0, component(mode)
    for strain in CYCLES:
        solid.stress_update = variables.stress_update(material, 0.0, part)
        u, pressure = solid.solve(deformed(mode, mesh.points, strain)[0], pressure)
        forces = elements.evaluate(u, pressure, False, solid.stress_update).forces
        at_face = mesh.points[:, face[0]] == 1
        pulled = np.bincount(elements.nodes.ravel(), forces[..., face[1]].ravel())[at_face].sum()
        variables = variables.after_energy(elements.isochoric_energy(u))

        energy, stress = mode(terms, strain)
        largest = max(largest, energy)
        expected = (1 - math.erf((largest - energy) / (m + beta * largest)) / r) * stress
        assert pulled == pytest.approx(expected, rel=1e-8, abs=1e-10)
        np.testing.assert_allclose(variables.largest_energy, largest, rtol=1e-8)


@pytest.mark.parametrize("constants", [(1.5, 0.05, 0.0), (3.0, 0.004, 0.3)])
def test_energy_lost_in_a_first_cycle_is_the_area_of_its_loop(constants):
    mullins, terms = Mullins(LAWS["Ogden"][0], *constants), LAWS["Ogden"][1]
    largest = uniaxial(terms, 0.7)[0]

    def gap(strain):
        energy, stress = uniaxial(terms, strain)
        return (1 - float(mullins.damage_variable(np.array(energy), np.array(largest)))) * stress

    lost = quad(gap, 0, 0.7, epsabs=1e-13)[0]
    assert mullins.dissipated(largest) == pytest.approx(lost, rel=1e-9)
    assert 0.05 * largest < lost < largest / constants[0]
    assert mullins.dissipated(0.0) == 0


@pytest.mark.parametrize("law", [NeoHookean(2.0, 0.45), MooneyRivlin(0.2, 0.1), LAWS["Ogden"][0]])
def test_the_tangent_is_the_derivative_of_the_residual_where_points_load_and_unload(law, block, body):
    rng = np.random.default_rng(2)
    mesh = block(cells=(1, 1, 1), distortion=0.1)
    solid = body(mesh, law, np.zeros((len(mesh.points), 3), bool))
    u, p = 0.1 * np.sin(mesh.points @ rng.normal(size=(3, 3))), rng.normal(size=mesh.corner_count)
    du, dp = rng.normal(size=u.shape), rng.normal(size=p.shape)
    energy = solid.assembly.elements.isochoric_energy(u)
    largest = energy * rng.choice([0.5, 1.2, 3.0], size=energy.shape)
    update = Softening(Mullins(law, 1.8, 0.5 * energy.mean(), 0.2), largest, part_between(mesh, {}, ()))
    assert 0.2 < (largest > energy).mean() < 0.8

    def residual(h):
        return solid.assembly.evaluate(u + h * du, p + h * dp, False, update).residual

    lower = solid.assembly.matrix(solid.assembly.evaluate(u, p, stress_update=update).entries).toarray()
    along = (lower + np.tril(lower, -1).T) @ np.concatenate([du.ravel(), dp])
    np.testing.assert_allclose(along, (residual(1e-6) - residual(-1e-6)) / 2e-6, rtol=0, atol=3e-7)
    loading = solid.assembly.evaluate(u, p).entries
    assert np.abs(solid.assembly.matrix(loading).toarray() - lower).max() > 1e-2  # the effect is not small


def test_energies_of_a_part_are_those_of_the_whole(symmetric_block):
    mesh = symmetric_block()
    images = node_images(mesh)
    part = part_between(mesh, images, MIRRORS[:2])
    law = NeoHookean()

    def stretched(points):
        return np.stack([0.1 * points[:, 0] ** 3, 0.2 * points[:, 1], -0.1 * points[:, 2] ** 2], axis=1)

    whole = Elements(mesh, law).isochoric_energy(stretched(mesh.points))
    own = Elements(part.mesh, law).isochoric_energy(stretched(part.mesh.points))
    np.testing.assert_allclose(expand_scalar(own, part, mesh), whole, rtol=1e-10)
    softening = Softening(Mullins(law, 2.0, 0.01), own, part)
    everything = part_between(mesh, images, ())
    np.testing.assert_allclose(softening.on(everything, mesh).largest, whole[everything.elements], rtol=1e-10)


@pytest.mark.parametrize(
    ("constants", "message"),
    [
        ((1.0, 0.1, 0.0), "mullins r = 1.0 is not allowed: a finite number above 1"),
        ((2.0, 0.0, 0.0), "mullins m = 0.0 is not allowed: a finite energy density in MPa above 0"),
        ((2.0, 0.1, -0.1), "mullins beta = -0.1 is not allowed: a finite number of 0 or more"),
        ((math.nan, 0.1, 0.0), "mullins r = nan is not allowed"),
        ((2.0, math.inf, 0.0), "mullins m = inf is not allowed"),
        ((2.0, "0.1", 0.0), "mullins m = '0.1' is not allowed"),
    ],
)
def test_constants_that_are_not_allowed(constants, message):
    with pytest.raises(InputError, match=message):
        Mullins(NeoHookean(), *constants)


def test_constants_as_text():
    law = NeoHookean()
    assert mullins_of("2 0.02 0.1", law) == Mullins(law, 2.0, 0.02, 0.1)
    assert mullins_of(" 2 0.02 ", law) == Mullins(law, 2.0, 0.02)
    assert mullins_of("  ", law) is None
    for text in ("2", "2 0.1 0.1 1", "2 0.1 x", "2, 0.1"):
        with pytest.raises(InputError, match="numbers 'r m beta', m in MPa, are needed"):
            mullins_of(text, law)


def test_the_effect_is_not_modelled_together_with_relaxation():
    with pytest.raises(InputError, match="law = Mullins"):
        Viscoelastic(Mullins(NeoHookean(), 2.0, 0.1), ((0.1, 1.0),))
