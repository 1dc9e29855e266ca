"""Optical power on every phototransistor of a scene, with its standard error."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from numbers import Integral, Real
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mitsuba_taxel import stages
from mitsuba_taxel.errors import InputError
from mitsuba_taxel.optics.choice import choose_integrator
from mitsuba_taxel.optics.scene import Scene
from mitsuba_taxel.optics.taxels import taxels_of
from mitsuba_taxel.optics.tracing import trace
from mitsuba_taxel.optics.walls import set_wavelength

if TYPE_CHECKING:
    from mitsuba_taxel.mechanics import RoofError

REPLICATES = 32
"""Independent randomisations of each reading; the standard error comes from their scatter."""
DEFAULT_TARGET_ERROR = 0.005
MOST_POINTS = 1 << 20
FIRST_POINTS = 256
_SAFETY = 1.25  # a standard error from 32 replicates is itself known to 13 %


def standard_error(replicates: np.ndarray) -> np.ndarray:
    """One standard deviation of the mean over the first axis of ``replicates`` (R, ...), from their scatter."""
    return replicates.std(axis=0, ddof=1) / math.sqrt(len(replicates))


@dataclass(frozen=True)
class Readings:
    """What the phototransistors of a scene read.

    Attributes
    ----------
    replicates : (R, T) power in W for each independent randomisation and taxel
    points : light paths for each taxel and replicate
    seed : what the random numbers came from
    seconds : time by stage, in s
    parameters : values of the scene's parameters
    irradiance : (height, width) map in W/mm², one block of pixels for each taxel, or None
    responsivity : (T,) photocurrent per power of each phototransistor at its LED's wavelength, in A/W, or None
    roof_errors : of each loaded pad, what its mechanics is off by (a `RoofError`), None where that is unknown
    remarks : what the reader of the numbers must know besides, in words
    """

    replicates: np.ndarray
    points: int
    seed: int
    seconds: dict[str, float] = field(default_factory=dict)
    parameters: dict[str, str] = field(default_factory=dict)
    irradiance: np.ndarray | None = None
    responsivity: np.ndarray | None = None
    roof_errors: list[RoofError | None] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)

    @property
    def notes(self) -> list[str]:
        """What the reader of the numbers must know, in words."""
        return [*self.remarks, *describe_mechanics(self.roof_errors)]

    @property
    def taxel(self) -> np.ndarray:
        """(T,) numbers of the taxels, from 1."""
        return np.arange(1, self.replicates.shape[1] + 1)

    @property
    def power(self) -> np.ndarray:
        """(T,) optical power in W."""
        return self.replicates.mean(axis=0)

    @property
    def standard_error(self) -> np.ndarray:
        """(T,) one standard deviation of :attr:`power`, in W, from the scatter of the replicates."""
        return standard_error(self.replicates)

    @property
    def photocurrent(self) -> np.ndarray | None:
        """(T,) current of each phototransistor, in A, or None if the responsivity is not known."""
        return None if self.responsivity is None else self.power * self.responsivity

    @property
    def relative_error(self) -> float:
        """Largest relative standard error of any taxel that receives light; 0 if none does."""
        lit = self.power > 0
        return float(np.max(self.standard_error[lit] / self.power[lit], initial=0.0))


@dataclass(frozen=True)
class Crosstalk:
    """Power that each LED alone brings to each phototransistor.

    Attributes
    ----------
    replicates : (R, T, T) power in W for each independent randomisation, LED and phototransistor
    points : light paths for each of them
    seed : what the random numbers came from
    """

    replicates: np.ndarray
    points: int
    seed: int

    @property
    def power(self) -> np.ndarray:
        """(T, T) optical power in W: row LED, column phototransistor."""
        return self.replicates.mean(axis=0)

    @property
    def standard_error(self) -> np.ndarray:
        """(T, T) one standard deviation of :attr:`power`, in W."""
        return standard_error(self.replicates)


def measure(
    scene: Scene | str | Path | Any,
    *,
    target_error: float | None = None,
    points: int | None = None,
    time_budget: float | None = None,
    seed: int = 0,
    irradiance: bool = False,
    continued: Readings | None = None,
) -> Readings:
    """Readings of all taxels of a scene.

    Parameters
    ----------
    scene : a :class:`Scene`, a path or name of an XML scene, a loaded ``mi.Scene``, or what :func:`prepare` returned
    target_error : relative standard error that the worst taxel should reach (default 0.005, if there is neither
        ``points`` nor ``time_budget``). Pilot runs with other random numbers choose how many points that takes; they
        do not enter the result.
    points : light paths for each taxel and replicate, instead of a target; rounded up to a power of two
    time_budget : seconds after which no further points are begun, loading the scene apart. Alone, it is used up;
        together with a target or a number of points the run ends at whichever comes first. At least 256 points are
        traced in any case.
    seed : whole number from 0 to 2**32 - 1
    irradiance : whether to return the irradiance map as well
    continued : readings of the same scene and seed, of 256 points or more, that this run goes on from: with
        ``points`` it gives what a run of so many points from the start would give (under Mitsuba's own integrators an
        estimate that is as good)

    Raises
    ------
    InputError
        for a value that is not allowed, or a scene that cannot be built or read.
    ComputationError
        if a pad cannot be deformed as asked.
    """
    check_request(target_error, points, seed, time_budget)
    if continued is not None and (continued.seed != seed or continued.points < FIRST_POINTS or irradiance):
        raise InputError("continued must be readings with the same seed, of 256 points or more, and without a map.")
    with stages.record() as seconds:
        ready = prepare(scene)
        clock = Clock(time_budget)
        with stages.stage("optics"):
            wanted = points
            if points is None and (target_error is not None or time_budget is None):
                target_error = DEFAULT_TARGET_ERROR if target_error is None else target_error
                wanted = points_for(ready, target_error, seed, clock)
            run = Run(ready, seed, irradiance, continued)
            run.go_on(wanted or MOST_POINTS, clock)
    current = _responsivity(ready.scene)
    pads = [shape for shape in ready.scene.shapes() if hasattr(shape, "state") and any(shape.value)]
    errors = [pad.state.error for pad in pads]
    result = Readings(run.powers, run.points, seed, seconds, ready.parameters, run.image, current, errors)
    result.remarks.extend([*ready.notes, *_remarks(result, target_error, points)])
    return result


def crosstalk(
    scene: Scene | str | Path | Any, *, target_error: float | None = None, points: int | None = None, seed: int = 0
) -> Crosstalk:
    """Power that each LED brings to each phototransistor.

    Parameters are those of :func:`measure`; a target error counts for the taxels' own readings.

    Raises
    ------
    InputError
        as :func:`measure`, and where the scene's integrator is one of Mitsuba's own, under which all LEDs are lit.
    """
    check_request(target_error, points, seed)
    ready = prepare(scene)
    if not hasattr(ready.integrator, "sample_paths"):
        raise InputError("crosstalk needs one of the integrators taxel_tracer, taxel_path and analog_tracer.")
    if points is None:
        points = points_for(ready, target_error or DEFAULT_TARGET_ERROR, seed)
    pairs = taxels_of(ready.scene)
    if len(pairs) > 1:
        raise InputError("crosstalk needs all taxels in one photo_reflector.")
    set_wavelength(ready.scene, [pairs[0].led])
    powers, _, points = trace(ready.integrator, ready.scene, pairs[0], points, seed, REPLICATES, crosstalk=True)
    return Crosstalk(powers, points, seed)


def points_for(scene: Any, target_error: float, seed: int, clock: Clock | None = None) -> int:
    """Points for each taxel and replicate that reach a relative standard error, found by pilot runs."""
    ready = prepare(scene)
    points = FIRST_POINTS
    for pilot in range(1, 16):
        run = Run(ready, _derived_seed(seed, pilot), False)
        run.go_on(points)
        error = _SAFETY * Readings(run.powers, run.points, seed).relative_error
        if error <= target_error or points >= MOST_POINTS:
            break
        if clock and not clock.allows(8 * run.seconds):
            return MOST_POINTS  # out of reach: the clock says when to stop
        growth = min((error / target_error) ** 1.5, 16.0)
        points = min(1 << math.ceil(math.log2(points * growth)), MOST_POINTS)
    return points


class Clock:
    """How much of a time budget is left."""

    def __init__(self, budget: float | None) -> None:
        self.end = math.inf if budget is None else time.perf_counter() + budget

    def allows(self, seconds: float) -> bool:
        """Whether something that takes so many seconds would end in time."""
        return time.perf_counter() + seconds <= self.end


class Run:
    """Readings that grow: each step traces as many points again as there are, and goes on in the same sequences."""

    def __init__(self, ready: Prepared, seed: int, image: bool, continued: Readings | None = None) -> None:
        self.ready, self.seed, self.with_image = ready, seed, image
        self.points = continued.points if continued else 0
        self.powers = continued.replicates if continued else np.empty((REPLICATES, 0))
        self.image: np.ndarray | None = None
        self.seconds = 0.0  # that the last step took

    def go_on(self, wanted: int, clock: Clock | None = None) -> None:
        """Trace until there are ``wanted`` points, or until the next step would not end in time."""
        if not self.points and (clock is None or clock.end == math.inf):
            self._step(wanted)
            return
        if not self.points:
            _trace(self.ready, 1, self.seed, 0, self.with_image)  # compiles, so that the steps are timed without it
        while self.points < wanted and (not self.points or clock is None or clock.allows(2 * self.seconds)):
            self._step(self.points or min(FIRST_POINTS, wanted))

    def _step(self, points: int) -> None:
        start = time.perf_counter()
        powers, image, points = _trace(self.ready, points, self.seed, self.points, self.with_image)
        total = self.points + points
        share = points / total
        self.powers = powers if not self.points else (1 - share) * self.powers + share * powers
        if self.with_image:
            self.image = image if self.image is None else (1 - share) * self.image + share * image
        self.points = total
        self.seconds = time.perf_counter() - start


class Prepared(NamedTuple):
    """A scene that is ready to be read."""

    scene: Any  # mi.Scene
    integrator: Any
    parameters: dict[str, str]
    notes: list[str]  # which integrator was chosen and why, where the scene names none


def prepare(scene: Any) -> Prepared:
    """Load whatever describes a scene, and choose an integrator if it names none."""
    if isinstance(scene, Prepared):
        return scene
    if isinstance(scene, (str, Path)):
        scene = Scene.from_file(scene)
    if not isinstance(scene, Scene):
        return Prepared(scene, scene.integrator(), {}, [])
    live = scene.load()
    if scene.names_integrator:
        return Prepared(live, live.integrator(), scene.parameters, [])
    taxels_of(live)
    integrator, reason = choose_integrator(live)
    return Prepared(live, integrator, scene.parameters, [f"integrator {reason}"])


def _trace(ready: Prepared, points: int, seed: int, first: int, image: bool):
    """Powers (replicates, taxels), the irradiance map of the first sensor if asked for, and the points used."""
    scene, integrator = ready.scene, ready.integrator
    if not hasattr(integrator, "sample_paths"):
        set_wavelength(scene, scene.emitters())
        return _render(scene, points, seed, first)
    results = []
    for pair in taxels_of(scene):
        set_wavelength(scene, [pair.led])
        results.append(trace(integrator, scene, pair, points, seed, REPLICATES, first=first, image=image))
    return np.concatenate([powers for powers, _, _ in results], axis=1), results[0][1], results[0][2]


def _render(scene: Any, points: int, seed: int, first: int):
    """As :func:`_trace`, by one of Mitsuba's own integrators, under which all LEDs are lit.

    What goes on from ``first`` points has random numbers of its own.
    """
    import drjit as dr
    import mitsuba as mi

    columns, images = [], []
    for sensor in scene.sensors():
        if not hasattr(sensor, "spread_film"):
            raise InputError(f"every sensor must be a phototransistor, not a {sensor.class_name()}.")
        faces = sensor.faces
        # Kept out of the kernel, which would otherwise be compiled anew for each of them.
        numbers = range(first * REPLICATES, (first + 1) * REPLICATES)
        seeds = [dr.opaque(mi.UInt32, _derived_seed(seed, number)) for number in numbers]
        renders = (mi.render(scene, sensor=sensor, spp=points, seed=value) for value in seeds)
        maps = np.array([np.asarray(image)[:, :, 0] for image in renders], dtype=float)
        blocks = maps.reshape(REPLICATES, faces.rows, sensor.block[1], faces.columns, sensor.block[0])
        columns.append(blocks.mean(axis=(2, 4)).reshape(REPLICATES, -1) * faces.area[0])
        images.append(maps.mean(axis=0))
    return np.concatenate(columns, axis=1), images[0], points


def _derived_seed(seed: int, index: int) -> int:
    """One of many seeds that follow from ``seed``, each with random numbers independent of the others'."""
    return int(np.random.SeedSequence([seed, index]).generate_state(1)[0])


