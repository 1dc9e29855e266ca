"""The least stiff displacement of a pad: against all eigenvalues of its tangent, and as load and material change."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.mechanics import NeoHookean, SpreadForce, State
from mitsuba_taxel.mechanics.derivatives.critical_mode import CriticalMode
from mitsuba_taxel.mechanics.equilibrium import tangent_blocks as least_mode
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import LoadedPad

MATERIAL = NeoHookean(2.0, 0.49)


def state_under(mesh, force):
    pad, value = LoadedPad(mesh, MATERIAL, SpreadForce()), np.array(force)
    unknowns = np.zeros(pad.unknowns)
    for share in (0.5, 1.0):
        unknowns = pad.solve(unknowns, share * value)[0].unknowns
    return State(mesh, MATERIAL, pad.load, value, *pad.split(unknowns), 1.0, 0.0, 0, True)


def least_eigenvalue(state):
    """Of the tangent without the pressures, which are eliminated, as a matrix."""
    pad = LoadedPad(state.mesh, state.material, state.load)
    on_part = pad.part.restrict(state.displacement, state.pressure)
    lower = pad.model.assembly.matrix(pad.model.evaluate(*on_part, state.value).entries).toarray()
    whole, moves = lower + np.tril(lower, -1).T, pad.numbering.displacements
    coupled = whole[:moves, moves:]
    return np.linalg.eigvalsh(whole[:moves, :moves] - coupled @ np.linalg.solve(whole[moves:, moves:], coupled.T))[0]


@pytest.fixture
def mesh(block):
    """A block that has no symmetry."""
    return block((1.2, 1.0, 1.4), (2, 2, 2), distortion=0.1, curvature=0.02)


def test_it_is_the_least_of_all_eigenvalues(mesh):
    state = state_under(mesh, (0.01, 0.02, -0.2))
    assert CriticalMode(state).stiffness == pytest.approx(least_eigenvalue(state), rel=1e-6)


def test_how_it_changes(mesh):
    """With the load as eigenvalues of other states do, to first order; and with the modulus and all loads to scale."""
    still, none = np.zeros((len(mesh.points), 3)), np.zeros(3)
    state, step = state_under(mesh, (0.01, 0.02, -0.2)), np.array([0.0, 0.0, -1e-3])
    mode = CriticalMode(state)
    assert mode.after(still, still, none, MATERIAL) == pytest.approx(mode.stiffness, rel=1e-6)
    ahead, behind = (mode.after(still, still, way * step, MATERIAL) for way in (1, -1))
    others = [least_eigenvalue(state_under(mesh, tuple(state.value + way * step))) for way in (1, -1)]
    assert ahead < behind and ahead - behind == pytest.approx(others[0] - others[1], rel=1e-3)

    def firmer(share):
        material = MATERIAL.changed(youngs_modulus=(1 + share) * MATERIAL.youngs_modulus)
        return mode.after(still, still, share * state.value, material)

    assert firmer(1e-4) - firmer(-1e-4) == pytest.approx(2e-4 * mode.stiffness, rel=1e-4)


def test_no_equilibrium_near_by_is_told(mesh):
    mode, still = CriticalMode(state_under(mesh, (0.0, 0.0, -0.1))), np.zeros((len(mesh.points), 3))
    with pytest.raises(ComputationError, match="no equilibrium was found after a small change of the pad"):
        mode.after(still, still, np.array([0.0, 0.0, -200.0]), MATERIAL)


def test_modes_that_cannot_be_told_apart_are_refused(mesh, monkeypatch):
    monkeypatch.setattr(least_mode, "MOST_ITERATIONS", 2)
    with pytest.raises(ComputationError, match="the least stiff mode of the pad was not found in 2 iterations"):
        CriticalMode(state_under(mesh, (0.01, 0.02, -0.2)))
