"""States under a small tangential force, solved with the tangent of the state under the normal force alone.

That tangent matrix splits into blocks by symmetry, which are much smaller than the matrix under both forces. A few
iterations with it reach equilibrium. Intermediate states along a load path are not needed.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from functools import cached_property

import numpy as np

from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.mechanics.continuation.load_segment import INTERPOLATION_TOLERANCE, LoadSegment
from mitsuba_taxel.mechanics.continuation.path_nodes import Interpolated
from mitsuba_taxel.mechanics.elements.model import Model
from mitsuba_taxel.mechanics.elements.solvers import Factorisation
from mitsuba_taxel.mechanics.equilibrium.linearised import Linearised
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import LoadedPad
from mitsuba_taxel.mechanics.equilibrium.solution import Rejected, Solution
from mitsuba_taxel.mechanics.equilibrium.tangent_blocks import SplitTangent, TangentBlock, tangent_blocks

SMALL = 1e-3
"""Change of a load, relative to a step of the path, for the finite difference that gives the rate of a state."""


class PushedStates:
    """States under a normal force and a small tangential force, solved from the state under the normal force.

    Parameters
    ----------
    pad : LoadedPad
        The symmetric part of the pad that is solved under the normal force.
    near : ndarray
        Unknowns close to those of the state under the normal force, from which it is solved.
    value : (3,) ndarray
        Value of the normal force.
    """

    def __init__(self, pad: LoadedPad, near: np.ndarray, value: np.ndarray) -> None:
        self._pad, self._near, self._value = pad, near, value
        self._factors: dict[Model, Factorisation] = {}
        self._tangents: dict[tuple[Mirror, ...], SplitTangent] = {}

    @cached_property
    def _at_normal(self) -> tuple[Solution, Linearised]:
        return self._pad.solve_linearised(self._near, self._value)

    @cached_property
    def _state(self) -> tuple[np.ndarray, np.ndarray]:
        """Displacement and pressure of the whole pad under the normal force."""
        return self._pad.split(self._at_normal[0].unknowns)

    def state(self, pad: LoadedPad, segment: LoadSegment, s: float) -> Interpolated:
        """State at a distance ``s`` along the segment on which the tangential force grows. ``pad`` is the part of the
        pad that has the symmetry of both forces.

        Raises
        ------
        Rejected
            if the tangent of the normal force does not lead there, or not to an acceptable state.
        """
        began = time.perf_counter()
        tangent, value = self._tangent(pad), segment.value(s)
        unknowns, iterations = accelerated(
            pad.gather(*self._state) + s * self._first_rate(pad, segment),
            lambda unknowns: pad.correction(tangent, unknowns, value),
            pad.numbering.displacements,
            INTERPOLATION_TOLERANCE,
        )
        solution = pad.figures_at(unknowns, value, iterations, self._at_normal[0].stability_checked)
        return Interpolated.of(solution, time.perf_counter() - began)

    def rate(self, pad: LoadedPad, segment: LoadSegment, s: float, unknowns: np.ndarray) -> np.ndarray:
        """Derivative of the unknowns of a state under tangential force with respect to the distance along its segment.

        Parameters
        ----------
        pad : LoadedPad
            Symmetric part of the pad on which the segment is solved.
        segment : LoadSegment
            The segment.
        s : float
            Load as distance along the segment, in N, mm or MPa.
        unknowns : (unknowns,) ndarray
            Unknowns of the pad.

        Returns
        -------
        (unknowns,) ndarray
            Derivative per N.

        Raises
        ------
        Rejected
            as :meth:`state` does.
        """
        tangent, little = self._tangent(pad), SMALL * segment.step

        def correction(rate: np.ndarray) -> np.ndarray | None:
            """Newton correction to an estimate of the derivative ``rate`` of the unknowns: it reduces the rate of
            change of the out-of-balance forces along the segment.
            """
            ahead, behind = (
                pad.correction(tangent, unknowns + change * rate, segment.value(s + change))
                for change in (little, -little)
            )
            return None if ahead is None or behind is None else (ahead - behind) / (2 * little)

        start, displacements = self._first_rate(pad, segment), pad.numbering.displacements
        return accelerated(start, correction, displacements, INTERPOLATION_TOLERANCE)[0]

    def _first_rate(self, pad: LoadedPad, segment: LoadSegment) -> np.ndarray:
        """Derivative of the unknowns with respect to the distance along the segment, at its start, where there is no
        tangential force."""
        return self._tangent(pad).step(pad.model.load_rate(self._state[0][pad.part.nodes], segment.direction, None))

    def _tangent(self, pad: LoadedPad) -> SplitTangent:
        if pad.mirrors not in self._tangents:
            self._tangents[pad.mirrors] = SplitTangent(pad, self._blocks, self._factor, self._pad.images)
        return self._tangents[pad.mirrors]

    @cached_property
    def _blocks(self) -> list[TangentBlock]:
        return tangent_blocks(self._pad)

    def _factor(self, block: TangentBlock) -> Factorisation:
        """Factored tangent matrix under the normal force, for one symmetry block; raises `Rejected` if the pad is
        unstable against displacements of this symmetry.
        """
        at_normal = self._at_normal[1]
        if block.model is self._pad.model:
            return at_normal.factor
        if block.model not in self._factors:
            on_part = block.model.part.restrict(*self._state)
            entries: np.ndarray | None = at_normal.entries
            if block.model.part is not self._pad.part:
                entries = block.model.evaluate(*on_part, self._value).entries
            assert entries is not None  # in balance, no element is inverted
            self._factors[block.model] = block.factored(entries, on_part[0], self._value).factor
        return self._factors[block.model]


MOST_ITERATIONS = 10
REMEMBERED = 5
"""Number of earlier corrections that are combined."""


def accelerated(
    start: np.ndarray, correct: Callable[[np.ndarray], np.ndarray | None], displacements: int, tolerance: float
) -> tuple[np.ndarray, int]:
    """Solve for the unknowns at which a correction vanishes, by Anderson's method (D. G. Anderson, J. ACM 12, 1965).

    Parameters
    ----------
    start : (n,) ndarray
        Unknowns from which the iteration starts.
    correct : Callable[[ndarray], ndarray | None]
        Correction that a step of the iteration subtracts from unknowns; None if it fails.
    displacements : int
        Number of displacements among the unknowns; they come first.
    tolerance : float
        Root mean square of the displacements of the last correction, relative to the largest displacement.

    Returns
    -------
    unknowns : (n,) ndarray
        Unknowns at which the correction vanishes.
    count : int
        Number of corrections.

    Raises
    ------
    Rejected
        if corrections do not become small.
    """
    unknowns, last = start, math.inf
    iterates: list[np.ndarray] = []
    corrections: list[np.ndarray] = []
    for iteration in range(1, MOST_ITERATIONS + 1):
        correction = correct(unknowns)
        size = math.inf if correction is None else math.sqrt(np.square(correction[:displacements]).mean())
        if correction is None or not size < last:
            raise Rejected("no convergence with the tangent of another state")
        iterates = [*iterates[-REMEMBERED:], unknowns]
        corrections, last = [*corrections[-REMEMBERED:], correction], size

        # The combination of the last iterates whose correction is least. Sums replace matrix products, whose rounding
        # depends on the number of threads.
        unknowns = unknowns - correction
        if len(iterates) > 1:
            steps, differences = np.diff(iterates, axis=0), np.diff(corrections, axis=0)
            displaced = differences[:, :displacements]
            products = np.einsum("in,jn->ij", displaced, displaced)
            right_side = np.einsum("in,n->i", displaced, correction[:displacements])
            weights = np.linalg.lstsq(products, right_side, rcond=None)[0]
            unknowns = unknowns - np.einsum("i,in->n", weights, steps - differences)
        if size <= tolerance * np.abs(unknowns[:displacements]).max():
            return unknowns, iteration
    raise Rejected(f"no convergence with the tangent of another state in {MOST_ITERATIONS} iterations")
