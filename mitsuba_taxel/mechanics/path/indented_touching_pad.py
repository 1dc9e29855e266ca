"""Equilibrium of a pad under an indenter that may touch itself, the board and packages."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from mitsuba_taxel.mechanics.elements.model import Configuration
from mitsuba_taxel.mechanics.elements.solvers import Factorisation
from mitsuba_taxel.mechanics.path.indented_pad import IndentedPad
from mitsuba_taxel.mechanics.path.self_touching_pad import MOST_HALVINGS, MOST_ITERATIONS, SelfTouchingPad
from mitsuba_taxel.mechanics.path.solution import Rejected


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
