"""Studies of images: the images of a scene's camera at all combinations of its varied parameters."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from mitsuba_taxel.backend import check_backend
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.studies.plan.growth import grown, without_failed
from mitsuba_taxel.studies.plan.job import Failure, ImageJob, describe
from mitsuba_taxel.studies.plan.to_contact import TO_CONTACT
from mitsuba_taxel.studies.plan.vary import combinations, curve_dimension
from mitsuba_taxel.studies.store.image_folder import ImageStore, image_table, is_enough, write_images
from mitsuba_taxel.studies.store.opening import stored_study
from mitsuba_taxel.studies.store.provenance import provenance

if TYPE_CHECKING:
    import xarray as xr

    from mitsuba_taxel.studies.plan.batch import Batch
    from mitsuba_taxel.studies.run.pool import Pool

COLOURS = "llvm_ad_rgb"
"""Variant for images, unless another variant is set."""


class ImageProgress(NamedTuple):
    """Progress of a study of images.

    Attributes
    ----------
    done, failed, total : int
        Number of finished jobs, of failed jobs among these, and of all jobs.
    error : float
        Largest total error of a pixel so far, NaN if one is unknown; see `CameraImage.relative_total_error`.
    """

    done: int
    failed: int
    total: int
    error: float


def sweep_images(
    batch: Batch,
    pool: Pool,
    folder: Path | None,
    retry_failed: bool = False,
    progress: Callable[[Any], None] | None = None,
) -> xr.Dataset:
    """Compute the images of all scenes of a batch, and store them.

    All images have the same seed. Each is stored as soon as it is computed; the same call resumes the study, and a call
    with more values, more samples or a stricter target extends it.

    Parameters
    ----------
    batch : Batch
        Scene with a camera, varied parameters and settings. ``target_error`` applies to the relative error of a pixel
        of each image.
    pool : Pool
        Executes the jobs.
    folder : Path or None
        Folder for the results.
    retry_failed : bool
        Whether scenes that failed in an earlier call are computed again.
    progress : Callable[[ImageProgress], None], optional
        Called after each scene.

    Returns
    -------
    xr.Dataset
        The table of the images; see `image_table`.

    Raises
    ------
    InputError
        if there is no folder, the batch has a setting that images do not have, or every scene is refused.
    ComputationError
        if no scene could be computed, or results could not be stored.
    """
    _check(batch, folder)
    assert folder is not None
    variant = os.environ.get("MITSUBA_TAXEL_VARIANT") or COLOURS
    check_backend(variant)
    store = ImageStore(folder)
    if (stored := stored_study(folder)) and (done := store.done()):
        batch = grown(batch, without_failed(stored, batch, set(done), store.failures().keys()))
    origin = provenance(batch)
    scene = batch.file.read_text(encoding="utf-8", errors="replace")
    with store.writing({**batch.as_toml(), "provenance": origin}, scene, pool.name, pool.processes):
        if retry_failed:
            store.forget_failures()
        failures = _compute(batch, pool, store, variant, progress)
        if failures and not store.done():
            index, failure = next(iter(failures.items()))
            values = dict(enumerate(values for _, values in combinations(batch.axes)))[index]
            raise type(failure.error())(f"{describe(values, batch.roles)}: {failure.message}")
        about = {"scene": batch.file.name, "seed": batch.seed, "target_error": batch.target_error}
        study = image_table(batch.axes, store, {**origin, **about})
        write_images(study, folder)
    return study


def _check(batch: Batch, folder: Path | None) -> None:
    """Raise `InputError` for a batch with a setting that images do not have."""
    for name in ("time_budget", "target_slope", "circuit", "derivatives", "maps"):
        if value := getattr(batch, name):
            raise InputError(f"{name} = {value!r} is not allowed for images of a camera: leave it out.")
    if batch.meshes == "last":
        raise InputError("meshes = 'last' is not allowed for images of a camera, which keep no mesh: leave it out.")
    if batch.name:
        raise InputError(f"scene {batch.name} has a camera: images need a study of this scene alone.")
    for axis in batch.axes:
        if axis.is_open:
            start, stop = axis.values[axis.dim][0], axis.values[axis.dim][-1]
            raise InputError(f"{axis.dim} = {start}:{stop} is not allowed for images of a camera: a step is needed.")
    if TO_CONTACT in batch.defines or any(TO_CONTACT in axis.values for axis in batch.axes):
        raise InputError(f"{TO_CONTACT} is not allowed for images of a camera: leave it out.")
    if folder is None:
        raise InputError("output is missing: a folder is needed for images of a camera.")


def _compute(
    batch: Batch, pool: Pool, store: ImageStore, variant: str, progress: Callable[[Any], None] | None
) -> dict[int, Failure]:
    """Compute and store the images that the folder does not have, and return the failures by number of the job."""
    # All jobs by curve: those of a curve share a load path.
    curve = [axis.dim for axis in batch.axes].index(curve_dimension(batch.axes))
    curves: dict[tuple[int, ...], list[ImageJob]] = {}
    parameters: dict[str, str] = {}
    for number, (index, values) in enumerate(combinations(batch.axes)):
        parameters = {**(parameters or batch.parameters(values)), **values}
        job = ImageJob(
            number=number,
            file=batch.file,
            parameters=parameters,
            mesh_size=batch.mesh_size,
            seed=batch.seed,
            samples=batch.points if batch.target_error is None else None,
            target_error=batch.target_error,
            difference=batch.difference,
            variant=variant,
        )
        curves.setdefault((*index[:curve], *index[curve + 1 :]), []).append(job)
    jobs = [job for along in curves.values() for job in along]

    # Stored failures stand, stored images that meet the settings too.
    numbers = {job.number for job in jobs}
    failures = {number: failure for number, failure in store.failures().items() if number in numbers}
    stored = {job.number: (job, store.facts(job.number, job.parameters)) for job in jobs}
    enough = {number: kept for number, (job, kept) in stored.items() if kept and is_enough(kept, job)}
    errors = {number: kept["relative_total_error"] for number, kept in enough.items()}
    finished = errors.keys() | failures.keys()
    remaining: Any = ([job for job in along if job.number not in finished] for along in curves.values())
    done: Any
    outcome: Any
    for done, outcome in pool.outcomes(remaining):
        store.keep(done, outcome)
        if isinstance(outcome, Failure):
            failures[done.number] = outcome
        else:
            failures.pop(done.number, None)
            errors[done.number] = outcome.about["relative_total_error"]
        if progress:
            worst = math.nan if None in errors.values() else max(errors.values(), default=0.0)
            progress(ImageProgress(len(errors) + len(failures), len(failures), len(jobs), worst))
    if not failures and not store.done():
        raise ComputationError("no image could be computed.")
    return dict(sorted(failures.items()))
