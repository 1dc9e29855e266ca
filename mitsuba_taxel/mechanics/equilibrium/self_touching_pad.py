"""Equilibrium of a pad that may touch itself, the board and packages: Newton's method against a barrier."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property, partial
from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sparse

from mitsuba_taxel.mechanics.contact.barriers.bodies import RigidBodies
from mitsuba_taxel.mechanics.contact.barriers.contacts import Contacts
from mitsuba_taxel.mechanics.elements.model import Configuration
from mitsuba_taxel.mechanics.elements.solvers import Factorisation, Solver, make_solver, sum_of_triangles
from mitsuba_taxel.mechanics.equilibrium.feet import where_linear
from mitsuba_taxel.mechanics.equilibrium.indented_pad import IndentedPad
from mitsuba_taxel.mechanics.equilibrium.linearised import Linearised
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import RESIDUAL_TOLERANCE, LoadedPad
from mitsuba_taxel.mechanics.equilibrium.solution import NO_HISTORY, Balanced, History, Rejected

MOST_ITERATIONS = 40
"""Largest number of Newton iterations: more than without contact, because corners may slide off others during a
solve."""
MOST_HALVINGS = 6
"""Number of halvings of a Newton step that does not bring the pad closer to balance."""
OVERSHOT = 0.5
"""Largest slope of the energy at the end of a step, relative to that at its start, with opposite sign."""


class SelfTouchingPad(LoadedPad):
    """A meshed pad glued to the board, with barriers between its walls, and against the board and rigid bodies.

    The whole pad may touch itself, also across the mirror planes of the part that is solved. Barriers and their tangent
    are restricted to displacements of the part. Stability against other displacements is tested with the tangent of the
    whole pad.

    Parameters
    ----------
    *parts, **more : Any
        See `LoadedPad`.
    bodies : RigidBodies, optional
        Bodies that the pad may touch.
    fraction : float
        Reach of the barriers, relative to the default.
    """

    solves_between = True
    _analysed: tuple[tuple[bytes, ...], Solver] | None = None
    """Pattern of the last tangent, and a solver that has analysed it."""

    def __init__(self, *parts: Any, bodies: RigidBodies | None = None, fraction: float = 1.0, **more: Any) -> None:
        self._bodies, self._fraction = bodies, fraction
        super().__init__(*parts, **more)

    def _linear(self) -> np.ndarray | None:
        return where_linear(self.whole, self.load, self._fraction)

    @cached_property
    def contacts(self) -> Contacts:
        return Contacts(self.whole, self.material.youngs_modulus, self._bodies, self._fraction)

    @cached_property
    def _expansion(self) -> sparse.csr_array:
        """Matrix (3 N, unknowns) from the unknowns to the displacements of the N nodes of the whole pad."""
        component, sign = self.part.components
        entries = sign.ravel(), (np.arange(component.size), component.ravel())
        of_part = sparse.csr_array(entries, shape=(component.size, 3 * len(self.part.mesh.points)))
        return sparse.csr_array(self.model.over_unknowns(of_part))

    def closer(self, unknowns: np.ndarray, value: np.ndarray) -> np.ndarray:
        """Unknowns of the equilibrium that results, near a given state, if the contact forces begin at half the
        distance. The difference shows the error of these forces.
        """
        arguments = self.whole, self.material, self.load, self.mirrors, self.images, self._solver_name
        return type(self)(*arguments, bodies=self._bodies, fraction=0.5 * self._fraction).equilibrium(unknowns, value)

    def towards(self, known: np.ndarray, guess: np.ndarray) -> np.ndarray:
        fraction = self.contacts.free_fraction(self.split(known)[0], self.split(guess)[0])
        return guess if fraction == 1 else known + fraction * (guess - known)

    def refuse_unstable(
        self, unknowns: np.ndarray, entries: np.ndarray, value: np.ndarray, history: History = NO_HISTORY
    ) -> None:
        displacement, pressure = self.split(unknowns)
        if not self.contacts.stiffness(displacement).nnz:
            super().refuse_unstable(unknowns, entries, value, history)
        elif self.mirrors:
            whole_pad = self._whole_pad
            stress_update = history.stress_update and history.stress_update.on(whole_pad.part, self.whole)
            alike = whole_pad.gather(displacement, pressure)
            tangent = whole_pad._evaluate(alike, value, history=History(stress_update)).entries
            assert tangent is not None  # no element is inverted
            whole_pad.is_stable(whole_pad._linearised(tangent, alike, value), alike, value, History(stress_update))

    @cached_property
    def _whole_pad(self) -> SelfTouchingPad:
        arguments = self.whole, self.material, self.load
        whole_pad = type(self)(*arguments, solver=self._solver_name, bodies=self._bodies, fraction=self._fraction)
        whole_pad.contacts = self.contacts
        return whole_pad

    def is_stable(
        self, linearised: Linearised, unknowns: np.ndarray, value: np.ndarray, history: History = NO_HISTORY
    ) -> bool:
        """Whether the equilibrium is stable, as :meth:`LoadedPad.is_stable`. The negative stiffness of forces that turn
        about corners is left out, because corners of cut faces and of bodies are sharper than the elements."""
        try:
            return super().is_stable(linearised, unknowns, value, history)
        except Rejected:
            steady = self._linearised(linearised.entries, unknowns, value, steady=True)
            return super().is_stable(steady, unknowns, value, history)

    def _balanced(
        self,
        start: np.ndarray,
        value: np.ndarray,
        linearised: Linearised | None = None,
        history: History = NO_HISTORY,
    ) -> Balanced:
        """Newton's method, whose steps are shortened until they cause no collision and the state is closer to
        equilibrium.

        Barriers are smooth, and their forces grow without limit towards contact (M. Li et al., Incremental Potential
        Contact, ACM Trans. Graph. 39, 2020).
        """
        unknowns, first_error = start, 0.0
        for iteration in range(MOST_ITERATIONS):
            # Test for equilibrium with the forces of the barriers.
            state = self._evaluate(unknowns, value, history=history)
            error = self._checked_error(state, unknowns, value, first_error, history)
            if error < RESIDUAL_TOLERANCE:
                return Balanced(unknowns=unknowns, state=state, error=error, iterations=iteration)
            first_error = first_error or error

            # Where the energy has no minimum, a step would lead to a saddle point. A tangent without forces that turn
            # about corners leads downwards.
            assert state.entries is not None  # no element is inverted
            linearised = self._linearised(state.entries, unknowns, value)
            if linearised.negative > self.numbering.pressures:
                linearised = self._linearised(state.entries, unknowns, value, steady=True)
            step = linearised.step(self._free_residual(state), self._plate_gap(unknowns, value))
            unknowns = self._line_search(unknowns, -step, state, value, history)
        raise Rejected(f"Newton's method does not converge in {MOST_ITERATIONS} iterations")

    def _line_search(
        self, unknowns: np.ndarray, step: np.ndarray, state: Configuration, value: np.ndarray, history: History
    ) -> np.ndarray:
        """Line search: the step is halved until the unknowns are closer to equilibrium, or not far beyond the point of
        least energy.

        Out-of-balance forces may grow towards a minimum of the energy, where a corner slides off an edge. There the
        step is doubled as long as the energy falls.
        """
        error, least, best = self._error(state, unknowns, value), math.inf, unknowns

        # The step is shortened until it causes no collision.
        step = self.towards(unknowns, unknowns + step) - unknowns
        slope = self._slope(step, state)
        for halvings in range(MOST_HALVINGS):
            length = 0.5**halvings
            trial = unknowns + length * step
            trial_state = self._evaluate(trial, value, with_tangent=False, history=history)
            if not trial_state.min_jacobian > 0:
                continue
            residual_error = self._error(trial_state, trial, value)
            if residual_error < (1 - 0.25 * length) * error:
                return trial

            # Not closer, but near the least energy along the step, or before it: then twice the length is tried.
            trial_slope = self._slope(step, trial_state)
            if trial_slope < -OVERSHOT * slope:
                for _ in range(MOST_HALVINGS):
                    trial, beyond = unknowns + length * step, unknowns + 2 * length * step
                    if not trial_slope < 0 or self.towards(trial, beyond) is not beyond:
                        break
                    beyond_state = self._evaluate(beyond, value, with_tangent=False, history=history)
                    if not beyond_state.min_jacobian > 0:
                        break
                    beyond_slope = self._slope(step, beyond_state)
                    if not beyond_slope < -OVERSHOT * trial_slope:
                        break
                    length, trial_slope = 2 * length, beyond_slope
                return unknowns + length * step

            # If no length is accepted, the best of all.
            if residual_error < least:
                best, least = trial, residual_error
        if math.isinf(least):
            raise Rejected("an element would be inverted")
        return best

    def _slope(self, step: np.ndarray, state: Configuration) -> float:
        """Derivative of the energy with respect to the length of a step of the unknowns."""
        displacements = slice(self.numbering.displacements)
        return float(step[displacements] @ self._free_residual(state)[displacements])

    def _evaluate(
        self, unknowns: np.ndarray, value: np.ndarray, with_tangent: bool = True, history: History = NO_HISTORY
    ) -> Configuration:
        return self._with_contacts(super()._evaluate(unknowns, value, with_tangent, history), unknowns)

    def _with_contacts(self, state: Configuration, unknowns: np.ndarray) -> Configuration:
        """Add the forces of the barriers to the residual, and their stiffness to the tangent, of a state."""
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
        analysed = self._analysed  # once, as another thread may replace it
        if analysed is None or analysed[0] != pattern:  # other contact pairs have another pattern
            self._analysed = analysed = pattern, make_solver(self._solver_name)
        constraints = self.model.constraints(self.numbering.split(unknowns)[0], value)
        factor = partial(self._factored, solver=analysed[1])
        return Linearised(entries, lower, factor, constraints, self.numbering.displacements, near)


class IndentedTouchingPad(IndentedPad, SelfTouchingPad):
    """A meshed pad under an indenter, with barriers between its walls and against the board and bodies.

    In each Newton step the contact with the indenter is solved exactly on the linearised pad, as in
    :class:`IndentedPad`; the linearised pad includes the barriers, as in :class:`SelfTouchingPad`.
    """

    _most_iterations: ClassVar[int] = MOST_ITERATIONS

    def _under_forces(
        self, unknowns: np.ndarray, value: np.ndarray, forces: np.ndarray, with_tangent: bool, history: History
    ) -> Configuration:
        return self._with_contacts(super()._under_forces(unknowns, value, forces, with_tangent, history), unknowns)

    def _with_fixed_directions(self, unknowns: np.ndarray, value: np.ndarray, history: History) -> Factorisation:
        """Factor of the tangent with contact pressures of fixed direction, as in :class:`IndentedPad`, and without the
        negative stiffness of contact forces that rotate about corners of walls."""
        inside = self.model.assembly.evaluate(*self.numbering.split(unknowns), True, history.stress_update)
        assert inside.entries is not None  # no element is inverted
        return self._linearised(inside.entries, unknowns, value, steady=True).factor

    def _step_length(
        self,
        change: tuple[np.ndarray, np.ndarray],
        unknowns: np.ndarray,
        forces: np.ndarray,
        value: np.ndarray,
        error: float,
        history: History,
    ) -> tuple[float, Configuration]:
        """Length of a Newton step that causes no collision. It is halved until the state is closer to equilibrium; if
        no length achieves this, the best one is returned."""
        step, force_step = change
        displacement, guess = self.split(unknowns)[0], self.split(unknowns + step)[0]
        length, least = self.contacts.free_fraction(displacement, guess), math.inf
        best: tuple[float, Configuration] | None = None
        for _ in range(MOST_HALVINGS):
            trial = unknowns + length * step
            state = self._under_forces(trial, value, forces + length * force_step, False, history)
            if state.min_jacobian > 0:
                trial_error = max(self._error(state, trial, value), self._gap_error(state))
                if trial_error < least:
                    least, best = trial_error, (length, state)
                if trial_error < (1 - 0.25 * length) * error:
                    break
            length *= 0.5
        if best is None:
            raise Rejected("an element would be inverted")
        return best
