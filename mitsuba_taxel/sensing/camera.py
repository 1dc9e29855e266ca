"""The image of a camera below a pad without cells, with its standard error and the depth at each pixel.

Light is traced by Mitsuba's integrators. Independent replicates give the standard error.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mitsuba_taxel.backend import in_turn
from mitsuba_taxel.base.arguments import check_flags, check_seed, check_whole, is_number
from mitsuba_taxel.base.convergence import COARSENING, LOCAL_ORDER
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.kernels.protocols import PadShape
from mitsuba_taxel.pads.regions import REGIONS
from mitsuba_taxel.sensing.camera_view import REPLICATES, View, refuse_unseen, view_of
from mitsuba_taxel.sensing.marker_flow import MarkerFlow, has_markers, marker_flow
from mitsuba_taxel.sensing.reading.mechanics_error import mechanics_deviations, moved
from mitsuba_taxel.sensing.scene.description import Scene
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads, loaded_pads

if TYPE_CHECKING:
    import mitsuba as mi

SAMPLES = 16
"""Default number of samples per pixel and replicate."""
MOST_SAMPLES = 2**20
"""Largest number of samples per pixel and replicate."""
PATHS_AT_ONCE = 2**21
"""Largest number of paths traced at the same time, unless an image has more pixels."""
RELATIVE_ERRORS = "relative_error", "relative_mechanics_error", "relative_total_error"
"""Names of the errors of a `CameraImage` that summarise its pixels."""
ERROR_REPLICATES = 4
"""Number of replicates whose light is traced again for the error of the finite elements."""
MECHANICS_SHARE = 0.95
"""Largest part of a target for the total error that the error of the finite elements may take. Nearer to the target,
almost unlimited samples would be needed for the rest."""
UNTOUCHED = "the indenter does not touch the pad: place it above the pad (indenter_x, indenter_y), or press it deeper"
"""Note on an image without a print."""
SLOPE_SHARE = 1 / (COARSENING**LOCAL_ORDER - 1)
"""Error of a pixel by the finite elements, relative to its change on elements of twice the size: images show the slope
of the coat, which is a gradient."""


@dataclass(frozen=True, eq=False)
class CameraImage:
    """An image of a camera, H pixels high and W wide, with C colour channels.

    Attributes
    ----------
    radiance : (H, W, C) ndarray
        Mean radiance of the replicates, in the units of the scene's lights. The channels are red, green and blue, or a
        single one.
    standard_error : (H, W, C) ndarray
        Standard error of the radiance by the light, 1 sigma.
    mechanics_error : (H, W, C) ndarray
        Error of the radiance, 1 sigma, by the finite elements of loaded pads; NaN if unknown. The difference to
        unloaded pads has the same error.
    depth : (H, W) ndarray
        Distance in mm, along the axis of the camera, from its plane to the first surface that is not clear, at the
        centre of each pixel; NaN without such a surface.
    coat : (H, W) ndarray of bool
        Whether that surface is the coat: the top of a pad without cells, seen from inside.
    displacement : (H, W, 3) ndarray
        Displacement of the coat by the load, in mm along x, y and z of the scene, at the centre of each pixel; NaN in
        other pixels.
    contact_pressure : (H, W) ndarray or None
        Contact pressure of an indenter on the coat, at the centre of each pixel: force in MPa per area of the unloaded
        coat. NaN in other pixels; None without an indenter that touches.
    samples : int
        Number of samples (light paths) per pixel and replicate.
    replicates : int
        Number of independent replicates.
    seed : int
        Seed of the random numbers.
    seconds : float
        Time of tracing light, in s.
    difference : (H, W, C) ndarray or None
        Radiance minus that of the same scene with unloaded pads, if requested. Both have the same random numbers.
    difference_error : (H, W, C) ndarray or None
        Standard error of the difference, 1 sigma.
    markers : MarkerFlow or None
        Flow of the markers on the coat; None without markers.
    notes : tuple of str
        Remarks, such as on an indenter that does not touch the pad.
    """

    radiance: np.ndarray
    standard_error: np.ndarray
    mechanics_error: np.ndarray
    depth: np.ndarray
    coat: np.ndarray
    displacement: np.ndarray
    contact_pressure: np.ndarray | None
    samples: int
    replicates: int
    seed: int
    seconds: float
    difference: np.ndarray | None = None
    difference_error: np.ndarray | None = None
    markers: MarkerFlow | None = None
    notes: tuple[str, ...] = ()

    @property
    def relative_error(self) -> float:
        """Relative error of the image by the light: the root mean square over all pixels that show the coat and are not
        black.

        For a pixel, it is the norm of the standard errors of its colours, relative to the norm of its colours, because
        a pixel may be dark in one colour.
        """
        return _relative_error(self.radiance, self.standard_error, self.coat)

    @property
    def relative_mechanics_error(self) -> float:
        """Relative error of the image by the finite elements, averaged as in :attr:`relative_error`; NaN if unknown."""
        return _relative_error(self.radiance, self.mechanics_error, self.coat)

    @property
    def relative_total_error(self) -> float:
        """Relative error of the image by light and finite elements together, averaged as in :attr:`relative_error`; NaN
        if one of them is unknown.
        """
        return math.hypot(self.relative_error, self.relative_mechanics_error)


@in_turn
def camera_image(
    scene: Scene | mi.Scene,
    *,
    samples: int | None = None,
    target_error: float | None = None,
    seed: int = 0,
    difference: bool = False,
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
        Instead of samples, the target for `CameraImage.relative_total_error`. The number of samples follows from a
        pilot image, which is not part of the result. If the error by the finite elements alone is above 95 % of the
        target, or unknown, the target applies to the error by the light: for the rest of it, almost unlimited samples
        would be needed.
    seed : int
        Seed of the random numbers, from 0 to 2**32 - 1.
    difference : bool
        Whether the difference to the image with unloaded pads is computed too, which doubles the time of the light.
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
        photo-reflectors, or an image larger than memory; or if the camera does not see the coat of a pad, or no light
        reaches it.
    """
    check_seed(seed)
    if samples is not None and target_error is not None:
        raise InputError("target_error and points exclude each other: give one of them.")
    if samples is not None:
        check_whole("points", samples, 1, MOST_SAMPLES)
    if target_error is not None and not (is_number(target_error) and 0 < target_error < 1):
        raise InputError(f"target_error = {target_error!r} is not allowed: a number between 0 and 1 is needed.")
    check_flags(difference=difference)
    if isinstance(scene, Scene):
        refuse_unseen(scene)
    live = scene.load() if isinstance(scene, Scene) else scene
    view = view_of(live)
    began = time.perf_counter()
    count, run = power_of_four(samples or SAMPLES), 0
    images = _replicates(live, view.camera, count, seed, run, progress)
    mechanics_error = _mechanics_error(live, view, images, count, seed, run)
    if target_error is not None:
        radiance, standard_error = _mean_and_error(images)
        error = _relative_error(radiance, standard_error, view.coat)
        mechanics = _relative_error(radiance, mechanics_error, view.coat)
        is_within = mechanics <= MECHANICS_SHARE * target_error  # not if unknown
        target = math.sqrt(target_error**2 - mechanics**2) if is_within else target_error
        if error > target:
            # A multiple of the pilot's samples, or a power of four, whose points are more even.
            more = (error / target) ** 2
            count, run = min(count * math.ceil(more), power_of_four(math.ceil(count * more)), MOST_SAMPLES), 1
            images = _replicates(live, view.camera, count, seed, run, progress)
    # Pixels at the border of the coat show what is beside it as well.
    padded = np.pad(view.coat, 1)
    inside = view.coat & padded[:-2, 1:-1] & padded[2:, 1:-1] & padded[1:-1, :-2] & padded[1:-1, 2:]
    if inside.any() and not np.any(images != 0, axis=0)[inside].any():
        raise InputError(
            f"no light reaches the coat, of {count * REPLICATES} paths from each pixel: turn a light towards the coat, "
            "and give the regions side and window, where light enters, the BSDF null."
        )
    changes: dict[str, Any] = {}
    if difference:
        with _unloaded(live):
            unloaded = _replicates(live, view.camera, count, seed, run, progress)
        changes = dict(zip(("difference", "difference_error"), _mean_and_error(images - unloaded), strict=True))
    if has_markers(live):
        with _unloaded(live):
            at_rest = view_of(live).points
        changes["markers"] = marker_flow(live, view.points - view.displacement, at_rest)
    radiance, standard_error = _mean_and_error(images)
    return CameraImage(
        radiance=radiance,
        standard_error=standard_error,
        mechanics_error=mechanics_error,
        depth=view.depth,
        coat=view.coat,
        displacement=view.displacement,
        contact_pressure=view.contact_pressure,
        samples=count,
        replicates=REPLICATES,
        seed=seed,
        seconds=time.perf_counter() - began,
        notes=tuple(UNTOUCHED for pad in loaded_pads(live) if pad.load.indenter is not None and not _is_touched(pad)),
        **changes,
    )


