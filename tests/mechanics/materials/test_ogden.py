"""Ogden's law at equal and nearly equal stretches, in three modes, and against other laws and another program."""

from __future__ import annotations

import shutil
import subprocess

import numpy as np
import pytest

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.mechanics.materials.drucker import stable_stretch
from mitsuba_taxel.mechanics.materials.laws import ArrudaBoyce, MooneyRivlin, NeoHookean, Ogden, Yeoh

THREE_TERMS = Ogden(0.4, 1.3, 0.1, 5.0, 0.02, -2.0, poisson_ratio=0.5)
ONE_TERM = Ogden(0.5, 3.7, poisson_ratio=0.5)
CHAINS = ArrudaBoyce(0.4, 2.5, poisson_ratio=0.5)
MODES = {
    "uniaxial": lambda x: (x, x**-0.5, x**-0.5),
    "planar": lambda x: (x, 1.0, 1 / x),
    "equibiaxial": lambda x: (x, x, x**-2),
}
NEARLY_EQUAL = [0.0, 1e-15, 1e-12, 1e-9, 1e-7, 1e-5, 1e-3]
EXTERNAL = pytest.mark.skipif(shutil.which("ccx") is None, reason="ccx is not installed")


def inputs(gradient):
    return gradient, np.asarray(np.linalg.det(gradient)), np.swapaxes(np.linalg.inv(gradient), -1, -2)


def turned(stretches, seed=4):
    """A gradient of these principal stretches along oblique axes, rotated."""
    rng = np.random.default_rng(seed)
    axes, rotation = (np.linalg.qr(rng.normal(size=(3, 3)))[0] for _ in range(2))
    return rotation * np.linalg.det(rotation) @ axes @ np.diag(stretches) @ axes.T * np.linalg.det(axes) ** 2


def differences(function, gradient, step):
    """Central differences of fourth order by the components of the gradient."""
    columns = []
    for index in np.ndindex(3, 3):
        offset = np.zeros((3, 3))
        offset[index] = step
        near, far = (function(gradient + k * offset) - function(gradient - k * offset) for k in (1, 2))
        columns.append((8 * near - far) / (12 * step))
    return np.stack(columns, axis=-1).reshape(*np.shape(columns[0]), 3, 3)


@pytest.mark.parametrize("gap", NEARLY_EQUAL)
@pytest.mark.parametrize("base", [(1.0, 1.0, 1.0), (1.6, 1.6, 0.4), (2.0, 0.7, 0.7)], ids=str)
@pytest.mark.parametrize("law", [THREE_TERMS, ONE_TERM], ids=["three", "one"])
def test_energy_stress_and_tangent_agree_at_nearly_equal_stretches(law, base, gap):
    gradient = turned(np.array(base) * (1 + gap * np.array([1.0, -0.3, 0.2])))
    stress, tangent = law.stress(*inputs(gradient)), law.tangent(*inputs(gradient))
    scale = np.abs(tangent).max()
    np.testing.assert_allclose(stress, differences(law.energy, gradient, 2e-3), atol=2e-9 * scale)
    by_stress = differences(lambda f: law.stress(*inputs(f)), gradient, 2e-3)
    np.testing.assert_allclose(tangent, by_stress, atol=2e-9 * scale)
    np.testing.assert_allclose(tangent, tangent.transpose(2, 3, 0, 1), atol=1e-14 * scale)


@pytest.mark.parametrize("gap", NEARLY_EQUAL)
@pytest.mark.parametrize("base", [(1.0, 1.0, 1.0), (3.0, 0.577, 0.577), (1.4, 1.4, 0.51)], ids=str)
def test_terms_of_exponent_2_and_minus_2_are_those_of_the_invariants(base, gap):
    """At any gap, which differences cannot resolve: both are exact to rounding."""
    gradient = turned(np.array(base) * (1 + gap * np.array([1.0, -0.3, 0.2])))
    pressure = np.array(0.37)
    for law, same in (
        (Ogden(0.4, 2.0), NeoHookean(0.8 * 1.49)),
        (Ogden(0.8, 2.0, 0.3, -2.0), MooneyRivlin(0.4, 0.15)),
    ):
        for of in (
            lambda m: m.stress(*inputs(gradient)),
            lambda m: m.moduli(*inputs(gradient), pressure).dense(),
            lambda m: m.energy(gradient),
        ):
            expected = of(same)
            np.testing.assert_allclose(of(law), expected, atol=3e-14 * np.abs(of(same)).max() + 3e-15)


