"""The image of a camera below a pad without cells, with its standard error and the depth at each pixel.

Light is traced by Mitsuba's integrators. Independent replicates give the standard error.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mitsuba_taxel.backend import in_turn
from mitsuba_taxel.backend.plugin_objects import kind_of
from mitsuba_taxel.base.arguments import check_seed, check_whole, is_number
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.kernels.paths.taxel_integrators import traces_taxels
from mitsuba_taxel.kernels.protocols import is_led, is_pad, is_phototransistor
from mitsuba_taxel.pads.regions import REGIONS
from mitsuba_taxel.sensing.scene.description import Scene
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads

if TYPE_CHECKING:
    import mitsuba as mi

SAMPLES, REPLICATES = 16, 16
"""Default number of samples per pixel and replicate, and number of replicates."""
MOST_SAMPLES = 2**20
"""Largest number of samples per pixel and replicate."""
BYTES_PER_SAMPLE = 400
"""Memory in bytes per traced path, measured with scenes of a few plugins."""
BYTES_PER_PIXEL = 2 * 8 * 3 * REPLICATES
"""Memory in bytes per pixel for the images of all replicates, and their copy."""
PATHS_AT_ONCE = 2**21
"""Largest number of paths traced at the same time, unless an image has more pixels."""
MOST_SURFACES = 16
"""Largest number of clear surfaces through which the depth is measured."""


@dataclass(frozen=True, eq=False)
class CameraImage:
    """An image of a camera, H pixels high and W wide, with C colour channels.

    Attributes
    ----------
    radiance : (H, W, C) ndarray
        Mean radiance of the replicates, in the units of the scene's lights. The channels are red, green and blue, or a
        single one.
    standard_error : (H, W, C) ndarray
        Standard error of the radiance, 1 sigma.
    depth : (H, W) ndarray
        Distance in mm, along the axis of the camera, from its plane to the first surface that is not clear, at the
        centre of each pixel; NaN without such a surface.
    coat : (H, W) ndarray of bool
        Whether that surface is the coat: the top of a pad without cells, seen from inside.
    samples : int
        Number of samples (light paths) per pixel and replicate.
    replicates : int
        Number of independent replicates.
    seed : int
        Seed of the random numbers.
    seconds : float
        Time of tracing light, in s.
    """

    radiance: np.ndarray
    standard_error: np.ndarray
    depth: np.ndarray
    coat: np.ndarray
    samples: int
    replicates: int
    seed: int
    seconds: float

    @property
    def relative_error(self) -> float:
        """Root mean square, over all pixels that show the coat and are not black, of the standard error relative to the
        radiance."""
        mean, error = self.radiance[self.coat], self.standard_error[self.coat]
        bright = mean > 0
        return float(np.sqrt(np.square(error[bright] / mean[bright]).mean())) if bright.any() else math.nan


@in_turn
def camera_image(
    scene: Scene | mi.Scene,
    *,
    samples: int | None = None,
    target_error: float | None = None,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> CameraImage:
    """Render the image of a scene's camera with Mitsuba's integrator, and estimate its standard error.

    Parameters
    ----------
    scene : Scene or mi.Scene
        Scene with one camera, lights of Mitsuba, an integrator of Mitsuba, and a pad without cells.
    samples : int, optional
        Number of samples per pixel and replicate, rounded up to a power of four; by default `SAMPLES`.
    target_error : float, optional
        Instead of samples, the target for `CameraImage.relative_error`. The number of samples follows from a pilot
        image, which is not part of the result.
    seed : int
        Seed of the random numbers, from 0 to 2**32 - 1.
    progress : Callable[[int, int], None], optional
        Called with (replicates done, all replicates).

    Returns
    -------
    CameraImage
        Mean of `REPLICATES` independent replicates, with its standard error.

    Raises
    ------
    InputError
        if a value is not allowed; if the scene has no camera or several cameras, no light, an integrator or lights for
        photo-reflectors, or an image larger than memory; or if the camera does not see the coat of a pad.
    """
    check_seed(seed)
    if samples is not None and target_error is not None:
        raise InputError("target_error and points exclude each other: give one of them.")
    if samples is not None:
        check_whole("points", samples, 1, MOST_SAMPLES)
    if target_error is not None and not (is_number(target_error) and 0 < target_error < 1):
        raise InputError(f"target_error = {target_error!r} is not allowed: a number between 0 and 1 is needed.")
    live = scene.load() if isinstance(scene, Scene) else scene
    camera, depth, coat = view_of(live)
    began = time.perf_counter()
    count = power_of_four(samples or SAMPLES)
    image = _replicates(live, camera, count, seed, 0, progress)
    if target_error is not None:
        pilot = CameraImage(*image, depth, coat, count, REPLICATES, seed, 0.0)
        error = pilot.relative_error
        if error > target_error:
            count = min(power_of_four(math.ceil(count * (error / target_error) ** 2)), MOST_SAMPLES)
            image = _replicates(live, camera, count, seed, 1, progress)
    return CameraImage(*image, depth, coat, count, REPLICATES, seed, time.perf_counter() - began)


def view_of(scene: mi.Scene) -> tuple[mi.Sensor, np.ndarray, np.ndarray]:
    """The camera of a scene, the depth at the centre of each pixel, and which pixels show the coat; nothing is
    rendered.

    Parameters
    ----------
    scene : mi.Scene
        Loaded scene.

    Returns
    -------
    camera : mi.Sensor
        The scene's only sensor.
    depth : (H, W) ndarray
        Distance in mm along the camera's axis to the first surface at each pixel, as in `CameraImage`.
    coat : (H, W) ndarray of bool
        Whether that surface is the coat of a pad without cells, as in `CameraImage`.

    Raises
    ------
    InputError
        if the scene's image cannot be computed; see :func:`camera_image`.
    """
    camera = _camera_of(scene)
    _refuse_large(camera)
    return camera, *_depth(scene, camera)


def _camera_of(scene: mi.Scene) -> mi.Sensor:
    """The only camera of a scene whose image can be computed; raises `InputError`."""
    cameras = [sensor for sensor in scene.sensors() if not is_phototransistor(sensor)]
    if len(cameras) != 1 or len(scene.sensors()) != 1:
        raise InputError(
            f"the scene holds {len(cameras)} cameras and {len(scene.sensors()) - len(cameras)} phototransistors: a "
            "single camera is needed for an image."
        )
    integrator = scene.integrator()
    if integrator is None or traces_taxels(integrator):
        raise InputError(
            f"integrator {kind_of(integrator)} reads phototransistors, and makes no image of a camera: use one of "
            "Mitsuba's own, such as path.",
            integrator,
        )
    if integrator.aov_names():
        raise InputError(f"integrator {kind_of(integrator)} is not allowed: it renders no colours; use path.")
    if not scene.emitters():
        raise InputError("the scene holds no light: at least one emitter is needed.")
    for emitter in filter(is_led, scene.emitters()):
        raise InputError(f"{kind_of(emitter)} is not modelled for cameras: use area, spot or point.", emitter)
    return cameras[0]


def _refuse_large(camera: mi.Sensor) -> None:
    """Raise for a film whose image does not fit into the free memory."""
    from mitsuba_taxel.mechanics.elements.memory import free_memory

    width, height = map(int, camera.film().crop_size())
    needed, free = float(width) * height * (BYTES_PER_SAMPLE + BYTES_PER_PIXEL), free_memory()
    if needed > free:
        raise InputError(
            f"width = {width}, height = {height} of the film are not allowed: the image needs "
            f"{needed / 2**30:.3g} GiB, and {free / 2**30:.3g} GiB are free. Make it smaller."
        )


def _replicates(
    scene: mi.Scene,
    camera: mi.Sensor,
    samples: int,
    seed: int,
    run: int,
    progress: Callable[[int, int], None] | None,
) -> tuple[np.ndarray, np.ndarray]:
    """Mean and standard error (H, W, C) of independent images; their seeds are derived from ``seed`` and ``run``."""
    import mitsuba as mi

    width, height = map(int, camera.film().crop_size())
    # Parts of a power of four: `ldsampler` and `multijitter` would round other numbers.
    at_once = min(samples, power_of_four(1 + max(1, PATHS_AT_ONCE // (width * height))) // 4)
    parts = samples // at_once
    seeds = np.random.SeedSequence([seed, run]).generate_state(REPLICATES * parts).reshape(REPLICATES, parts)
    images = []
    for done, own_seeds in enumerate(seeds.tolist(), start=1):
        image = np.zeros(1)
        for own_seed in own_seeds:
            image = image + np.array(mi.render(scene, sensor=camera, spp=at_once, seed=own_seed), dtype=float) / parts
        images.append(image)
        if progress is not None:
            progress(done, REPLICATES)
    stack = np.stack(images)[..., : 3 if images[0].shape[-1] > 3 else None]
    if not np.isfinite(stack).all():
        raise InputError("the image is not finite: check the units of sizes (mm) and powers in the scene.")
    return stack.mean(axis=0), stack.std(axis=0, ddof=1) / math.sqrt(REPLICATES)


def power_of_four(count: int) -> int:
    """The least power of four that is at least ``count``.

    Parameters
    ----------
    count : int
        Any number above 0.

    Returns
    -------
    int
        The power.
    """
    return 4 ** (((count - 1).bit_length() + 1) // 2)


def _depth(scene: mi.Scene, camera: mi.Sensor) -> tuple[np.ndarray, np.ndarray]:
    """Depth (H, W) in mm at the centre of each pixel, and mask (H, W) of the pixels that show the coat.

    Rays pass through surfaces that only transmit light, and are refracted there. `InputError` is raised if no pixel
    shows the coat."""
    import drjit as dr
    import mitsuba as mi

    film = camera.film()
    width, height = map(int, film.crop_size())
    pixel = dr.arange(mi.UInt32, width * height)
    place = (mi.Point2f(mi.Float(pixel % width), mi.Float(pixel // width)) + 0.5) / mi.Vector2f(width, height)
    ray, _ = camera.sample_ray(0.0, 0.5, place, mi.Point2f(0.5, 0.5))
    context, going = mi.BSDFContext(), mi.Mask(True)
    context.type_mask = mi.BSDFFlags.Null | mi.BSDFFlags.DeltaTransmission
    hit = scene.ray_intersect(ray)
    for _ in range(MOST_SURFACES):
        going &= hit.is_valid()
        sample, weight = hit.bsdf().sample(context, hit, 0.5, mi.Point2f(0.5, 0.5), going)
        passes = mi.has_flag(sample.sampled_type, mi.BSDFFlags.Null)
        passes |= mi.has_flag(sample.sampled_type, mi.BSDFFlags.DeltaTransmission)
        going &= passes & (dr.max(weight) > 0)
        if not dr.any(going):
            break
        ray = dr.select(going, hit.spawn_ray(hit.to_world(sample.wo)), ray)
        beyond = scene.ray_intersect(ray, going)
        hit = dr.select(going, beyond, hit)
    in_camera = camera.world_transform().inverse() @ hit.p
    seen = np.array(hit.is_valid())
    depth = np.where(seen, np.array(in_camera.z, dtype=float), math.nan)
    on_pad, on_coat = np.zeros(width * height, dtype=bool), np.zeros(width * height, dtype=bool)
    for pad in deformed_pads(scene):
        is_hit = seen & np.array(hit.shape == mi.ShapePtr(pad))
        code = np.rint(np.array(pad.eval_attribute_1("face_region", hit, mi.Mask(is_hit))))
        on_pad |= is_hit
        on_coat |= is_hit & (code == REGIONS["top"]) & (np.array(mi.Frame3f.cos_theta(hit.wi)) < 0)
    if not any(map(is_pad, scene.shapes())):
        raise InputError("the scene holds no deformable_pad: a camera needs one, with cell = 'none'.")
    if not on_pad.any():
        raise InputError("the camera sees nothing of the pad: turn it towards the pad, or take away what hides it.")
    if not on_coat.any():
        raise InputError(
            "the camera does not see the coat (the top of the pad, from inside): place the camera below the pad, and "
            "give the window (region bottom) the BSDF null."
        )
    _, weight = hit.bsdf().sample(mi.BSDFContext(), hit, 0.5, mi.Point2f(0.5, 0.5), mi.Mask(on_coat))
    if not (np.array(dr.max(weight)) * on_coat > 0).any():
        raise InputError(
            "the coat reflects nothing to the inside: the BSDF of region top must reflect there, as twosided does."
        )
    return depth.reshape(height, width), on_coat.reshape(height, width)
