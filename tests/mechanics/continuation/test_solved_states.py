"""States between the nodes of a path under a body, which share the factor of the nearer node."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.mechanics import Indenter, IndenterDisplacement, NeoHookean, reactions
from mitsuba_taxel.mechanics.continuation import solved_states
from mitsuba_taxel.mechanics.continuation.pad_path import pad_path
from mitsuba_taxel.mechanics.equilibrium.meshed_pad import MeshedPad
from mitsuba_taxel.pads import Pad

PAD, LAW, SIZE = Pad("parallelepiped", 1, 1), NeoHookean(4.16), 2.5
DEPTHS = (0.12, 0.2, 0.3)


def states(depths):
    load = IndenterDisplacement(Indenter("sphere", radius=9.0, at=(0.4, 0.3)))
    path = pad_path(PAD, LAW, load, SIZE)
    return path, {depth: path.state(np.array([0.0, 0.0, -depth])) for depth in depths}


def test_a_state_is_that_with_a_factor_of_its_own(few_elements_under_bodies, monkeypatch):
    """Solved, with its rate, to the tolerance of the solver; of two states near a node, the second factors nothing."""
    factored = []
    own = MeshedPad._factored
    monkeypatch.setattr(MeshedPad, "_factored", lambda self, *matrix: factored.append(self) or own(self, *matrix))
    path, between = states(DEPTHS)
    ((segment, _),) = path.segments.to(np.array([0.0, 0.0, -0.2]))
    assert not {node.s for node in segment.nodes} & set(DEPTHS)
    before = len(factored)
    path.state(np.array([0.0, 0.0, -0.29]))
    assert len(factored) == before
    pad = path.segments.pad_for(segment.origin, segment.direction)
    for depth, state in between.items():
        alone = segment.solved(pad, depth)
        displacement = pad.split(alone.unknowns)[0]
        np.testing.assert_allclose(state.displacement, displacement, atol=1e-8 * depth)
        np.testing.assert_array_equal(state.path_rate().direction, (0, 0, -1))
        np.testing.assert_allclose(state.path_rate().displacement, pad.split(alone.tangent)[0], atol=1e-6)
        assert reactions(state).imbalance < 1e-8 and state.stability_checked


def test_a_state_does_not_depend_on_those_before(few_elements_under_bodies, monkeypatch, tmp_path):
    _, forwards = states(DEPTHS)
    monkeypatch.setenv("MITSUBA_TAXEL_CACHE", str(tmp_path / "another"))
    few_elements_under_bodies()
    solved_states.release_factor()
    _, backwards = states(DEPTHS[::-1])
    for depth in DEPTHS:
        np.testing.assert_array_equal(forwards[depth].displacement, backwards[depth].displacement)
