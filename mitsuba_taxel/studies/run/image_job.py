"""Execution of one job of a study of images: the image of its scene's camera."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path

from mitsuba_taxel.backend import in_turn
from mitsuba_taxel.base.processes import stages
from mitsuba_taxel.sensing import Scene
from mitsuba_taxel.sensing.camera import RELATIVE_ERRORS, camera_image
from mitsuba_taxel.sensing.camera_view import refuse_unseen
from mitsuba_taxel.sensing.image_file import white_level, write_exr
from mitsuba_taxel.sensing.reading.pad_results import pad_results
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads
from mitsuba_taxel.studies.plan.job import ImageJob, ImageResult


@in_turn
def image_of(job: ImageJob) -> ImageResult:
    """Compute the image of a job's scene, and the numbers of its deformed pad.

    Parameters
    ----------
    job : ImageJob
        The job.

    Returns
    -------
    ImageResult
        Content of the OpenEXR file. The facts in its header are ``parameters``, ``mesh_size``, ``variant``,
        ``target_error``, those of `RELATIVE_ERRORS`, ``coat_share``, ``white`` (radiance that is white in a picture),
        ``seconds_by_stage``, and ``pads`` and ``pad_errors``, the values and errors of `pad_results` by name; None if
        unknown.
    """
    import mitsuba as mi

    before = mi.variant()
    mi.set_variant(job.variant)
    try:
        return _image_of(job)
    finally:
        if before is not None:
            mi.set_variant(before)


def _image_of(job: ImageJob) -> ImageResult:
    """Compute the image of a job's scene in the current variant of Mitsuba."""
    with stages.record() as seconds:
        scene = Scene(job.file, job.parameters, job.mesh_size)
        refuse_unseen(scene)
        live = scene.load()
        with stages.stage("optics"):
            image = camera_image(
                live, samples=job.samples, target_error=job.target_error, seed=job.seed, difference=job.difference
            )
        pads = pad_results([pad.state for pad in deformed_pads(live)], with_errors=True)
    about = {
        "parameters": job.parameters,
        "mesh_size": job.mesh_size,
        "variant": job.variant,
        "target_error": job.target_error,
        **{name: _known(getattr(image, name)) for name in RELATIVE_ERRORS},
        "coat_share": float(image.coat.mean()),
        "white": white_level(image),
        "seconds_by_stage": seconds,
        "pads": {name: _known(number.value) for name, number in pads.items()},
        "pad_errors": {name: _known(number.error) for name, number in pads.items()},
    }
    with tempfile.TemporaryDirectory() as folder:
        write_exr(image, file := Path(folder) / "image.exr", about)
        return ImageResult(file.read_bytes(), about, seconds)


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None
