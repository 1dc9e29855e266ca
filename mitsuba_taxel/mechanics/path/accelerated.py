"""Iterations with a factored tangent of another state, accelerated by those before.

Between two near states the tangent differs most beside singular edges, in few displacements. Corrections by the tangent
of the other state reduce all errors but these quickly, and combinations of few corrections reduce these too
(D. G. Anderson, J. ACM 12, 547, 1965; for a linear problem they are those of GMRES: H. F. Walker and P. Ni, SIAM J.
Numer. Anal. 49, 1715, 2011).
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from mitsuba_taxel.mechanics.path.solution import Rejected

MOST_ITERATIONS = 10
REMEMBERED = 5
"""Number of earlier corrections that are combined."""


def accelerated(
    start: np.ndarray, correct: Callable[[np.ndarray], np.ndarray | None], displacements: int, tolerance: float
) -> tuple[np.ndarray, int]:
    """The unknowns at which a correction vanishes, and the number of corrections made.

    Parameters
    ----------
    start : (n,) ndarray
        Unknowns near by.
    correct : Callable[[ndarray], ndarray | None]
        What a step of the iteration subtracts from the unknowns; None if there is none.
    displacements : int
        Number of displacements among the unknowns; they come first.
    tolerance : float
        Root mean square of the displacements of the last correction made, relative to the largest displacement.

    Raises
    ------
    Rejected
        if corrections do not become small.
    """
    unknowns, last = start, math.inf
    places: list[np.ndarray] = []
    corrections: list[np.ndarray] = []
    for iteration in range(1, MOST_ITERATIONS + 1):
        correction = correct(unknowns)
        size = math.inf if correction is None else math.sqrt(np.square(correction[:displacements]).mean())
        if correction is None or not size < last:
            raise Rejected("the tangent of another state leads no closer")
        places, corrections, last = [*places[-REMEMBERED:], unknowns], [*corrections[-REMEMBERED:], correction], size
        unknowns = _combined(places, corrections, displacements)
        if size <= tolerance * np.abs(unknowns[:displacements]).max():
            return unknowns, iteration
    raise Rejected(f"the tangent of another state leads no closer in {MOST_ITERATIONS} iterations")


def _combined(places: list[np.ndarray], corrections: list[np.ndarray], displacements: int) -> np.ndarray:
    """The next unknowns, from the last ones and their corrections."""
    place, correction = places[-1], corrections[-1]
    if len(places) == 1:
        return place - correction
    moved, changed = np.diff(places, axis=0), np.diff(corrections, axis=0)
    seen, left = changed[:, :displacements], correction[:displacements]
    # Not as matrix products, whose rounding depends on the number of threads.
    products, wanted = np.einsum("in,jn->ij", seen, seen), np.einsum("in,n->i", seen, left)
    weights = np.linalg.lstsq(products, wanted, rcond=None)[0]
    return place - correction - np.einsum("i,in->n", weights, moved - changed)
