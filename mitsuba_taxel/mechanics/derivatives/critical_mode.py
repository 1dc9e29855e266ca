"""The least stiff mode of a pad, and the change of its stiffness when the pad or its load changes slightly.

A pad becomes unstable where the smallest eigenvalue of its tangent matrix falls to 0. If the matrix changes slightly,
this eigenvalue is, to first order, the product of the changed matrix with the unchanged eigenvector on both sides (T.
Kato, Perturbation Theory for Linear Operators, 1966, chapter 2). So one eigenvector gives the change of the eigenvalue
with load, shape and material.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.mechanics.continuation.state import State
from mitsuba_taxel.mechanics.derivatives.sensitivities import mirrors_of_state
from mitsuba_taxel.mechanics.elements.solvers import symmetric_product
from mitsuba_taxel.mechanics.equilibrium.pad_parts import loaded_pad
from mitsuba_taxel.mechanics.equilibrium.solution import Rejected
from mitsuba_taxel.mechanics.equilibrium.tangent_blocks import TangentBlock, least_mode, tangent_blocks
from mitsuba_taxel.mechanics.materials.laws import Material

CONVERGED = 1e-7
"""Change of the mode at which the iteration ends; the error of the eigenvalue is proportional to its square."""


class CriticalMode:
    """Least stiff mode of a stable pad: the eigenvector of its tangent matrix with the smallest eigenvalue.

    Parameters
    ----------
    state : State
        A stable state.

    Attributes
    ----------
    stiffness : float
        The eigenvalue, in N/mm for displacements with unit sum of squares.

    Raises
    ------
    InputError
        if the load of the state is a plate that tilts.
    ComputationError
        if the state is not stable, or its least stiff modes cannot be distinguished.
    """

    def __init__(self, state: State) -> None:
        if state.load.tilts:
            raise InputError(
                f"load = {state.load.name!r} is not allowed: the least stiff mode under a tilting plate "
                "is not modelled; a load without a tilting plate is needed."
            )
        self._state, self._mirrors = state, mirrors_of_state(state)
        pad = loaded_pad(state.mesh, state.material, state.load, self._mirrors)
        self._blocks = tangent_blocks(pad)
        try:
            modes = [_mode(block, state) for block in self._blocks]
        except Rejected as rejection:
            raise ComputationError(
                f"the least stiff mode is computed for stable pads only: {rejection}; a smaller load is needed."
            ) from rejection
        self._place = int(np.argmin([stiffness for stiffness, _ in modes]))
        self.stiffness, self._mode = modes[self._place]

    def after(self, displacement: np.ndarray, velocity: np.ndarray, value: np.ndarray, material: Material) -> float:
        """Stiffness of the mode after a small change of the pad or its load.

        Parameters
        ----------
        displacement, velocity : (N, 3) ndarray
            Approximate change of the displacement, and movement of the undeformed nodes, in mm. Components without the
            symmetry of the state do not change an eigenvalue to first order, and are left out.
        value : (components,) ndarray
            Change of the load's value.
        material : Material
            Law of the changed pad.

        Returns
        -------
        float
            Stiffness in N/mm.

        Raises
        ------
        ComputationError
            if no equilibrium is found.
        """
        state, block = self._state, self._blocks[0]
        mesh = replace(state.mesh, points=state.mesh.points + self._symmetric(velocity))
        pad = loaded_pad(mesh, material, state.load, self._mirrors)
        start = pad.gather(state.displacement + self._symmetric(displacement), state.pressure)
        try:
            solution, _ = pad.solve_with_tangent(start, state.value + block.of_value(value))
        except Rejected as rejection:
            raise ComputationError(
                f"no equilibrium was found after a small change of the pad: {rejection}; a smaller load is needed."
            ) from None
        model = tangent_blocks(pad)[self._place].model
        on_part = model.part.restrict(*pad.split(solution.unknowns))
        entries = model.evaluate(*on_part, state.value + block.of_value(value)).entries
        assert entries is not None  # no element is inverted in equilibrium
        return float(self._mode @ symmetric_product(model.assembly.matrix(entries), self._mode))

    def _symmetric(self, field: np.ndarray) -> np.ndarray:
        """Component of a vector field (N, 3) at the nodes that has the symmetry of the deformed pad."""
        symmetric_part = self._blocks[0].model.part
        return symmetric_part.expand(self._blocks[0].of_field(field), np.zeros(self._state.mesh.corner_count))[0]


def _mode(block: TangentBlock, state: State) -> tuple[float, np.ndarray]:
    """Smallest eigenvalue of one symmetry block of the tangent matrix, and its eigenvector over the unknowns of the
    pad."""
    on_part = block.model.part.restrict(state.displacement, state.pressure)
    entries = block.model.evaluate(*on_part, state.value).entries
    assert entries is not None  # no element is inverted in a state
    return least_mode(block, block.factored(entries, on_part[0], state.value), CONVERGED)
