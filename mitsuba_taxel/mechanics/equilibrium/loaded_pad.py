"""Equilibrium of a pad under a load: one Newton solve, on the symmetric part of the pad."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property

import numpy as np

from mitsuba_taxel.mechanics.contact.barriers.singular_edges import judged_nodes
from mitsuba_taxel.mechanics.elements.model import Configuration
from mitsuba_taxel.mechanics.equilibrium.linearised import Linearised
from mitsuba_taxel.mechanics.equilibrium.meshed_pad import MeshedPad
from mitsuba_taxel.mechanics.equilibrium.solution import (
    NO_HISTORY,
    Balanced,
    History,
    Rejected,
    Solution,
    refuse_surplus,
    singular,
)
from mitsuba_taxel.mechanics.equilibrium.stability import Stability
from mitsuba_taxel.mechanics.equilibrium.top_corners import gives_way

RESIDUAL_TOLERANCE = 1e-9
"""Largest out-of-balance force accepted, relative to the load."""
MOST_ITERATIONS = 20
MOST_HALVINGS = 6
"""Number of halvings of a Newton step that inverts an element."""
SLOW = 0.1
"""A factored tangent is reused while each iteration reduces the error to less than this fraction; see also
`FEW_ITERATIONS`."""
FEW_ITERATIONS, FEW_UNKNOWNS = 3, 20_000
"""A factored tangent is also reused if this number of further iterations, each as effective as the last one, would
reach the tolerance: together they cost less than a factorisation. The number applies to at most so many unknowns; for n
unknowns it grows with n^(2/3), like the cost of a factorisation relative to that of an iteration."""
NEAR = 1e-3
"""Distance of displacements, relative to the largest, within which the tangent of a nearby state is used."""


class LoadedPad(MeshedPad):
    """A meshed pad glued to the board, under a load.

    All solves find an equilibrium by Newton's method (:meth:`_balanced`). They differ in the check of stability, and in
    the tangent that they return:

    ======================== ============================================== ========================================
    method                   stability is checked against                   tangent, and its factor
    ======================== ============================================== ========================================
    solve                    all displacements                              of the state, its own
    solve_symmetric          the same, or left to `refuse_unstable`         of the state, of a state near by
    solve_linearised         those with the symmetry of the load            of a state within `NEAR`
    solve_with_tangent       those with the symmetry of the load            of the state, of a state near by
    solve_between            nothing: those on both sides are stable        of the state, of a state near by
    solve_after              those with the symmetry of the load            of the last iteration with a new one
    equilibrium_with_tangent nothing                                        of the state, its own
    equilibrium              nothing                                        none is returned
    ======================== ============================================== ========================================

    Parameters are those of a :class:`MeshedPad`.
    """

    def solve(self, start: np.ndarray, value: np.ndarray) -> tuple[Solution, Linearised]:
        """The stable equilibrium that Newton's method finds.

        Parameters
        ----------
        start : (unknowns,) ndarray
            Unknowns from which the iteration starts.
        value : (3,) or (1,) ndarray
            Value of the load on the whole pad, in N, mm or MPa.

        Returns
        -------
        solution : Solution
            The equilibrium.
        linearised : Linearised
            Factored tangent of the pad at the equilibrium.

        Raises
        ------
        Rejected
            if it does not converge, inverts an element, or ends in an unstable equilibrium.
        """
        balanced = self._balanced(start, value)
        linearised = self._linearised(self._entries(balanced, value), balanced.unknowns, value)
        unknowns = self._further_step(linearised, balanced.state, balanced.unknowns, value)
        balanced = replace(balanced, unknowns=unknowns, linearised=None)
        solution = self._accepted(balanced, self.is_stable(linearised, balanced.unknowns, value))
        self.refuse_unstable(solution.unknowns, linearised.entries, value)
        return solution, linearised

    def solve_symmetric(self, start: np.ndarray, value: np.ndarray) -> tuple[Solution, Linearised]:
        """The equilibrium and its tangent, as from :meth:`solve`, but without the stability check of
        :meth:`refuse_unstable`.

        Only one factored matrix is then in memory at a time: that of a nearby state, if it suffices.

        Parameters
        ----------
        start : (unknowns,) ndarray
            Unknowns from which the iteration starts.
        value : (c,) ndarray
            Value of the load, in N, mm or MPa.

        Returns
        -------
        solution : Solution
            The equilibrium.
        linearised : Linearised
            Factored tangent of the pad at the equilibrium.

        Raises
        ------
        Rejected
            if there is no acceptable state.
        """
        balanced = self._balanced(start, value)
        entries = self._entries(balanced, value)
        if balanced.linearised is not None and self._stability.of_all:
            linearised = self._linearised(entries, balanced.unknowns, value, balanced.linearised)
            return self._accepted(balanced, True), linearised
        balanced = replace(balanced, linearised=None)  # frees its memory for the next one
        linearised = self._linearised(entries, balanced.unknowns, value)
        return self._accepted(balanced, self.is_stable(linearised, balanced.unknowns, value)), linearised

    def refuse_unstable(
        self, unknowns: np.ndarray, entries: np.ndarray, value: np.ndarray, history: History = NO_HISTORY
    ) -> None:
        """Raise Rejected if an equilibrium is unstable against displacements that :class:`Stability` checks.

        Parameters
        ----------
        unknowns : (unknowns,) ndarray
            Unknowns of the equilibrium.
        entries : ndarray
            Entries of the tangent there, :attr:`Linearised.entries`.
        value : ndarray
            Value of the load.
        history : History
            Earlier states that the equilibrium depends on.
        """
        try:
            refuse_surplus(self._stability.surplus(entries, *self.split(unknowns), value, history.stress_update))
        except RuntimeError as failure:
            raise singular(failure) from failure

    def solve_linearised(self, start: np.ndarray, value: np.ndarray) -> tuple[Solution, Linearised]:
        """The equilibrium, as from :meth:`solve`, and the factored tangent at this state or a nearby one.

        It is for the pad at rest, and between states of a path that are known to be stable: stability against
        displacements that break the symmetry of the load is not tested again. The pad may be linearised at a nearby
        state, at most `NEAR` away from the solution.

        Parameters
        ----------
        start : (unknowns,) ndarray
            Unknowns from which the iteration starts.
        value : (c,) ndarray
            Value of the load, in N, mm or MPa.

        Returns
        -------
        solution : Solution
            The equilibrium.
        linearised : Linearised
            Factored tangent of the pad at the equilibrium.

        Raises
        ------
        Rejected
            if there is no acceptable state.
        """
        balanced = self._balanced(start, value)
        linearised = balanced.linearised
        largest = np.abs(balanced.unknowns[: self.numbering.displacements]).max()
        if linearised is None or balanced.distance > NEAR * largest:
            linearised = self._linearised(self._entries(balanced, value), balanced.unknowns, value, linearised)
        return self._accepted(balanced, self.is_stable(linearised, balanced.unknowns, value)), linearised

    def solve_between(
        self, start: np.ndarray, value: np.ndarray, near: Callable[[], Linearised]
    ) -> tuple[Solution, Linearised]:
        """The equilibrium and its tangent, as from :meth:`solve_linearised`, for a load that lies between the loads of
        two stable states of a path.

        Parameters
        ----------
        start : (unknowns,) ndarray
            Unknowns from which the iteration starts.
        value : (c,) ndarray
            Value of the load, in N, mm or MPa.
        near : Callable[[], Linearised]
            Returns the pad linearised at a nearby state, whose factor is used if that is enough.

        Returns
        -------
        solution : Solution
            The equilibrium.
        linearised : Linearised
            Factored tangent of the pad at the equilibrium.

        Raises
        ------
        Rejected
            if there is no acceptable state.
        """
        return self.solve_linearised(start, value)

    def solve_with_tangent(self, start: np.ndarray, value: np.ndarray) -> tuple[Solution, Linearised]:
        """The equilibrium and its tangent, as from :meth:`solve_linearised`. The tangent is that of the state itself,
        but its factor may be that of a nearby state.

        Parameters
        ----------
        start : (unknowns,) ndarray
            Unknowns from which the iteration starts.
        value : (c,) ndarray
            Value of the load, in N, mm or MPa.

        Returns
        -------
        solution : Solution
            The equilibrium.
        linearised : Linearised
            Factored tangent of the pad at the equilibrium.

        Raises
        ------
        Rejected
            if there is no acceptable state.
        """
        solution, nearby = self.solve_linearised(start, value)
        state = self._evaluate(solution.unknowns, value)
        assert state.entries is not None  # no element is inverted
        linearised = self._linearised(state.entries, solution.unknowns, value, nearby)
        unknowns = self._further_step(linearised, state, solution.unknowns, value)
        return replace(solution, unknowns=unknowns), linearised

    def equilibrium_with_tangent(self, start: np.ndarray, value: np.ndarray) -> tuple[Solution, Linearised]:
        """An equilibrium, which may be unstable, and its factored tangent; see :meth:`solve_with_tangent`.

        Parameters
        ----------
        start : (unknowns,) ndarray
            Unknowns from which the iteration starts.
        value : (c,) ndarray
            Value of the load, in N, mm or MPa.

        Returns
        -------
        solution : Solution
            The equilibrium.
        linearised : Linearised
            Factored tangent of the pad at the equilibrium.

        Raises
        ------
        Rejected
            if there is no acceptable state.
        """
        balanced = self._balanced(start, value)
        linearised = self.tangent_at(balanced.unknowns, value, None)
        unknowns = self._further_step(linearised, balanced.state, balanced.unknowns, value)
        return self._accepted(replace(balanced, unknowns=unknowns, linearised=None), True), linearised

    def _further_step(
        self, linearised: Linearised, state: Configuration, unknowns: np.ndarray, value: np.ndarray
    ) -> np.ndarray:
        """The unknowns after one more Newton step from an equilibrium. The step costs one back-substitution, and
        removes the effect of the residual on derivatives."""
        return unknowns - linearised.step(self._free_residual(state), self._plate_gap(unknowns, value))

    def solve_after(
        self, start: np.ndarray, value: np.ndarray, near: Linearised | None, history: History = NO_HISTORY
    ) -> tuple[Solution, Linearised]:
        """The stable equilibrium of a pad that depends on earlier states, given by ``history``. The matrix factored at
        ``near`` is used as long as iterations converge fast.

        Stability against displacements without the symmetry of the load is not tested.

        Parameters
        ----------
        start : (unknowns,) ndarray
            Unknowns from which the iteration starts.
        value : (c,) ndarray
            Value of the load, in N, mm or MPa.
        near : Linearised or None
            Factored tangent of the pad at a nearby state; it is reused.
        history : History
            Earlier states that the equilibrium depends on.

        Returns
        -------
        solution : Solution
            The equilibrium.
        linearised : Linearised
            Factored tangent of the pad at the equilibrium.

        Raises
        ------
        Rejected
            if there is no acceptable state.
        """
        balanced = self._balanced(start, value, near, history)
        linearised = balanced.linearised
        if linearised is None:
            entries = self._entries(balanced, value, history)
            linearised = self._linearised(entries, balanced.unknowns, value)
        checked = self.is_stable(linearised, balanced.unknowns, value, history)
        return self._accepted(balanced, checked), linearised

    def stable_tangent(
        self, unknowns: np.ndarray, value: np.ndarray, near: Linearised, history: History = NO_HISTORY
    ) -> Linearised:
        """Factored tangent at an equilibrium, whose stability against all displacements is tested.

        If :class:`Stability` also tests displacements with the symmetry of the load, the factorisation of the nearby
        state ``near`` is reused.

        Parameters
        ----------
        unknowns : (unknowns,) ndarray
            Unknowns of the pad.
        value : (c,) ndarray
            Value of the load, in N, mm or MPa.
        near : Linearised or None
            Factored tangent of the pad at a nearby state; it is reused.
        history : History
            Earlier states that the equilibrium depends on.

        Returns
        -------
        Linearised
            The pad linearised at the equilibrium.

        Raises
        ------
        Rejected
            if there is no acceptable state.
        """
        of_all = self._stability.of_all
        linearised = self.tangent_at(unknowns, value, near if of_all else None, history)
        if not of_all:
            self.is_stable(linearised, unknowns, value, history)
        self.refuse_unstable(unknowns, linearised.entries, value, history)
        return linearised

    def equilibrium(self, start: np.ndarray, value: np.ndarray) -> np.ndarray:
        """The unknowns of the equilibrium, as from :meth:`solve`, without a check of stability.

        Parameters
        ----------
        start : (unknowns,) ndarray
            Unknowns from which the iteration starts.
        value : (c,) ndarray
            Value of the load, in N, mm or MPa.

        Returns
        -------
        (unknowns,) ndarray
            The unknowns in equilibrium.

        Raises
        ------
        Rejected
            if there is no acceptable state.
        """
        return self._balanced(start, value).unknowns

    def figures_at(
        self, unknowns: np.ndarray, value: np.ndarray, iterations: int, checked: bool, history: History = NO_HISTORY
    ) -> Solution:
        """Create a solution from given unknowns: its residual and smallest volume ratio are computed.

        Parameters
        ----------
        unknowns : (unknowns,) ndarray
            Unknowns of the pad.
        value : (c,) ndarray
            Value of the load, in N, mm or MPa.
        iterations : int
            Number of iterations of their solve.
        checked : bool
            Whether their stability is known.
        history : History
            Earlier states that the equilibrium depends on.

        Returns
        -------
        Solution
            Solution with residual and least volume ratio.

        Raises
        ------
        Rejected
            if an element is inverted.
        """
        state = self._evaluate(unknowns, value, with_tangent=False, history=history)
        error = self._checked_error(state, unknowns, value, 0.0, history)
        return self._accepted(Balanced(unknowns=unknowns, state=state, error=error, iterations=iterations), checked)

    def _balanced(
        self,
        start: np.ndarray,
        value: np.ndarray,
        linearised: Linearised | None = None,
        history: History = NO_HISTORY,
    ) -> Balanced:
        """Newton's method, whose iterations share a factored tangent as long as they converge fast enough.

        With the residual r and its tangent K, iterations are u <- u - K^-1 r (J. Bonet and R. D. Wood, Nonlinear
        Continuum Mechanics for Finite Element Analysis, 2nd ed., 2008, chapter 9).
        """
        unknowns, first_error, last_error, distance = start.copy(), 0.0, math.inf, 0.0
        correction = np.zeros_like(unknowns)
        for iteration in range(MOST_ITERATIONS):
            # The residual, and the tangent only if no factored one is available. A step that has inverted an element is
            # halved.
            state = self._evaluate(unknowns, value, linearised is None, history)
            for _ in range(MOST_HALVINGS):
                if state.min_jacobian > 0 or not iteration:
                    break
                correction = correction / 2
                unknowns = unknowns + correction
                state = self._evaluate(unknowns, value, history=history)

            # Test for equilibrium.
            error = self._checked_error(state, unknowns, value, first_error, history)
            if error < RESIDUAL_TOLERANCE:
                return Balanced(
                    unknowns=unknowns,
                    state=state,
                    error=error,
                    iterations=iteration,
                    linearised=linearised,
                    distance=distance,
                )

            # A tangent is factored at first, and where the last one has become too poor: where it reduces the error
            # slowly, and more iterations with it would cost more than a factorisation.
            if state.entries is None:
                ratio, few = error / last_error, FEW_ITERATIONS * max(1.0, self.unknowns / FEW_UNKNOWNS) ** (2 / 3)
                if ratio > SLOW and error * ratio**few > RESIDUAL_TOLERANCE:
                    state = self._evaluate(unknowns, value, history=history)
            if state.entries is not None:
                linearised = None  # frees its memory for the next one
                linearised, distance = self._linearised(state.entries, unknowns, value), 0.0
            assert linearised is not None  # tangent of an earlier iteration
            first_error, last_error = first_error or error, error

            # One step, and the distance from the state of the tangent.
            correction = linearised.step(self._free_residual(state), self._plate_gap(unknowns, value))
            distance += float(np.abs(correction[: self.numbering.displacements]).max())
            unknowns = unknowns - correction
        raise Rejected(f"Newton's method does not converge in {MOST_ITERATIONS} iterations")

    def _accepted(self, balanced: Balanced, checked: bool) -> Solution:
        """Convert the result of Newton's method to a solution; raises Rejected if an element is inverted at a node."""
        nodal = self.model.least_nodal_jacobian(self.numbering.split(balanced.unknowns)[0], self._judged_nodes)
        if not nodal > 0:
            raise Rejected(f"an element would be inverted at a node (J = {nodal:.2g})")
        return Solution(
            unknowns=balanced.unknowns,
            min_jacobian=min(balanced.state.min_jacobian, nodal),
            residual=balanced.error,
            iterations=balanced.iterations,
            stability_checked=checked,
        )

    def _entries(self, balanced: Balanced, value: np.ndarray, history: History = NO_HISTORY) -> np.ndarray:
        """Entries of the tangent at an equilibrium."""
        entries = balanced.state.entries
        if entries is None:
            entries = self._evaluate(balanced.unknowns, value, history=history).entries
        assert entries is not None  # no element is inverted
        return entries

    def _checked_error(
        self, state: Configuration, unknowns: np.ndarray, value: np.ndarray, first: float, history: History
    ) -> float:
        """Relative error of equilibrium in an iteration; raises Rejected if the iteration should not continue."""
        if not state.min_jacobian > 0:
            raise Rejected(f"an element would be inverted (J = {state.min_jacobian:.2g})")
        if not first and history.stress_update is None:
            limit = gives_way(-value[-1], self.whole, self.material, self.load)
            if math.isfinite(limit):
                raise Rejected(
                    f"corners of its top become unstable beyond {limit:.3g} MPa of constant direction, on any mesh: "
                    f"a plate, load = plate_force, keeps their shape"
                )
        error = self._error(state, unknowns, value)
        if not error < 1e6 * max(first or error, 1.0):
            raise Rejected("Newton's method diverges")
        return error

    @cached_property
    def _judged_nodes(self) -> np.ndarray:
        return judged_nodes(self.whole)[self.part.nodes]

    def is_stable(
        self, linearised: Linearised, unknowns: np.ndarray, value: np.ndarray, history: History = NO_HISTORY
    ) -> bool:
        """Check that an equilibrium is stable against displacements with its symmetry. :meth:`refuse_unstable` checks
        further displacements.

        Parameters
        ----------
        linearised : Linearised
            Factored tangent of the pad at the state, or at a nearby one.
        unknowns : (unknowns,) ndarray
            Unknowns of the pad.
        value : (c,) ndarray
            Value of the load, in N, mm or MPa.
        history : History
            Earlier states that the equilibrium depends on.

        Returns
        -------
        bool
            True if the check was possible, and the equilibrium has passed it; False if the check is not possible, as
            with friction.

        Raises
        ------
        Rejected
            if it is unstable.
        """
        refuse_surplus(linearised.negative - self.numbering.pressures)
        return True

    @cached_property
    def _stability(self) -> Stability:
        return Stability(self.whole, self.mirrors, self.images, self.model, self._solver_name)
