"""Execution of one job of a study: readings of its scene. Jobs and results can be sent to another process."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from mitsuba_taxel.backend import in_turn
from mitsuba_taxel.backend.own_plugins import load_plugins
from mitsuba_taxel.base.errors import ComputationError, InputError, comes_from_interrupt
from mitsuba_taxel.base.processes import stages
from mitsuba_taxel.kernels.protocols import PadShape
from mitsuba_taxel.sensing import Readings, Scene, measure
from mitsuba_taxel.sensing.reading.derivative_values import BY_CURVE, Derivatives, unit_of
from mitsuba_taxel.sensing.reading.irradiance_file import write_irradiance
from mitsuba_taxel.sensing.reading.mechanics_error import roof_errors
from mitsuba_taxel.sensing.reading.paired import paired
from mitsuba_taxel.sensing.reading.runs import FIRST_POINTS, Prepared, prepare
from mitsuba_taxel.sensing.scene.left_out import NONE
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads, loaded_pads
from mitsuba_taxel.studies.plan.job import MAPS, MESHES, Failure, ImageJob, ImageResult, Job, JobResult
from mitsuba_taxel.studies.plan.to_contact import TO_CONTACT, as_number, path_to_contact
from mitsuba_taxel.studies.run.deformation import mesh_key, write_mesh

if TYPE_CHECKING:
    from mitsuba_taxel.sensing.reading.contact_value import FirstContact


@overload
def run(job: Job) -> JobResult | Failure: ...
@overload
def run(job: ImageJob) -> ImageResult | Failure: ...
def run(job: Job | ImageJob) -> JobResult | ImageResult | Failure:
    """Compute the readings, or the image, of a job's scene. Exceptions are returned as failures, so that other jobs
    continue; interrupts are raised."""
    try:
        load_plugins(*job.plugins)
        if isinstance(job, ImageJob):
            from mitsuba_taxel.studies.run.image_job import image_of  # readings need nothing of it

            return image_of(job)
        return _read(job)
    except Exception as error:
        if comes_from_interrupt(error):
            raise KeyboardInterrupt from error
        return failure_of(error)


def failure_of(error: BaseException) -> Failure:
    """Convert an exception to a `Failure`."""
    if isinstance(error, (InputError, ComputationError)):
        return Failure(str(error), isinstance(error, InputError))
    return Failure(" ".join(f"{type(error).__name__}: {error}".split()))


@in_turn
def _read(job: Job) -> JobResult:
    """Compute a job: the readings of its scene with derivatives or first contact, errors of its pads' roofs, and its
    files."""
    with stages.record() as seconds:
        # Scene and readings.
        parameters = {name: word for name, word in job.parameters.items() if name != TO_CONTACT}
        scene = Scene(job.file, parameters, job.mesh_size)
        ready = prepare(scene) if job.base is None else paired(Scene(job.file, job.base, job.mesh_size), scene)
        readings = measure(
            ready,
            points=job.points or None,
            seed=job.seed,
            irradiance=job.maps,
            mechanics_error=job.mechanics_error,
            continued=job.continued,
        )

        # Derivatives of the readings, or the first contact and its derivatives.
        path = path_to_contact(job.parameters.get(TO_CONTACT, NONE))
        if path is None:
            readings = _with_derivatives(readings, job, scene, ready)
        else:
            readings = replace(readings, contact=_contact(job, scene, *path))

        # Errors of the roofs, which a bare job leaves unknown; contents of files.
        errors: list[Any] = [None for _ in loaded_pads(ready.scene)] if job.bare else roof_errors(ready.scene)
        files = {}
        with stages.stage("files"):
            if job.meshes:
                files = {_name(pad): _content(".ply", partial(write_mesh, pad)) for pad in deformed_pads(ready.scene)}
            if job.maps:
                files[f"{MAPS}/{job.number:06d}.exr"] = _content(".exr", partial(write_irradiance, readings))
    readings = replace(readings, irradiance=None, parameters=job.parameters, mesh_size=job.mesh_size)
    return JobResult(replace(readings, roof_errors=errors), seconds, files)


def _with_derivatives(readings: Readings, job: Job, scene: Scene, ready: Prepared) -> Readings:
    """The readings with the requested derivatives, or with a remark that gives the reason why there are none."""
    if not job.derivatives or (job.where_smooth and readings.points):
        return readings
    from mitsuba_taxel.sensing.derivatives.diffuse_derivatives import derivatives_by
    from mitsuba_taxel.sensing.derivatives.scene_rates import rates
    from mitsuba_taxel.sensing.diffuse.diffuse_cells import NotFollowed
    from mitsuba_taxel.sensing.diffuse.diffuse_taxels import NotDiffuse

    try:
        changes = [replace(rates(scene, name), side=job.sides.get(name, 0)) for name in job.derivatives]
        return replace(readings, derivatives=derivatives_by(changes, ready.scene, job.mechanics_error))
    except (InputError, ComputationError) as reason:
        if job.where_smooth:
            return readings
        if not isinstance(reason, (NotDiffuse, ComputationError)):
            raise
        if not (job.from_paths and isinstance(reason, (NotDiffuse, NotFollowed))):
            return replace(readings, remarks=[*readings.remarks, str(reason)])
    return replace(readings, derivatives=_by_paths(readings, job, scene, ready))


def _by_paths(readings: Readings, job: Job, scene: Scene, ready: Prepared) -> Derivatives:
    """Derivatives from differences of random paths. Derivatives with respect to fitted forces stay NaN until the study
    is complete."""
    from mitsuba_taxel.sensing.derivatives.path_derivatives import derivatives_of_paths
    from mitsuba_taxel.sensing.derivatives.scene_rates import rates

    changes = [rates(scene, name) for name in job.derivatives]
    shape, points = (len(readings.taxel), len(changes)), readings.points or FIRST_POINTS
    empty = Derivatives(
        parameters=job.derivatives,
        units=tuple(unit_of(change.unit) for change in changes),
        values=np.full(shape, math.nan),
        standard_errors=np.full(shape, math.nan),
        power=readings.power,
        power_errors=readings.standard_error,
        strain=math.nan,
        strain_rates=np.full(len(changes), math.nan),
        clearance=math.nan,
        clearance_rates=np.full(len(changes), math.nan),
        method=BY_CURVE,
    )
    columns = [number for number, name in enumerate(job.derivatives) if name not in job.fitted]
    if not columns:
        return empty
    chosen, alone = [changes[number] for number in columns], ready._replace(paired=None)
    result = derivatives_of_paths(chosen, alone, readings.replicates, readings.seed, points, bool(job.points))
    for name in ("values", "standard_errors", "strain_rates", "clearance_rates"):
        getattr(empty, name)[..., columns] = getattr(result, name)
    return replace(empty, strain=result.strain, clearance=result.clearance, method=result.method)


def _contact(job: Job, scene: Scene, along: str, furthest: float) -> FirstContact:
    """The first contact of a scene's pad, from its value of the parameter ``along`` to the value ``furthest``."""
    from mitsuba_taxel.sensing.derivatives.first_contact import first_contact

    start = as_number(scene.parameters.get(along, ""))
    if not math.isfinite(start):
        raise InputError(
            f"{TO_CONTACT} = '{along}={furthest:g}' is not allowed: a parameter of the scene with a "
            f"number as its value is needed."
        )

    def at(value: float) -> Scene:
        return Scene(job.file, {**scene.parameters, along: repr(value)}, job.mesh_size)

    names = () if job.where_smooth else job.derivatives
    with stages.stage("first contact"):
        return first_contact(at, along, start, furthest, names)


def _name(pad: PadShape) -> str:
    """File name of a pad's mesh. Pads with identical surfaces have the same name, so that their mesh is stored once."""
    return f"{MESHES}/pad_{mesh_key(pad)[:16]}.ply"


def _content(suffix: str, write: Callable[[Path], None]) -> bytes:
    """Bytes of the file that the function ``write`` writes; the suffix determines its format."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"file{suffix}"
        write(file)
        return file.read_bytes()
