"""Derivatives of a deformed pad by its shape: against differences of full solves on morphed meshes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.mechanics import (
    MooneyRivlin,
    NeoHookean,
    PatchForce,
    PlateDisplacement,
    PlateForce,
    Pressure,
    SpreadForce,
    State,
    Yeoh,
)
from mitsuba_taxel.mechanics.derivatives import sensitivities
from mitsuba_taxel.mechanics.derivatives.sensitivities import linearise
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import LoadedPad
from mitsuba_taxel.pads import CELL_SHAPES, REGIONS, Pad, mesh_velocity

LOADS = {
    "spread force": (SpreadForce(), (0.12, -0.05, -0.2)),
    "patch": (PatchForce((0.6, 0.4), (0.5, 0.7)), (0.03, 0.0, -0.1)),
    "plate force": (PlateForce(), (0.15, -0.05, -0.5)),
    "plate displacement": (PlateDisplacement(), (0.06, 0.02, -0.09)),
    "pressure": (Pressure(), (0.3,)),
}
LAW = Yeoh(0.7, -0.05, 0.1)
LAWS = {"incompressible": NeoHookean(2.0, 0.5), "Mooney-Rivlin": MooneyRivlin(0.5, 0.2, 0.48), "Yeoh": LAW}


class Solved:
    """A state in balance to rounding errors, and those of the same pad on morphed meshes."""

    def __init__(self, mesh, material, load, value) -> None:
        self.value = np.array(value, dtype=float)
        pad = LoadedPad(mesh, material, load)
        solution, self._linearised = pad.solve(np.zeros(pad.unknowns), self.value)
        unknowns = solution.unknowns
        self._unknowns = unknowns - pad.correction(self._linearised, unknowns, self.value)
        fields = pad.split(self._unknowns)
        self.state = State(mesh, material, load, self.value, *fields, solution.min_jacobian, 0.0, 0, True)

    def morphed(self, moves):
        """Displacement with the undeformed nodes moved a little."""
        state, unknowns = self.state, self._unknowns
        pad = LoadedPad(replace(state.mesh, points=state.mesh.points + moves), state.material, state.load)
        for _ in range(8):  # the tangent is that of the pad as it was, which leaves but a small share of the error
            correction = pad.correction(self._linearised, unknowns, self.value)
            unknowns = unknowns - correction
            if np.abs(correction).max() < 1e-9 * np.abs(unknowns).max():
                break
        return pad.split(unknowns)[0]

    def difference(self, velocity, step):
        """Central difference of fourth order of the displacement."""
        ahead, behind, further, back = (self.morphed(k * step * velocity) for k in (1, -1, 2, -2))
        return (8 * (ahead - behind) - (further - back)) / (12 * step)


def solved(mesh, material, load, value):
    return Solved(mesh, material, load, value).state


def assert_near(found, expected, tolerance):
    assert np.abs(found - expected).max() <= tolerance * np.abs(expected).max()


def bending(mesh):
    """A velocity without symmetry, under which the bottom stays flat."""
    x, y, z = mesh.points.T
    return np.stack([0.3 * x + 0.2 * y * z, np.sin(x + z) - 0.2 * y, z * (0.5 + 0.3 * x - 0.4 * y**2)], axis=1)


@pytest.fixture
def mesh(block):
    """A block that has no symmetry."""
    return block((1.2, 1.0, 0.8), (2, 2, 2), distortion=0.15, curvature=0.02)


@pytest.mark.parametrize(
    ("law", "kind"), [("Yeoh", kind) for kind in LOADS] + [(law, "spread force") for law in LAWS if law != "Yeoh"]
)
def test_by_shape_is_the_difference_of_full_solves(law, kind, mesh):
    load, value = LOADS[kind]
    here, velocity = Solved(mesh, LAWS[law], load, value), bending(mesh)
    answer = linearise(here.state)
    found = answer.by_shape(velocity)
    assert_near(found, here.difference(velocity, 2e-3), 1e-7)
    other = mesh.points * [[1.0, 1.0, 0.0]]
    assert_near(answer.by_shape(velocity + other), found + answer.by_shape(other), 1e-9)


@pytest.mark.parametrize("kind", LOADS)
def test_pull_back_by_shape_is_the_transpose(kind, mesh):
    state = solved(mesh, LAW, *LOADS[kind])
    answer, rng = linearise(state), np.random.default_rng(3)
    shapes = {"bending": bending(mesh), "any": rng.standard_normal(mesh.points.shape)}
    gradient = rng.standard_normal(mesh.points.shape)
    found = answer.pull_back(gradient, shapes).shape
    assert found == pytest.approx({n: np.vdot(gradient, answer.by_shape(v)) for n, v in shapes.items()}, rel=1e-8)


def test_a_larger_pad_has_a_larger_displacement(mesh):
    """All lengths scaled at equal stress: u(lambda X) = lambda u(X), with forces by lambda squared."""
    state = solved(mesh, LAW, *LOADS["spread force"])
    answer = linearise(state)
    rate = answer.by_shape(mesh.points) + 2 * answer.by_value(state.value)
    assert_near(rate, answer.displacement, 1e-8)


def test_a_pad_that_is_moved_sideways_stays_as_it_is_under_a_spread_force_but_not_on_a_patch(mesh):
    sideways = np.broadcast_to([1.0, 0.5, 0.0], mesh.points.shape)
    rates = {kind: linearise(solved(mesh, LAW, *LOADS[kind])).by_shape(sideways) for kind in LOADS}
    size = {kind: np.abs(rate).max() for kind, rate in rates.items()}
    assert size.pop("patch") > 1e-3
    assert max(size.values()) < 1e-9


SYMMETRIC = {
    "normal": (SpreadForce(), (0, 0, -2.0)),
    "along x": (SpreadForce(), (0.6, 0, -2.0)),
    "along the diagonal": (SpreadForce(), (0.5, 0.5, -1.0)),
    "askew": (SpreadForce(), (0.5, 0.2, -1.0)),
    "patch": (PatchForce((0.0, 0.0), (1.0, 2.0)), (0, 0, -0.5)),
    "patch aside": (PatchForce((0.4, 0.0), (1.0, 1.0)), (0, 0, -0.5)),
    "plate force": (PlateForce(), (0, 0, -2.0)),
    "plate displacement": (PlateDisplacement(), (0, 0, -0.2)),
    "plate displacement along x": (PlateDisplacement(), (0.1, 0, -0.2)),
    "pressure": (Pressure(), (0.4,)),
}


@pytest.mark.parametrize(
    ("kind", "size"),
    [(kind, (2.0, 2.0, 1.5)) for kind in SYMMETRIC] + [("normal", (3.0, 2.0, 1.5)), ("along x", (3.0, 2.0, 1.5))],
)
def test_blocks_by_symmetry_answer_as_the_whole(kind, size, symmetric_block, monkeypatch):
    mesh = symmetric_block(size, (1, 1, 2))
    state = solved(mesh, LAW, *SYMMETRIC[kind])
    rng = np.random.default_rng(1)
    gradient, askew = rng.standard_normal((2, *mesh.points.shape))
    x, y, z = mesh.points.T
    odd = np.stack([y * z, 0 * x, 0 * x], axis=1)
    directions = np.eye(len(state.value))

    def answers():
        answer = linearise(state)
        found = answer.pull_back(gradient, {"askew": askew, "odd": odd, "all": mesh.points})
        rates = [answer.by_value(d) for d in directions] + [answer.by_material("c10")]
        rates += [answer.by_shape(v) for v in (askew, odd, mesh.points)]
        return [answer.displacement, *rates, np.array([*found.value, *found.material.values(), *found.shape.values()])]

    here = answers()
    monkeypatch.setattr(sensitivities, "mirrors_of_state", lambda state: ())
    for found, expected in zip(here, answers(), strict=True):
        assert_near(found, expected, 2e-8)


PAD = {
    shape: Pad(shape, rows=1, columns=1, height=3.0, cell_height=None if shape == "hemispheric" else 1.2)
    for shape in CELL_SHAPES
}


@pytest.mark.parametrize("value", [(0.0, 0.0, -2.0), (0.8, 0.0, -1.0)], ids=["normal", "tangential"])
@pytest.mark.parametrize("shape", CELL_SHAPES)
def test_roofs_follow_the_dimensions_as_full_solves_say(shape, value):
    """Of all of them at once, in different amounts: answers are linear in the velocity."""
    here = Solved(PAD[shape].mesh(4.0), NeoHookean(), SpreadForce(), value)
    mesh, amounts = here.state.mesh, {"cell_size": 1.0, "cell_height": -0.8, "wall": 0.5, "height": 0.6}
    velocity = sum(amount * mesh_velocity(PAD[shape], mesh, name) for name, amount in amounts.items())
    roof = np.unique(mesh.faces[mesh.face_region == REGIONS["roof"]])
    step = 1e-3
    expected = (here.morphed(step * velocity) - here.morphed(-step * velocity)) / (2 * step)
    assert_near(linearise(here.state).by_shape(velocity)[roof], expected[roof], 1e-4)


def test_pads_of_several_cells_follow_their_pitch():
    pad = Pad(rows=1, columns=2, height=3.0, cell_height=1.2)
    here = Solved(pad.mesh(4.0), NeoHookean(), SpreadForce(), (0.5, 0.0, -2.0))
    velocity = mesh_velocity(pad, here.state.mesh, "pitch")
    expected = (here.morphed(1e-3 * velocity) - here.morphed(-1e-3 * velocity)) / 2e-3
    assert_near(linearise(here.state).by_shape(velocity), expected, 1e-5)


def test_at_rest_no_shape_moves_anything(mesh):
    state = solved(mesh, LAW, SpreadForce(), (0.0, 0.0, 0.0))
    assert np.abs(linearise(state).by_shape(bending(mesh))).max() < 1e-12


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda a: a.by_shape(a.displacement[:3]), r"velocity = \(3, 3\) is not allowed: an array \(\d+, 3\)"),
        (lambda a: a.by_shape("wall"), "velocity = "),
        (lambda a: a.pull_back(a.displacement, {"wall": np.nan * a.displacement}), r"shapes\['wall'\] = .*finite"),
    ],
)
def test_what_is_asked_wrongly_is_refused(ask, message, mesh):
    with pytest.raises(InputError, match=message):
        ask(linearise(solved(mesh, LAW, *LOADS["spread force"])))
