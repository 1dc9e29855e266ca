"""Equilibrium of a pad that a rigid body presses on: Newton's method with the pressures of the contact beside it.

In each step the pad is linear, and which nodes press is found exactly: from how these few answer each other's
pressures, by back-solves with the factor of the pad alone.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property

import numpy as np

from mitsuba_taxel.mechanics.contact.complementarity import pressures
from mitsuba_taxel.mechanics.contact.indentation import Pressing
from mitsuba_taxel.mechanics.elements.held import answers
from mitsuba_taxel.mechanics.elements.model import Configuration
from mitsuba_taxel.mechanics.elements.solvers import Factorisation
from mitsuba_taxel.mechanics.path.equilibrium import (
    MOST_ITERATIONS,
    NATURAL_STRAIN,
    NEAR,
    RESIDUAL_TOLERANCE,
    SLOW,
    Balance,
    Linearised,
    LoadedPad,
    Rejected,
    Solution,
)

MOST_HALVINGS = 5
"""Of a step of Newton's method that would turn an element inside out."""
LIKELY = 0.25
"""Gap, relative to a step of the path, up to which a node may press at the start of a solve."""


class IndentedPad(LoadedPad):
    """A meshed pad glued to the board, under a rigid body that is moved."""

    solves_between = True

    def solve_linearised(self, start: np.ndarray, value: np.ndarray) -> tuple[Solution, Linearised]:
        found = self._balanced(start, value)
        largest = np.abs(found.unknowns[: self.numbering.displacements]).max()
        near = found.linearised if found.distance <= NEAR * largest else None
        linearised = self._linearised(self._entries(found, value), found.unknowns, value, near)
        return self._accepted(found, self._is_stable(linearised)), linearised

    def _balanced(self, start: np.ndarray, value: np.ndarray, linearised: Linearised | None = None) -> Balance:
        """Newton's method, whose iterations share a factored tangent as long as they get on with it."""
        unknowns, first, last, distance = start, 0.0, math.inf, 0.0
        pushed_by = self._likely_pressures(unknowns, value)
        state = self._pushed(unknowns, value, pushed_by)
        contact = _LinearContact(self, linearised.factor, _pressing_of(state)) if linearised else None
        for iteration in range(MOST_ITERATIONS):
            error = max(self._checked_error(state, unknowns, value, first), self._out_of_touch(state))
            settled = self._settled(state)
            error_left = self._error(settled, unknowns, value)
            if error_left < RESIDUAL_TOLERANCE:
                return Balance(unknowns, settled, error_left, iteration, linearised, distance)
            if contact is None or error > SLOW * last:
                linearised = contact = None  # frees its memory for the next one
                if state.entries is None:
                    state = self._pushed(unknowns, value, pushed_by)
                assert state.entries is not None  # no element is turned inside out
                linearised, distance = self._linearised(state.entries, unknowns, value), 0.0
                contact = _LinearContact(self, linearised.factor, _pressing_of(state))
            first, last = first or error, error
            step, further = contact.step(state)
            for _ in range(MOST_HALVINGS):
                state = self._pushed(unknowns + step, value, pushed_by + further, with_tangent=False)
                if state.min_jacobian > 0:
                    break
                step, further = 0.5 * step, 0.5 * further
            unknowns, pushed_by = unknowns + step, pushed_by + further
            distance += float(np.abs(step[: self.numbering.displacements]).max())
        raise Rejected(f"Newton's method does not converge in {MOST_ITERATIONS} iterations")

    def _pushed(
        self, unknowns: np.ndarray, value: np.ndarray, pushed_by: np.ndarray, with_tangent: bool = True
    ) -> Configuration:
        return self.model.evaluate(*self.numbering.split(unknowns), value, with_tangent, self.past, pushed_by)

    def _settled(self, state: Configuration) -> Configuration:
        """The same displacement with the pressures that its gaps make."""
        pressing, slack = _pressing_of(state), self.model.indentation.slack
        own = pressing._replace(pressure=np.maximum(-pressing.gap, 0.0) / slack)
        load = self.numbering.summed(own.pushed)
        return replace(state, residual=state.residual + state.load - load, load=load, entries=None, pressing=own)

    def _out_of_touch(self, state: Configuration) -> float:
        """Largest gap at a node that presses, or depth at one that does not, relative to the pad's height."""
        pressing, body = _pressing_of(state), self.model.indentation
        gap = np.where(
            pressing.pressure > 0, pressing.gap + body.slack * pressing.pressure, np.minimum(pressing.gap, 0)
        )
        return float(np.abs(gap / body.area)[self.model.may_press].max(initial=0.0)) / self.height

    def _likely_pressures(self, unknowns: np.ndarray, value: np.ndarray) -> np.ndarray:
        """(m,) those that hold the pad best in a displacement that is not one of balance."""
        body = self.model.indentation
        found = np.zeros(len(body.node))
        state = self._pushed(unknowns, value, found, with_tangent=False)
        pressing = _pressing_of(state)
        likely = np.flatnonzero((pressing.gap < LIKELY * self.step * body.area) & self.model.may_press)
        if state.min_jacobian > 0 and state.residual.any():
            rows = self.model.over_unknowns(pressing.rate[likely])
            products = (rows @ rows.T).toarray()
            found[likely] = np.linalg.lstsq(products, rows @ state.residual, rcond=None)[0]
        return np.maximum(found, 0.0)

    @cached_property
    def _small_load(self) -> float:
        """What smaller forces are measured by: those of a natural strain on the least area of a node."""
        return NATURAL_STRAIN * self.material.youngs_modulus * float(self.model.indentation.area.min())


class _LinearContact:
    """A pad at a state, linear, and the nodes that a body may press on.

    Parameters
    ----------
    factor : Factorisation
        Of the tangent with pressures that stay.
    pressing : Pressing
        How the body stands to the nodes.
    """

    def __init__(self, pad: IndentedPad, factor: Factorisation, pressing: Pressing) -> None:
        self._factor, self._slack, self._may = factor, pad.model.indentation.slack, pad.model.may_press
        self._rows = pad.model.over_unknowns(pressing.rate)
        self._known = np.zeros(0, dtype=np.int64)
        self._answers = np.zeros((len(self._slack), 0))

    def step(self, state: Configuration) -> tuple[np.ndarray, np.ndarray]:
        """Changes of the unknowns and of the pressures (m,) to where linear pad and body are in balance."""
        pressing = _pressing_of(state)
        free = -self._factor.solve_roughly(state.residual)
        gap = pressing.gap + self._rows @ free
        asked = self._may & ((pressing.pressure > 0) | (gap < 0))
        further = np.zeros(len(gap))
        while asked.any():
            self._learn(np.flatnonzero(asked))
            known = self._known
            matrix = self._answers[known] + np.diag(self._slack[known])
            before = pressing.pressure[known]
            found = pressures(matrix, gap[known] - self._answers[known] @ before, before > 0)
            if found is None:
                raise Rejected("the contact with the indenter does not settle")
            further[known] = found - before
            asked = self._may & (gap + self._answers @ further[known] < 0)
            asked[known] = False
        return free + self._factor.solve_roughly(self._rows.T @ further), further

    def _learn(self, nodes: np.ndarray) -> None:
        """Find how all answer pressures at these."""
        new = np.setdiff1d(nodes, self._known)
        self._known = np.concatenate([self._known, new])
        self._answers = np.hstack([self._answers, answers(self._factor, self._rows, self._rows[new])])


def _pressing_of(state: Configuration) -> Pressing:
    assert state.pressing is not None  # a body is the load
    return state.pressing
