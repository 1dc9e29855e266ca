"""Incremental readings: prepared scenes are traced with an increasing number of points, within a time budget."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeAlias

import mitsuba as mi
import numpy as np

from mitsuba_taxel.backend import activate_variant, in_turn
from mitsuba_taxel.backend.plugin_objects import make_plugin
from mitsuba_taxel.base.arguments import require
from mitsuba_taxel.kernels.paths.taxel_integrators import traces_taxels
from mitsuba_taxel.kernels.paths.wavefronts import trace
from mitsuba_taxel.kernels.protocols import has_faces, is_led
from mitsuba_taxel.kernels.walls import set_wavelength
from mitsuba_taxel.sensing.reading.readings import Readings
from mitsuba_taxel.sensing.scene.description import Scene
from mitsuba_taxel.sensing.scene.scene_pads import contact_notes, deformed_pads, loaded_pads
from mitsuba_taxel.sensing.scene.taxels import taxels_of
from mitsuba_taxel.sensing.validity.checked import check_readable
from mitsuba_taxel.sensing.validity.dark_backs import dark_backs

REPLICATES = 32
"""Number of independent randomisations of each reading; their scatter gives the standard error."""
MOST_POINTS = 1 << 20
"""Largest number of points per taxel and replicate."""
FIRST_POINTS = 256
"""Number of points per taxel and replicate in the first step of a run."""
CHOSEN_INTEGRATOR = "integrator taxel_tracer: it connects paths from LED and phototransistor, and supports every wall"
"""Note for a scene that names no integrator."""


class PairedPowers(Protocol):
    """Interface of readings that are computed as those of a base state plus a difference, so that readings under
    several loads share their noise.
    """

    def powers(self, points: int, seed: int, first: int) -> tuple[np.ndarray, int]:
        """Readings (R, T) in W of T taxels in R replicates, and the number of points (paths) used, counted from the
        point ``first`` of the random sequences.
        """

    def has_less_noise(self) -> bool:
        """Whether paired differences from the base state have less noise than differences of plain readings with shared
        random numbers."""

    def deviations(self, seed: int, points: int) -> tuple[np.ndarray, np.ndarray | None]:
        """Readings (R, T) in W, and their changes (2, R, T) by two components of the change of shape on coarser finite
        elements; the changes are None if unknown."""


class Prepared(NamedTuple):
    """A loaded and checked scene with its integrator, ready for tracing."""

    scene: mi.Scene
    integrator: mi.Integrator
    parameters: dict[str, str]
    notes: list[str]  # which integrator was chosen and why, if the scene names none
    paired: PairedPowers | None = None  # readings relative to a base state, which replace those of the scene


AnyScene: TypeAlias = "Scene | Prepared | mi.Scene | str | Path | dict[str, Any]"
"""A :class:`Scene`, the result of :func:`prepare`, a loaded scene, a path or name of an XML scene, or a dictionary."""


@in_turn
def prepare(scene: AnyScene) -> Prepared:
    """Load and check a scene given in any form, and choose an integrator if the scene names none.

    Parameters
    ----------
    scene : Scene or str or Path or dict or mi.Scene or Prepared
        Scene in any form that :func:`measure` takes.

    Returns
    -------
    Prepared
        The prepared scene, which :func:`measure` accepts in place of the scene.

    Raises
    ------
    InputError
        if the scene cannot be built or read.
    """
    scene = described(scene)
    if isinstance(scene, Prepared):
        check_readable(scene.scene, scene.integrator)  # it may have been changed
        return scene
    live, parameters = (scene.load(), scene.parameters) if isinstance(scene, Scene) else (scene, {})
    integrator, notes = live.integrator(), []
    if integrator is None:
        integrator = make_plugin("taxel_tracer")
        notes.append(CHOSEN_INTEGRATOR)
    check_readable(live, integrator)
    if any(not pad.state.displacement.any() for pad in loaded_pads(live)):
        notes.append("a pad is at rest: its indenter does not touch it")  # any other load moves a pad
    for pad in deformed_pads(live):
        if pad.state.buckled_at is not None:
            at = ", ".join(f"{component:.4g}" for component in pad.state.buckled_at)
            notes.append(
                f"a pad has buckled at ({at}) {pad.state.load.unit}: one of its mirror-image shapes is followed"
            )
    notes += contact_notes(live)
    if deformed_pads(live) and any(has_faces(end) and end.resin_index is not None for end in live.sensors()):
        notes.append("dies lie below windows: light is computed by random paths")  # also where all walls are diffuse
    notes += dark_backs(live).values()
    if not traces_taxels(integrator) and _lights(live) > 1:
        notes.append("Mitsuba's own integrator: each reading holds the light of all LEDs and other emitters at once")
    return Prepared(live, integrator, parameters, notes)


def _lights(scene: mi.Scene) -> int:
    """Number of light sources of a scene: all LEDs of arrays and all other emitters."""
    return sum(emitter.faces.count if is_led(emitter) else 1 for emitter in scene.emitters())


def described(scene: AnyScene) -> Scene | Prepared | mi.Scene:
    """Convert a name, a path or a dictionary of a scene to a `Scene`; a scene in any other form is returned unchanged.
    """
    if isinstance(scene, (str, Path, dict)):
        return Scene(scene)
    activate_variant()
    require("scene", scene, (Scene, Prepared, mi.Scene), "a Scene, a path, a name, a dictionary or an mi.Scene")
    return scene


class Clock:
    """The remaining part of a time budget for a reading."""

    def __init__(self, budget: float | None) -> None:
        self.end = math.inf if budget is None else time.perf_counter() + budget

    @property
    def left(self) -> float:
        """Remaining time in s, negative after the end."""
        return self.end - time.perf_counter()

    def allows(self, seconds: float) -> bool:
        """Whether a task that takes ``seconds`` would end within the time budget."""
        return seconds <= self.left


class Run:
    """Incremental readings by random paths: each step doubles the number of points, and continues the same random
    sequences.

    Parameters
    ----------
    ready : Prepared
        The scene.
    seed : int
        Seed of the random numbers.
    image : bool
        Whether to accumulate the irradiance map.
    continued : Readings, optional
        Readings that the run continues.
    """

    def __init__(self, ready: Prepared, seed: int, image: bool = False, continued: Readings | None = None) -> None:
        self.ready, self.seed, self.with_image = ready, seed, image
        self.points = continued.points if continued else 0
        self.powers = continued.replicates if continued else np.empty((REPLICATES, 0))
        self.image: np.ndarray | None = None
        self.seconds = 0.0  # of the last step

    def extend_to(self, points: int, clock: Clock | None = None) -> None:
        """Trace until a number of points is reached, or until the next step would not end within the time budget.

        Parameters
        ----------
        points : int
            Number of points per taxel and replicate.
        clock : Clock, optional
            Time budget.
        """
        if not self.points and (clock is None or clock.end == math.inf):
            self._step(points)
            return
        if not self.points:
            traced(self.ready, 1, self.seed, 0, self.with_image)  # compiles before steps are timed
        while self.points < points and (not self.points or clock is None or clock.allows(2 * self.seconds)):
            self._step(self.points or min(FIRST_POINTS, points))

    def extend_to_error(self, target: float, clock: Clock) -> None:
        """Double the number of points until the error is below a target or the time budget ends; a pilot run may have
        predicted too few points.

        Parameters
        ----------
        target : float
            Relative standard error of the worst taxel.
        clock : Clock
            Time budget.
        """
        while self.points < MOST_POINTS and clock.allows(2 * self.seconds):
            if Readings(self.powers, self.points, self.seed).relative_error <= target:
                return
            self._step(self.points)

    def _step(self, points: int) -> None:
        """Trace further points, and average them with the earlier points."""
        start = time.perf_counter()
        powers, image, points = traced(self.ready, points, self.seed, self.points, self.with_image)
        total = self.points + points
        weight = points / total
        self.powers = powers if not self.points else (1 - weight) * self.powers + weight * powers
        if self.with_image:
            self.image = image if self.image is None or image is None else (1 - weight) * self.image + weight * image
        self.points = total
        self.seconds = time.perf_counter() - start


def derived_seed(seed: int, index: int) -> int:
    """Derive one of many independent seeds from a seed.

    Parameters
    ----------
    seed : int
        Seed from 0 on.
    index : int
        Number of the derived seed, from 0 on.

    Returns
    -------
    int
        The derived seed, from 0 to 2**32 - 1.
    """
    return int(np.random.SeedSequence([seed, index]).generate_state(1)[0])


def traced(
    ready: Prepared, points: int, seed: int, first: int, image: bool
) -> tuple[np.ndarray, np.ndarray | None, int]:
    """Trace the readings of a scene by random paths.

    Parameters
    ----------
    ready : Prepared
        The scene.
    points : int
        Points per taxel and replicate.
    seed : int
        Seed of the random numbers.
    first : int
        Index of the first point in the random sequences; larger than 0 for a continued run.
    image : bool
        Whether to return the irradiance map.

    Returns
    -------
    powers : (R, T) ndarray
        Powers in W of T taxels in R replicates.
    map : ndarray or None
        Irradiance map of the first sensor, in W/mm²; None if not requested.
    points : int
        Number of points used per taxel and replicate.
    """
    scene, integrator = ready.scene, ready.integrator
    if ready.paired is not None and not image:
        powers, points = ready.paired.powers(points, seed, first)
        return powers, None, points
    if not traces_taxels(integrator):
        set_wavelength(scene, scene.emitters())
        return _render(scene, points, seed, first)
    results = []
    for pair in taxels_of(scene):
        set_wavelength(scene, [pair.led])
        results.append(trace(integrator, scene, pair, points, seed, REPLICATES, first=first, image=image))
    return np.concatenate([powers for powers, _, _ in results], axis=1), results[0][1], results[0][2]


def _render(scene: mi.Scene, points: int, seed: int, first: int):
    """Trace readings by one of Mitsuba's own integrators, with all LEDs lit at once. Returns powers, map and number of
    points, like :func:`traced`.

    A continuation from ``first`` points uses other random numbers.
    """
    import drjit as dr

    columns, images = [], []
    for sensor in scene.sensors():
        faces = sensor.faces
        # Opaque values, because the kernel would be recompiled for each seed otherwise.
        numbers = range(first * REPLICATES, (first + 1) * REPLICATES)
        seeds = [dr.opaque(mi.UInt32, derived_seed(seed, number)) for number in numbers]
        renders = (mi.render(scene, sensor=sensor, spp=points, seed=value) for value in seeds)
        maps = np.array([np.asarray(image)[:, :, 0] for image in renders], dtype=float)
        blocks = maps.reshape(REPLICATES, faces.rows, sensor.block[1], faces.columns, sensor.block[0])
        columns.append(blocks.mean(axis=(2, 4)).reshape(REPLICATES, -1) * faces.area[0])
        images.append(maps.mean(axis=0))
    return np.concatenate(columns, axis=1), images[0], points