@pytest.mark.parametrize("stretch", [0.4, 0.8, 1.0001, 1.1, 1.6, 3.0])
@pytest.mark.parametrize("law", [THREE_TERMS, ONE_TERM, CHAINS], ids=["ogden 3", "ogden 1", "arruda_boyce"])
@pytest.mark.parametrize("mode", MODES)
def test_homogeneous_stretch_of_an_incompressible_solid(mode, law, stretch):
    """s = sum of 2 mu / alpha (l^(alpha - 1) - l3^alpha / l) (Ogden 1972), or 2 W1 (l^2 - l3^2) / l for chains."""
    first, second, third = np.array(MODES[mode](stretch))
    stretches = np.array([first, second, third])
    isochoric = law.stress(*inputs(np.diag(stretches)))
    nominal = np.diag(isochoric) - isochoric[2, 2] * third / stretches
    if isinstance(law, Ogden):
        expected = sum(2 * mu / alpha * (first ** (alpha - 1) - third**alpha / first) for mu, alpha in law.terms)
    else:
        i1 = (stretches**2).sum()
        coefficients = (1 / 2, 1 / 10, 33 / 1050, 76 / 7000, 2595 / 673750)
        w1 = 0.4 * sum(c * i1**i / 2.5 ** (2 * i) for i, c in enumerate(coefficients))
        expected = 2 * w1 * (first - third**2 / first)
    assert nominal[0] == pytest.approx(expected, rel=1e-11)
    if mode == "equibiaxial":
        assert nominal[1] == pytest.approx(expected, rel=1e-11)


@pytest.mark.parametrize("stretches", [(1.0, 1.0, 1.0), (1.3, 1.1, 1 / 1.43), (2.0, 0.5**0.5, 0.5**0.5)], ids=str)
def test_energy_of_invariants_is_that_of_stretches(stretches):
    squares = np.square(stretches)
    expected = sum(2 * mu / alpha**2 * (np.power(stretches, alpha).sum() - 3) for mu, alpha in THREE_TERMS.terms)
    assert THREE_TERMS.energy(np.diag(stretches)) == pytest.approx(expected, abs=1e-14)
    assert THREE_TERMS.strain_energy(squares.sum(), (1 / squares).sum()) == pytest.approx(expected, abs=1e-8)


def test_limits_of_stability_are_the_closed_ones():
    """Mooney-Rivlin in equibiaxial tension, the first mode to fall: the stiffness along it, d2W/de2, vanishes."""
    law = MooneyRivlin(0.5, -0.05)
    limit = stable_stretch(law)

    def least(x):
        """Slope of the Kirchhoff stress without change of volume: 4 (c10 l^2 + c01 / l^2), by direction."""
        slopes = 4 * (0.5 * np.array([x**2, x**2, x**-4]) - 0.05 * np.array([x**-2, x**-2, x**4]))
        plane = np.array([[1, -1, 0], [1, 1, -2]]) / np.sqrt([[2], [6]])
        return np.linalg.eigvalsh(plane @ np.diag(slopes) @ plane.T)[0]

    assert least(limit * 0.999) > 0 > least(limit * 1.001)
    for stable in (NeoHookean(), MooneyRivlin(0.4, 0.1), Yeoh(0.5, 0.1, 0.01), THREE_TERMS, CHAINS):
        assert stable_stretch(stable) == np.inf
    assert 1.5 < stable_stretch(Ogden(0.6, 2.7, -0.02, -3.0)) < np.inf


@pytest.mark.parametrize(
    ("law", "constants", "name"),
    [
        (MooneyRivlin, (0.5, -0.2), "c01"),
        (Yeoh, (0.5, 0.0, -0.05), "c30"),
        (Ogden, (0.4, 1.3, -0.3, -2.0), "mu_2"),
    ],
)
def test_a_law_that_falls_at_small_stretch_is_refused_with_its_limit(law, constants, name):
    with pytest.raises(InputError, match=rf"^{name} = -.* up to a principal stretch of 1.5 .* rises up to 1\.\d+\.$"):
        law(*constants)


