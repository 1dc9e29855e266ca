"""The stable states of a buckled pad: the states on the branch that begins at the end of a segment.

At the start of a branch the derivative of the displacement with respect to the load is unbounded, and both are smooth
functions of the amplitude of the mode in which the pad buckles. So the branch is a segment of states of prescribed
amplitude, with the load as an additional unknown (E. Riks, Int. J. Solids Struct. 15, 1979). The load must rise with
the amplitude, and the states must be stable under it: where the load falls, a pad jumps. If the load falls only at
first, and by no more than the effect of the elements, the branch is followed further.

If a pad with ``self_contact`` presses on an obstacle, it bends little more. From there on the load is prescribed again,
and the branch is stable under it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import ClassVar, NamedTuple

import numpy as np

from mitsuba_taxel.mechanics.contact.barriers.self_contact import ContactTest
from mitsuba_taxel.mechanics.continuation.load_segment import LoadSegment
from mitsuba_taxel.mechanics.continuation.path_nodes import Interpolated, hermite
from mitsuba_taxel.mechanics.elements.constraints import Numbering
from mitsuba_taxel.mechanics.elements.loads import Load
from mitsuba_taxel.mechanics.equilibrium.linearised import Linearised
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import MOST_ITERATIONS, RESIDUAL_TOLERANCE, LoadedPad
from mitsuba_taxel.mechanics.equilibrium.natural_step import NATURAL_STRAIN, TICKS
from mitsuba_taxel.mechanics.equilibrium.solution import UNSTABLE, Rejected, Solution

PRECISE = 1e-14
"""Absolute tolerance in mm, and relative tolerance, of the amplitude that belongs to a load."""

LEAP = 1.0
"""Amplitude, relative to a whole step, up to which the load may fall at the start of a branch; the pad then jumps by
this amplitude."""
FALLS = f"{UNSTABLE}: the load falls as the pad buckles"


class _Bordered(NamedTuple):
    """Tangent matrix of the pad (equilibrium linearised at a state), with the derivative of its unknowns with respect
    to the load."""

    tangent: Linearised
    rate: np.ndarray

    @property
    def entries(self) -> np.ndarray:
        return self.tangent.entries


class BuckledPad:
    """The equations of a buckled pad whose deflection in the buckling mode (amplitude, in mm) is prescribed; the load
    is the last unknown.

    A `LoadSegment` follows it like any other pad, with the amplitude as the value of the load.

    Parameters
    ----------
    pad : LoadedPad
        The part of the pad between the mirrors under which the mode is symmetric.
    segment : LoadSegment
        The segment at whose end it buckles.
    onset, mode : ndarray
        The unknowns of the pad at the onset, and the unknowns of the mode.
    """

    solves_between: ClassVar[bool] = False

    def __init__(self, pad: LoadedPad, segment: LoadSegment, onset: np.ndarray, mode: np.ndarray) -> None:
        self.pad, self._segment = pad, segment
        self.onset = np.append(onset, segment.limit)
        moves = np.arange(pad.unknowns) < pad.numbering.displacements
        self._measure = moves * mode / np.square(mode[moves]).sum()

    @property
    def numbering(self) -> Numbering:
        return self.pad.numbering

    @property
    def load(self) -> Load:
        return self.pad.load

    def split(self, unknowns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self.pad.split(unknowns[:-1])

    def ticks(self, response: np.ndarray) -> int:
        return TICKS

    def solve_symmetric(self, start: np.ndarray, amplitude: np.ndarray) -> tuple[Solution, _Bordered]:
        solution, bordered = self.solve_linearised(start, amplitude)
        if not (self._measure @ bordered.rate > 0 and solution.unknowns[-1] > self.onset[-1]):
            raise Rejected(FALLS)
        self.pad.is_stable(bordered.tangent, solution.unknowns[:-1], self._segment.value(solution.unknowns[-1]))
        return solution, bordered

    def solve_linearised(self, start: np.ndarray, amplitude: np.ndarray) -> tuple[Solution, _Bordered]:
        """Equilibrium of the pad at a prescribed amplitude of the buckling mode, with its tangent matrix. Stability is
        not tested.
        """
        unknowns = start
        for iteration in range(MOST_ITERATIONS):
            value = self._segment.value(unknowns[-1])
            solution = self.pad.figures_at(unknowns[:-1], value, iteration, True)
            tangent = self.pad.tangent_at(unknowns[:-1], value, None)
            bordered = _Bordered(tangent, self.pad.rate(tangent, unknowns[:-1], self._segment.direction, value))
            correction = self.correction(bordered, unknowns, amplitude)
            if correction is None:
                break
            ahead = unknowns - correction
            if self.towards(unknowns, ahead) is not ahead:
                raise Rejected("it presses on an object that it touches")
            unknowns = ahead
            # At the start of a branch, the load needs one more iteration.
            if iteration and solution.residual < RESIDUAL_TOLERANCE:
                return replace(solution, unknowns=unknowns), bordered
        raise Rejected(f"Newton's method does not converge in {MOST_ITERATIONS} iterations")

    def refuse_unstable(self, unknowns: np.ndarray, entries: np.ndarray, amplitude: np.ndarray) -> None:
        self.pad.refuse_unstable(unknowns[:-1], entries, self._segment.value(unknowns[-1]))

    def rate(
        self, bordered: _Bordered, unknowns: np.ndarray, direction: np.ndarray, amplitude: np.ndarray
    ) -> np.ndarray:
        return np.append(bordered.rate, 1.0) / (self._measure @ bordered.rate)

    def correction(self, bordered: _Bordered, unknowns: np.ndarray, amplitude: np.ndarray) -> np.ndarray | None:
        correction = self.pad.correction(bordered.tangent, unknowns[:-1], self._segment.value(unknowns[-1]))
        if correction is None:
            return None
        excess = self._measure @ (unknowns - self.onset)[:-1] - amplitude[0]
        load = (excess - self._measure @ correction) / (self._measure @ bordered.rate)
        return np.append(correction + load * bordered.rate, load)

    def towards(self, known: np.ndarray, guess: np.ndarray) -> np.ndarray:
        return self.pad.towards(known, guess)  # the load, the last unknown, by the same fraction


class BuckledBranch:
    """The states of a pad after it has buckled, as a function of the load: the distance along the straight segment of
    the load path.

    Parameters
    ----------
    pad : LoadedPad
        The part of the pad between the mirrors under which the mode is symmetric.
    segment : LoadSegment
        The segment at whose end the pad buckles.
    onset : tuple[ndarray, ndarray]
        Displacement (N, 3) and pressure (corners,) of the whole pad at the end of the segment.

    Attributes
    ----------
    curve : LoadSegment
        States as a function of the amplitude in mm.
    buckled : BuckledPad
        The pad of that segment.
    onwards : LoadSegment or None
        States as a function of the load beyond the end of ``curve``, if the pad bears more load after it touches
        something.
    """

    def __init__(self, pad: LoadedPad, segment: LoadSegment, onset: tuple[np.ndarray, np.ndarray]) -> None:
        displacement, pressure = np.split(segment.mode, [-pad.whole.corner_count])
        mode = pad.gather(displacement.reshape(-1, 3), pressure)
        self.pad, self._segment = pad, segment
        self.buckled = BuckledPad(pad, segment, pad.gather(*onset), mode)
        self.curve = LoadSegment(
            np.zeros(1), np.ones(1), NATURAL_STRAIN * pad.height, segment.judged, segment.tolerance
        )
        first = replace(
            segment.nodes[-1], s=0.0, unknowns=self.buckled.onset, tangent=np.append(mode, 0.0), seconds=0.0
        )
        self.curve.nodes.append(first)
        self._onwards: LoadSegment | None = None

    @property
    def onwards(self) -> LoadSegment | None:
        curve, segment = self.curve, self._segment
        ends = 0 < curve.limit < math.inf and UNSTABLE not in curve.reason and not np.isfinite(curve.place).all()
        if self._onwards is None and ends and self.pad.contacts is not None:
            start = segment.value(self.solved_to)
            self._onwards = LoadSegment(start, segment.direction, segment.step, segment.judged, segment.tolerance)
        return self._onwards

    @property
    def _last(self) -> LoadSegment:
        return self.onwards or self.curve

    @property
    def reason(self) -> str:
        """Reason why there are no states of the buckled pad beyond the end of the branch, as text."""
        return self._last.reason

    @property
    def place(self) -> np.ndarray:
        """Point (3,) in mm at which the buckled pad touches something where the branch ends; NaN without contact."""
        return self._last.place

    @property
    def limit(self) -> float:
        """Load beyond which the buckled pad has no state, as distance along the segment of the load path; infinite if
        unknown.
        """
        if self.onwards:
            return self.solved_to + self.onwards.limit
        return self.load_at(self.curve.limit) if math.isfinite(self.curve.limit) else math.inf

    def value(self, s: float) -> np.ndarray:
        """Value of the load at the distance ``s`` along the segment of the load path."""
        return self._segment.value(s)

    def reaches(self, s: float) -> bool:
        """Whether the state of the buckled pad at the distance ``s`` can be interpolated between solved states."""
        return min(self.solved_to, self.limit) >= s

    def extend(self, s: float, contact: ContactTest, touched: Callable[[], bool]) -> None:
        """Solve states of the buckled pad with growing amplitude of the buckling mode.

        Parameters
        ----------
        s : float
            Distance along the segment to be reached.
        contact : ContactTest
            Test for contacts of the deformed pad.
        touched : Callable[[], bool]
            Whether the pad has touched something, which ends the branch.
        """
        curve = self.curve
        if len(curve.nodes) == 1:
            # If the load falls from the start of the branch, no shorter step helps: the branch ends there.
            little, first = LEAP * curve.step, curve.nodes[0]
            try:
                self.buckled.solve_symmetric(first.unknowns + little * first.tangent, np.array([little]))
            except Rejected as rejection:
                if str(rejection) == FALLS:
                    curve.limit, curve.reason = 0.0, f"cannot be loaded further ({FALLS})"
        curve.extend(
            self.buckled, math.inf, lambda: curve.nodes[0].unknowns, contact,
            lambda: self.solved_to >= s or touched(),
        )  # fmt: skip

    def load_at(self, amplitude: float) -> float:
        """Load at which the buckling mode has a given amplitude in mm. The load is measured as distance along the
        segment of the load path."""
        return float(self.curve.unknowns_at(amplitude)[-1])

    def at(self, pad: LoadedPad, s: float) -> Interpolated:
        """The state of the buckled pad at a distance along the segment of the load path; the branch must have been
        extended this far.

        Parameters
        ----------
        pad : LoadedPad
            The part of the pad between the mirrors of the mode.
        s : float
            Load as distance along the segment, in N, mm or MPa.

        Returns
        -------
        Interpolated
            The state, with its residual, smallest volume ratio and solution time.

        Raises
        ------
        Rejected
            if an element is inverted.
        """
        curve, amplitude = self.curve, self._amplitude(s)
        checked = all(node.stability_checked for node in curve.interval(amplitude))
        state = pad.figures_at(curve.unknowns_at(amplitude)[:-1], self.value(s), 0, checked)
        return Interpolated.of(state, curve.seconds_to(amplitude))

    def seconds_before(self, s: float) -> float:
        """CPU time in s that earlier parts of the branch took to solve, up to the part that contains the distance
        ``s``."""
        nodes = self._segment.nodes + (self.curve.nodes if self.onwards and s > self.solved_to else [])
        return sum(node.seconds for node in nodes)

    def rate(self, s: float) -> np.ndarray:
        """Derivative of the buckled pad's unknowns with respect to the distance along the segment; unbounded at the
        start of the branch.
        """
        rate = self.curve.rate(self._amplitude(s))
        return rate[:-1] / rate[-1]

    @property
    def solved_to(self) -> float:
        """Load of the last state that was solved at a prescribed amplitude, as distance along the segment of the load
        path.
        """
        return float(self.curve.nodes[-1].unknowns[-1])

    def _amplitude(self, s: float) -> float:
        """Amplitude of the buckling mode in mm at a load, which is given as distance along the segment. Amplitudes at
        which the load falls at the start of the branch are skipped."""
        from scipy.optimize import brentq  # here, as only pads that buckle need it

        nodes = self.curve.nodes
        start = max(index for index, node in enumerate(nodes[:-1]) if node.unknowns[-1] <= s)
        low, high = (
            replace(node, unknowns=node.unknowns[-1:], tangent=node.tangent[-1:]) for node in nodes[start : start + 2]
        )
        return float(brentq(lambda a: hermite(low, high, a)[0] - s, low.s, high.s, xtol=PRECISE, rtol=PRECISE))
