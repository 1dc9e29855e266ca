"""The light-transport methods that are compared: the integrators of this package, and Mitsuba's own."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.kernels.walls import is_bounded_from_detector, set_wavelength, walls_of
from mitsuba_taxel.sensing.measurement import crosstalk, measure
from mitsuba_taxel.sensing.reading.runs import MOST_POINTS, REPLICATES, Prepared, prepare
from mitsuba_taxel.sensing.scene.description import Scene
from mitsuba_taxel.sensing.scene.left_out import used_by
from mitsuba_taxel.specification.taxel_tracer import STRATEGIES

LARGEST_STRAY = 1e-4
"""Largest fraction of a reading that may come from LEDs of other taxels, for integrators that light all LEDs at
once."""
_STRAY_POINTS = 256
_RAYS = 1 << 12
MOST_LANES = 1 << 25
"""Largest number of paths in a launch of Mitsuba's integrators."""


class Estimate(NamedTuple):
    """Power (T,) of T taxels in W, and the standard error (T,) that the method states; NaN if it states none."""

    power: np.ndarray
    stated: np.ndarray


Estimator = Callable[[int, int], Estimate]
"""Function of (samples per taxel, seed) that returns an `Estimate`."""


@dataclass(frozen=True)
class Method:
    """A light-transport method: an integrator with its sampler.

    ``strategy`` is a parameter of `taxel_tracer`; only the strategy ``all`` includes all light.
    """

    integrator: str
    sampler: str = "owen_sobol"
    strategy: str = "all"

    @property
    def is_ours(self) -> bool:
        """Whether the integrator belongs to this package, so that each taxel is read with its own LED alone."""
        return self.integrator in _OURS

    @property
    def name(self) -> str:
        if self.is_ours:
            return self.integrator if self.strategy == "all" else f"{self.integrator} {self.strategy}"
        return f"{self.integrator} ({self.sampler})"

    @property
    def most_samples(self) -> int:
        """Largest number of samples per taxel in one run, limited by the sampler or by memory."""
        if self.is_ours:
            return MOST_POINTS * REPLICATES
        return MOST_POINTS if self.sampler == "owen_sobol" else MOST_LANES


_OURS = ("taxel_tracer", "taxel_path", "analog_tracer")
METHODS = (
    *(Method("taxel_tracer", strategy=strategy) for strategy in STRATEGIES),
    Method("taxel_path"),
    Method("analog_tracer"),
    *(Method("path", sampler) for sampler in ("independent", "stratified", "multijitter", "owen_sobol")),
    Method("ptracer", "independent"),
)


def estimator(method: Method, scene: Scene, folder: Path, stray: float) -> Estimator:
    """Load a scene with the integrator of a method, and return a function that estimates its readings.

    Parameters
    ----------
    method : Method
        The method.
    scene : Scene
        The scene.
    folder : Path
        Folder for the file of the scene with the method's integrator.
    stray : float
        See :func:`stray_light`.

    Raises
    ------
    InputError
        if the method does not support the scene; the message gives the reason.
    """
    if not method.is_ours and not stray <= LARGEST_STRAY:
        fraction = "an unknown share" if math.isnan(stray) else f"{stray:.1%}"
        raise InputError(
            f"the method lights all LEDs at once, so that {fraction} of a reading would come from LEDs of other "
            "taxels: it is left out of the comparison."
        )
    prepared = prepare(_variant(method, scene, folder))
    if method.is_ours:
        return of_readings(prepared)
    set_wavelength(prepared.scene, prepared.scene.emitters())
    return _stock(prepared.scene)


def stray_light(scene: Scene) -> float:
    """Largest fraction, of any taxel's reading, that the LEDs of other taxels would add; NaN if unknown."""
    try:
        power = crosstalk(scene, points=_STRAY_POINTS).power
    except InputError:
        return math.nan
    own_power = power.diagonal()
    lit = own_power > 0
    return float(np.max((power.sum(axis=0) - own_power)[lit] / own_power[lit], initial=0.0))


def is_bounded(scene: Scene) -> bool:
    """Whether the weights of light paths that start at the phototransistor are bounded."""
    return all(map(is_bounded_from_detector, walls_of(prepare(scene).scene)))