def _responsivity(live: Any) -> np.ndarray | None:
    """(T,) A/W; None where LEDs and phototransistors do not pair up."""
    try:
        pairs = taxels_of(live)
    except InputError:
        return None
    return np.concatenate([np.full(pair.count, pair.sensor.responsivity(pair.led.wavelength)) for pair in pairs])


def _remarks(result: Readings, target_error: float | None, points: int | None) -> list[str]:
    notes = []
    if target_error is not None and result.relative_error > target_error:
        notes.append(
            f"target error {target_error:g} not reached: {result.relative_error:.2g} with {result.points} points"
        )
    if points is not None and result.points < points:
        notes.append(f"time budget used up after {result.points} of {points} points")
    dark = result.taxel[result.power <= 0]
    if len(dark):
        notes.append(f"no light found on taxel {', '.join(map(str, dark))}")
    return notes


def describe_mechanics(errors: Sequence[RoofError | None]) -> list[str]:
    """What is known of the error of loaded pads, which the standard error of the light does not hold; for the worst."""
    if not errors:
        return []
    known = [error for error in errors if error is not None]
    if len(known) < len(errors):
        return ["mechanics error unknown: the stated error is that of the light alone"]
    worst = max(known, key=lambda error: error.displacement)
    return [
        f"mechanics: roofs right to {worst.displacement:.2g} mm (at worst {worst.largest:.2g} mm, {worst.relative:.1%} "
        f"of the largest displacement) and {worst.slope:.2g} degrees; not part of the stated standard error"
    ]