def _unloaded(scene: mi.Scene) -> AbstractContextManager[None]:
    """Context manager: within the block, the pads of a scene have no load."""
    pads = deformed_pads(scene)
    rest = [pad.moved_places(replace(pad.state, displacement=0 * pad.state.displacement), pad.pad) for pad in pads]
    return moved(scene, pads, rest)


def _is_touched(pad: PadShape) -> bool:
    """Whether the indenter touches a pad."""
    return pad.contact_pressure is not None and bool(pad.contact_pressure.any())


def _replicates(
    scene: mi.Scene,
    camera: mi.Sensor,
    samples: int,
    seed: int,
    run: int,
    progress: Callable[[int, int], None] | None,
    replicates: int = REPLICATES,
) -> np.ndarray:
    """Render independent images (R, H, W, C) of a camera; their seeds follow from ``seed`` and ``run``."""
    import mitsuba as mi

    width, height = map(int, camera.film().crop_size())
    # Parts of a power of four: `ldsampler` and `multijitter` would round other numbers.
    most, at_once = max(1, PATHS_AT_ONCE // (width * height)), 1
    while 4 * at_once <= most and samples % (4 * at_once) == 0:
        at_once *= 4
    parts = samples // at_once
    seeds = np.random.SeedSequence([seed, run]).generate_state(REPLICATES * parts).reshape(REPLICATES, parts)
    images = []
    for done, own_seeds in enumerate(seeds[:replicates].tolist(), start=1):
        image = np.zeros(1)
        for own_seed in own_seeds:
            image = image + np.array(mi.render(scene, sensor=camera, spp=at_once, seed=own_seed), dtype=float) / parts
        images.append(image)
        if progress is not None:
            progress(done, REPLICATES)
    stack = np.stack(images)[..., : 3 if images[0].shape[-1] > 3 else None]
    if not np.isfinite(stack).all():
        raise InputError("the image is not finite: check the units of sizes (mm) and powers in the scene.")
    return stack


def _mechanics_error(
    scene: mi.Scene, view: View, images: np.ndarray, samples: int, seed: int, run: int
) -> np.ndarray:
    """Error (H, W, C) by the finite elements of loaded pads, of the mean of images (R, H, W, C); NaN if unknown.

    Some images are traced again, with the same random numbers, in pads displaced by each component of the error of
    their shape. The mean square of the noise is subtracted from the square of each change. Two meshes may agree by
    chance at a pixel, so the error is the root mean square over the pixels of neighbouring elements.
    """
    if not (pads := loaded_pads(scene)):
        return np.zeros(images.shape[1:])
    unchanged = [images[:ERROR_REPLICATES]]  # traced already

    def traced() -> np.ndarray:
        if unchanged:
            return unchanged.pop()
        return _replicates(scene, view.camera, samples, seed, run, None, ERROR_REPLICATES)

    _, changes = mechanics_deviations(scene, traced)
    if changes is None:
        return np.full(images.shape[1:], math.nan)
    square = np.zeros(images.shape[1:])
    for mean, noise in map(_mean_and_error, changes):
        square += np.square(mean) - np.square(noise)
    faces = sum(np.count_nonzero(pad.state.mesh.face_region == REGIONS["top"]) for pad in pads)
    width = round(math.sqrt(view.coat.sum() / faces))
    return SLOPE_SHARE * np.sqrt(np.maximum(_local_mean(square, view.coat, width), 0))


def _local_mean(values: np.ndarray, coat: np.ndarray, reach: int) -> np.ndarray:
    """Mean of values (H, W, C) over the pixels of the coat (H, W) up to ``reach`` pixels away along each axis; the
    values themselves in other pixels."""
    sums = np.concatenate([values * coat[..., None], coat[..., None]], axis=-1)
    for axis in (0, 1):
        along = np.moveaxis(sums, axis, 0)
        total = np.concatenate([np.zeros_like(along[:1]), np.cumsum(along, axis=0)])
        place = np.arange(len(along))
        part = total[np.minimum(place + reach + 1, len(along))] - total[np.maximum(place - reach, 0)]
        sums = np.moveaxis(part, 0, axis)
    return np.where(coat[..., None], sums[..., :-1] / np.maximum(sums[..., -1:], 1), values)


def _mean_and_error(images: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean and its standard error (H, W, C) of independent images (R, H, W, C)."""
    return images.mean(axis=0), images.std(axis=0, ddof=1) / math.sqrt(len(images))


def _relative_error(radiance: np.ndarray, standard_error: np.ndarray, coat: np.ndarray) -> float:
    """Root mean square of the relative error of all pixels that show the coat and are not black; NaN without these. The
    colours of a pixel count together."""
    mean, error = (np.linalg.norm(values[coat], axis=-1) for values in (radiance, standard_error))
    bright = mean > 0
    return float(np.sqrt(np.square(error[bright] / mean[bright]).mean())) if bright.any() else math.nan


def power_of_four(count: int) -> int:
    """Round up to a power of four.

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
