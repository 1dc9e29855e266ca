"""Derivatives of a deformed pad by load and material: against differences of full solves, and what scaling demands."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.mechanics import (
    MooneyRivlin,
    NeoHookean,
    Ogden,
    PatchForce,
    PlateDisplacement,
    PlateForce,
    Pressure,
    SpreadForce,
    State,
    Yeoh,
    load_path,
)
from mitsuba_taxel.mechanics.derivatives.sensitivities import linearise
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import LoadedPad
from mitsuba_taxel.pads import Pad, mesh_pad
from mitsuba_taxel.parameters import parameters_of

LOADS = {
    "normal": (SpreadForce(), (0.0, 0.0, -0.3)),
    "tangential": (SpreadForce(), (0.12, -0.05, -0.2)),
    "patch": (PatchForce((0.6, 0.4), (0.5, 0.7)), (0.03, 0.0, -0.1)),
    "plate force": (PlateForce(), (0.15, -0.05, -0.5)),
    "plate displacement": (PlateDisplacement(), (0.06, 0.02, -0.09)),
    "pressure": (Pressure(), (0.4,)),
}
"""Values for a shear modulus of 1 MPa where they are forces or pressures."""
MATERIALS = {
    "neo-Hookean": NeoHookean(4.16, 0.49),
    "incompressible": NeoHookean(2.0, 0.5),
    "Mooney-Rivlin": MooneyRivlin(0.5, 0.2, 0.48),
    "Yeoh": Yeoh(0.7, -0.05, 0.1),
    "Ogden": Ogden(0.6, 1.7, 0.1, -2.0, 0.02, 4.0),
}


def value_of(kind, material):
    load, value = LOADS[kind]
    return np.array(value) * (1 if isinstance(load, PlateDisplacement) else material.shear_modulus)


def each(cases):
    return pytest.mark.parametrize(
        ("material", "load", "value"),
        [(MATERIALS[law], LOADS[kind][0], value_of(kind, MATERIALS[law])) for law, kind in cases],
        ids=[f"{law}, {kind}" for law, kind in cases],
    )


# An incompressible block under pressure stays as it is.
CASES = [(law, kind) for law in MATERIALS for kind in LOADS if (law, kind) != ("incompressible", "pressure")]
every_law = each([(law, kind) for law, kind in CASES if kind in ("tangential", "plate displacement", "pressure")])
every_case = each(CASES)


@pytest.fixture
def mesh(block):
    """A block that has no symmetry."""
    return block((1.2, 1.0, 0.8), (2, 2, 2), distortion=0.15, curvature=0.02)


def solved(mesh, material, load, value, start=None):
    """A state in balance to rounding errors, from a ``start`` near by or from rest."""
    pad, value = LoadedPad(mesh, material, load), np.array(value, dtype=float)
    unknowns = np.zeros(pad.unknowns) if start is None else pad.gather(start.displacement, start.pressure)
    for share in (0.5, 1.0) if start is None else (1.0,):
        solution, linearised = pad.solve(unknowns, share * value)
        unknowns = solution.unknowns
    for _ in range(3):  # the tangent may be that of an earlier iterate, with which one step is not enough
        unknowns = unknowns - pad.correction(linearised, unknowns, value)
    displacement, pressure = pad.split(unknowns)
    return State(mesh, material, load, value, displacement, pressure, solution.min_jacobian, 0.0, 0, True)


def difference(state_at, step):
    """Central difference of fourth order of the displacement by a number."""
    ahead, behind, further, back = (state_at(k * step).displacement for k in (1, -1, 2, -2))
    return (8 * (ahead - behind) - (further - back)) / (12 * step)


def one_sided(state_at, step):
    """Difference of third order of the displacement on one side."""
    here, first, second, third = (state_at(k * step).displacement for k in range(4))
    return (18 * first - 9 * second + 2 * third - 11 * here) / (6 * step)


def by_parameter(state, name, differ=difference, relative_step=1e-3):
    value = getattr(state.material, name)

    def state_at(change):
        material = replace(state.material, **{name: value + change})
        return solved(state.mesh, material, state.load, state.value, state)

    return differ(state_at, relative_step * (abs(value) or 1.0))


def assert_near(found, expected, tolerance, scale=None):
    assert np.abs(found - expected).max() <= tolerance * (scale or np.abs(expected).max())


def example(mesh, kind, material):
    return solved(mesh, material, LOADS[kind][0], value_of(kind, material))


def size_of(numbers):
    return np.abs(numbers).max()


@each([("Yeoh", kind) for kind in LOADS] + [(law, "tangential") for law in MATERIALS if law != "Yeoh"])
def test_by_value_is_the_difference_of_full_solves(material, load, value, mesh):
    state = solved(mesh, material, load, value)
    answer = linearise(state)
    rng = np.random.default_rng(3)
    direction = rng.normal(size=len(value))
    step = 1e-3 * np.linalg.norm(value)
    expected = difference(lambda s: solved(mesh, material, load, state.value + s * direction, state), step)
    assert_near(answer.by_value(direction), expected, 1e-8)


def test_by_place_is_the_difference_of_full_solves(mesh):
    """Of a patch across edges of elements, which its edge does not meet: there the share of nodes is smooth."""
    state = example(mesh, "patch", MATERIALS["Yeoh"])

    def state_at(step):
        patch = replace(state.load, centre=tuple(np.add(state.load.centre, step * np.array([0.6, -0.8]))))
        return solved(mesh, state.material, patch, state.value, state)

    assert_near(linearise(state).by_place([0.6, -0.8]), difference(state_at, 1e-4), 1e-5)
    for kind in ("normal", "plate force"):
        assert not linearise(example(mesh, kind, MATERIALS["Yeoh"])).by_place([1, 0]).any()


@every_law
def test_by_material_is_the_difference_of_full_solves(material, load, value, mesh):
    """Relative to the displacement, for a change of the parameter by itself: some parameters hardly matter."""
    state = solved(mesh, material, load, value)
    answer = linearise(state)
    for name in material.parameters:
        if material.poisson_ratio == 0.5 and name == "poisson_ratio":
            expected = by_parameter(state, name, one_sided, -1e-4)
        else:
            expected = by_parameter(state, name)
        number = getattr(material, name)
        assert_near(number * answer.by_material(name), number * expected, 1e-8, size_of(state.displacement))


@pytest.mark.parametrize(
    ("material", "name"),
    [
        (MooneyRivlin(0.5, 0.0), "c01"),
        (MooneyRivlin(0.0, 0.5), "c10"),
        (Yeoh(0.7, 0.0, 0.0), "c20"),
        (Yeoh(0.7, 0.0, 0.0), "c30"),
        (NeoHookean(4.16, 0.0), "poisson_ratio"),
        (NeoHookean(4.16, 0.5), "poisson_ratio"),
        (NeoHookean(4.16, 0.499999), "poisson_ratio"),
    ],
)
def test_a_parameter_at_the_end_of_what_its_law_allows(material, name, mesh):
    state = example(mesh, "tangential", material)
    step = -1e-4 if material.poisson_ratio > 0.4999 else 1e-4
    expected = by_parameter(state, name, one_sided, step)
    assert_near(linearise(state).by_material(name), expected, 1e-7)


def test_poisson_s_ratio_has_the_same_effect_just_below_one_half(mesh):
    at, below = (linearise(example(mesh, "tangential", NeoHookean(4.16, nu))) for nu in (0.5, 0.49999))
    assert_near(below.by_material("poisson_ratio"), at.by_material("poisson_ratio"), 1e-3)


@every_law
def test_a_stiffer_pad_under_a_larger_load_has_the_same_shape(material, load, value, mesh):
    """Shapes depend on load over modulus alone, at a given Poisson's ratio; under a driven plate not even on that."""
    answer = linearise(solved(mesh, material, load, value))
    moduli = [name for name, parameter in parameters_of(type(material)).items() if parameter.unit == "MPa"]
    stiffer = sum(getattr(material, name) * answer.by_material(name) for name in moduli)
    larger = answer.by_value(value)
    if isinstance(load, PlateDisplacement):
        assert size_of(stiffer) < 1e-10 * size_of(larger)
    else:
        assert_near(-stiffer, larger, 1e-9)


