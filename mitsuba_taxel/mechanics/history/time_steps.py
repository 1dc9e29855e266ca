"""Time steps between two rows of a load, of lengths for which the stress changes evenly enough.

Within a step, the stress of the law is a parabola over the step's :class:`Growth`, that begins with its rate; in
contact, with an indenter or of the pad with itself, it is linear in time.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from mitsuba_taxel.mechanics.contact.friction import Rubbed
from mitsuba_taxel.mechanics.contact.self_contact import Contact
from mitsuba_taxel.mechanics.elements.loads import Load
from mitsuba_taxel.mechanics.elements.past import Relaxing
from mitsuba_taxel.mechanics.equilibrium.indented_pad import IndentedPad
from mitsuba_taxel.mechanics.equilibrium.linearised import Linearised
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import LoadedPad
from mitsuba_taxel.mechanics.equilibrium.natural_step import NATURAL_STRAIN
from mitsuba_taxel.mechanics.equilibrium.solution import Rejected
from mitsuba_taxel.mechanics.history.reached import LEFT, Way
from mitsuba_taxel.mechanics.materials.creep import CreepResponse, Growth, Measures
from mitsuba_taxel.mechanics.materials.viscoelastic import Viscoelastic

TIME_TOLERANCE = 1e-3
"""Allowed error of the stress per step, relative to the largest so far, root mean square over the pad."""
INTERPOLATION_TOLERANCE = 1e-4
"""Allowed error of states between the ends of a step that leads beyond rows, root mean square over the pad, relative to
the largest displacement or pressure: what Newton's method would add a quarter of the way from an end."""
TICKS = 64
"""Smallest fraction of a step without equilibrium; or of the time since the row before, or of the shortest relaxation
time before that: in such a part no term of the series changes much."""
MOST_GROWTH, LEAST_CUT, MOST_CUT, CAUTION = 4.0, 0.5, 0.02, 0.8
"""Limits of the factor between steps, according to the error of the one before."""
DOUBT = 0.3
"""Share of its error to which that of a step is known."""
HELD = 10.0
"""Longest step under a constant load, relative to the longest time of the response to it."""
SHORTEST = 1e-15
"""Fraction of the way between two rows below which a step is not reduced."""

Touch = Callable[[LoadedPad, np.ndarray], Contact | None]


class Ended(Exception):
    """No further state: the ``reason``, the ``value`` of the load and fraction ``share`` of the way reached, and a
    ``contact`` there."""

    def __init__(self, value: np.ndarray, share: float, reason: str, contact: Contact | None = None) -> None:
        super().__init__(reason)
        self.value, self.share, self.reason, self.contact = value, share, reason, contact


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
    friction, ``further`` the length in s of a next step that may lead beyond rows, ``recalled`` the memory of
    the load of :class:`CreepResponse`. ``deviation`` is the estimated error of the unknowns, ``doubt`` the sum of the
    largest displacements by each step's error, as far as it lasts; ``midway`` is that of the last step.
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
    recalled: np.ndarray | None = None
    deviation: np.ndarray | None = None
    doubt: float = 0.0
    midway: Midway | None = None


