"""Equilibrium of a pad that may touch itself, the board and packages: Newton's method against a barrier."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sparse

from mitsuba_taxel.mechanics.contact.bodies import RigidBodies
from mitsuba_taxel.mechanics.contact.contacts import Contacts
from mitsuba_taxel.mechanics.contact.feet import where_linear
from mitsuba_taxel.mechanics.elements.model import Configuration
from mitsuba_taxel.mechanics.elements.solvers import Factorisation, make_solver, sum_of_triangles
from mitsuba_taxel.mechanics.equilibrium.indented_pad import IndentedPad
from mitsuba_taxel.mechanics.equilibrium.linearised import Linearised
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import RESIDUAL_TOLERANCE, LoadedPad
from mitsuba_taxel.mechanics.equilibrium.solution import Balanced, Rejected

MOST_ITERATIONS = 40
"""More than of a pad without contact, as its corners may slide off others on the way."""
MOST_HALVINGS = 6
"""Number of halvings of a Newton step that does not bring the pad closer to balance."""
OVERSHOT = 0.5
"""Slope of the energy along a step, relative to that at its begin, up to which it may rise again at its end."""


class SelfTouchingPad(LoadedPad):
    """A meshed pad glued to the board, whose walls stay apart, and off the board and rigid ``bodies``.

    The whole pad touches itself, also across the mirrors of the part that is solved for. Its barriers and tangent are
    restricted to displacements of the part. Against others, stability is that of the tangent of the whole. The reach of
    the barriers is a ``share`` of the usual one. Further parameters are those of a `LoadedPad`.
    """

    solves_between = True
    _pattern: tuple[bytes, ...] = ()

    def __init__(self, *parts: Any, bodies: RigidBodies | None = None, share: float = 1.0, **more: Any) -> None:
        self._bodies, self._share = bodies, share
        super().__init__(*parts, **more)

    def _linear(self) -> np.ndarray | None:
        return where_linear(self.whole, self.load, self._share)

    @cached_property
    def contacts(self) -> Contacts:
        return Contacts(self.whole, self.material.youngs_modulus, self._bodies, self._share)

    @cached_property
    def _expansion(self) -> sparse.csr_array:
        """(3 N, unknowns) displacements of the whole pad."""
        place, sign = self.part.components
        entries = sign.ravel(), (np.arange(place.size), place.ravel())
        of_part = sparse.csr_array(entries, shape=(place.size, 3 * len(self.part.mesh.points)))
        return sparse.csr_array(self.model.over_unknowns(of_part))

    def closer(self, unknowns: np.ndarray, value: np.ndarray) -> np.ndarray:
        """The unknowns in balance near those of a state, with half the reach."""
        parts = self.whole, self.material, self.load, self.mirrors, self.images, self._solver_name
        return type(self)(*parts, bodies=self._bodies, share=0.5 * self._share).balance(unknowns, value)

    def towards(self, known: np.ndarray, guess: np.ndarray) -> np.ndarray:
        share = self.contacts.free_share(self.split(known)[0], self.split(guess)[0])
        return guess if share == 1 else known + share * (guess - known)

    def refuse_unstable(self, unknowns: np.ndarray, entries: np.ndarray, value: np.ndarray) -> None:
        displacement, pressure = self.split(unknowns)
        if not self.contacts.stiffness(displacement).nnz:
            super().refuse_unstable(unknowns, entries, value)
        elif self.mirrors:
            whole = self._of_whole
            whole.past = self.past and self.past.on(whole.part, self.whole)
            alike = whole.gather(displacement, pressure)
            tangent = whole._evaluate(alike, value).entries
            assert tangent is not None  # no element is inverted
            whole.is_stable(whole._linearised(tangent, alike, value), alike, value)

    @cached_property
    def _of_whole(self) -> SelfTouchingPad:
        parts = self.whole, self.material, self.load
        whole = type(self)(*parts, solver=self._solver_name, bodies=self._bodies, share=self._share)
        whole.contacts = self.contacts
        return whole

    def is_stable(self, linearised: Linearised, unknowns: np.ndarray, value: np.ndarray) -> bool:
        """As of a `LoadedPad`, whatever forces do that turn about corners: these are corners of cut faces and of
        bodies that are sharper than the elements."""
        try:
            return super().is_stable(linearised, unknowns, value)
        except Rejected:
            steady = self._linearised(linearised.entries, unknowns, value, steady=True)
            return super().is_stable(steady, unknowns, value)

    def _balanced(self, start: np.ndarray, value: np.ndarray, linearised: Linearised | None = None) -> Balanced:
        """Newton's method with steps that collide with nothing, shortened until they lead closer to balance."""
        unknowns, first = start, 0.0
        for iteration in range(MOST_ITERATIONS):
            state = self._evaluate(unknowns, value)
            error = self._checked_error(state, unknowns, value, first)
            if error < RESIDUAL_TOLERANCE:
                return Balanced(unknowns, state, error, iteration, None, 0.0)
            first = first or error
            assert state.entries is not None  # no element is inverted
            linearised = self._linearised(state.entries, unknowns, value)
            if linearised.negative > self.numbering.pressures:  # a step would lead to a saddle
                linearised = self._linearised(state.entries, unknowns, value, steady=True)
            step = linearised.step(self._left(state), self._gap(unknowns, value))
            unknowns = self._along(unknowns, -step, state, value)
        raise Rejected(f"Newton's method does not converge in {MOST_ITERATIONS} iterations")

    def _along(self, unknowns: np.ndarray, step: np.ndarray, state: Configuration, value: np.ndarray) -> np.ndarray:
        """The first place along a step, halved until so, that is closer to balance, or not far beyond the least energy.

        Out-of-balance forces may grow on the way to a minimum of the energy, where a corner slides off an edge. There
        the step is doubled as long as the energy falls on.
        """
        error, least, best = self._error(state, unknowns, value), math.inf, unknowns
        step = self.towards(unknowns, unknowns + step) - unknowns
        slope = self._slope(step, state)
        for halvings in range(MOST_HALVINGS):
            share = 0.5**halvings
            tried = unknowns + share * step
            there = self._evaluate(tried, value, with_tangent=False)
            if not there.min_jacobian > 0:
                continue
            left = self._error(there, tried, value)
            if left < (1 - 0.25 * share) * error:
                return tried
            if self._slope(step, there) < -OVERSHOT * slope:
                return self._further(unknowns, step, share, there, value)
            if left < least:
                best, least = tried, left
        if math.isinf(least):
            raise Rejected("an element would be inverted")
        return best

    def _further(
        self, unknowns: np.ndarray, step: np.ndarray, share: float, there: Configuration, value: np.ndarray
    ) -> np.ndarray:
        """The place at a share of a step that leads down, which is doubled while the energy falls on."""
        slope = self._slope(step, there)
        for _ in range(MOST_HALVINGS):
            here, tried = unknowns + share * step, unknowns + 2 * share * step
            if not slope < 0 or self.towards(here, tried) is not tried:
                break
            there = self._evaluate(tried, value, with_tangent=False)
            if not there.min_jacobian > 0 or not self._slope(step, there) < -OVERSHOT * slope:
                break
            share, slope = 2 * share, self._slope(step, there)
        return unknowns + share * step

    def _slope(self, step: np.ndarray, state: Configuration) -> float:
        """Derivative of the energy at a state by the share of a step."""
        moved = slice(self.numbering.displacements)
        return float(step[moved] @ self._left(state)[moved])

    def _evaluate(self, unknowns: np.ndarray, value: np.ndarray, with_tangent: bool = True) -> Configuration:
        return self._kept_apart(super()._evaluate(unknowns, value, with_tangent), unknowns)

    def _kept_apart(self, state: Configuration, unknowns: np.ndarray) -> Configuration:
        """A state with the forces of contact added."""
        if not state.min_jacobian > 0:
            return state
        forces = self.contacts.all_forces(self.split(unknowns)[0]).ravel()
        if not forces.any():
            return state
        return replace(state, residual=state.residual - self._expansion.T @ forces / self.part.copies)

    def _linearised(
        self,
        entries: np.ndarray,
        unknowns: np.ndarray,
        value: np.ndarray,
        near: Linearised | None = None,
        steady: bool = False,
    ) -> Linearised:
        stiffness, lower = self.contacts.stiffness(self.split(unknowns)[0], steady), self.model.assembly.matrix(entries)
        if stiffness.nnz:
            added = sparse.tril(self._expansion.T @ stiffness @ self._expansion / self.part.copies)
            lower = sum_of_triangles(lower, added)
        pattern = lower.indptr.tobytes(), lower.indices.tobytes()
        if pattern != self._pattern:  # other pairs: it has to be analysed again
            self._solver, self._pattern = make_solver(self._solver_name), pattern
        held = self.model.held(self.numbering.split(unknowns)[0], value)
        return Linearised(entries, lower, self._factored, held, self.numbering.displacements, near)