@every_case
def test_pull_back_is_the_transpose(material, load, value, mesh):
    answer = linearise(solved(mesh, material, load, value))
    cotangent = np.random.default_rng(5).normal(size=(len(mesh.points), 3))
    gradient = answer.pull_back(cotangent)
    assert gradient.value.shape == (len(value),)
    assert set(gradient.material) == set(material.parameters)
    for component, unit in zip(gradient.value, np.eye(len(value)), strict=True):
        rate = answer.by_value(unit)
        assert component == pytest.approx((cotangent * rate).sum(), abs=1e-10 * size_of(rate))
    for name, component in gradient.material.items():
        rate = answer.by_material(name)
        bound = 1e-10 * max(size_of(rate), size_of(answer.displacement) / abs(getattr(material, name)))
        assert component == pytest.approx((cotangent * rate).sum(), abs=bound)


@pytest.mark.parametrize("kind", LOADS)
def test_pull_back_of_a_scalar_that_is_not_linear(kind, mesh):
    """L = log(1 + sum w |u|^2 / u0^2), by differences of full solves along a change of all components at once."""
    material, rng = MATERIALS["Yeoh"], np.random.default_rng(7)
    load, value = LOADS[kind][0], value_of(kind, material)
    weight, direction = rng.uniform(size=(len(mesh.points), 1)), rng.normal(size=len(value))
    state = solved(mesh, material, load, value)
    unit = size_of(state.displacement)
    inside = 1 + (weight * state.displacement**2).sum() / unit**2
    gradient = linearise(state).pull_back(2 * weight * state.displacement / unit**2 / inside)

    def scalar(changed):
        return np.log(1 + (weight * changed.displacement**2).sum() / unit**2)

    def slope(state_at, step):
        ahead, behind, further, back = (scalar(state_at(k * step)) for k in (1, -1, 2, -2))
        return (8 * (ahead - behind) - (further - back)) / (12 * step)

    by_value = slope(
        lambda s: solved(mesh, material, load, state.value + s * direction, state), 1e-3 * np.linalg.norm(value)
    )
    assert gradient.value @ direction == pytest.approx(by_value, rel=1e-7)
    for name in ("c10", "poisson_ratio"):
        number = getattr(material, name)
        by_number = slope(
            lambda s, name=name, number=number: solved(
                mesh, replace(material, **{name: number * (1 + s)}), load, value, state
            ),
            1e-4,
        )
        assert number * gradient.material[name] == pytest.approx(by_number, rel=1e-7)


