"""The material laws against closed forms, their own energy and finite differences."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace

import numpy as np
import pytest
from scipy.optimize import brentq

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.mechanics import NeoHookean
from mitsuba_taxel.mechanics.materials.invariants import IsochoricInvariants
from mitsuba_taxel.mechanics.materials.laws import Material, MooneyRivlin, Ogden, Yeoh
from mitsuba_taxel.mechanics.materials.laws.arruda_boyce import ArrudaBoyce
from mitsuba_taxel.mechanics.materials.moduli import PAIRS

pytestmark = pytest.mark.quick

POISSON = [0.0, 0.3, 0.49, 0.4999, 0.5]


@dataclass(frozen=True)
class Gent(Material):
    """A. N. Gent, Rubber Chem. Technol. 69, 59, 1996."""

    mu: float
    limit: float
    poisson_ratio: float = 0.49

    def strain_energy(self, i1, i2):
        return -self.mu * self.limit / 2 * np.log(1 - (i1 - 3) / self.limit)


@dataclass(frozen=True)
class Mixed(Material):
    """A law with all five derivatives."""

    a: float
    b: float
    poisson_ratio: float = 0.49

    def strain_energy(self, i1, i2):
        return self.a * (i1 - 3) * (1 + i2 / 5) + self.b * (np.sqrt(i2) - 3**0.5) ** 2 + self.b * (i1**2 - 9) / i2


LAWS = [
    NeoHookean(),
    NeoHookean(2.5, 0.5),
    MooneyRivlin(0.4, 0.15),
    MooneyRivlin(0.0, 0.3),
    Yeoh(0.5, -0.02, 0.01),
    Yeoh(0.08, 0.014, 0.0, 0.5),
    ArrudaBoyce(0.4, 2.5),
    Ogden(0.4, 1.3, 0.1, 5.0, 0.02, -2.0),
    Ogden(0.6, 2.7, -0.02, -3.0, poisson_ratio=0.5),
    Gent(0.7, 30.0),
    Mixed(0.3, 0.2),
]


@pytest.fixture(params=LAWS, ids=str)
def law(request):
    return request.param


@pytest.fixture
def gradients():
    rng = np.random.default_rng(3)
    gradients = np.eye(3) + 0.3 * rng.uniform(-1, 1, (50, 3, 3))
    return gradients[np.linalg.det(gradients) > 0.3]


def stress(law, gradient):
    return law.stress(gradient, np.linalg.det(gradient), np.swapaxes(np.linalg.inv(gradient), -1, -2))


def tangent(law, gradient):
    return law.tangent(gradient, np.linalg.det(gradient), np.swapaxes(np.linalg.inv(gradient), -1, -2))


def differences(function, gradient, step=1e-5):
    columns = []
    for i in range(3):
        for j in range(3):
            offset = np.zeros((3, 3))
            offset[i, j] = step
            columns.append((function(gradient + offset) - function(gradient - offset)) / (2 * step))
    columns = np.stack(columns, axis=-1)
    return columns.reshape(*columns.shape[:-1], 3, 3)


def test_stress_is_the_derivative_of_the_energy(law, gradients):
    expected = differences(law.energy, gradients)
    np.testing.assert_allclose(stress(law, gradients), expected, atol=3e-9 * np.abs(expected).max())


def test_tangent_is_the_derivative_of_the_stress_and_symmetric(law, gradients):
    moduli = tangent(law, gradients)
    expected = differences(lambda f: stress(law, f), gradients)
    np.testing.assert_allclose(moduli, expected, atol=3e-9 * np.abs(expected).max())
    np.testing.assert_allclose(moduli, moduli.transpose(0, 3, 4, 1, 2), atol=1e-14 * np.abs(moduli).max())


def test_the_stiffness_of_elements_is_that_of_all_components(law, gradients):
    """With a pressure that does work on the volume, whose moduli are those of p J."""
    rng = np.random.default_rng(6)
    gradients = gradients[:12].reshape(3, 4, 3, 3)
    determinant, turned = np.linalg.det(gradients), np.swapaxes(np.linalg.inv(gradients), -1, -2)
    pressure, weight = rng.normal(size=(3, 4)), rng.uniform(0.5, 1, (3, 4))
    shapes = rng.normal(size=(3, 4, 10, 3))
    dense = tangent(law, gradients) + differences(
        lambda f: pressure[..., None, None] * np.linalg.det(f)[..., None, None] * np.linalg.inv(f).swapaxes(-1, -2),
        gradients,
    )
    whole = np.einsum("mq,mqaj,mqijkl,mqbl->mabik", weight, shapes, dense, shapes)
    expected = whole[:, PAIRS[0], PAIRS[1]].reshape(3, -1, 9)
    blocks = law.moduli(gradients, determinant, turned, pressure).stiffness(weight, shapes)
    np.testing.assert_allclose(blocks, expected, atol=1e-8 * np.abs(expected).max())


def test_energy_does_not_know_rotations_and_stress_turns_with_them(law, gradients):
    rotation, _ = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))
    rotation *= np.linalg.det(rotation)
    np.testing.assert_allclose(law.energy(rotation @ gradients), law.energy(gradients), rtol=1e-12)
    np.testing.assert_allclose(law.energy(gradients @ rotation), law.energy(gradients), rtol=1e-12)
    upright = stress(law, gradients)
    bound = 1e-13 * np.abs(upright).max()
    np.testing.assert_allclose(stress(law, rotation @ gradients), rotation @ upright, atol=bound)
    np.testing.assert_allclose(stress(law, gradients @ rotation), upright @ rotation, atol=bound)


def test_volume_changes_alone_make_no_isochoric_stress(law):
    swollen = np.array([0.7, 1.0, 1.6])[:, None, None] * np.eye(3)
    np.testing.assert_allclose(law.energy(swollen), law.energy(np.eye(3)), atol=1e-14)
    np.testing.assert_allclose(stress(law, swollen), 0, atol=1e-14)


def test_any_batch_of_gradients_is_taken(law, gradients):
    batch = gradients[:6].reshape(2, 3, 3, 3)
    np.testing.assert_allclose(stress(law, batch), stress(law, gradients[:6]).reshape(batch.shape), rtol=1e-13)
    np.testing.assert_allclose(tangent(law, batch)[1, 2], tangent(law, gradients[5]), rtol=1e-13, atol=1e-14)


def test_a_law_of_the_first_invariant_does_not_pay_for_the_second(gradients, monkeypatch):
    def refuse(self):
        raise AssertionError("computed")

    monkeypatch.setattr(IsochoricInvariants, "second", property(refuse))
    monkeypatch.setattr(IsochoricInvariants, "_h", property(refuse))
    for law in (NeoHookean(), Yeoh(0.5, 0.1, 0.0), Gent(0.7, 30.0)):
        stress(law, gradients), tangent(law, gradients)
    monkeypatch.setattr(IsochoricInvariants, "first_derivative", property(refuse))
    tangent(NeoHookean(), gradients)  # nor for second derivatives of its energy, which are zero
    with pytest.raises(AssertionError):
        tangent(Yeoh(0.5, 0.1, 0.0), gradients)


@pytest.mark.parametrize("nu", POISSON)
def test_moduli_at_small_strain_are_those_of_linear_elasticity(nu):
    law = NeoHookean(2.5, nu)
    assert law.shear_modulus == pytest.approx(2.5 / (2 * (1 + nu)))
    assert law.compressibility == pytest.approx(3 * (1 - 2 * nu) / 2.5)
    # Stretched along z, free laterally: 1/E = 1/(9 kappa) + 1/(3 mu).
    assert law.compressibility / 9 + 1 / (3 * law.shear_modulus) == pytest.approx(1 / 2.5)


def test_tangent_at_rest_is_that_of_linear_elasticity(law):
    """mu (delta_ik delta_jl + delta_il delta_jk - 2/3 delta_ij delta_kl)."""
    one = np.eye(3)
    shear = np.einsum("ik,jl->ijkl", one, one) + np.einsum("il,jk->ijkl", one, one)
    expected = law.shear_modulus * (shear - 2 / 3 * np.einsum("ij,kl->ijkl", one, one))
    np.testing.assert_allclose(tangent(law, one), expected, atol=1e-14)


def test_moduli_at_small_strain_follow_from_the_constants(law):
    nu = law.poisson_ratio
    shear_modulus = {
        NeoHookean: lambda: law.youngs_modulus / (2 * (1 + nu)),
        MooneyRivlin: lambda: 2 * (law.c10 + law.c01),
        Yeoh: lambda: 2 * law.c10,
        ArrudaBoyce: lambda: (
            law.chain_modulus
            * sum(
                2 * i * c * 3 ** (i - 1) / law.locking_stretch ** (2 * i - 2)
                for i, c in enumerate((1 / 2, 1 / 20, 11 / 1050, 19 / 7000, 519 / 673750), 1)
            )
        ),
        Ogden: lambda: law.mu_1 + law.mu_2 + law.mu_3,
        Gent: lambda: law.mu,
        Mixed: lambda: 2 * (law.a * 8 / 5 + law.b * 2),
    }[type(law)]()
    assert law.shear_modulus == pytest.approx(shear_modulus, rel=1e-14)
    assert law.youngs_modulus == pytest.approx(2 * shear_modulus * (1 + nu), rel=1e-14)
    assert law.compressibility == pytest.approx(3 * (1 - 2 * nu) / (2 * shear_modulus * (1 + nu)), rel=1e-14)


def test_a_law_is_a_value_whose_parameters_can_be_replaced(law):
    assert law.parameters == tuple(asdict(law))
    assert "poisson_ratio" in law.parameters
    for name in law.parameters:
        assert replace(law, **{name: getattr(law, name)}) == law
    harder = replace(law, **{law.parameters[0]: 2 * getattr(law, law.parameters[0]) + 0.1})
    assert harder.shear_modulus > law.shear_modulus
    assert len({law, harder, replace(law)}) == 2


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        ({"youngs_modulus": 0.0}, "youngs_modulus"),
        ({"youngs_modulus": -1.0}, "youngs_modulus"),
        ({"youngs_modulus": math.nan}, "youngs_modulus"),
        ({"youngs_modulus": math.inf}, "youngs_modulus"),
        ({"youngs_modulus": "soft"}, "youngs_modulus"),
        ({"poisson_ratio": 0.51}, "poisson_ratio"),
        ({"poisson_ratio": -0.1}, "poisson_ratio"),
        ({"poisson_ratio": math.nan}, "poisson_ratio"),
        ({"poisson_ratio": None}, "poisson_ratio"),
    ],
)
def test_moduli_out_of_range_are_refused_in_one_line(arguments, name):
    with pytest.raises(InputError, match=rf"^{name} = .* is not allowed") as caught:
        NeoHookean(**arguments)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("law", "arguments", "name"),
    [
        (MooneyRivlin, (-0.1, 0.5), "c10"),
        (MooneyRivlin, (0.5, -0.14), "c01"),
        (MooneyRivlin, (0.0, 0.0), "shear_modulus"),
        (MooneyRivlin, (math.nan, 0.1), "c10"),
        (MooneyRivlin, (0.1, math.inf), "c01"),
        (MooneyRivlin, (0.1, 0.1, 0.6), "poisson_ratio"),
        (Yeoh, (0.0, 0.1, 0.1), "c10"),
        (Yeoh, (-0.1, 0.1, 0.1), "c10"),
        (Yeoh, (0.5, 0.1, -0.1), "c30"),
        (Yeoh, (0.5, -0.07, 0.0), "c20"),
        (Yeoh, (0.5, -0.13, 0.01), "c20"),
        (Ogden, (0.5, 0.0), "alpha_1"),
        (Ogden, (0.5, 2.0, 0.1, 0.0), "alpha_2"),
        (Ogden, (0.5, 51.0), "alpha_1"),
        (Ogden, (-0.5, 2.0), "mu_1"),
        (Ogden, (0.0, 2.0), "shear_modulus"),
        (Ogden, (0.4, 1.3, -0.3, -2.0), "mu_2"),
        (Ogden, (math.nan, 2.0), "mu_1"),
        (Yeoh, (0.5, "stiff", 0.01), "c20"),
        (Yeoh, (0.5, 0.1, None), "c30"),
        (Yeoh, (0.5, 0.1, 0.0, -0.2), "poisson_ratio"),
        (Gent, (-0.7, 30.0), "shear_modulus"),
        (Gent, (math.nan, 30.0), "mu"),
    ],
)
def test_what_makes_no_sensible_material_is_refused_in_one_line(law, arguments, name):
    with pytest.raises(InputError, match=rf"^{name} = .* is not allowed: .* needed") as caught:
        law(*arguments)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("share", [0.5, 0.999, 1.001])
def test_a_negative_c20_is_allowed_as_long_as_the_energy_rises(share):
    c10, c30 = 0.4, 0.02
    c20 = -share * math.sqrt(3 * c10 * c30)
    x = np.linspace(0, 20, 20001)
    rises = (c10 + 2 * c20 * x + 3 * c30 * x**2 > 0).all()
    assert rises == (share < 1)
    if rises:
        Yeoh(c10, c20, c30)
    else:
        with pytest.raises(InputError, match="^c20 = "):
            Yeoh(c10, c20, c30)


MOONEY, YEOH = MooneyRivlin(0.4, 0.15, 0.5), Yeoh(0.5, -0.02, 0.01, 0.5)

# Nominal stress along the first axis of the incompressible solid, free of stress along the third: 2 (x - x^-2)
# (W1 + W2 / x) in uniaxial, 2 (x - x^-5) (W1 + x^2 W2) in equibiaxial and 2 (x - x^-3) (W1 + W2) in planar tension
# or compression (L. R. G. Treloar, The Physics of Rubber Elasticity, 3rd ed., 1975; R. S. Rivlin and D. W. Saunders,
# Phil. Trans. R. Soc. A 243, 251, 1951), with the laws' constants put in.
HOMOGENEOUS = {
    "uniaxial": (
        lambda x: (x, x**-0.5, x**-0.5),
        lambda x, c10, c01: 2 * (x - x**-2) * (c10 + c01 / x),
        lambda x, c10, c20, c30: 2 * (x - x**-2) * (c10 + 2 * c20 * (d := x**2 + 2 / x - 3) + 3 * c30 * d**2),
    ),
    "equibiaxial": (
        lambda x: (x, x, x**-2),
        lambda x, c10, c01: 2 * (x - x**-5) * (c10 + c01 * x**2),
        lambda x, c10, c20, c30: 2 * (x - x**-5) * (c10 + 2 * c20 * (d := 2 * x**2 + x**-4 - 3) + 3 * c30 * d**2),
    ),
    "planar": (
        lambda x: (x, 1.0, 1 / x),
        lambda x, c10, c01: 2 * (x - x**-3) * (c10 + c01),
        lambda x, c10, c20, c30: 2 * (x - x**-3) * (c10 + 2 * c20 * (d := x**2 + x**-2 - 2) + 3 * c30 * d**2),
    ),
}


def closed_form(mode, law, stretch):
    _, mooney, yeoh = HOMOGENEOUS[mode]
    if law is MOONEY:
        return mooney(stretch, law.c10, law.c01)
    return yeoh(stretch, law.c10, law.c20, law.c30)


@pytest.mark.parametrize("stretch", [0.4, 0.8, 1.1, 1.6, 3.0])
@pytest.mark.parametrize("law", [MOONEY, YEOH], ids=["mooney_rivlin", "yeoh"])
@pytest.mark.parametrize("mode", HOMOGENEOUS)
def test_homogeneous_stretch_of_an_incompressible_solid(mode, law, stretch):
    stretches = np.array(HOMOGENEOUS[mode][0](stretch))
    isochoric = stress(law, np.diag(stretches))
    np.testing.assert_allclose(isochoric, np.diag(np.diag(isochoric)), atol=1e-14)
    nominal = np.diag(isochoric) - isochoric[2, 2] * stretches[2] / stretches  # p F^-T with p = -P33 l3
    assert nominal[0] == pytest.approx(closed_form(mode, law, stretch), rel=1e-12)


@pytest.mark.parametrize("shear", [0.1, 0.7, 2.0])
@pytest.mark.parametrize("law", [MOONEY, YEOH], ids=["mooney_rivlin", "yeoh"])
def test_simple_shear_of_an_incompressible_solid(law, shear):
    """s_12 = 2 (W1 + W2) g, s_11 - s_33 = 2 W1 g^2, s_22 - s_33 = -2 W2 g^2 (Cauchy; Rivlin 1948)."""
    gradient = np.eye(3) + shear * np.outer([1, 0, 0], [0, 1, 0])
    cauchy = stress(law, gradient) @ gradient.T
    w1, w2 = (law.c10, law.c01) if law is MOONEY else (law.c10 + 2 * law.c20 * shear**2 + 3 * law.c30 * shear**4, 0)
    assert cauchy[0, 1] == pytest.approx(2 * (w1 + w2) * shear, rel=1e-13)
    assert cauchy[0, 0] - cauchy[2, 2] == pytest.approx(2 * w1 * shear**2, rel=1e-13)
    assert cauchy[1, 1] - cauchy[2, 2] == pytest.approx(-2 * w2 * shear**2, rel=1e-12, abs=1e-14)
    np.testing.assert_allclose(cauchy, cauchy.T, atol=1e-14)


@pytest.mark.parametrize(("extension", "softer"), [(0.3, 1e-4), (0.5, 1e-3), (0.6, 5e-3), (0.7, 0.025)])
def test_eight_chains_follow_the_inverse_langevin_function(extension, softer):
    """dW/dI1 = (mu N^(1/2) / (6 lambda)) L^-1(lambda / N^(1/2)), where lambda^2 = I1 / 3 (Arruda and Boyce 1993)."""
    locking = 3.0
    stretch = extension * locking
    slope = brentq(lambda x: 1 / math.tanh(x) - 1 / x - extension, 1e-3, 100)
    law, i1, step = ArrudaBoyce(0.5, locking), 3 * stretch**2, 1e-4
    rate = (law.strain_energy(i1 + step, 3.0) - law.strain_energy(i1 - step, 3.0)) / (2 * step)
    assert -softer <= rate / (0.5 * locking / (6 * stretch) * slope) - 1 <= 1e-6
