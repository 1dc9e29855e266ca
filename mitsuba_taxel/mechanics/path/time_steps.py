"""Time steps between two rows of a load, of lengths for which the stress changes linearly enough."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from mitsuba_taxel.mechanics.contact.friction import Rubbed
from mitsuba_taxel.mechanics.contact.self_contact import Contact
from mitsuba_taxel.mechanics.elements.past import Relaxing
from mitsuba_taxel.mechanics.materials.viscoelastic import Viscoelastic
from mitsuba_taxel.mechanics.path.equilibrium import NATURAL_STRAIN, LoadedPad, Rejected
from mitsuba_taxel.mechanics.path.indented_pad import IndentedPad
from mitsuba_taxel.mechanics.path.linearised import Linearised
from mitsuba_taxel.mechanics.path.reached import cubic

TIME_TOLERANCE = 1e-3
"""Allowed error of the stress per step, relative to the largest so far, root mean square over the pad."""
INTERPOLATION_TOLERANCE = 1e-4
"""Allowed correction by Newton's method in the middle of a step that leads beyond rows, root mean square over the pad,
relative to the largest displacement or pressure. States between its ends have it, so their error is less."""
TICKS = 64
"""Smallest fraction of a step without equilibrium; or of the time since the row before, or of the shortest relaxation
time before that: in such a part no term of the series changes much."""
MOST_GROWTH, LEAST_CUT, MOST_CUT, CAUTION = 4.0, 0.5, 0.02, 0.8
"""Limits of the factor between steps, according to the error of the one before."""
SHORTEST = 1e-15
"""Fraction of the way between two rows below which a step is not reduced."""

Touch = Callable[[LoadedPad, np.ndarray], Contact | None]


class Ended(Exception):
    """No further state: the ``reason``, and the ``value`` of the load and fraction ``share`` of the way reached."""

    def __init__(self, value: np.ndarray, share: float, reason: str) -> None:
        super().__init__(reason)
        self.value, self.share, self.reason = value, share, reason


class TooLong(Exception):
    """A step that leads beyond rows is not accurate; a ``share`` of it may be."""

    def __init__(self, share: float) -> None:
        super().__init__(share)
        self.share = share


@dataclass(frozen=True, eq=False)
class Moment:
    """A state between two rows, at a fraction ``share`` of the way.

    ``velocity`` is the rate of the unknowns per s, None if unknown or the load jumps; ``unjudged`` the largest
    displacement in mm since displacements without the load's symmetry were last checked, ``rubbed`` the history of
    friction, ``further`` the length in s of a next step that may lead beyond rows.
    """

    unknowns: np.ndarray
    relaxing: Relaxing
    velocity: np.ndarray | None
    unjudged: float
    share: float = 0.0
    min_jacobian: float = 1.0
    residual: float = 0.0
    iterations: int = 0
    stability_checked: bool = True
    rubbed: Rubbed | None = None
    further: float = 0.0


class Stretch:
    """The way from one row to the next.

    Parameters
    ----------
    load : tuple[ndarray, ndarray]
        Its value at the start, and its change.
    duration : float
        In s; 0 for a jump.
    scale : float
        MPa, largest stress so far, root mean square over the pad; the attribute includes that of this way.
    judges : bool
        Whether states must be stable against all displacements, not only those with the symmetry of the load.
    coarsening : int
        Length of steps under friction, 1 or 2 times that of the path.
    count : int, optional
        Number of steps under friction of the path; by default that of its length.
    """

    def __init__(
        self,
        pad: LoadedPad,
        material: Viscoelastic,
        start: Moment,
        load: tuple[np.ndarray, np.ndarray],
        duration: float,
        scale: float,
        judges: bool,
        coarsening: int = 1,
        count: int | None = None,
    ) -> None:
        self._pad, self._material, self._start, self._load = pad, material, start, load
        self._duration, self.scale, self._tolerance = duration, scale, coarsening**2 * TIME_TOLERANCE
        steps = float(np.linalg.norm(load[1])) / pad.step
        if isinstance(pad, IndentedPad) and pad.friction:
            steps = (2 * math.ceil(steps) if count is None else count) / coarsening
        self._longest = 1 / max(steps, 1.0)
        self._leaps = bool(material.prony) and not isinstance(pad, IndentedPad)
        self._furthest = (duration / steps if steps else math.inf) if self._leaps else 0.0
        self._quickest = min(material.times) / duration if material.prony and duration else math.inf
        self._near: Linearised | None = None
        self._judges = judges

    def run(self, touch: Touch) -> Moment:
        """The state at the end; ``touch`` finds contacts.

        After a change of the load's rate, the error of the first step is estimated together with the second, and both
        are repeated if it is too large.

        Raises
        ------
        Ended
            if there is no further state.
        """
        here, before = self._start, None
        length = 0.5 if self._duration and here.relaxing.slope is None else 1.0
        while here.share < 1:
            length = min(length, self._longest, 1 - here.share)
            share = 1.0 if here.share + 1.001 * length > 1 else here.share + length
            try:
                after = self._step(here, share)
            except Rejected as rejection:
                length /= 2
                if length < max(min(self._longest, max(here.share, self._quickest)) / TICKS, SHORTEST):
                    raise self._ended(here, f"cannot be loaded further ({rejection})") from rejection
                continue
            error, judged = self._judged(before, here, after)
            if error > self._tolerance and length > SHORTEST:
                here, before = (before or here), None
                length *= min(max(CAUTION * np.sqrt(self._tolerance / error), MOST_CUT), LEAST_CUT)
                continue
            self._refuse_contact(here, after, touch)
            first = here.relaxing.slope is None and self._duration
            before = here if first else None
            here = judged
            if not first:
                growth = CAUTION * np.sqrt(self._tolerance / error) if error else MOST_GROWTH
                length *= min(max(growth, LEAST_CUT), MOST_GROWTH)
        return replace(here, further=min(length * self._duration, self._furthest))

    def leap(self, touch: Touch) -> tuple[Moment, np.ndarray]:
        """The state at the end by one step, and what Newton's method would subtract from a cubic in the middle.

        Raises
        ------
        TooLong
            if states on the way are not to be interpolated.
        """
        here = self._start
        try:
            after = self._step(here, 1.0)
        except Rejected as rejection:
            raise TooLong(LEAST_CUT) from rejection
        midway, off = self._midway(here, after)
        error, judged = self._judged(None, here, after)
        if touch(self._pad, after.unknowns):
            raise TooLong(LEAST_CUT)
        ratio = max(math.sqrt(error / self._tolerance), (off / INTERPOLATION_TOLERANCE) ** 0.25)
        growth = CAUTION / max(ratio, CAUTION / MOST_GROWTH)
        if ratio > 1:
            raise TooLong(max(growth, MOST_CUT))
        return replace(judged, further=min(growth * self._duration, self._furthest)), midway

    def _midway(self, here: Moment, after: Moment) -> tuple[np.ndarray, float]:
        """What Newton's method would subtract from a cubic in the middle of a step, and its relative size."""
        pad, time = self._pad, 0.5 * self._duration
        assert here.velocity is not None and after.velocity is not None and self._near is not None
        change = after.unknowns - here.unknowns
        unknowns = here.unknowns + cubic(0.5, self._duration, change, here.velocity, after.velocity)
        pad.past = here.relaxing.past(self._material, time, pad.part)
        found = pad.correction(self._near, unknowns, self._load[0] + 0.5 * self._load[1])
        if found is None:
            raise TooLong(LEAST_CUT)
        parts = zip(*(np.split(field, [pad.numbering.displacements]) for field in (found, unknowns)), strict=True)
        return found, max(math.sqrt(np.square(off).mean()) / (np.abs(of).max() or 1.0) for off, of in parts)

    def deviation(self, end: Moment) -> np.ndarray:
        """(unknowns,) estimated error due to time steps."""
        error = end.relaxing.error.sum(axis=0)
        if self._near is None or not error.any():
            return np.zeros(self._pad.unknowns)
        return self._pad.answer(self._near, end.unknowns, error)

    def _step(self, here: Moment, share: float) -> Moment:
        """The state at a fraction of the way, by one step."""
        pad, time = self._pad, (share - here.share) * self._duration
        remembers = bool(self._material.prony)
        pad.past = here.relaxing.past(self._material, time, pad.part) if remembers else None
        if isinstance(pad, IndentedPad):
            pad.rubbed = here.rubbed
        guess = here.unknowns
        if here.velocity is not None:
            known = (MOST_GROWTH if self._leaps else 1.0) * here.relaxing.step
            guess = guess + min(time, known) * here.velocity
        value = self._load[0] + share * self._load[1]
        solution, near = pad.solve_next(guess, value, self._near, judged=False)
        moved = float(np.abs(solution.unknowns - here.unknowns)[: pad.numbering.displacements].max())
        unjudged = here.unjudged + moved
        if self._judges and unjudged > NATURAL_STRAIN * pad.height:
            del near
            self._near = None  # frees its memory for the next one
            solution, near = pad.solve_next(solution.unknowns, value, None, judged=True)
            unjudged = 0.0
        self._near = near
        relaxing, rubbed = here.relaxing, None
        if remembers:
            stress = pad.model.assembly.elements.isochoric_stress(pad.numbering.split(solution.unknowns)[0])
            relaxing = relaxing.after(self._material, time, stress)
        if isinstance(pad, IndentedPad):
            rubbed = pad.rubbed_at(solution.unknowns, value)
        velocity = (solution.unknowns - here.unknowns) / time if time else None
        if share == 1 and time and self._leaps:
            velocity = self._velocity(here, solution.unknowns, stress, time)
        figures = solution.min_jacobian, solution.residual, solution.iterations, solution.stability_checked
        return Moment(solution.unknowns, relaxing, velocity, unjudged, share, *figures, rubbed)

    def _velocity(self, here: Moment, unknowns: np.ndarray, stress: np.ndarray, time: float) -> np.ndarray:
        """Rate of the unknowns per s at the end of the step, where the law gives ``stress``."""
        assert self._near is not None
        rate = self._load[1] / self._duration
        by_load = self._pad.rate(self._near, unknowns, rate, self._load[0] + self._load[1])
        relaxed = here.relaxing.ageing(self._material, time, stress)
        return by_load + self._pad.answer(self._near, unknowns, relaxed)

    def _judged(self, before: Moment | None, here: Moment, after: Moment) -> tuple[float, Moment]:
        """Relative error of the last step, or of the first two, and the state with this error added to its
        variables."""
        if not self._material.prony:
            return 0.0, after
        self.scale = max(self.scale, self._pad.size_of(after.relaxing.stress))
        if after.relaxing.slope is None or here.relaxing.slope is None or not self.scale:
            return 0.0, after
        bend = after.relaxing.bend(here.relaxing)
        missed = after.relaxing.missed(self._material, bend)
        error = self._pad.size_of(missed.sum(axis=0))
        if before is not None:
            earlier = here.relaxing.missed(self._material, bend)
            error = max(error, self._pad.size_of(earlier.sum(axis=0)))
            missed = missed + self._material.over(after.relaxing.step).decay[:, None, None, None] * earlier
        return error / self.scale, replace(after, relaxing=after.relaxing.off_by(missed))

    def _refuse_contact(self, here: Moment, after: Moment, touch: Touch) -> None:
        contact = touch(self._pad, after.unknowns)
        if contact:
            place = ", ".join(f"{number:.4g}" for number in contact.place)
            raise self._ended(here, f"touches {contact.what} near ({place}) mm, which is outside the model")

    def _ended(self, here: Moment, reason: str) -> Ended:
        return Ended(self._load[0] + here.share * self._load[1], here.share, reason)