def test_answers_are_linear(mesh):
    answer = linearise(example(mesh, "tangential", MATERIALS["Yeoh"]))
    rng = np.random.default_rng(2)
    a, b = rng.normal(size=(2, 3))
    expected = 2 * answer.by_value(a) - 3 * answer.by_value(b)
    assert_near(answer.by_value(2 * a - 3 * b), expected, 1e-12)
    f, g = rng.normal(size=(2, len(mesh.points), 3))
    both, first, second = (answer.pull_back(cotangent) for cotangent in (2 * f - 3 * g, f, g))
    assert_near(both.value, 2 * first.value - 3 * second.value, 1e-11)
    for name, component in both.material.items():
        assert component == pytest.approx(2 * first.material[name] - 3 * second.material[name], rel=1e-9)


@pytest.mark.parametrize("load", [SpreadForce(), PlateForce()], ids=["spread", "plate"])
@pytest.mark.parametrize("young", [0.5, 4.16])
def test_at_rest_without_poisson_s_ratio_a_block_yields_as_a_spring(young, load, block):
    """u = z F / (E A), by the linear theory: nothing bulges, so that the glue does not matter."""
    mesh = block((1.5, 0.8, 2.0), (2, 2, 3), distortion=0.15, curvature=0.02)
    still, no_pressure = np.zeros_like(mesh.points), np.zeros(mesh.corner_count)
    rest = State(mesh, NeoHookean(young, 0.0), load, np.zeros(3), still, no_pressure, 1.0, 0.0, 0, True)
    answer = linearise(rest)
    expected = mesh.points * [0, 0, 1 / (young * 1.5 * 0.8)]
    assert_near(answer.by_value((0, 0, 1)), expected, 1e-10)
    assert not answer.by_material("youngs_modulus").any()


@pytest.mark.parametrize("kind", ["tangential", "plate force"])
def test_the_work_of_one_force_on_another_s_displacement_is_mutual(kind, mesh):
    """Betti: the compliance of the loaded face is a symmetric matrix, about a strained state too."""
    answer = linearise(example(mesh, kind, MATERIALS["Mooney-Rivlin"]))
    share = SpreadForce().nodal(mesh)  # under a plate all of the top moves as one
    compliance = np.stack([share @ answer.by_value(unit) / share.sum() for unit in np.eye(3)])
    assert_near(compliance, compliance.T, 1e-11)
    assert np.linalg.eigvalsh(compliance).min() > 0


def test_a_driven_plate_moves_the_top_with_it(mesh):
    answer = linearise(example(mesh, "plate displacement", MATERIALS["neo-Hookean"]))
    top = np.isclose(mesh.points[:, 2], 0.8)
    rate = answer.by_value((0.3, -0.2, 1.0))
    np.testing.assert_allclose(rate[top], [[0.3, -0.2, 1.0]] * np.count_nonzero(top), rtol=0, atol=1e-11)
    assert not answer.by_value((0.3, -0.2, 1.0))[np.isclose(mesh.points[:, 2], 0)].any()


