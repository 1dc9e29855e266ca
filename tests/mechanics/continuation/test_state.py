"""Figures of a state are its own, not those of a solved state nearby."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.geometry.element_maps import map_determinants
from mitsuba_taxel.mechanics import (
    Indenter,
    IndenterDisplacement,
    IndenterForce,
    NeoHookean,
    PatchForce,
    PlateDisplacement,
    PlateForce,
    Pressure,
    SpreadForce,
    Viscoelastic,
    load_path,
)
from mitsuba_taxel.mechanics.contact.barriers.singular_edges import judged_nodes
from mitsuba_taxel.mechanics.elements.elements import Elements
from mitsuba_taxel.mechanics.elements.nodal_forces import board_force, glued_force, internal_forces
from mitsuba_taxel.pads import Pad

PAD, LAW, SIZE = Pad(rows=1, columns=1), NeoHookean(1.0, 0.45), 3.0
BALL = Indenter("sphere", at=(0.0, 0.0), radius=2.0)
KINDS = [
    (SpreadForce(), (0.0, 0.0, -1.0)),
    (SpreadForce(), (0.2, 0.1, -0.5)),
    (PatchForce((0.0, 0.0), (2.0, 2.0)), (0.0, 0.0, -0.1)),
    (PlateForce(), (0.0, 0.0, -1.0)),
    (PlateDisplacement(), (0.0, 0.0, -0.1)),
    (PlateDisplacement(self_contact=True), (0.0, 0.0, -0.1)),
    (Pressure(), (0.02,)),
    (IndenterDisplacement(BALL), (0.0, 0.0, -0.1)),
    (IndenterForce(BALL), (0.0, 0.0, -0.1)),
]
NAMES = [f"{type(load).__name__} {value}" for load, value in KINDS]


def least_volume_ratio(state):
    """At the quadrature points of the elements, and where they must not be inverted, by determinants alone."""
    gradient = Elements(state.mesh, state.material).gradient(slice(None), state.displacement) + np.eye(3)
    at_nodes = map_determinants(state.mesh.points + state.displacement, state.mesh.tets)
    at_nodes /= map_determinants(state.mesh.points, state.mesh.tets)
    return min(np.linalg.det(gradient).min(), at_nodes[judged_nodes(state.mesh)[state.mesh.tets]].min(initial=1.0))


@pytest.mark.parametrize(("load", "value"), KINDS, ids=NAMES)
def test_the_least_volume_ratio(load, value):
    """For small loads its distance from one is proportional to them; so little of an indenter is not resolved."""
    indented = isinstance(load, IndenterDisplacement | IndenterForce)
    shares = (0.37,) if indented else (0.37, 1e-5, 2e-5)
    found = load_path(PAD, LAW, np.multiply.outer(shares, value), load=load, mesh_size=SIZE)
    for state in found:
        assert state.min_jacobian == pytest.approx(least_volume_ratio(state), abs=1e-12)
    if not indented:
        once, twice = (1 - state.min_jacobian for state in found[1:])
        assert 0 < once < 2e-4 and twice / once == pytest.approx(2.0, rel=1e-3)


def test_the_residual():
    """Of a state between solved ones, by the forces of all elements; and no iterations were made for it."""
    (state,) = load_path(PAD, LAW, [(0.0, 0.0, -0.37)], mesh_size=SIZE)
    mesh, nodal = state.mesh, SpreadForce().nodal(state.mesh)
    load = nodal[:, None] / nodal.sum() * state.value
    left = internal_forces(mesh, LAW, state.displacement, state.pressure) - load
    left[mesh.points[:, 2] == 0] = 0.0
    of_natural_strain = max(1.0, 0.02 * LAW.youngs_modulus * nodal.sum() / 0.37)
    expected = np.linalg.norm(left) / np.linalg.norm(load) / of_natural_strain
    assert 1e-9 < state.residual == pytest.approx(expected, rel=0.5)  # there of a quarter, with nodes on its walls
    assert state.newton_iterations == 0


def test_figures_of_a_buckled_pad(fresh, monkeypatch, symmetric_block):
    """Between solved amplitudes."""
    mesh = symmetric_block((1.0, 2.0, 16.0), (1, 1, 8))
    monkeypatch.setattr("mitsuba_taxel.mechanics.continuation.path_problem.pad_mesh", lambda *_: mesh)
    onset = 4.0 * np.pi**2 / 48 * 2.0 / 16.0**2
    (state,) = load_path(PAD, NeoHookean(4.0, 0.0), [(0.0, 0.0, -1.013 * onset)], mesh_size=SIZE)
    assert state.buckled_at is not None
    assert state.min_jacobian == pytest.approx(least_volume_ratio(state), abs=1e-12)


def test_figures_between_steps_of_time():
    """Which lead beyond the row that is asked for, where everything is larger."""
    soft = Viscoelastic(LAW, ((0.5, 1.0),))
    times = [0.01, 5.0, 100.0]
    values = [(0.0, 0.0, -0.01 * time) for time in times]
    found = load_path(PAD, soft, values, times=times, load=PlateForce(), mesh_size=SIZE)
    for state in found:
        assert state.min_jacobian == pytest.approx(least_volume_ratio(state), abs=1e-12)
    between, solved = found[:2]
    assert between.newton_iterations == 0 < solved.newton_iterations
    assert between.memory.error < solved.memory.error


@pytest.mark.parametrize("pad", [PAD, Pad(cell="cylindrical", rows=1, columns=2)], ids=["one cell", "two cells"])
def test_the_force_of_the_board(pad):
    """From the elements at the board alone, as from all elements, and against the load."""
    (state,) = load_path(pad, LAW, [(0.05, 0.02, -0.4)], mesh_size=SIZE)
    arguments = state.mesh, LAW, state.displacement, state.pressure
    force = board_force(*arguments)
    np.testing.assert_allclose(force, glued_force(*arguments), atol=1e-13)
    np.testing.assert_allclose(force, (-0.05, -0.02, 0.4), atol=1e-4)
    inverted = state.displacement * (1.0, 1.0, 1e3)
    assert np.isnan(board_force(state.mesh, LAW, inverted, state.pressure)).all()