# One cube of C3D8 elements in each mode, almost incompressible: what CalculiX says the stress is.
DECK = """*NODE, NSET=ALL
1,0,0,0
2,1,0,0
3,1,1,0
4,0,1,0
5,0,0,1
6,1,0,1
7,1,1,1
8,0,1,1
*ELEMENT, TYPE=C3D8, ELSET=CUBE
1,1,2,3,4,5,6,7,8
*MATERIAL, NAME=RUBBER
*HYPERELASTIC, {law}
{constants}
*SOLID SECTION, ELSET=CUBE, MATERIAL=RUBBER
*BOUNDARY
1,1,1
4,1,1
5,1,1
8,1,1
1,2,2
2,2,2
5,2,2
6,2,2
1,3,3
2,3,3
3,3,3
4,3,3
*STEP, NLGEOM, INC=1000
*STATIC
0.1,1
*BOUNDARY
{moved}
*NODE PRINT, NSET=ALL, FREQUENCY=1000
RF,U
*END STEP
"""
FACES = {1: (2, 3, 6, 7), 2: (3, 4, 7, 8), 3: (5, 6, 7, 8)}
DRIVEN = {"uniaxial": {1: 1}, "planar": {1: 1, 2: 0}, "equibiaxial": {1: 1, 2: 1}}
CALCULIX = {
    "ogden 1": (Ogden(0.5, 3.7, poisson_ratio=0.499), "OGDEN, N=1", lambda d: f"0.5,3.7,{d}"),
    "ogden 2": (
        Ogden(0.4, 1.3, 0.1, 5.0, poisson_ratio=0.499), "OGDEN, N=2", lambda d: f"0.4,1.3,0.1,5.0,{d},0."
    ),
    "arruda_boyce": (ArrudaBoyce(0.4, 2.5, poisson_ratio=0.499), "ARRUDA-BOYCE", lambda d: f"0.4,2.5,{d}"),
}  # fmt: skip


@EXTERNAL
@pytest.mark.parametrize("stretch", [0.7, 1.8])
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("name", CALCULIX)
def test_calculix_finds_the_same_stress(name, mode, stretch, tmp_path):
    law, keyword, constants = CALCULIX[name]
    moved = [
        f"{node},{axis},{axis},{factor * (stretch - 1):.15g}"
        for axis, factor in DRIVEN[mode].items()
        for node in FACES[axis]
    ]
    text = DECK.format(law=keyword, constants=constants(f"{2 * law.compressibility:.12g}"), moved="\n".join(moved))
    (tmp_path / "cube.inp").write_text(text)
    run = subprocess.run(["ccx", "cube"], cwd=tmp_path, capture_output=True, text=True)
    assert run.returncode == 0, run.stdout[-500:]
    printed = (tmp_path / "cube.dat").read_text()
    tables = (printed.partition(heading)[2] for heading in ("forces", "displacements"))
    force, displacement = (np.loadtxt(table.splitlines()[2:10])[:, 1:] for table in tables)
    first, third = (sum(force[node - 1, axis - 1] for node in FACES[axis]) for axis in (1, 3))

    # The same cube by our law, at the stretches found there; pressure has no part in the difference of both stresses.
    stretches = 1 + displacement[6]
    isochoric = np.diag(law.stress(*inputs(np.diag(stretches)))) * stretches
    assert first * stretches[0] - third * stretches[2] == pytest.approx(isochoric[0] - isochoric[2], rel=5e-6)
    assert abs(third) < 1e-4
    np.testing.assert_allclose(stretches, MODES[mode](stretch), rtol=0.01)
    # The volume is that of the same bulk modulus, as far as digits are printed.
    assert np.prod(stretches) - 1 == pytest.approx(-isochoric[2] * law.compressibility, abs=1e-4)


@pytest.mark.parametrize("exponent", [-20.0, -8.7, 12.0])
def test_a_positive_term_is_stable_at_any_stretch(exponent):
    """Its energy is convex in the logarithms of the stretches; rounding made it unstable at 1.9, 4.2 and 8.2."""
    assert stable_stretch(Ogden(mu_1=0.1, alpha_1=exponent)) == np.inf