@dataclass(frozen=True, eq=False)
class Midway:
    """What is known between the ends of a step over a ``growth``, which ``begun`` with a velocity.

    ``found`` is what Newton's method would subtract from a cubic in the middle, ``left`` what it would then add a
    quarter of the way from an end, where that is more, ``off`` the relative size of that, and ``bend`` the third power
    of the stress, of :meth:`Relaxing.missed_on`.
    """

    growth: Growth
    begun: np.ndarray
    found: np.ndarray
    left: np.ndarray
    off: float
    bend: np.ndarray


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
        self._leaps, self._response = leaps(pad, material), response(pad.load, material)
        self._furthest = furthest(pad, self._response, load[1] / duration) if self._leaps and duration else 0.0
        self._quickest = min(material.times) / duration if material.prony and duration else math.inf
        self._near: Linearised | None = None
        self._judges = judges

    def run(self, touch: Touch) -> Moment:
        """The state at the end; ``touch`` finds contacts.

        Where stress is linear in time, after a change of the load's rate the error of the first step is estimated
        together with the second, and both are repeated if it is too large.

        Raises
        ------
        Ended
            if there is no further state.
        """
        here, before = self._start, None
        try:
            here = self._set_out(here)
        except Rejected as rejection:
            raise self._ended(here, f"cannot be loaded further ({rejection})") from rejection
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
                length *= min(max(self._growth(error, after), MOST_CUT), LEAST_CUT)
                continue
            self._refuse_contact(here, after, touch)
            first = here.relaxing.slope is None and self._duration
            before = here if first else None
            here = judged
            if not first:
                length *= min(max(self._growth(error, after), LEAST_CUT), MOST_GROWTH)
        return replace(here, further=min(length * self._duration, self._furthest))

    def leap(self, touch: Touch) -> Moment:
        """The state at the end by one step.

        Raises
        ------
        TooLong
            if states on the way are not to be interpolated.
        """
        try:
            here = self._set_out(self._start)
            after = self._step(here, 1.0)
        except Rejected as rejection:
            raise TooLong(LEAST_CUT) from rejection
        error, judged = self._judged(None, here, after)
        if touch(self._pad, after.unknowns):
            raise TooLong(LEAST_CUT)
        growth = min(self._growth(error, after), MOST_GROWTH)
        if growth < CAUTION:
            raise TooLong(max(growth, MOST_CUT))
        return replace(judged, further=min(growth * self._duration, self._furthest))

    def _growth(self, error: float, after: Moment) -> float:
        """Factor of the length of a step that had an ``error``, for the next one."""
        if after.midway is None:
            return CAUTION * math.sqrt(self._tolerance / error) if error else MOST_GROWTH
        ratio = max((error / self._tolerance) ** (1 / 3), (after.midway.off / INTERPOLATION_TOLERANCE) ** 0.25)
        return CAUTION / ratio if ratio else MOST_GROWTH

    def _set_out(self, here: Moment) -> Moment:
        """The state at the start with its rates, where these are needed and not known."""
        if not (self._leaps and self._duration and here.velocity is None):
            return here
        pad, relaxing, (value, change) = self._pad, here.relaxing, self._load
        pad.past = relaxing.past(self._material, 0.0, pad.part)
        self._near = pad.tangent_at(here.unknowns, value, None)
        fading = -relaxing.fading(self._material)
        velocity = pad.rate_in_time(self._near, here.unknowns, change / self._duration, value, fading)
        return self._with_rates(here, velocity)

    def _with_rates(self, at: Moment, velocity: np.ndarray) -> Moment:
        """A state that has a ``velocity``."""
        displaced, moving = (self._pad.numbering.split(field)[0] for field in (at.unknowns, velocity))
        slope = self._pad.model.assembly.elements.isochoric_rate(displaced, moving)
        return replace(at, velocity=velocity, relaxing=replace(at.relaxing, slope=slope))

    def _midway(self, here: Moment, after: Moment, measures: Measures) -> Midway:
        """The middle of a step; raises Rejected if there is none."""
        pad, growth = self._pad, measures.main
        assert here.velocity is not None and after.velocity is not None
        size, ends = pad.numbering.displacements, (here.unknowns, after.unknowns)
        way = Way(measures, size, *ends, here.velocity, after.velocity)
        middle = growth.time_at(0.5)
        found, left, off = self._off(here, growth, middle, way.at(middle)), np.zeros(size), 0.0
        for share in (LEFT, 1 - LEFT):
            time = growth.time_at(share)
            unknowns = way.at(time) - measures.bump(time)[0] * found
            error = self._off(here, growth, time, unknowns)
            parts = zip(*(np.split(field, [size]) for field in (error, unknowns)), strict=True)
            off = max(off, *(math.sqrt(np.square(part).mean()) / (np.abs(of).max() or 1.0) for part, of in parts))
            left = max(left, -error, key=lambda field: float(np.abs(field[:size]).max()))
        stress = pad.model.assembly.elements.isochoric_stress(pad.numbering.split(way.at(middle) - found)[0])
        bend = 8 * (here.relaxing.middle(after.relaxing.stress, growth) - stress)
        return Midway(growth, here.velocity, found, left, off, bend)

    def _off(self, here: Moment, growth: Growth, time: float, unknowns: np.ndarray) -> np.ndarray:
        """What Newton's method would subtract from unknowns within a step, at a time in s since its start."""
        pad = self._pad
        assert self._near is not None
        pad.past = here.relaxing.past(self._material, time, pad.part, growth.until(time))
        value = self._load[0] + (here.share + time / self._duration) * self._load[1]
        found = pad.correction(self._near, unknowns, value)
        if found is None:
            raise Rejected("an element would be inverted on the way")
        return found

    def deviation(self, end: Moment) -> np.ndarray:
        """(unknowns,) estimated error due to time steps.

        That of each step is known to `DOUBT` of it; what is not known does not cancel as they do.
        """
        if end.deviation is not None:
            largest = float(np.abs(end.deviation[: self._pad.numbering.displacements]).max())
            return end.deviation * (1 + DOUBT * end.doubt / largest) if largest else end.deviation
        error = end.relaxing.error.sum(axis=0)
        if self._near is None or not error.any():
            return np.zeros(self._pad.unknowns)
        return self._pad.answer(self._near, end.unknowns, error)

    def _step(self, here: Moment, share: float) -> Moment:
        """The state at a fraction of the way, by one step."""
        pad, time = self._pad, (share - here.share) * self._duration
        remembers = bool(self._material.prony)
        measures = self._measures(here, time) if self._leaps and time else None
        growth = measures.main if measures else None
        pad.past = here.relaxing.past(self._material, time, pad.part, growth) if remembers else None
        if isinstance(pad, IndentedPad):
            pad.rubbed = here.rubbed
        guess = here.unknowns
        if here.velocity is not None:
            ahead = (1 / growth.rate(0.0) if growth else min(time, here.relaxing.step)) * here.velocity
            guess = pad.towards(guess, guess + ahead)
        value = self._load[0] + share * self._load[1]
        solution, self._near = pad.solve_next(guess, value, self._near)
        moved = float(np.abs(solution.unknowns - here.unknowns)[: pad.numbering.displacements].max())
        unjudged = here.unjudged + moved
        if self._judges and (unjudged > NATURAL_STRAIN * pad.height or share == 1):
            self._near = pad.judged(solution.unknowns, value, self._near)
            unjudged = 0.0
        elif growth is not None:
            self._near = pad.tangent_at(solution.unknowns, value, self._near)
        relaxing, rubbed = here.relaxing, None
        if remembers:
            stress = pad.model.assembly.elements.isochoric_stress(pad.numbering.split(solution.unknowns)[0])
            relaxing = relaxing.after(self._material, time, stress, growth)
        if isinstance(pad, IndentedPad):
            rubbed = pad.rubbed_at(solution.unknowns, value)
        velocity = (solution.unknowns - here.unknowns) / time if time and not self._leaps else None
        figures = solution.min_jacobian, solution.residual, solution.iterations, solution.stability_checked
        after = Moment(solution.unknowns, relaxing, velocity, unjudged, share, *figures, rubbed)
        if self._leaps:
            assert here.recalled is not None
            change = (share - here.share) * self._load[1]
            after = replace(after, recalled=self._response.after(here.recalled, change, time))
        return self._with_rates_and_midway(here, after, value, measures) if measures else after

    def _with_rates_and_midway(self, here: Moment, after: Moment, value: np.ndarray, measures: Measures) -> Moment:
        """The state after a step, with its rates and the middle of the step."""
        pad, growth = self._pad, measures.main
        assert self._near is not None  # the tangent there
        ageing = here.relaxing.ageing(self._material, growth, after.relaxing.stress)
        rate = self._load[1] / self._duration
        after = self._with_rates(after, pad.rate_in_time(self._near, after.unknowns, rate, value, ageing))
        return replace(after, midway=self._midway(here, after, measures))

    def _measures(self, here: Moment, time: float) -> Measures:
        """Of a step of a length in s."""
        assert here.recalled is not None
        return self._response.measures(here.recalled, self._load[1] / self._duration, time)

    def _judged(self, before: Moment | None, here: Moment, after: Moment) -> tuple[float, Moment]:
        """Relative error of the last step, or of the first two, and the state with this error added to its
        variables."""
        if not self._material.prony:
            return 0.0, after
        self.scale = max(self.scale, self._pad.size_of(after.relaxing.stress))
        if not self.scale:
            return 0.0, after
        if self._leaps:
            return self._with_errors(here, after)
        if after.relaxing.slope is None or here.relaxing.slope is None:
            return 0.0, after
        bend = after.relaxing.bend(here.relaxing)
        missed = after.relaxing.missed(self._material, bend)
        error = self._pad.size_of(missed.sum(axis=0))
        if before is not None:
            earlier = here.relaxing.missed(self._material, bend)
            error = max(error, self._pad.size_of(earlier.sum(axis=0)))
            missed = missed + self._material.over(after.relaxing.step).decay[:, None, None, None] * earlier
        return error / self.scale, replace(after, relaxing=after.relaxing.off_by(missed))

    def _with_errors(self, here: Moment, after: Moment) -> tuple[float, Moment]:
        """As :meth:`_judged`, where what follows from errors of the terms is known: the state has that too."""
        assert self._near is not None
        pad, relaxing, growth, error = self._pad, after.relaxing, None, 0.0
        doubt = here.doubt * math.exp(-relaxing.step * float(self._response.rates.min()))
        if after.midway is not None:
            growth = after.midway.growth
            missed = relaxing.missed_on(self._material, growth, after.midway.bend)
            own = pad.answer(self._near, after.unknowns, missed.sum(axis=0))
            error = pad.size_of(missed.sum(axis=0)) / self.scale
            doubt += float(np.abs(own[: pad.numbering.displacements]).max())
            relaxing = relaxing.off_by(missed)
        deviation = pad.answer(self._near, after.unknowns, relaxing.error.sum(axis=0))
        displaced, moved = (pad.numbering.split(field)[0] for field in (after.unknowns, deviation))
        off = pad.model.assembly.elements.isochoric_rate(displaced, moved)
        relaxing = relaxing.followed(self._material, off, growth)
        return error, replace(after, relaxing=relaxing, deviation=deviation, doubt=doubt)

    def _refuse_contact(self, here: Moment, after: Moment, touch: Touch) -> None:
        contact = touch(self._pad, after.unknowns)
        if contact:
            place = ", ".join(f"{number:.4g}" for number in contact.place)
            raise self._ended(here, f"touches {contact.what} near ({place}) mm, which is outside the model", contact)

    def _ended(self, here: Moment, reason: str, contact: Contact | None = None) -> Ended:
        return Ended(self._load[0] + here.share * self._load[1], here.share, reason, contact)


def leaps(pad: LoadedPad, material: Viscoelastic) -> bool:
    """Whether steps may lead beyond rows."""
    return bool(material.prony) and not pad.solves_between


def response(load: Load, material: Viscoelastic) -> CreepResponse:
    """Of a pad to a kind of load."""
    return CreepResponse.of(material.prony, not load.gives_displacement)


def furthest(pad: LoadedPad, to_load: CreepResponse, rate: np.ndarray) -> float:
    """Length in s of the longest step that leads beyond rows, under a load with a ``rate`` per s."""
    speed = float(np.linalg.norm(rate))
    return pad.step / speed if speed else HELD / float(to_load.rates.min())
