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
"""Largest value of 1 - cos(angle) between two changes of a load that count as parallel."""

MOST_KEPT = 8
"""Number of cached rates of the nodes with a load. Each may need a factorisation. A study needs those of its first
scene twice: while it chooses steps and mesh, and for the readings."""

_kept: Recent[np.ndarray] = Recent("responses of linearised pads", MOST_KEPT)


@dataclass(frozen=True, eq=False)
class Nodal:
    """Rates of change of the N nodes of a pad's mesh when one parameter of the scene changes.

    Attributes
    ----------
    displacement, velocity : (N, 3) ndarray
        Rates of change of the nodes' displacement and of their undeformed positions, in mm per unit of the parameter.
    dimensions : dict[str, float]
        Rates of change of the pad's dimensions, by name.
    side : int
        Side for one-sided derivatives of an unloaded pad: 1 towards larger values of the parameter, -1 towards smaller
        values, 0 for the mean of both. `LinearisedPad.nodal` chooses the side on which the load presses on the pad.
    """

    displacement: np.ndarray
    velocity: np.ndarray
    dimensions: dict[str, float]
    side: int = 0


class LinearisedPad:
    """A deformed pad, linearised about its own state or about a state on other elements: its nodes move in proportion
    to parameters.
    """

    def __init__(self, pad: PadShape, state: State) -> None:
        self.pad, self.state = pad, state

    @cached_property
    def _linear(self) -> LinearisedState:
        from mitsuba_taxel.mechanics import linearise

        return linearise(self.state)

    def nodal(self, change: Rates) -> Nodal:
        """Rates of change of the nodes of the state's mesh with a parameter, from the linearised equilibrium.

        Raises
        ------
        InputError
            if the state has no derivative with respect to the parameter.
        ComputationError
            if the pad has no equilibrium at a neighbouring load.
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
        """The largest strain, and its derivatives with respect to the parameters of ``nodal``."""
        from mitsuba_taxel.mechanics.results.largest_strain import largest_strain

        strain = largest_strain(self.state)
        return strain.value, np.array([strain.rate(rate.displacement, rate.velocity) for rate in nodal])

    def _by_load(self, load: np.ndarray) -> np.ndarray:
        """First-order displacement (N, 3) of the nodes for a change of the load, in mm. For a change along the load
        path, it is taken from the state."""
        ahead = self.state.path_rate()
        if ahead is not None and abs(load @ ahead.direction) > (1 - PARALLEL) * np.linalg.norm(load):
            return (load @ ahead.direction) * ahead.displacement
        state = self.state
        arrays = load, state.value, state.displacement, state.pressure
        objects = state.mesh, state.material, state.load, state.bodies, state.memory
        return _kept.of(arrays, lambda: self._linear.by_value(load), *objects)


def _side(load: np.ndarray) -> int:
    """Side of a change of the load: 1 if it presses on the pad, such as a pressure or a downward force or displacement;
    -1 if it pulls; else 0."""
    presses = load[0] if len(load) == 1 else -load[2]
    return int(np.sign(presses))