@pytest.fixture(scope="module")
def pad_states():
    """States of a small pad: of a symmetric load, and of one that has no symmetry; both between nodes of the path."""
    pad = Pad("hemispheric", rows=1, columns=1)
    return load_path(pad, NeoHookean(), [(0, 0, -1.0), (0.3, -0.2, -1.0)], mesh_size=2.0)


@pytest.mark.parametrize("number", [0, 1])
def test_a_state_between_nodes_is_first_brought_to_balance(number, pad_states):
    state = pad_states[number]
    exact = solved(state.mesh, state.material, state.load, state.value)
    answer = linearise(state)
    assert size_of(state.displacement - exact.displacement) > 1e-8 * size_of(exact.displacement)
    assert_near(answer.displacement, exact.displacement, 1e-9)
    assert_near(answer.pressure, exact.pressure, 1e-8)  # forces balance to 1e-9 of the load


@pytest.mark.parametrize(
    ("value", "direction"), [((0, 0, -1.0), (0, 0, -1)), ((-0.2, 0.3, -1.0), np.array([-2, 3, 0]) / 13**0.5)]
)
def test_a_path_goes_on_as_the_tangent_says(value, direction):
    """Of a state whose path is a mirror image, too."""
    state = load_path(Pad("hemispheric", rows=1, columns=1), NeoHookean(), [value], mesh_size=2.0)[0]
    found = state.path_rate()
    np.testing.assert_allclose(found.direction, direction, atol=1e-12)
    assert_near(found.displacement, linearise(state).by_value(direction), 2e-4)


def test_at_rest_no_direction_of_a_path_is_known():
    state = load_path(Pad("hemispheric", rows=1, columns=1), NeoHookean(), [(0, 0, 0)], mesh_size=2.0)[0]
    assert state.path_rate() is None


def test_a_symmetric_state_answers_changes_that_break_its_symmetry(pad_states):
    state = pad_states[0]
    answer = linearise(state)
    sideways = np.array([0.8, 0.6, 0.0])
    expected = difference(
        lambda s: solved(state.mesh, state.material, state.load, state.value + s * sideways, answer), 5e-3
    )
    assert_near(answer.by_value(sideways), expected, 1e-8)
    cotangent = np.zeros_like(state.displacement)
    cotangent[np.argmax(state.mesh.points @ [1.0, 0.3, 1.0]), 1] = 1.0  # one node at a corner of the top, along y
    assert answer.pull_back(cotangent).value @ sideways == pytest.approx((cotangent * expected).sum(), rel=1e-7)


def test_an_incompressible_hollow_pad_under_pressure():
    mesh, law, load = mesh_pad(Pad("hemispheric", rows=1, columns=1), 3.0), NeoHookean(4.16, 0.5), Pressure()
    state = solved(mesh, law, load, (0.15,))
    answer = linearise(state)
    expected = difference(lambda s: solved(mesh, law, load, state.value + s, state), 3e-4)
    assert_near(answer.by_value((1.0,)), expected, 1e-8)
    assert_near(-4.16 * answer.by_material("youngs_modulus"), 0.15 * expected, 1e-8)
    gradient = answer.pull_back(state.displacement)
    assert gradient.value == pytest.approx([(state.displacement * expected).sum()], rel=1e-8)


def test_a_state_that_is_not_stable_has_no_sensitivities(block):
    """A slender column beyond Euler's load."""
    mesh = block((1.0, 1.0, 12.0), (1, 1, 12))
    euler = np.pi**2 * 4.16 / 12 / (2 * 12.0) ** 2
    below = solved(mesh, NeoHookean(4.16, 0.3), SpreadForce(), (0, 0, -0.8 * euler))
    linearise(below)
    with pytest.raises(ComputationError, match=r"force = \(0, 0, -0\.0\d+\) N: .*unstable"):
        linearise(replace(below, value=np.array([0, 0, -1.3 * euler])))


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda a: a.by_value((1.0, 0.0)), r"direction = \[1.0, 0.0\] is not allowed: an array \(3,\)"),
        (lambda a: a.by_value((1.0, 0.0, np.nan)), r"direction = \[1.0, 0.0, nan\]"),
        (lambda a: a.by_value("down"), "direction = down"),
        (lambda a: a.by_material("c10"), "parameter = 'c10' is not allowed: one of youngs_modulus, poisson_ratio is"),
        (lambda a: a.pull_back(a.displacement.ravel()), r"gradient = \(\d+,\) is not allowed: an array \(\d+, 3\)"),
        (lambda a: a.pull_back(np.nan * a.displacement), "finite numbers"),
    ],
)
def test_what_is_asked_wrongly_is_refused(ask, message, mesh):
    answer = linearise(example(mesh, "normal", NeoHookean()))
    with pytest.raises(InputError, match=message):
        ask(answer)
