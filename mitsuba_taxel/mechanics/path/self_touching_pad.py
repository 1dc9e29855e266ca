"""Equilibrium of a pad whose walls may touch each other and the board: Newton's method against a barrier."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property

import numpy as np
import scipy.sparse as sparse

from mitsuba_taxel.mechanics.contact.barrier import Barrier
from mitsuba_taxel.mechanics.elements.model import Configuration
from mitsuba_taxel.mechanics.elements.solvers import make_solver
from mitsuba_taxel.mechanics.path.equilibrium import MOST_ITERATIONS, RESIDUAL_TOLERANCE, Balance, LoadedPad, Rejected
from mitsuba_taxel.mechanics.path.linearised import Linearised

MOST_HALVINGS = 6
"""Number of halvings of a Newton step that does not bring the pad closer to balance."""


class SelfTouchingPad(LoadedPad):
    """A meshed pad glued to the board, whose walls stay apart, and off the board.

    The whole pad touches itself, also across the mirrors of the part that is solved for. Its barrier and tangent are
    restricted to displacements of the part. Against others, stability is that of the tangent of the whole.
    """

    solves_between = True
    _pattern: tuple[bytes, ...] = ()

    @cached_property
    def _barrier(self) -> Barrier:
        return Barrier(self.whole, self.material.youngs_modulus)

    @cached_property
    def _expansion(self) -> sparse.csr_array:
        """(3 N, unknowns) displacements of the whole pad."""
        place, sign = self.part.components
        entries = sign.ravel(), (np.arange(place.size), place.ravel())
        of_part = sparse.csr_array(entries, shape=(place.size, 3 * len(self.part.mesh.points)))
        return sparse.csr_array(self.model.over_unknowns(of_part))

    def towards(self, known: np.ndarray, guess: np.ndarray) -> np.ndarray:
        return known + self._barrier.free_share(self.split(known)[0], self.split(guess)[0]) * (guess - known)

    def refuse_unstable(self, unknowns: np.ndarray, entries: np.ndarray, value: np.ndarray) -> None:
        displacement, pressure = self.split(unknowns)
        if not self._barrier.stiffness(displacement).nnz:
            super().refuse_unstable(unknowns, entries, value)
        elif self.mirrors and self._solver.knows_inertia:
            whole = self._of_whole
            alike = whole.gather(displacement, pressure)
            tangent = whole._evaluate(alike, value).entries
            assert tangent is not None  # no element is inverted
            whole._is_stable(whole._linearised(tangent, alike, value), alike, value)

    @cached_property
    def _of_whole(self) -> SelfTouchingPad:
        return SelfTouchingPad(self.whole, self.material, self.load, solver=self._solver_name)

    def _balanced(self, start: np.ndarray, value: np.ndarray, linearised: Linearised | None = None) -> Balance:
        """Newton's method with steps that collide with nothing, shortened until they lead closer to balance."""
        unknowns, first = start, 0.0
        for iteration in range(MOST_ITERATIONS):
            state = self._evaluate(unknowns, value)
            error = self._checked_error(state, unknowns, value, first)
            if error < RESIDUAL_TOLERANCE:
                return Balance(unknowns, state, error, iteration, None, 0.0)
            first = first or error
            assert state.entries is not None  # no element is inverted
            step = self._linearised(state.entries, unknowns, value).step(self._left(state), self._gap(unknowns, value))
            unknowns = self._shortened(unknowns, -step, value, error)
        raise Rejected(f"Newton's method does not converge in {MOST_ITERATIONS} iterations")

    def _shortened(self, unknowns: np.ndarray, step: np.ndarray, value: np.ndarray, error: float) -> np.ndarray:
        """The best place along a step, or the first that is good enough."""
        best, least = unknowns, math.inf
        step = self.towards(unknowns, unknowns + step) - unknowns
        for halvings in range(MOST_HALVINGS):
            tried = unknowns + 0.5**halvings * step
            state = self._evaluate(tried, value, with_tangent=False)
            left = self._error(state, tried, value) if state.min_jacobian > 0 else math.inf
            if left < least:
                best, least = tried, left
            if least < (1 - 0.25 * 0.5**halvings) * error:
                break
        if math.isinf(least):
            raise Rejected("an element would be inverted")
        return best

    def _evaluate(self, unknowns: np.ndarray, value: np.ndarray, with_tangent: bool = True) -> Configuration:
        state = super()._evaluate(unknowns, value, with_tangent)
        if not state.min_jacobian > 0:
            return state
        own, board = self._barrier.forces(self.split(unknowns)[0])
        return replace(state, residual=state.residual - self._expansion.T @ (own + board).ravel() / self.part.copies)

    def _linearised(
        self, entries: np.ndarray, unknowns: np.ndarray, value: np.ndarray, near: Linearised | None = None
    ) -> Linearised:
        stiffness = self._barrier.stiffness(self.split(unknowns)[0])
        added = sparse.tril(self._expansion.T @ stiffness @ self._expansion / self.part.copies)
        lower = sparse.csc_matrix(self.model.assembly.matrix(entries) + added)
        lower.sort_indices()
        pattern = lower.indptr.tobytes(), lower.indices.tobytes()
        if pattern != self._pattern:  # other pairs: it has to be analysed again
            self._solver, self._pattern = make_solver(self._solver_name), pattern
        held = self.model.held(self.numbering.split(unknowns)[0], value)
        return Linearised(entries, lower, self._factored, held, self.numbering.displacements, near)