class IndentedTouchingPad(IndentedPad, SelfTouchingPad):
    """A meshed pad glued to the board, under a moved indenter, whose walls stay apart, and off the board and bodies.

    The indenter presses as on an :class:`IndentedPad`, in each step exactly on the linear pad; barriers are part of
    that, as of a :class:`SelfTouchingPad`.
    """

    _most_iterations: ClassVar[int] = MOST_ITERATIONS

    def _pushed(
        self, unknowns: np.ndarray, value: np.ndarray, pushed_by: np.ndarray, with_tangent: bool = True
    ) -> Configuration:
        return self._kept_apart(super()._pushed(unknowns, value, pushed_by, with_tangent), unknowns)

    def _with_straight_pushes(self, unknowns: np.ndarray, value: np.ndarray) -> Factorisation:
        """As of an :class:`IndentedPad`; forces that turn about corners of walls do not make it unstable either."""
        inside = self.model.assembly.evaluate(*self.numbering.split(unknowns), True, self.past)
        assert inside.entries is not None  # no element is inverted
        return self._linearised(inside.entries, unknowns, value, steady=True).factor

    def _share_of(
        self,
        change: tuple[np.ndarray, np.ndarray],
        unknowns: np.ndarray,
        pushed_by: np.ndarray,
        value: np.ndarray,
        error: float,
    ) -> tuple[float, Configuration]:
        """How much of a change collides with nothing and leads closer to balance, halved until so; else the best of
        these."""
        step, further = change
        known, guess = self.split(unknowns)[0], self.split(unknowns + step)[0]
        share, least = self.contacts.free_share(known, guess), math.inf
        best: tuple[float, Configuration] | None = None
        for _ in range(MOST_HALVINGS):
            tried = unknowns + share * step
            there = self._pushed(tried, value, pushed_by + share * further, with_tangent=False)
            if there.min_jacobian > 0:
                left = max(self._error(there, tried, value), self._out_of_touch(there))
                if left < least:
                    least, best = left, (share, there)
                if left < (1 - 0.25 * share) * error:
                    break
            share *= 0.5
        if best is None:
            raise Rejected("an element would be inverted")
        return best