def offset_share(scene: Scene) -> float:
    """Approximate relative error of readings by Mitsuba's own integrators, which start rays at a distance from
    surfaces.

    The offset from a surface at the position p is 9e-5 (1 + max |p|), see
    :func:`mitsuba_taxel.kernels.paths.ray_offsets.leave`. The result is the offset divided by the median distance from
    a phototransistor to the first wall.
    """
    import mitsuba as mi

    built = prepare(scene).scene
    sensor = built.sensors()[0]
    random = mi.PCG32(_RAYS)
    position, direction = (mi.Point2f(random.next_float32(), random.next_float32()) for _ in range(2))
    intersection = built.ray_intersect(sensor.sample_ray(0, 0, position, direction)[0])
    distance, hit = np.array(intersection.t), np.isfinite(np.array(intersection.t))
    if not hit.any():
        return 0.0
    largest_coordinate = np.abs(np.array(intersection.p)[:, hit]).max()
    return float(9e-5 * (1 + largest_coordinate) / np.median(distance[hit]))


def of_readings(prepared: Prepared) -> Estimator:
    """Return a function that estimates the readings of a prepared scene by random paths of its integrator."""

    def estimate(samples: int, seed: int) -> Estimate:
        points = max(1, samples // REPLICATES)
        readings = measure(prepared, points=points, seed=seed, mechanics_error=False)
        return Estimate(readings.power, readings.standard_error)

    return estimate


def _stock(scene: Any) -> Estimator:
    """Return a function that estimates readings by one of Mitsuba's own integrators, which states no error. Each run is
    a single launch, which is the fastest way."""
    import drjit as dr
    import mitsuba as mi

    def estimate(samples: int, seed: int) -> Estimate:
        columns = []
        for sensor in scene.sensors():
            faces, (width, height) = sensor.faces, sensor.block
            # Kept out of the kernel, which would otherwise be recompiled for each seed.
            number = dr.opaque(mi.UInt32, seed)
            with _errors_alone():  # samplers report each count that they round up
                image = mi.render(scene, sensor=sensor, spp=max(1, samples // (width * height)), seed=number)
            blocks = np.asarray(image, dtype=float)[:, :, 0].reshape(faces.rows, height, faces.columns, width)
            columns.append(blocks.mean(axis=(1, 3)).ravel() * faces.area[0])
        power = np.concatenate(columns)
        return Estimate(power, np.full_like(power, math.nan))

    return estimate


@contextmanager
def _errors_alone() -> Iterator[None]:
    """Context manager: Mitsuba logs errors only."""
    import mitsuba as mi

    level = mi.log_level()
    mi.set_log_level(mi.LogLevel.Error)
    try:
        yield
    finally:
        mi.set_log_level(level)


def _variant(method: Method, scene: Scene, folder: Path) -> Scene:
    """Write a scene with the integrator and sampler of a method, and with the scene's own limit of reflections."""
    # Read the limits of the scene's integrators, and remove these.
    file = folder / "scene.xml"
    scene.write_xml(file)
    root = ElementTree.parse(file).getroot()
    values = {f"${name}": value for name, value in Scene(file).parameters.items()}
    reflections, roulette = -1, None
    for integrator_element in root.findall("integrator"):
        settings = {value.get("name"): value.get("value", "") for value in integrator_element.findall("integer")}
        numbers = {name: int(values.get(word, word)) for name, word in settings.items()}
        reflections, roulette = numbers.get("max_depth", -1), numbers.get("rr_depth")
        if integrator_element.get("type") not in _OURS and reflections > 0:
            reflections -= 1  # Mitsuba counts edges of a path, from the LED to the first wall on
        root.remove(integrator_element)
    if reflections >= 0 and method.integrator == "analog_tracer":
        raise InputError(
            "analog_tracer follows each ray to its end, but the scene's integrator limits the number of reflections: "
            "remove its max_depth to compare."
        )
    # Add the integrator of the method.
    integrator = ElementTree.Element("integrator", type=method.integrator)
    if method.integrator == "taxel_tracer":
        ElementTree.SubElement(integrator, "string", name="strategy", value=method.strategy)
    if method.integrator != "analog_tracer":
        depth = reflections if method.is_ours or reflections < 0 else reflections + 1
        ElementTree.SubElement(integrator, "integer", name="max_depth", value=str(depth))
        if roulette is not None:
            ElementTree.SubElement(integrator, "integer", name="rr_depth", value=str(roulette))
    root.append(integrator)
    # Replace the samplers, and remove defaults that are no longer used.
    for sensor in root.iter("sensor"):
        for sampler in sensor.findall("sampler"):
            sensor.remove(sampler)
        ElementTree.SubElement(sensor, "sampler", type=method.sampler)
    used = set().union(*(used_by(element.attrib) for element in root.iter()))
    for default in root.findall("default"):
        if default.get("name") not in used:
            root.remove(default)
    ElementTree.ElementTree(root).write(file)
    return Scene.from_file(file)
