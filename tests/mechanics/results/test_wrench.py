"""Force, moment and centre of pressure of plates and indenters, against statics."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.mechanics import Indenter, IndenterDisplacement, NeoHookean, PlateDisplacement, State, load_path
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import LoadedPad
from mitsuba_taxel.mechanics.results.balance import reactions
from mitsuba_taxel.pads import Pad
from mitsuba_taxel.sensing.reading.pad_results import REACTION_RESULTS, pad_results

PAD = Pad(rows=1, columns=1)


@pytest.mark.parametrize(("x", "y", "radius", "depth"), [(0.6, 0.0, 2.5, 0.2), (0.4, -0.5, 1.5, 0.15)])
def test_forces_of_a_smooth_ball_pass_through_its_centre(x, y, radius, depth):
    """Without friction, every force of contact does, so that the moment is that of the total force there."""
    ball = IndenterDisplacement(Indenter("sphere", radius=radius, at=(x, y)))
    (state,) = load_path(PAD, NeoHookean(), [(0.0, 0.0, -depth)], load=ball, mesh_size=1.2)
    found, top = reactions(state), state.mesh.points[:, 2].max()
    centre = np.array([x, y, top + radius - depth])
    scale = radius * abs(found.applied_force[2])
    np.testing.assert_allclose(found.applied_moment, np.cross(centre, found.applied_force), rtol=0, atol=1e-3 * scale)
    # The line through the ball's centre meets the top's plane beside the tip, by the force's inclination.
    beside = (top - centre[2]) * found.applied_force[:2] / found.applied_force[2]
    np.testing.assert_allclose(found.centre_of_pressure, [x, y] + beside, rtol=0, atol=1e-3 * radius)
    assert found.applied_force[2] < 0 and np.abs(beside).max() > 0.005  # the thin pad is stiffer on one side

    results = pad_results([state], with_errors=False)
    values = [results[result.name].value for result in REACTION_RESULTS]
    np.testing.assert_array_equal(values, [*found.applied_force, *found.applied_moment, *found.centre_of_pressure])
    assert "reaction_fz" not in pad_results([state, state], with_errors=False)  # of several pads, no common wrench


@pytest.mark.parametrize(("ratio", "height"), [(0.3, 0.5), (0.1, 0.8)])
def test_a_sheared_layer_turns_about_its_middle(block, ratio, height):
    """A layer between two plates is the same upside down: for a small shear, its moment about half its height is 0."""
    law, plate = NeoHookean(1.0, ratio), PlateDisplacement()
    mesh, value = block(np.array([2.0, 2.0, height]), (6, 6, 4)), np.array([1e-4, 0.0, 0.0])
    pad = LoadedPad(mesh, law, plate)
    solution, _ = pad.solve(np.zeros(pad.unknowns), value)
    figures = (solution.min_jacobian, solution.residual, solution.iterations, True)
    found = reactions(State(mesh, law, plate, value, *pad.split(solution.unknowns), *figures))
    force = found.applied_force[0]
    assert force > 0
    assert found.applied_moment[1] == pytest.approx(height / 2 * force, rel=0.01)
    assert abs(found.applied_moment[2] - (-mesh.points[:, 1].mean() * force)) < 0.01 * 2.0 * force


def test_a_pad_at_rest_has_no_force_and_no_centre():
    ball = IndenterDisplacement(Indenter("sphere", radius=2.5))
    (state,) = load_path(PAD, NeoHookean(), [(0.0, 0.0, 0.0)], load=ball, mesh_size=1.2)
    results = pad_results([state], with_errors=True)
    assert all(results[name] == (0.0, 0.0) for name in ("reaction_fx", "reaction_fz", "reaction_my"))
    assert np.isnan(results["centre_of_pressure_x"].value)
