"""Equilibrium of a pad under an indenter: Newton's method with contact pressures as additional unknowns.

In each iteration the pad is linear, and the contact set is determined exactly from the flexibility of the pad at few
nodes, by back-solves with the factor of the pad alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np
import scipy.sparse as sparse

from mitsuba_taxel.mechanics.contact.friction import Friction, FrictionState
from mitsuba_taxel.mechanics.contact.indentation import ContactState
from mitsuba_taxel.mechanics.contact.linear_contact import pressures, tractions
from mitsuba_taxel.mechanics.elements.load_constraints import responses
from mitsuba_taxel.mechanics.elements.model import Configuration
from mitsuba_taxel.mechanics.elements.solvers import Factorisation
from mitsuba_taxel.mechanics.equilibrium.linearised import Linearised
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import MOST_ITERATIONS, NEAR, RESIDUAL_TOLERANCE, LoadedPad
from mitsuba_taxel.mechanics.equilibrium.natural_step import NATURAL_STRAIN
from mitsuba_taxel.mechanics.equilibrium.solution import NO_HISTORY, Balanced, History, Rejected, Solution

SLOW_PRESSED = 0.2
"""A factored tangent is reused while each iteration reduces the error to less than this fraction. It is larger than
without an indenter, because nodes that come into contact keep the error large with any tangent."""
MOST_HALVINGS = 5
"""Number of halvings of a Newton step that would invert an element."""
LIKELY = 0.25
"""Largest gap of nodes that may be in contact at the start of a solve, relative to a step of the path."""


@dataclass(frozen=True, eq=False)
class Nearby:
    """Results of a solve that are reused for a slightly moved indenter: unknowns, factored tangent, and flexibility at
    the nodes that the indenter may touch."""

    unknowns: np.ndarray
    linearised: Linearised
    contact: _LinearContact | None


class IndentedPad(LoadedPad):
    """The equations of a meshed pad that is glued to the board and touched by a moved indenter."""

    solves_between = True
    _most_iterations: ClassVar[int] = MOST_ITERATIONS

    @cached_property
    def friction(self) -> Friction | None:
        """Friction of the indenter; None if it has none."""
        body = self.model.indentation
        return Friction(body, self.part.mesh.points, self.part.group) if body.indenter.friction else None

    def friction_state_at(
        self, unknowns: np.ndarray, value: np.ndarray, history: History = NO_HISTORY
    ) -> FrictionState | None:
        """State of the indenter's friction at an equilibrium, from which the next step continues: tractions and
        positions of the faces.

        Parameters
        ----------
        unknowns : (unknowns,) ndarray
            Unknowns of the pad.
        value : (c,) ndarray
            Value of the load, in N, mm or MPa.
        history : History
            Earlier states that the equilibrium depends on.

        Returns
        -------
        FrictionState or None
            None without friction.
        """
        if self.friction is None:
            return None
        displacement = self.numbering.split(unknowns)[0]
        contact_state = self.model.indentation.contact_state(displacement, value)
        return FrictionState(
            self.friction.slip_position(displacement, value),
            self._own_traction(displacement, value, contact_state, history),
        )

    def _own_traction(
        self, displacement: np.ndarray, value: np.ndarray, contact_state: ContactState, history: History
    ) -> np.ndarray:
        """Tractions (m, 3) of friction in MPa at m contact nodes, computed from the slip in the contact
        ``contact_state``. The indenter must have friction.
        """
        assert self.friction is not None
        tangents, slip_position = (
            self.friction.tangents(contact_state),
            self.friction.slip_position(displacement, value),
        )
        return self.friction.traction(
            tangents, slip_position, history.friction_state or self.friction.at_rest(), contact_state.pressure
        )

    def solve_linearised(self, start: np.ndarray, value: np.ndarray) -> tuple[Solution, Linearised]:
        solution, nearby = self.solve_nearby(start, value)
        return solution, nearby.linearised

    def solve_nearby(self, start: np.ndarray, value: np.ndarray, near: Nearby | None = None) -> tuple[Solution, Nearby]:
        """The equilibrium that :meth:`solve_linearised` finds, in less time: the factorised stiffness of a similar
        state is reused as long as iterations converge fast.

        Parameters
        ----------
        start : (unknowns,) ndarray
            Unknowns from which the iteration starts.
        value : (3,) ndarray
            Displacement of the indenter, mm.
        near : Nearby, optional
            Result of a solve at a similar position of the indenter.

        Returns
        -------
        solution : Solution
            The equilibrium.
        nearby : Nearby
            Results to reuse for similar positions of the indenter.

        Raises
        ------
        Rejected
            if there is no acceptable state.
        """
        displacements = self.numbering.displacements
        if near is None:
            balanced, contact = self._solved(start, value)
        else:
            balanced, contact = self._solved(start, value, near.linearised, contact=near.contact)
        distance = balanced.distance
        if near is not None and balanced.linearised is near.linearised:
            distance = float(np.abs((balanced.unknowns - near.unknowns)[:displacements]).max())

        # The factor of a similar state is used if it suffices; else its memory is freed for a new factor.
        entries = self._entries(balanced, value)
        if balanced.linearised is None or distance > NEAR * np.abs(balanced.unknowns[:displacements]).max():
            balanced, contact = replace(balanced, linearised=None), None
        linearised = self._linearised(entries, balanced.unknowns, value, balanced.linearised)
        solution = self._accepted(balanced, self.is_stable(linearised, balanced.unknowns, value))
        return solution, Nearby(balanced.unknowns, linearised, contact)

    def solve_between(
        self, start: np.ndarray, value: np.ndarray, near: Callable[[], Linearised]
    ) -> tuple[Solution, Linearised]:
        if self.friction is not None or self.contacts is not None:
            return super().solve_between(start, value, near)
        balanced, _ = self._solved(start, value, near())
        entries = self._entries(balanced, value)
        linearised = self._linearised(entries, balanced.unknowns, value, balanced.linearised)
        return self._accepted(balanced, True), linearised

    def is_stable(
        self, linearised: Linearised, unknowns: np.ndarray, value: np.ndarray, history: History = NO_HISTORY
    ) -> bool:
        if self.friction is not None:
            return False
        try:
            return super().is_stable(linearised, unknowns, value, history)
        except Rejected as unstable:
            factor = self._with_fixed_directions(unknowns, value, history)
            constraints = self.model.constraints(self.numbering.split(unknowns)[0], value)
            if factor.negative_pivots == self.numbering.pressures + constraints.negative(factor):
                raise Rejected(
                    "it slips off the indenter, whose edge is too sharp for the elements: a rounder indenter is needed"
                ) from unstable
            raise

    def _balanced(
        self,
        start: np.ndarray,
        value: np.ndarray,
        linearised: Linearised | None = None,
        history: History = NO_HISTORY,
    ) -> Balanced:
        return self._solved(start, value, linearised, history)[0]

    def _solved(
        self,
        start: np.ndarray,
        value: np.ndarray,
        linearised: Linearised | None = None,
        history: History = NO_HISTORY,
        contact: _LinearContact | None = None,
    ) -> tuple[Balanced, _LinearContact | None]:
        """Newton's method with the pressures of contact, and the tractions of friction, as further unknowns.

        In each iteration the pad is linearised, and the contact set of the linearised pad is found exactly: no gap is
        negative, no pressure pulls, and one of both is 0 (P. Wriggers, Computational Contact Mechanics, 2006, chapter
        10).
        """
        # The pressures at the start are unknown; those that balance the start best are used.
        unknowns, first_error, last_error, distance = start, 0.0, math.inf, 0.0
        forces = self._initial_pressures(unknowns, value, history)
        state = self._under_forces(unknowns, value, forces, linearised is None, history)
        if linearised and contact is None:
            contact = self._contact(linearised.factor, state)
        for iteration in range(self._most_iterations):
            # Test for equilibrium, with the pressures that follow from the gaps. The error under the pressures of the
            # iteration, and of its gaps, measures how good the tangent still is.
            error = max(self._checked_error(state, unknowns, value, first_error, history), self._gap_error(state))
            consistent = self._with_gap_pressures(state, unknowns, value, history)
            residual_error = self._error(consistent, unknowns, value)
            if residual_error < RESIDUAL_TOLERANCE:
                balanced = Balanced(
                    unknowns=unknowns,
                    state=consistent,
                    error=residual_error,
                    iterations=iteration,
                    linearised=linearised,
                    distance=distance,
                )
                return balanced, contact

            # A tangent is factored at first, and where the last one has become too poor.
            if contact is None or error > SLOW_PRESSED * last_error:
                linearised = contact = None  # frees its memory for the next one
                if state.entries is None:
                    state = self._under_forces(unknowns, value, forces, True, history)
                assert state.entries is not None  # no element is inverted
                linearised, distance = self._linearised(state.entries, unknowns, value), 0.0
                contact = self._contact(linearised.factor, state)
            first_error, last_error = first_error or error, error

            # The contact set of the linear pad. Pressures that follow the normals of a sharp body may make it
            # unstable; without that, steps are shorter.
            slip = self._slip(state, unknowns, value, history)
            change = contact.step(state, forces, slip)
            if change is None:
                linearised = contact = None  # frees its memory for the next one
                contact = _LinearContact(
                    self, self._with_fixed_directions(unknowns, value, history), _contact_state_of(state)
                )
                change = contact.step(state, forces, slip)
            if change is None:
                raise Rejected("the contact with the indenter does not settle")

            # The step is shortened until it inverts no element.
            step_length, state = self._step_length(change, unknowns, forces, value, error, history)
            step, force_step = step_length * change[0], step_length * change[1]
            unknowns, forces = unknowns + step, forces + force_step
            distance += float(np.abs(step[: self.numbering.displacements]).max())
        raise Rejected(f"Newton's method does not converge in {self._most_iterations} iterations")

    def _step_length(
        self,
        change: tuple[np.ndarray, np.ndarray],
        unknowns: np.ndarray,
        forces: np.ndarray,
        value: np.ndarray,
        error: float,
        history: History,
    ) -> tuple[float, Configuration]:
        """Length of a Newton step, halved until no element is inverted, and residual and tangent of the pad after the
        step."""
        length, (step, force_step) = 1.0, change
        for _ in range(MOST_HALVINGS):
            state = self._under_forces(unknowns + length * step, value, forces + length * force_step, False, history)
            if state.min_jacobian > 0:
                break
            length *= 0.5
        return length, state

    def _contact(self, factor: Factorisation, state: Configuration) -> _LinearContact:
        """Contact problem of the pad linearised at a state, with the factored tangent matrix of that state."""
        return _LinearContact(self, factor, _contact_state_of(state), factor.negative_pivots - self.numbering.pressures)

    def _with_fixed_directions(self, unknowns: np.ndarray, value: np.ndarray, history: History) -> Factorisation:
        """Factored tangent of the pad at a state, for contact pressures of fixed directions.

        Pressures that follow the normals of the indenter push the pad off a sharply rounded body, so that the
        linearised pad may be unstable although the pad is stable. With fixed directions, the linearised pad is stable
        wherever the pad without an indenter is stable, but steps are shorter.
        """
        inside = self.model.assembly.evaluate(*self.numbering.split(unknowns), True, history.stress_update)
        assert inside.entries is not None  # no element is inverted
        return self._linearised(inside.entries, unknowns, value).factor

    def _under_forces(
        self, unknowns: np.ndarray, value: np.ndarray, forces: np.ndarray, with_tangent: bool, history: History
    ) -> Configuration:
        """Residual and tangent of the pad under ``forces`` (m, 3) in MPa at the m contact nodes: pressures, and
        tractions along two tangents."""
        displacement, pressure = self.numbering.split(unknowns)
        traction = None
        if self.friction is not None:
            tangents = self.friction.tangents(self.model.indentation.contact_state(displacement, value))
            traction = np.einsum("mki,mk->mi", tangents, forces[:, 1:])
        return self.model.evaluate(
            displacement, pressure, value, with_tangent, history.stress_update, (forces[:, 0], traction)
        )

    def _slip(self, state: Configuration, unknowns: np.ndarray, value: np.ndarray, history: History) -> np.ndarray:
        """Slip (m, 2) in mm³ of m contact nodes along two tangents since the previous step, integrated over the area of
        each node; (m, 0) without friction."""
        if self.friction is None:
            return np.zeros((len(self.model.indentation.node), 0))
        slip_position = self.friction.slip_position(self.numbering.split(unknowns)[0], value)
        before = history.friction_state or self.friction.at_rest()
        return self.friction.slip(self.friction.tangents(_contact_state_of(state)), slip_position, before)

    def _with_gap_pressures(
        self, state: Configuration, unknowns: np.ndarray, value: np.ndarray, history: History
    ) -> Configuration:
        """Residual of the pad with contact forces that follow from its displacement: pressures from the gaps, tractions
        from the slip."""
        contact_state, body = _contact_state_of(state), self.model.indentation
        own = contact_state._replace(pressure=np.maximum(-contact_state.gap, 0.0) / body.slack)
        if self.friction is not None:
            traction = self._own_traction(self.numbering.split(unknowns)[0], value, own, history)
            own = own._replace(friction_forces=body.carried.T @ traction)
        load = self.numbering.summed(own.nodal_forces)
        return replace(state, residual=state.residual + state.load - load, load=load, entries=None, contact_state=own)

    def _gap_error(self, state: Configuration) -> float:
        """Error of the gaps, relative to the pad's height: the largest gap at a node in contact, or penetration at any
        other node."""
        contact_state, body = _contact_state_of(state), self.model.indentation
        gap = np.where(
            contact_state.pressure > 0,
            contact_state.gap + body.slack * contact_state.pressure,
            np.minimum(contact_state.gap, 0),
        )
        return float(np.abs(gap / body.area)[self.model.may_press].max(initial=0.0)) / self.height

    def _initial_pressures(self, unknowns: np.ndarray, value: np.ndarray, history: History) -> np.ndarray:
        """Pressures (m, 3) in MPa that best balance the pad at a displacement out of equilibrium, without tractions."""
        body = self.model.indentation
        forces = np.zeros((len(body.node), 3))
        state = self._under_forces(unknowns, value, forces, False, history)
        contact_state = _contact_state_of(state)
        likely = np.flatnonzero((contact_state.gap < LIKELY * self.step * body.area) & self.model.may_press)
        if state.min_jacobian > 0 and state.residual.any():
            rows = self.model.over_unknowns(contact_state.rate[likely])
            products = (rows @ rows.T).toarray()
            forces[likely, 0] = np.linalg.lstsq(products, rows @ state.residual, rcond=None)[0]
        return np.maximum(forces, 0.0)

    @cached_property
    def _small_load(self) -> float:
        """Lower bound of the load by which residuals are divided, in N: the stress at the natural strain of about 2 %,
        times the smallest surface area of a node.
        """
        return NATURAL_STRAIN * self.material.youngs_modulus * float(self.model.indentation.area.min())


class _LinearContact:
    """Contact of an indenter with a pad that is linearised at a state; only contact nodes are unknowns.

    Parameters
    ----------
    pad : IndentedPad
        The pad.
    factor : Factorisation
        Factor of the tangent at constant pressures.
    contact_state : ContactState
        Gaps at the state.
    surplus : int
        Number of negative eigenvalues of the tangent. A stable pad has none once contact is included.
    """

    def __init__(self, pad: IndentedPad, factor: Factorisation, contact_state: ContactState, surplus: int = 0) -> None:
        self._factor, self._may_press, self._friction = factor, pad.model.may_press, pad.friction
        self._surplus = surplus
        rows = [contact_state.rate]
        if pad.friction is not None:
            rows.append(pad.friction.rows(pad.friction.tangents(contact_state)))
        self._rows = pad.model.over_unknowns(sparse.csr_array(sparse.vstack(rows)))
        self._count = len(self._may_press)
        self._directions = self._rows.shape[0] // self._count  # 1, or 3 with friction
        self._slack = np.tile(pad.model.indentation.slack, self._directions)
        self._solved_nodes = np.zeros(0, dtype=np.int64)
        self._responses = np.zeros((len(self._slack), 0))

    def step(self, state: Configuration, forces: np.ndarray, slip: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """A step of Newton's method: the change of the unknowns of the linearised pad, with the contact pressures that
        the indenter then exerts.

        The unknowns of the pad are eliminated (Schur complement): gaps are then linear in the pressures. Their small
        matrix is the flexibility of the pad at the nodes that may come into contact.

        Parameters
        ----------
        state : Configuration
            Residual and gaps of the pad.
        forces : (m, 3) ndarray
            Pressures, and tractions along two tangents, MPa.
        slip : (m, 2) ndarray
            Slip along these tangents, mm³.

        Returns
        -------
        tuple[ndarray, ndarray] or None
            Changes of the unknowns, and of the forces; None if no equilibrium is found.
        """
        # Gaps and slip of the pad without a change of the forces.
        before = forces[:, : self._directions].T.ravel()
        free = -self._factor.solve_roughly(state.residual)
        offset = np.concatenate([_contact_state_of(state).gap, slip.T.ravel()]) + self._rows @ free
        count, force_change = self._count, np.zeros(len(before))

        # Solve for the candidates, add the nodes that then are inside the body, and so on.
        candidates = self._may_press & ((before[:count] > 0) | (offset[:count] < 0))
        while candidates.any():
            # Responses of all nodes to pressures and tractions at new candidates, by back-solves.
            new = np.setdiff1d(np.flatnonzero(candidates), self._solved_nodes)
            new_rows = (new + count * np.arange(self._directions)[:, None]).ravel()
            shape = len(self._slack), self._directions, -1
            new_responses = responses(self._factor, self._rows, self._rows[new_rows]).reshape(shape)
            self._responses = np.concatenate([self._responses.reshape(shape), new_responses], axis=2)
            self._responses = self._responses.reshape(len(self._slack), -1)
            self._solved_nodes = np.concatenate([self._solved_nodes, new])

            # Pressures, followed by tractions, at all candidates.
            rows = (self._solved_nodes + count * np.arange(self._directions)[:, None]).ravel()
            matrix = self._responses[rows] + np.diag(self._slack[rows])
            candidate_offset = offset[rows] - self._responses[rows] @ before[rows]
            if self._friction is None:
                solution = pressures(matrix, candidate_offset, before[rows] > 0)
            else:
                solution = tractions(matrix, candidate_offset, self._friction.coefficient, before[rows])
            if solution is None:
                return None
            force_change[rows] = solution - before[rows]
            candidates = self._may_press & (offset[:count] + self._responses[:count] @ force_change[rows] < 0)
            candidates[self._solved_nodes] = False

        # Where the tangent alone is unstable, the nodes in contact must hold the pad (E. V. Haynsworth, Linear Algebra
        # Appl. 1, 1968).
        if self._surplus:
            active = before[:count] + force_change[:count] > 0
            columns = np.flatnonzero(active[self._solved_nodes])
            nodes = self._solved_nodes[columns]
            flexibility = self._responses[np.ix_(nodes, columns)] + np.diag(self._slack[nodes])
            if int(np.count_nonzero(np.linalg.eigvalsh(flexibility) < 0)) != self._surplus:
                return None
        force_changes = np.zeros_like(forces)
        force_changes[:, : self._directions] = force_change.reshape(self._directions, count).T
        return free + self._factor.solve_roughly(self._rows.T @ force_change), force_changes


def _contact_state_of(state: Configuration) -> ContactState:
    assert state.contact_state is not None  # the load is an indenter
    return state.contact_state
