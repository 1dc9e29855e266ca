"""Studies: readings of scenes at all combinations of their varied parameters."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from mitsuba_taxel.base.arguments import check_flags, check_progress, path_of, table_of
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.base.processes import stages
from mitsuba_taxel.electronics import Circuit, with_volts
from mitsuba_taxel.sensing import Readings, Scene
from mitsuba_taxel.sensing.reading.prepared_scenes import Settings
from mitsuba_taxel.sensing.reading.runs import FIRST_POINTS, Clock
from mitsuba_taxel.studies.plan.batch import Batch, batch_from, make_batch, read_study
from mitsuba_taxel.studies.plan.growth import grown, without_failed
from mitsuba_taxel.studies.plan.job import Failure, Job, describe
from mitsuba_taxel.studies.plan.refused_values import check_derivatives, check_values
from mitsuba_taxel.studies.plan.vary import combinations
from mitsuba_taxel.studies.run.chosen_steps import with_chosen_steps
from mitsuba_taxel.studies.run.curve_jobs import curve_jobs
from mitsuba_taxel.studies.run.pilots import piloted_settings
from mitsuba_taxel.studies.run.pool import Pool, open_pool
from mitsuba_taxel.studies.run.scene_source import file_of
from mitsuba_taxel.studies.run.slope_meshes import settings_for_slopes
from mitsuba_taxel.studies.store.dataset import assemble
from mitsuba_taxel.studies.store.folder import Store, StoredResult, StoreError, begin_tree, keepable
from mitsuba_taxel.studies.store.opening import open_study, stored_study
from mitsuba_taxel.studies.store.provenance import provenance

RECENT = 16
"""Number of last scenes whose median time is the expected time of the next scene, for the time budget."""


class Progress(NamedTuple):
    """Progress of a study.

    Attributes
    ----------
    done, failed, total : int
        Number of finished jobs, of failed jobs among these, and of all jobs.
    error : float
        Largest relative total error of a reading so far, NaN if one is unknown.
    """

    done: int
    failed: int
    total: int
    error: float


def sweep(
    source: str | Path | Scene,
    vary: Mapping[str, str | Iterable[object]],
    defines: Mapping[str, object] | None = None,
    *,
    together: Mapping[str, str | Iterable[object]] | None = None,
    target_error: float | None = None,
    points: int | None = None,
    time_budget: float | None = None,
    mesh_size: float | None = None,
    seed: int = 0,
    output: str | Path | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    retry_failed: bool = False,
    maps: bool = False,
    difference: bool = False,
    derivatives: Sequence[str] = (),
    target_slope: float | None = None,
    circuit: Circuit | None = None,
    meshes: str = "all",
    parquet: bool = False,
    progress: Callable[[Progress], None] | None = None,
) -> xr.Dataset:
    """Compute the readings of a scene at all combinations of the values of its varied parameters.

    A scene with a camera gives images instead of readings; see the section Notes.

    Readings are computed without random numbers if all scenes of the pilot runs have diffuse walls (see ``measure``).
    Otherwise all readings have the same seed and number of points: they share their random numbers, so that most of the
    noise cancels in differences of neighbouring readings. With ``output``, each reading is stored as soon as it is
    computed; after an interruption, the same call resumes the study.

    Parameters
    ----------
    source : str or Path or Scene
        Path of a scene, or the name of a shipped one. A scene made in Python is written to ``output``, or else to the
        temporary folder of this machine, with the parameters that ``write_xml`` gives it.
    vary : Mapping[str, str or Iterable[object]]
        Values by parameter: ``"start:stop:step"`` (stop included), ``"a,b,c"``, ``"@FILE"`` with one value per line, or
        a list of values. Each parameter is one dimension of the result. One of fx, fy and fz may be ``"start:stop"``:
        its steps are then chosen so that they resolve the curve, and derivatives with respect to it are computed.
    defines : Mapping[str, object], optional
        Values for other parameters of the scene.
    together : Mapping[str, str or Iterable[object]], optional
        Values by parameter, of equal lengths, taken row by row along a dimension ``step``.
    target_error : float, optional
        Target for the relative total error (mechanics and light) of the worst taxel. The first, middle and last scene
        of each curve are made to reach it. Without ``target_error`` and ``points``, the error of the light alone is at
        most 0.005.
    points : int, optional
        Number of light paths for each taxel and randomisation, instead of a target error.
    time_budget : float, optional
        Largest duration of the study in s; it limits the points and the refinement of meshes. Scenes that would not
        finish in time are not started, except for the first; a note states their number, and the same call continues.
    mesh_size : float, optional
        Size of the finite elements in mm, for pads whose scene does not set it; a target error may reduce it.
    seed : int
        Whole number from 0 to 2**32 - 1.
    output : str or Path, optional
        Folder for the results: a new or empty folder, or the folder of the same study. A call with further values,
        further varied parameters or a stricter target extends the study there; existing results are kept.
    workers : int, optional
        Number of processes to use, in place of this one.
    scheduler : str, optional
        Address of a Dask scheduler whose workers to use; they need access to the same files.
    retry_failed : bool
        Whether scenes that failed in an earlier call are computed again.
    maps : bool
        Whether to write irradiance maps to ``output`` as well, as OpenEXR.
    difference : bool
        Whether to store the difference of each image of a camera to that of the unloaded pad as well.
    derivatives : Sequence[str]
        Parameters with respect to which readings are differentiated, as for :func:`measure`; by default the varied
        forces, if readings need no random numbers. Slopes against a force then follow from its derivatives. With random
        paths, the derivative with respect to a force that is varied alone, over four values or more, is the slope of a
        smooth curve through the readings; other derivatives are differences of random paths. ``derivative_method`` in
        the result names the method.
    target_slope : float, optional
        Target error of the slopes against the varied forces, relative to the slope of the steepest taxel. Pads whose
        scene does not set a mesh size get a mesh that meets the target at the ends of some curves. With random paths,
        the target applies to the mean and the largest slope, and pilot runs choose the points unless these are given.
    circuit : Circuit, optional
        Read-out circuit, whose voltages and counts are returned with the powers.
    meshes : str
        Which deformed pads to write to ``output``: ``all``, the ``last`` of each curve, or ``none``.
    parquet : bool
        Whether to write the readings to ``output`` as ``readings.parquet`` as well.
    progress : Callable[[Progress], None], optional
        Called after each scene.

    Returns
    -------
    xr.Dataset
        The results that `mitsuba_taxel.sensing.reading.results` lists, each over the varied parameters and its own
        dimensions: ``power``, its errors by light, mechanics and geometry and in total, numbers of the deformed pad,
        derivatives by ``parameter``, and so on. Beside them ``replicate_power`` in W, also over ``replicate``;
        ``taxel_x`` and ``taxel_y``, the positions of the phototransistors in mm; ``seconds`` by ``stage``; ``mesh``,
        the file of the pad; with a circuit, ``voltage``, ``voltage_error`` and ``noise`` in V, and ``counts``. Failed
        readings are NaN; the attribute ``failures`` gives the reasons, one per line. Other attributes are seed, points,
        mesh size, versions, the fixed parameters, and the seconds of the pilot runs that chose points and mesh.

    Raises
    ------
    InputError
        if a parameter, a value, the folder, or every scene is refused.
    ComputationError
        if no scene could be computed, or results could not be stored.

    Notes
    -----
    For a scene with a camera, ``output`` gets the image of each scene as ``images/000000.exr`` and so on, a PNG beside
    it, the table ``images.csv`` and a contact sheet; ``target_error`` applies to the relative error of a pixel of each
    image, and ``points`` is the number of samples per pixel and replicate. The result is the table of
    `mitsuba_taxel.studies.store.image_folder.image_table`. Images are in colour, unless the environment variable
    ``MITSUBA_TAXEL_VARIANT`` names another variant of Mitsuba.
    """
    what: dict[str, Any] = {
        "target_error": target_error,
        "points": points,
        "time_budget": time_budget,
        "mesh_size": mesh_size,
        "seed": seed,
        "maps": maps,
        "difference": difference,
        "derivatives": derivatives,
        "target_slope": target_slope,
        "circuit": circuit,
        "meshes": meshes,
    }
    folder = None if output is None else path_of("output", output)

    # A scene object is written to a file, and the study of that file is run.
    if isinstance(source, Scene):
        varied = {*table_of("vary", vary, "values"), *table_of("together", together, "values")}
        with file_of(source, folder) as (file, values):
            fixed = {name: word for name, word in values.items() if name not in varied}
            how: dict[str, Any] = {"workers": workers, "scheduler": scheduler, "retry_failed": retry_failed}
            what["mesh_size"] = source.mesh_size if mesh_size is None else mesh_size
            return sweep(
                file,
                vary,
                {**fixed, **table_of("defines", defines, "values")},
                together=together,
                output=folder,
                parquet=parquet,
                progress=progress,
                **what,
                **how,
            )

    # Everything is checked before anything is computed. Values are tried in scenes only if results are stored.
    batch = replace(make_batch(source, vary, defines, together=together, **what), from_paths=True)
    check_flags(retry_failed=retry_failed, parquet=parquet)
    check_progress(progress)
    if folder is None:
        check_derivatives(batch)
    else:
        check_values(batch)
    with open_pool(workers, scheduler) as pool:
        return _run(batch, pool, folder, retry_failed, parquet, progress)


def _run(
    batch: Batch,
    pool: Pool,
    folder: Path | None,
    retry_failed: bool,
    parquet: bool,
    progress: Callable[[Any], None] | None,
) -> xr.Dataset:
    """Compute a batch: readings, as :func:`run_batch` returns them, or images if the scene has a camera."""
    first = {name: words[0] for axis in batch.axes for name, words in axis.values.items()}
    if not batch.scene(first).has_camera():
        if batch.difference:
            raise InputError("difference = True is not allowed for readings, only for images of a camera.")
        return run_batch(batch, pool, folder, retry_failed, parquet, progress)
    from mitsuba_taxel.studies.run.images import sweep_images  # readings need nothing of it

    if parquet:
        raise InputError("parquet = True is not allowed for images of a camera, only for readings: leave it out.")
    return sweep_images(batch, pool, folder, retry_failed, progress)


def run_batch(
    batch: Batch,
    pool: Pool,
    folder: Path | None,
    retry_failed: bool = False,
    parquet: bool = False,
    progress: Callable[[Progress], None] | None = None,
) -> xr.Dataset:
    """Compute the readings of all scenes of a batch, and store the results.

    Parameters
    ----------
    batch : Batch
        Scene, varied parameters and settings.
    pool : Pool
        Executes the jobs.
    folder : Path or None
        Folder for the results; None if they are not stored.
    retry_failed : bool
        Whether scenes that failed in an earlier call are computed again.
    parquet : bool
        Whether to write ``readings.parquet`` as well.
    progress : Callable[[Progress], None], optional
        Called after each scene.

    Returns
    -------
    xr.Dataset
        The results, as :func:`sweep` returns them.

    Raises
    ------
    InputError
        if the folder or every scene is refused.
    ComputationError
        if no scene could be computed, or results could not be stored.
    """
    # Steps of an open range are chosen; a stored study is extended.
    clock = Clock(batch.time_budget)
    batch = with_chosen_steps(batch)
    if folder is not None and (stored := stored_study(folder)) and (done := Store(folder).done()):
        failed = Store(folder).failures().keys()
        batch = grown(batch, without_failed(stored, batch, set(done), failed))
    origin = provenance(batch)

    # Without a folder, results stay in memory.
    if folder is None:
        return _dataset(batch, origin, _compute(batch, pool, None, progress, clock))
    from mitsuba_taxel.studies.store.tables import (
        check_parquet,
        draw_results,
        write_readings,
        write_resolution,
        write_summary,
    )

    # With a folder, each result is stored when it arrives; tables and plots are written at the end.
    if parquet:
        check_parquet()
    store = Store(folder)
    scene = batch.file.read_text(encoding="utf-8", errors="replace")
    with store.writing({**batch.as_toml(), "provenance": origin}, scene, pool.name, pool.processes):
        if retry_failed:
            store.forget_failures()
        study = _dataset(batch, origin, _compute(batch, pool, store, progress, clock))
        if not batch.bare:
            write_readings(study, folder, parquet)
            write_summary(study, folder)
            draw_results(study, folder)
            write_resolution(study, folder)
    return study


def _dataset(batch: Batch, origin: Mapping[str, Any], computed: _BatchOutcome) -> xr.Dataset:
    """Assemble the results of a batch to the dataset that :func:`sweep` returns; raises the first failure if there are
    no results."""
    failures = computed.failures
    if not computed.results:
        index, failure = next(iter(failures.items()))
        values = dict(combinations(batch.axes))[index]
        raise type(failure.error())(f"{describe(values, batch.roles)}: {failure.message}")
    about = {"scene": batch.file.name, "seed": batch.seed}
    about |= {"target_error": batch.target_error, "target_slope": batch.target_slope}
    about |= {"derivatives": batch.derivatives if batch.from_paths else ()}
    run = {**computed.settings._asdict(), "pilot_seconds": computed.pilot_seconds}
    study = assemble(batch.axes, computed.results, failures, {**origin, **about, **run})
    return with_volts(study, batch.circuit)


class _BatchOutcome(NamedTuple):
    """Outcomes of the jobs of a batch by their indices along its dimensions, the settings, and the seconds of the pilot
    runs by stage."""

    results: dict[tuple[int, ...], StoredResult]
    failures: dict[tuple[int, ...], Failure]
    settings: Settings
    pilot_seconds: dict[str, float]


def _compute(
    batch: Batch, pool: Pool, store: Store | None, progress: Callable[[Progress], None] | None, clock: Clock
) -> _BatchOutcome:
    """Results of the jobs of a batch: from the store if it has them, else from the pool."""
    # All jobs, by curve.
    settings, pilot_seconds = _settings(batch, store, pool.machines)
    indices = {number: index for number, (index, _) in enumerate(combinations(batch.axes))}
    curves = curve_jobs(batch, settings, store is not None)
    jobs = [job for curve in curves for job in curve]

    # Stored failures stand, stored results with sufficient settings too; other jobs are computed, and extend stored
    # results with fewer points.
    failures = {number: failure for number, failure in store.failures().items() if number in indices} if store else {}
    stored = ((job.number, store.load(job.number, job.parameters)) for job in jobs) if store else ()
    earlier = {number: kept for number, kept in stored if kept is not None}
    results = {number: kept for number, kept in earlier.items() if _is_enough(kept.readings, settings)}
    curves = [[_continued(job, earlier.get(job.number), settings) for job in curve] for curve in curves]
    worst = np.max([kept.readings.relative_total_error for kept in results.values()], initial=0.0)
    finished = {*results, *failures}
    outcomes = pool.outcomes([job for job in curve if job.number not in finished] for curve in curves)

    # Each outcome is stored and reported; no further job is started if the next would exceed the time budget.
    spent: deque[float] = deque(maxlen=RECENT)
    for job, outcome in outcomes:
        if store:
            store.keep(job, outcome)
        if isinstance(outcome, Failure):
            failures[job.number] = outcome
        else:
            failures.pop(job.number, None)
            results[job.number] = keepable(outcome)
            worst = np.maximum(worst, outcome.readings.relative_total_error)  # NaN if one is unknown
            spent.append(sum(outcome.seconds.values()))
        if progress:
            done = len(results) + len(failures)
            progress(Progress(done, len(failures), len(jobs), float(worst)))
        if not clock.allows(float(np.median(spent)) if spent else 0.0):
            outcomes.close()
            break
    return _BatchOutcome(
        {indices[number]: kept for number, kept in sorted(results.items())},
        {indices[number]: failure for number, failure in sorted(failures.items())},
        settings,
        pilot_seconds,
    )


def _is_enough(readings: Readings, settings: Settings) -> bool:
    """Whether readings of an earlier run meet the present settings. Readings by random paths do not meet settings for
    light without random numbers."""
    enough = readings.points >= settings.points if settings.points else not readings.points
    return enough and readings.mesh_size == settings.mesh_size


def _continued(job: Job, kept: StoredResult | None, settings: Settings) -> Job:
    """Let a job continue earlier readings of the same mesh with fewer points, if there are any; returns the job."""
    if kept is None or job.maps or not settings.points or kept.readings.mesh_size != settings.mesh_size:
        return job
    return job if kept.readings.points < FIRST_POINTS else replace(job, continued=kept.readings)


def _settings(batch: Batch, store: Store | None, machines: int) -> tuple[Settings, dict[str, float]]:
    """Number of points and mesh size for all scenes, and the seconds of pilot runs by stage.

    They are as requested, those of an earlier run unless the target is stricter now, or determined by pilot runs.
    """
    if batch.points is not None and batch.target_slope is None:
        return Settings(batch.points, batch.mesh_size), {}
    choice = store.choice if store else None
    if store and choice is not None and not store.aims_higher:
        return choice
    with stages.record() as seconds, stages.stage("optics"):
        settings = Settings(batch.points, batch.mesh_size) if batch.points else piloted_settings(batch, machines)
        if batch.target_slope is not None:
            settings = settings_for_slopes(batch, settings)
    # Points of an earlier run are not reduced, so that its results can be extended.
    if choice is not None and settings.points and choice[0].mesh_size == settings.mesh_size:
        settings = settings._replace(points=max(settings.points, choice[0].points))
    if store:
        store.keep_choice(settings, seconds)
    return settings, seconds


def run_study(
    file: str | Path,
    output: str | Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    retry_failed: bool = False,
    parquet: bool = False,
    progress: Callable[[Progress], None] | None = None,
) -> xr.Dataset | xr.DataTree:
    """Compute the readings of all scenes that a study file (TOML) defines, as :func:`sweep` does for one scene.

    The results of a study of several scenes are stored in subfolders with the names of the scenes.

    Parameters
    ----------
    file : str or Path
        TOML file; ``taxel new study`` writes a template.
    output : str or Path
        Folder for the results; new, empty, or that of the same study.
    workers : int, optional
        Number of processes to use, in place of this one.
    scheduler : str, optional
        Address of a Dask scheduler whose workers to use; they need access to the same files.
    retry_failed : bool
        Whether scenes that failed in an earlier call are computed again.
    parquet : bool
        Whether to write the readings to ``output`` as ``readings.parquet`` as well.
    progress : Callable[[Progress], None], optional
        Called after each scene.

    Returns
    -------
    xr.Dataset or xr.DataTree
        The dataset of :func:`sweep`, or a tree of such datasets by the scenes' names. Scenes that failed as a whole are
        missing; the tree's attribute ``failures`` gives the reasons, one per line.

    Raises
    ------
    InputError
        if the study or the folder is refused.
    ComputationError
        if no scene could be computed, or results could not be stored.
    """
    file, folder = path_of("file", file), path_of("output", output)
    check_flags(retry_failed=retry_failed, parquet=parquet)
    check_progress(progress)
    content, here = read_study(file), file.resolve().parent
    with open_pool(workers, scheduler) as pool:
        # A study of one scene.
        if not content["scenes"][0].get("name"):
            batch = replace(batch_from(content, 0, here), from_paths=True)
            check_values(batch)
            return _run(batch, pool, folder, retry_failed, parquet, progress)

        # A study of several scenes.
        begin_tree(folder, content)
        failures: dict[str, InputError | ComputationError] = {}
        # Each scene has its folder; the failure of one does not stop the others, unless nothing can be stored.
        for number, scene in enumerate(content["scenes"]):
            try:
                batch = replace(batch_from(content, number, here), from_paths=True)
                check_values(batch)
                _run(batch, pool, folder / batch.name, retry_failed, parquet, progress)
            except StoreError:
                raise
            except (InputError, ComputationError) as error:
                failures[scene["name"]] = error
    if len(failures) == len(content["scenes"]):
        name, reason = next(iter(failures.items()))
        raise type(reason)(f"{name}: {reason}")
    tree = open_study(folder)
    lines = [*tree.attrs["failures"].splitlines(), *(f"{name}: {reason}" for name, reason in failures.items())]
    tree.attrs["failures"] = "\n".join(lines)
    return tree
