"""The load at which a pad becomes unstable, and its derivatives, extrapolated from a state shortly before."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.mechanics.derivatives.critical_mode import CriticalMode
from mitsuba_taxel.sensing.derivatives.linearised_pad import LinearisedPad
from mitsuba_taxel.sensing.derivatives.scene_rates import Rates, rates
from mitsuba_taxel.sensing.scene.description import Scene
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads

MOVED = 2e-5
"""Largest movement of a node for the finite difference, relative to the height of the pad."""


class Instability:
    """The value of a parameter at which the pad of a scene becomes unstable, extrapolated from the scene's own state.

    The stiffness of the softest mode is 0 at the instability, and is assumed to be linear in the parameter ``along``. A
    change of the stiffness by another parameter shifts the value of ``along`` at the instability.

    Attributes
    ----------
    value : float
        Value of ``along`` at the instability, in its unit.
    """

    def __init__(self, scene: Scene, along: str) -> None:
        (pad,) = deformed_pads(scene.load())
        self._scene, self._state = scene, pad.state
        self._linear, self._mode = LinearisedPad(pad, pad.state), CriticalMode(pad.state)
        change = rates(scene, along)
        self._by_value = self._stiffening(change)
        self.value = change.value - self._mode.stiffness / self._by_value

    def rate(self, name: str) -> float:
        """Derivative of the load at the instability (``value``) with respect to another parameter of the scene."""
        return -self._stiffening(rates(self._scene, name)) / self._by_value

    def _stiffening(self, change: Rates) -> float:
        """Derivative of the stiffness of the softest mode with respect to a parameter, by a central difference."""
        if change.place.any():
            raise InputError(
                f"the load at which the pad becomes unstable has no derivative with respect to {change.name}: leave it "
                "out."
            )
        nodal, state = self._linear.nodal(change), self._state
        largest = float(np.linalg.norm(nodal.displacement + nodal.velocity, axis=1).max())
        if not largest:
            return 0.0
        step = MOVED * float(np.ptp(state.mesh.points[:, 2])) / largest

        def stiffness_at(offset: float) -> float:
            constants = {name: getattr(state.material, name) + offset * rate for name, rate in change.material.items()}
            changes = offset * nodal.displacement, offset * nodal.velocity, offset * change.load
            return self._mode.after(*changes, state.material.changed(**constants))

        return (stiffness_at(step) - stiffness_at(-step)) / (2 * step)
