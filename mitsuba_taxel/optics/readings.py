"""Optical power on every phototransistor of a scene, with its standard error."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from numbers import Integral
from pathlib import Path
from typing import Any

import numpy as np

from mitsuba_taxel import stages
from mitsuba_taxel.errors import InputError
from mitsuba_taxel.optics.scene import Scene

REPLICATES = 32
"""Independent randomisations of each reading; the standard error comes from their scatter."""
DEFAULT_TARGET_ERROR = 0.005
MOST_POINTS = 1 << 20
_FIRST_PILOT = 256
_SAFETY = 1.25  # a standard error from 32 replicates is itself known to 13 %


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
    notes : what the reader of the numbers must know, in words
    """

    replicates: np.ndarray
    points: int
    seed: int
    seconds: dict[str, float] = field(default_factory=dict)
    parameters: dict[str, str] = field(default_factory=dict)
    irradiance: np.ndarray | None = None
    notes: list[str] = field(default_factory=list)

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
        return self.replicates.std(axis=0, ddof=1) / math.sqrt(len(self.replicates))

    @property
    def relative_error(self) -> float:
        """Largest relative standard error of any taxel that receives light; 0 if none does."""
        lit = self.power > 0
        return float(np.max(self.standard_error[lit] / self.power[lit], initial=0.0))


def measure(
    scene: Scene | str | Path | Any,
    *,
    target_error: float | None = None,
    points: int | None = None,
    seed: int = 0,
    irradiance: bool = False,
) -> Readings:
    """Readings of all taxels of a scene.

    Parameters
    ----------
    scene : a :class:`Scene`, a path or name of an XML scene, or a loaded ``mi.Scene``
    target_error : relative standard error that the worst taxel should reach (default 0.005). Pilot runs with other
        random numbers choose how many points that takes; they do not enter the result.
    points : light paths for each taxel and replicate, instead of a target; rounded up to a power of two
    seed : whole number from 0 to 2**32 - 1
    irradiance : whether to return the irradiance map as well

    Raises
    ------
    InputError
        for a value that is not allowed, or a scene that cannot be built or read.
    ComputationError
        if a pad cannot be deformed as asked.
    """
    check_request(target_error, points, seed)
    with stages.record() as seconds:
        live, parameters = _live(scene)
        with stages.stage("optics"):
            if points is None:
                target_error = DEFAULT_TARGET_ERROR if target_error is None else target_error
                points = points_for(live, target_error, seed)
            powers, image, points = _trace(live, points, seed, irradiance)
    result = Readings(powers, points, seed, seconds, parameters, image)
    result.notes.extend(_notes(live, result, target_error))
    return result


def points_for(scene: Any, target_error: float, seed: int) -> int:
    """Points for each taxel and replicate that reach a relative standard error, found by pilot runs."""
    live, _ = _live(scene)
    points = _FIRST_PILOT
    for pilot in range(1, 16):
        powers, _, points = _trace(live, points, _derived_seed(seed, pilot), False)
        error = _SAFETY * Readings(powers, points, seed).relative_error
        if error <= target_error or points >= MOST_POINTS:
            break
        growth = min((error / target_error) ** 1.5, 16.0)
        points = min(1 << math.ceil(math.log2(points * growth)), MOST_POINTS)
    return points


def _live(scene: Any) -> tuple[Any, dict[str, str]]:
    """The ``mi.Scene`` of whatever describes it, and the values of its parameters."""
    if isinstance(scene, (str, Path)):
        scene = Scene.from_file(scene)
    if isinstance(scene, Scene):
        return scene.load(), scene.parameters
    return scene, {}


def _trace(scene: Any, points: int, seed: int, image: bool):
    """Powers (replicates, taxels), the irradiance map of the first sensor if asked for, and the points used."""
    from mitsuba_taxel.optics.taxels import taxels_of

    integrator = scene.integrator()
    if not hasattr(integrator, "trace"):
        return _render(scene, points, seed)
    pairs = taxels_of(scene)
    results = [integrator.trace(scene, pair, points, seed, REPLICATES, image) for pair in pairs]
    return np.concatenate([powers for powers, _, _ in results], axis=1), results[0][1], results[0][2]


def _render(scene: Any, points: int, seed: int):
    """As :func:`_trace`, by one of Mitsuba's own integrators, under which all LEDs are lit."""
    import mitsuba as mi

    columns, images = [], []
    for sensor in scene.sensors():
        if not hasattr(sensor, "spread_film"):
            raise InputError(f"every sensor must be a phototransistor, not a {sensor.class_name()}.")
        faces = sensor.faces
        seeds = [_derived_seed(seed, replicate) for replicate in range(REPLICATES)]
        renders = (mi.render(scene, sensor=sensor, spp=points, seed=value) for value in seeds)
        maps = np.array([np.asarray(image)[:, :, 0] for image in renders], dtype=float)
        blocks = maps.reshape(REPLICATES, faces.rows, sensor.block[1], faces.columns, sensor.block[0])
        columns.append(blocks.mean(axis=(2, 4)).reshape(REPLICATES, -1) * faces.area[0])
        images.append(maps.mean(axis=0))
    return np.concatenate(columns, axis=1), images[0], points


def _derived_seed(seed: int, index: int) -> int:
    """One of many seeds that follow from ``seed``, each with random numbers independent of the others'."""
    return int(np.random.SeedSequence([seed, index]).generate_state(1)[0])


def _notes(scene: Any, result: Readings, target_error: float | None) -> list[str]:
    notes = []
    if any(hasattr(shape, "pad") for shape in scene.shapes()):
        notes.append("mechanics error unknown: the stated error is that of the light alone")
    if target_error is not None and result.relative_error > target_error:
        notes.append(
            f"target error {target_error:g} not reached: {result.relative_error:.2g} with {result.points} points"
        )
    dark = result.taxel[result.power <= 0]
    if len(dark):
        notes.append(f"no light found on taxel {', '.join(map(str, dark))}")
    return notes


def check_request(target_error: float | None, points: int | None, seed: int) -> None:
    """Refuse what :func:`measure` cannot be asked for; see there for the parameters.

    Raises
    ------
    InputError
        for a value that is not allowed, or both a target and a number of points.
    """
    if target_error is not None and points is not None:
        raise InputError("target_error and points exclude each other: give one of them.")
    if target_error is not None and not 0 < target_error < 1:
        raise InputError(f"target_error = {target_error} is not allowed: a number between 0 and 1 is needed.")
    if points is not None and not (isinstance(points, Integral) and 1 <= points <= MOST_POINTS):
        raise InputError(f"points = {points} is not allowed: a whole number from 1 to {MOST_POINTS} is needed.")
    if not (isinstance(seed, Integral) and 0 <= seed < 1 << 32):
        raise InputError(f"seed = {seed} is not allowed: a whole number from 0 to {(1 << 32) - 1} is needed.")
