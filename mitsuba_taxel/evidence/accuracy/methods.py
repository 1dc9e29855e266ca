"""The compared light-transport methods: this project's integrators and Mitsuba's own."""

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
"""Largest share of a reading from other LEDs than the taxel's own, for integrators that light all of them."""
_STRAY_POINTS = 256
_RAYS = 1 << 12
MOST_LANES = 1 << 25
"""Paths per launch of Mitsuba's integrators."""


class Estimate(NamedTuple):
    """(T,) power of each taxel in W, and the standard error stated by the method, NaN if it has none."""

    power: np.ndarray
    stated: np.ndarray


Estimator = Callable[[int, int], Estimate]
"""(samples for each taxel, seed) -> estimate."""


@dataclass(frozen=True)
class Method:
    """An integrator with its sampler; ``strategy`` is that of `taxel_tracer`, of which only ``all`` includes all
    light."""

    integrator: str
    sampler: str = "owen_sobol"
    strategy: str = "all"

    @property
    def is_ours(self) -> bool:
        """Whether the integrator is one of this project's, which read each taxel with its own LED."""
        return self.integrator in _OURS

    @property
    def name(self) -> str:
        if self.is_ours:
            return self.integrator if self.strategy == "all" else f"{self.integrator} {self.strategy}"
        return f"{self.integrator} ({self.sampler})"

    @property
    def most_samples(self) -> int:
        """Per taxel in one run: limit of the sampler's points, or of memory."""
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
    """A method on a scene that stays loaded.

    Parameters
    ----------
    folder : Path
        For the scene's variant as a file.
    stray : float
        See :func:`stray_light`.

    Raises
    ------
    InputError
        if the method does not support the scene; the message gives the reason.
    """
    if not method.is_ours and not stray <= LARGEST_STRAY:
        share = "an unknown share" if math.isnan(stray) else f"{stray:.1%}"
        raise InputError(f"it lights all LEDs at once, and {share} of a reading would be of other taxels.")
    ready = prepare(_variant(method, scene, folder))
    if method.is_ours:
        return of_readings(ready)
    set_wavelength(ready.scene, ready.scene.emitters())
    return _stock(ready.scene)


def stray_light(scene: Scene) -> float:
    """Largest share of a taxel's reading that LEDs of other taxels would add; NaN if unknown."""
    try:
        power = crosstalk(scene, points=_STRAY_POINTS).power
    except InputError:
        return math.nan
    own = power.diagonal()
    lit = own > 0
    return float(np.max((power.sum(axis=0) - own)[lit] / own[lit], initial=0.0))


def is_bounded(scene: Scene) -> bool:
    """Whether paths from the phototransistor have bounded weights."""
    return all(map(is_bounded_from_detector, walls_of(prepare(scene).scene)))


def offset_share(scene: Scene) -> float:
    """Approximate relative error of readings by Mitsuba's integrators due to the offset of ray origins.

    The offset is 9e-5 (1 + max |p|) from a surface at p (:func:`mitsuba_taxel.kernels.paths.ray_offsets.leave`), here
    relative to the median distance from a phototransistor to the first wall.
    """
    import mitsuba as mi

    live = prepare(scene).scene
    sensor = live.sensors()[0]
    random = mi.PCG32(_RAYS)
    position, direction = (mi.Point2f(random.next_float32(), random.next_float32()) for _ in range(2))
    si = live.ray_intersect(sensor.sample_ray(0, 0, position, direction)[0])
    distance, hit = np.array(si.t), np.isfinite(np.array(si.t))
    if not hit.any():
        return 0.0
    furthest = np.abs(np.array(si.p)[:, hit]).max()
    return float(9e-5 * (1 + furthest) / np.median(distance[hit]))


def of_readings(ready: Prepared) -> Estimator:
    """Readings of a prepared scene by random paths of its own integrator."""

    def estimate(samples: int, seed: int) -> Estimate:
        points = max(1, samples // REPLICATES)
        readings = measure(ready, points=points, seed=seed, mechanics_error=False)
        return Estimate(readings.power, readings.standard_error)

    return estimate


def _stock(live: Any) -> Estimator:
    """One launch per run, which is the cheapest for these integrators; they state no error."""
    import drjit as dr
    import mitsuba as mi

    def estimate(samples: int, seed: int) -> Estimate:
        columns = []
        for sensor in live.sensors():
            faces, (width, height) = sensor.faces, sensor.block
            # Kept out of the kernel, which would otherwise be recompiled for each seed.
            number = dr.opaque(mi.UInt32, seed)
            with _errors_alone():  # samplers report each count that they round up
                image = mi.render(live, sensor=sensor, spp=max(1, samples // (width * height)), seed=number)
            blocks = np.asarray(image, dtype=float)[:, :, 0].reshape(faces.rows, height, faces.columns, width)
            columns.append(blocks.mean(axis=(1, 3)).ravel() * faces.area[0])
        power = np.concatenate(columns)
        return Estimate(power, np.full_like(power, math.nan))

    return estimate


@contextmanager
def _errors_alone() -> Iterator[None]:
    """Let Mitsuba log errors only."""
    import mitsuba as mi

    before = mi.log_level()
    mi.set_log_level(mi.LogLevel.Error)
    try:
        yield
    finally:
        mi.set_log_level(before)


def _variant(method: Method, scene: Scene, folder: Path) -> Scene:
    """The scene with a method's integrator, limited to as many reflections as its own, and sampler."""
    file = folder / "scene.xml"
    scene.write_xml(file)
    root = ElementTree.parse(file).getroot()
    stated = {f"${name}": value for name, value in Scene(file).parameters.items()}
    reflections, roulette = -1, None
    for old in root.findall("integrator"):
        words = {value.get("name"): value.get("value", "") for value in old.findall("integer")}
        values = {name: int(stated.get(word, word)) for name, word in words.items()}
        reflections, roulette = values.get("max_depth", -1), values.get("rr_depth")
        if old.get("type") not in _OURS and reflections > 0:
            reflections -= 1  # Mitsuba counts edges of a path, from the LED to the first wall on
        root.remove(old)
    if reflections >= 0 and method.integrator == "analog_tracer":
        raise InputError("it follows each ray to its end, and the scene's integrator limits the reflections.")
    integrator = ElementTree.Element("integrator", type=method.integrator)
    if method.integrator == "taxel_tracer":
        ElementTree.SubElement(integrator, "string", name="strategy", value=method.strategy)
    if method.integrator != "analog_tracer":
        depth = reflections if method.is_ours or reflections < 0 else reflections + 1
        ElementTree.SubElement(integrator, "integer", name="max_depth", value=str(depth))
        if roulette is not None:
            ElementTree.SubElement(integrator, "integer", name="rr_depth", value=str(roulette))
    root.append(integrator)
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