def check_request(target_error: float | None, points: int | None, seed: int, time_budget: float | None = None) -> None:
    """Refuse what :func:`measure` cannot be asked for; see there for the parameters.

    Raises
    ------
    InputError
        for a value that is not allowed, or both a target and a number of points.
    """
    if target_error is not None and points is not None:
        raise InputError("target_error and points exclude each other: give one of them.")
    if target_error is not None and not (isinstance(target_error, Real) and 0 < target_error < 1):
        raise InputError(f"target_error = {target_error} is not allowed: a number between 0 and 1 is needed.")
    if points is not None and not (_is_whole(points) and 1 <= points <= MOST_POINTS):
        raise InputError(f"points = {points} is not allowed: a whole number from 1 to {MOST_POINTS} is needed.")
    if time_budget is not None and not (isinstance(time_budget, Real) and 0 < time_budget < math.inf):
        raise InputError(f"time_budget = {time_budget} is not allowed: a finite number of seconds above 0 is needed.")
    if not (_is_whole(seed) and 0 <= seed < 1 << 32):
        raise InputError(f"seed = {seed} is not allowed: a whole number from 0 to {(1 << 32) - 1} is needed.")


def _is_whole(value: object) -> bool:
    return isinstance(value, Integral) and not isinstance(value, bool)
