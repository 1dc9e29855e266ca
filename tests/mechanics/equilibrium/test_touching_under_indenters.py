"""Paths of pads that touch themselves, the board or a package below an indenter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from touching_pads import (
    LAW,
    PACKAGE,
    SMALL,
    TOP,
    lowest,
    pressed,
    stored,
)

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.mechanics import (
    Indenter,
    IndenterDisplacement,
    IndenterForce,
    Viscoelastic,
)
from mitsuba_taxel.mechanics import reactions as reactions_of
from mitsuba_taxel.mechanics.contact.barriers.barrier import Barrier
from mitsuba_taxel.mechanics.contact.barriers.body_barrier import BodyBarrier
from mitsuba_taxel.mechanics.contact.barriers.contacts import Contacts
from mitsuba_taxel.mechanics.contact.indentation import Indentation
from mitsuba_taxel.mechanics.equilibrium.self_touching_pad import IndentedTouchingPad
from mitsuba_taxel.mechanics.results.contact_pressure import indentation_of

pytest.importorskip("ipctk")
pytestmark = pytest.mark.usefixtures("mechanics_error_unknown")


BALL, DEEP = Indenter("sphere", radius=2.5), (0, 0, -2.4)
"""Displacement beside that of -2.2 mm at which walls touch under the ball."""


def test_a_path_goes_on_under_an_indenter(few_elements_under_bodies):
    """What the body does is stored in the pad, or done against contact; nothing is out of balance."""
    on, step = IndenterDisplacement(BALL, self_contact=True), 5e-4
    with pytest.raises(ComputationError, match=r"touches itself .* -1\.6\d*\) mm\. With self_contact = true"):
        pressed(DEEP, load=IndenterDisplacement(BALL))
    less, state, more = pressed(*((0, 0, DEEP[2] + way) for way in (step, 0.0, -step)), load=on)
    reactions, barrier = reactions_of(state), Barrier(state.mesh, LAW.youngs_modulus)
    assert reactions.imbalance < 1e-8 and state.stability_checked
    assert 0 < barrier.gap(state.displacement) < barrier.reach
    contact = sum(Contacts(state.mesh, LAW.youngs_modulus, None).forces(state.displacement))
    done = (contact * (more.displacement - less.displacement)).sum()
    body = Indentation(state.mesh, BALL, LAW.youngs_modulus)

    def energy(at):
        return stored(at) + (body.slack * body.contact_state(at.displacement, at.value).pressure ** 2).sum() / 2

    expected = -2 * step * reactions.applied_force[2] + done
    assert done < -1e-4 * expected and energy(more) - energy(less) == pytest.approx(expected, rel=2e-5)
    (pushed,) = pressed((0, 0, reactions.applied_force[2]), load=IndenterForce(BALL, self_contact=True))
    np.testing.assert_allclose(pushed.indenter_moved, DEEP, atol=1e-8)
    np.testing.assert_allclose(pushed.displacement, state.displacement, atol=1e-6)


def test_a_roof_is_held_by_a_package_below_an_indenter():
    """The body then presses more, by what the package bears."""
    on, deep = IndenterDisplacement(BALL, self_contact=True), (0, 0, -1.2)
    (held,), (free,) = (pressed(deep, load=on, **bodies) for bodies in ({"obstacles": PACKAGE}, {}))
    assert TOP < lowest(held, over=(0.5, 0.7)) and lowest(free, over=(0.5, 0.7)) < TOP - 0.02
    borne = BodyBarrier(held.mesh, LAW.youngs_modulus, held.bodies).forces(held.displacement)[:, 2].sum()
    more = reactions_of(free).applied_force[2] - reactions_of(held).applied_force[2]
    assert borne > 0.1 and 0 < more < borne
    assert reactions_of(held).imbalance < 1e-8 and held.stability_checked


def test_a_dragged_body_presses_walls_on_each_other(few_elements_under_bodies):
    """With friction of the body: some places slip under their bound, others stick."""
    on = IndenterDisplacement(replace(BALL, friction=0.3), self_contact=True)
    (state,) = pressed((0.2, 0, -2.0), load=on)
    barrier, reactions = Barrier(state.mesh, LAW.youngs_modulus), reactions_of(state)
    assert reactions.imbalance < 1e-8 and reactions.applied_force[0] > 0.05
    assert np.abs(barrier.forces(state.displacement)[0]).sum() > 1e-3
    body, pressing = indentation_of(state)
    share = np.linalg.norm(body.at_nodes(state.traction), axis=1) / np.maximum(0.3 * pressing.pressure, 1e-9)
    touching = pressing.pressure > 0
    assert share.max() < 1 + 1e-6 and share[~touching].max() == 0
    assert 0 < np.mean(share[touching] > 1 - 1e-6) < 0.5


def test_steps_under_friction_are_not_cut(few_elements_under_bodies, monkeypatch):
    """Below, walls that press on each other turn about corners, and make the linear pad unstable; the pad is not."""
    find, found = IndentedTouchingPad._balanced, []

    def balanced(pad, *start):
        found.append(None)
        found[-1] = find(pad, *start)
        return found[-1]

    monkeypatch.setattr(IndentedTouchingPad, "_balanced", balanced)
    pressed((0, 0, -2.34), load=IndenterDisplacement(replace(BALL, friction=0.3), self_contact=True), size=SMALL)
    assert all(found)


SOFT, LEFT = Viscoelastic(LAW, ((0.2, 1.0), (0.3, 10.0))), 0.5 * LAW.shear_modulus
"""A silicone with a memory, and the shear modulus in MPa that lasts; its compressibility is that of the law."""


def test_a_ball_sinks_in_until_walls_touch(few_elements_under_bodies):
    on = IndenterDisplacement(BALL, self_contact=True)
    (state,) = pressed(DEEP, load=on, material=SOFT, times=[1.0])
    reactions, barrier = reactions_of(state), Barrier(state.mesh, LAW.youngs_modulus)
    assert reactions.imbalance < 1e-8 and state.stability_checked
    assert 0 < barrier.gap(state.displacement) < barrier.reach
