"""Equilibrium of a pad that a rigid body presses on: forces have kinks where it touches, and steps are cut back."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np

from mitsuba_taxel.mechanics.elements.model import Configuration
from mitsuba_taxel.mechanics.path.equilibrium import (
    MOST_ITERATIONS,
    NATURAL_STRAIN,
    RESIDUAL_TOLERANCE,
    SLOW,
    Balance,
    Linearised,
    LoadedPad,
    Rejected,
)

MOST_TRIALS = 8
"""Of shares of a step of Newton's method."""
SLACK = 0.5
"""Work of the forces along a step where it may end, relative to that where it begins."""


class IndentedPad(LoadedPad):
    """A meshed pad glued to the board, under a rigid body that is moved."""

    solves_between = True

    def _balanced(self, start: np.ndarray, value: np.ndarray, linearised: Linearised | None = None) -> Balance:
        """Newton's method; a step that inverts an element, or adds much to the error, is halved."""
        unknowns, distance = start, 0.0
        state = self._evaluate(unknowns, value)
        error, last = self._checked_error(state, unknowns, value, 0.0), math.inf
        for iteration in range(MOST_ITERATIONS):
            if error < RESIDUAL_TOLERANCE:
                return Balance(unknowns, state, error, iteration, linearised, distance)
            if linearised is None or error > SLOW * last:
                linearised = None  # frees its memory for the next one
                entries = state.entries if iteration == 0 else self._evaluate(unknowns, value).entries
                assert entries is not None  # no element is turned inside out
                linearised, distance = self._linearised(entries), 0.0
            step, last = linearised.step(state.residual, np.zeros(0)), error
            share, state = self._along(unknowns, step, state, value)
            unknowns = unknowns - share * step
            error = self._error(state, unknowns, value)
            distance += share * float(np.abs(step[: self.numbering.displacements]).max())
        raise Rejected(f"Newton's method does not converge in {MOST_ITERATIONS} iterations")

    def _along(
        self, unknowns: np.ndarray, step: np.ndarray, state: Configuration, value: np.ndarray
    ) -> tuple[float, Configuration]:
        """The share of a step of Newton's method that is taken, and the pad there.

        Forces do little work along the rest of the step there: where faces begin or cease to touch, the energy along
        it is least (K.-J. Bathe, Finite Element Procedures, 1996, section 8.4.3).
        """
        moves = slice(self.numbering.displacements)
        at_start = float(step[moves] @ state.residual[moves])
        low, high, work_low, work_high = 0.0, 1.0, at_start, math.nan
        share = 1.0
        for trial in range(MOST_TRIALS):
            moved = self._evaluate(unknowns - share * step, value, with_tangent=False)
            work = float(step[moves] @ moved.residual[moves]) if moved.min_jacobian > 0 else math.nan
            forwards = work * at_start > 0
            enough = abs(work) <= SLACK * abs(at_start) or (forwards and math.isnan(work_high))
            if enough or (trial + 1 == MOST_TRIALS and not math.isnan(work)):
                return share, moved
            if forwards:
                low, work_low = share, work
            else:
                high, work_high = share, work
            part = 0.5 if math.isnan(work_high) else work_low / (work_low - work_high)
            share = low + min(max(part, 0.1), 0.9) * (high - low)
        raise Rejected("an element would be turned inside out")

    @cached_property
    def _small_load(self) -> float:
        """What smaller forces are measured by: those of a natural strain on the smallest face."""
        area = float(self.model.indentation.area.sum(axis=1).min())
        return NATURAL_STRAIN * self.material.youngs_modulus * area
