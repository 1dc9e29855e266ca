"""A pad's state, and the first-order movement of its nodes with parameters of the scene."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from mitsuba_taxel.base.caches import Recent
from mitsuba_taxel.kernels.protocols import PadShape
from mitsuba_taxel.pads.parametric.pad import Pad
from mitsuba_taxel.sensing.derivatives.scene_rates import Rates

if TYPE_CHECKING:
    from mitsuba_taxel.mechanics import LinearisedState, State

PARALLEL = 1e-8
"""One minus the cosine up to which two changes of a load count as parallel."""

MOST_KEPT = 8
"""Number of the latest rates with a load that are kept. Each may need a factorisation, and a study asks for those of
its first scene while it chooses steps and mesh, and again when it reads it."""

_kept: Recent[np.ndarray] = Recent("responses of linearised pads", MOST_KEPT)


@dataclass(frozen=True, eq=False)
class Nodal:
    """Rates of the nodes with a parameter.

    Attributes
    ----------
    displacement, velocity : (N, 3) ndarray
        Rates of the displacement and of the undeformed positions of the nodes, in mm per unit of the parameter.
    dimensions : dict[str, float]
        Rates of the dimensions of the pad.
    side : int
        Side of a pad at rest for one-sided derivatives: 1 with a larger parameter, -1 with a smaller one, 0 for
        the mean of both. By default it is the side on which the pad is pressed.
    """

    displacement: np.ndarray
    velocity: np.ndarray
    dimensions: dict[str, float]
    side: int = 0


class LinearisedPad:
    """A pad linearised about its own state, or about a state on other elements."""

    def __init__(self, pad: PadShape, state: State) -> None:
        self.pad, self.state = pad, state

    @cached_property
    def _linear(self) -> LinearisedState:
        from mitsuba_taxel.mechanics import linearise

        return linearise(self.state)

    def nodal(self, change: Rates) -> Nodal:
        """Rates of the nodes of the state's mesh.

        Raises
        ------
        InputError
            if there is no derivative with respect to the parameter.
        ComputationError
            if there is no equilibrium nearby.
        """
        from mitsuba_taxel.pads.parametric.velocities import mesh_velocity

        displacement = np.zeros_like(self.state.displacement)
        velocity = np.zeros_like(displacement)
        for name, rate in change.pad.items():
            assert isinstance(self.pad.pad, Pad)  # others have no dimensions
            velocity += rate * mesh_velocity(replace(self.pad.pad), self.state.mesh, name)
        if change.load.any():
            displacement += self._by_load(change.load)
        if not self.pad.is_loaded:  # only a load displaces a pad at rest
            return Nodal(displacement, velocity, change.pad, change.side or _side(change.load))
        if change.place.any():
            displacement += self._linear.by_place(change.place)
        for name, rate in change.material.items():
            displacement += rate * self._linear.by_material(name)
        if change.pad:
            displacement += self._linear.by_shape(velocity)
        return Nodal(displacement, velocity, change.pad)

    def strain(self, nodal: list[Nodal]) -> tuple[float, np.ndarray]:
        """The largest strain, and its rates."""
        from mitsuba_taxel.mechanics.results.largest_strain import largest_strain

        strain = largest_strain(self.state)
        return strain.value, np.array([strain.rate(rate.displacement, rate.velocity) for rate in nodal])

    def _by_load(self, load: np.ndarray) -> np.ndarray:
        """First-order displacement (N, 3) for a change of the load. Along the load path, the state contains it."""
        ahead = self.state.path_rate()
        if ahead is not None and abs(load @ ahead.direction) > (1 - PARALLEL) * np.linalg.norm(load):
            return (load @ ahead.direction) * ahead.displacement
        state = self.state
        arrays = load, state.value, state.displacement, state.pressure
        objects = state.mesh, state.material, state.load, state.bodies, state.memory
        return _kept.of(arrays, lambda: self._linear.by_value(load), *objects)


def _side(load: np.ndarray) -> int:
    """Sign of a change of the load: 1 for a change that presses on the pad, such as a pressure or a downward force or
    displacement."""
    presses = load[0] if len(load) == 1 else -load[-1]
    return int(np.sign(presses))
