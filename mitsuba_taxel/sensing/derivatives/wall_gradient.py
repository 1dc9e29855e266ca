"""Readings of a pad with diffuse cells at a state, and their changes by any small displacement of its nodes."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from threadpoolctl import threadpool_limits

from mitsuba_taxel.base.processes.threads import side_by_side
from mitsuba_taxel.sensing.diffuse.deterministic_light import FINE, MOST_HIDDEN, MOST_OFF
from mitsuba_taxel.sensing.diffuse.diffuse_cells import DiffuseCells, NotFollowed

if TYPE_CHECKING:
    from mitsuba_taxel.mechanics import State
    from mitsuba_taxel.transport.cell import Cell


class WallGradient:
    """The light in diffuse cells at a state of their pad, linearised about it.

    A reading P changes by dP = sum over the points x of the walls of dP/dx . dx. The derivatives come from one adjoint
    solution of the light in each cell, so that each further displacement costs one product.

    Parameters
    ----------
    cells : DiffuseCells
        Cells of a loaded scene.
    state : State
        State of the pad of the scene, on any mesh.

    Raises
    ------
    NotFollowed
        if patches are too coarse for the light, or walls occlude too much of it.
    """

    def __init__(self, cells: DiffuseCells, state: State) -> None:
        numbers = range(len(cells.cells))
        self._cells, self._at_rest = cells, not state.displacement.any()
        self._patches = [cells.patches(number, state.mesh) for number in numbers]

        def solve(number: int) -> Cell:
            patches = self._patches[number]
            positions = patches.rest + patches.carried(state.displacement)
            return cells.solved(number, cells.light_mesh(number, FINE), positions)

        with threadpool_limits(1, "blas"):
            self._solved = side_by_side(solve, list(numbers))
        for cell in self._solved:
            if np.hypot(cell.emission_error, cell.reception_error) > MOST_OFF * cell.reading:
                raise NotFollowed("readings are not available: patches are too coarse for a narrow beam or response.")
        self._led = np.array([taxel.power for taxel in cells.taxels])

    @property
    def power(self) -> np.ndarray:
        """Readings (T,) in W."""
        return self._led * [cell.reading for cell in self._solved]

    def refuse_occluded(self) -> None:
        """Raise `NotFollowed` if walls of the loaded scene occlude too much of the light. The pad of the scene must be
        in the state about which the light is linearised."""
        hidden = max(self._cells.occluded_fraction(*cell.flows()) for cell in self._solved)
        if hidden > MOST_HIDDEN:
            raise NotFollowed(
                f"readings are not available: walls occlude {hidden:.1%} of the light of a reading; at most "
                f"{MOST_HIDDEN:.1%} is allowed."
            )

    def along(self, displacement: np.ndarray) -> np.ndarray:
        """Changes of the readings by a small displacement, to first order.

        At rest, the readings have a kink: points of a flat roof see each other only where it bends inwards. The result
        is therefore the one-sided derivative in the direction of the displacement, and not exactly linear in it.

        Parameters
        ----------
        displacement : (N, 3) ndarray
            Displacement of the nodes of the state's mesh in mm.

        Returns
        -------
        (T,) ndarray
            Changes in W.
        """
        changes = np.empty(len(self._solved))
        for number, (cell, patches) in enumerate(zip(self._solved, self._patches, strict=True)):
            velocity = patches.carried(displacement)
            changes[number] = np.vdot(self._gradients[number], velocity)
            if self._at_rest:
                changes[number] += cell.bent(velocity, 1).sum()
        return self._led * changes

    @cached_property
    def _gradients(self) -> list[np.ndarray]:
        with threadpool_limits(1, "blas"):
            return side_by_side(lambda cell: cell.gradient(), self._solved)
