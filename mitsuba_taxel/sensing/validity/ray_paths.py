"""Analog light paths, which are reflected or absorbed as photons are: tracing from wall to wall, and samples for
pictures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from numbers import Integral
from typing import NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsuba_taxel.backend import in_turn
from mitsuba_taxel.backend.plugin_objects import make_plugin
from mitsuba_taxel.base.arguments import check_whole
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.kernels.paths.ray_offsets import clearance_of, leave, release
from mitsuba_taxel.kernels.taxel_pair import TaxelPair
from mitsuba_taxel.kernels.walls import set_wavelength
from mitsuba_taxel.sensing.scene.taxels import taxels_of
from mitsuba_taxel.sensing.validity.shared_places import refuse_shared_places

MOST_VERTICES = 64
"""Largest number of vertices of a sampled path, its start included."""
MOST_PATHS = 100_000
"""Largest number of paths that :func:`sample_paths` returns."""
_BATCH = 1 << 14
_MOST_BATCHES = 64


class PathStep(NamedTuple):
    """One step of many light paths, to the next surface or out of the scene. Each array has an entry for each path.

    ``active`` marks paths that have not ended, and ``hit`` marks active paths that hit a surface. ``depth`` is the
    number of earlier reflections. The power ``power`` in W arrives along ``ray``, and the power ``onward`` in W is
    reflected. ``weight`` is the reflected fraction that the BSDF predicts.
    """

    depth: mi.UInt32
    ray: mi.Ray3f
    si: mi.SurfaceInteraction3f
    active: mi.Bool
    hit: mi.Bool
    power: mi.Float
    onward: mi.Float
    weight: mi.Float


def emit(
    scene: mi.Scene, pair: TaxelPair, index: mi.UInt32, sampler: mi.Sampler
) -> tuple[mi.Point3f, mi.Ray3f, mi.Float]:
    """Sample random rays of light from the LEDs of an array.

    Parameters
    ----------
    scene : mi.Scene
        A loaded scene.
    pair : TaxelPair
        The array of LEDs.
    index : mi.UInt32
        Index of the LED of each ray, from 0.
    sampler : mi.Sampler
        Source of random numbers.

    Returns
    -------
    position : mi.Point3f
        Position where each ray leaves its package, in mm.
    ray : mi.Ray3f
        Ray from this position, in the direction of the light.
    passed : mi.Float
        Fraction of the ray's power that leaves the package.
    """
    source = pair.led.sample_point(index, sampler.next_2d())
    direction = pair.led.sample_direction_of_emission(sampler.next_2d())
    position, passed = pair.led.leave(index, source, direction)
    return position, release(position, pair.led.faces.frame.n, direction, clearance_of(scene, pair)), passed


@dr.syntax
def follow(
    scene: mi.Scene,
    ray: mi.Ray3f,
    power: mi.Float,
    clearance: mi.Float,
    sampler: mi.Sampler,
    most_reflections: int,
    weighted: int,
    visit: Callable[[PathStep], None],
) -> None:
    """Trace light paths from wall to wall, and call a function at each step.

    At the first ``weighted`` reflections, the power of a path is multiplied by the reflected fraction. At later
    reflections, the path is reflected with its whole power or ends, with the reflected fraction as probability (Russian
    roulette). This preserves the expected power at each surface.

    Parameters
    ----------
    scene : mi.Scene
        A loaded scene.
    ray : mi.Ray3f
        First ray of each path.
    power : mi.Float
        Power of each path, in W.
    clearance : mi.Float
        Offset of the starts of rays from surfaces, in mm.
    sampler : mi.Sampler
        Source of random numbers.
    most_reflections : int
        Number of reflections after which a path ends; its last ``onward`` power is lost.
    weighted : int
        Number of first reflections that reduce the power of the path.
    visit : Callable[[PathStep], None]
        Called at each step with the state of all paths.
    """
    context = mi.BSDFContext(mi.TransportMode.Importance)
    depth = mi.UInt32(0)
    limit = dr.opaque(mi.UInt32, most_reflections)
    first_random = dr.opaque(mi.UInt32, weighted)
    active = power > 0
    while active:
        si = scene.ray_intersect(ray, active)
        hit = active & si.is_valid()
        bs, weights = si.bsdf(ray).sample(context, si, sampler.next_1d(hit), sampler.next_2d(hit), hit)
        weight = dr.select(hit, weights[0], 0)
        survival = dr.select(depth < first_random, 1, dr.minimum(weight, 1))
        reflected = (weight > 0) & (sampler.next_1d(hit) < survival)
        onward = dr.select(reflected, power * weight / survival, 0)
        visit(PathStep(depth, ray, si, active, hit, power, onward, weight))
        active &= reflected & (depth < limit)
        ray = leave(si.p, si.n, si.to_world(bs.wo), clearance)
        power = mi.Float(onward)
        depth += 1


def landed(pair: TaxelPair, step: PathStep) -> tuple[mi.Bool, mi.UInt32]:
    """Mask of the paths that hit the front of a phototransistor in this step, and the phototransistors' numbers.

    Parameters
    ----------
    pair : TaxelPair
        The arrays of LEDs and phototransistors.
    step : PathStep
        Present step of the paths.

    Returns
    -------
    hit : mi.Bool
        Mask of the paths that hit a phototransistor.
    index : mi.UInt32
        Index of the nearest phototransistor, from 0.
    """
    nearest, _ = pair.sensor.window.faces.locate(step.si.p)
    inside, _ = pair.sensor.contains(nearest, step.si.p, step.ray.d)
    in_front = dr.dot(step.ray.d, pair.sensor.normal) < 0
    return step.hit & (step.si.shape == mi.ShapePtr(pair.sensor.get_shape())) & inside & in_front, nearest


@dataclass(frozen=True)
class RayPaths:
    """A sample of N light paths from the LED of one taxel.

    Attributes
    ----------
    vertices : list of ndarray
        For each path, the positions (V, 3) in mm of its V vertices, from 2 to 64: the LED or its window, each
        reflection, and the end of the path. A path that escapes ends shortly after its last reflection. Light that does
        not leave a package has no path.
    reached : (N,) ndarray
        Mask of the paths that reached the taxel's own phototransistor.
    power : (N,) ndarray
        Power in W that each path represents.
    taxel : int
        Number of the taxel, from 1.
    drawn, arrived : int
        Number of paths traced for this sample, and number of traced paths that reached the phototransistor.
    """

    vertices: list[np.ndarray]
    reached: np.ndarray
    power: np.ndarray
    taxel: int
    drawn: int
    arrived: int


@in_turn
def sample_paths(
    scene: mi.Scene,
    taxel: int,
    *,
    count: int = 200,
    seed: int = 0,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> RayPaths:
    """Sample light paths from a taxel's LED for a picture. If possible, half of them reach its phototransistor.

    At each wall, a path is reflected with the wall's reflectance as probability, else absorbed. Each path therefore
    represents the same power: that of the LED divided by the number of traced paths. Up to 1048576 paths are traced to
    find enough paths that reach the phototransistor.

    Parameters
    ----------
    scene : mi.Scene
        A loaded ``mi.Scene``.
    taxel : int
        Number of the taxel, from 1.
    count : int
        Number of paths to return, 1 to 100000. If too few reach the phototransistor, other paths complete the number.
    seed : int
        Whole number from 0 to 2**32 - 1.
    progress : Callable[[int, int], None]
        Called with two numbers of paths that reach the phototransistor: those found so far, and those needed.

    Returns
    -------
    RayPaths
        Vertices in mm, and the power of each path in W.

    Raises
    ------
    InputError
        if a value is not allowed, or the scene has no `annular_led` and `phototransistor`.
    """
    check_whole("count", count, 1, MOST_PATHS)
    pair, index = find_taxel(scene, taxel)
    set_wavelength(scene, [pair.led])
    needed = max(1, count // 2)
    hits: list[np.ndarray] = []
    misses: list[np.ndarray] = []
    arrived = batch = 0
    while batch < _MOST_BATCHES and len(hits) < needed:
        vertices, reached = _draw(scene, pair, index, int(np.random.SeedSequence([seed, batch]).generate_state(1)[0]))
        arrived += int(reached.sum())
        hits += [vertices[i] for i in np.flatnonzero(reached)[: needed - len(hits)]]
        misses += [vertices[i] for i in np.flatnonzero(~reached)[: count - len(misses)]]
        batch += 1
        progress(len(hits), needed)
    misses = misses[: count - len(hits)]
    drawn = batch * _BATCH
    power = np.full(len(hits) + len(misses), pair.led.power[0] / drawn)
    return RayPaths(hits + misses, np.arange(len(power)) < len(hits), power, taxel, drawn, arrived)


def find_taxel(scene: mi.Scene, taxel: int) -> tuple[TaxelPair, int]:
    """Find the pair of arrays that holds a taxel, and the index of the taxel in them.

    Parameters
    ----------
    scene : mi.Scene
        A loaded scene.
    taxel : int
        Number of the taxel, from 1.

    Returns
    -------
    pair : TaxelPair
        The arrays of LEDs and phototransistors.
    index : int
        Index of the taxel in the arrays, from 0.

    Raises
    ------
    InputError
        if there is no such taxel.
    """
    refuse_shared_places(scene)
    pairs = taxels_of(scene)
    total = sum(pair.count for pair in pairs)
    if not (isinstance(taxel, Integral) and 1 <= taxel <= total):
        allowed = f"a whole number from 1 to {total} is needed" if total > 1 else "1 is needed, as there is no other"
        raise InputError(f"taxel = {taxel} is not allowed: {allowed}.")
    index = int(taxel) - 1
    for pair in pairs:
        if index < pair.count:
            break
        index -= pair.count
    return pair, index


def _draw(scene: mi.Scene, pair: TaxelPair, index: int, seed: int) -> tuple[list[np.ndarray], np.ndarray]:
    """Trace a batch of paths. Returns the vertices of each path that leaves the LED's package, and whether it reaches
    the phototransistor."""
    sampler = make_plugin("independent")
    sampler.seed(seed, _BATCH)
    lane = dr.arange(mi.UInt32, _BATCH)
    positions = dr.zeros(mi.Float, 3 * MOST_VERTICES * _BATCH)
    counts, reached = dr.ones(mi.UInt32, _BATCH), dr.zeros(mi.UInt32, _BATCH)
    dr.make_opaque(positions, counts, reached)
    distance = pair.led.faces.centres - pair.sensor.faces.centres
    stub = dr.gather(mi.Float, dr.norm(distance), dr.opaque(mi.UInt32, index))

    def record(step: PathStep) -> None:
        end = dr.select(step.hit, step.si.p, step.ray(stub))
        dr.scatter(positions, end, lane * MOST_VERTICES + step.depth + 1, step.active)
        dr.scatter(counts, step.depth + 2, lane, step.active)
        here, nearest = landed(pair, step)
        dr.scatter(reached, mi.UInt32(1), lane, step.active & here & (nearest == index))

    source, ray, passed = emit(scene, pair, dr.opaque(mi.UInt32, index, _BATCH), sampler)
    dr.scatter(positions, source, lane * MOST_VERTICES)
    leaves = mi.Bool(True)
    if pair.is_below_windows:
        leaves = sampler.next_1d() < passed
    power = dr.select(leaves, 1, 0) + dr.zeros(mi.Float, _BATCH)
    follow(scene, ray, power, clearance_of(scene, pair), sampler, MOST_VERTICES - 2, 0, record)
    table = positions.numpy().reshape(_BATCH, MOST_VERTICES, 3)
    lengths = counts.numpy()
    complete = np.flatnonzero(lengths > 1)
    return [table[i, : lengths[i]].astype(float) for i in complete], reached.numpy()[complete] > 0
