"""A sweep: one scene read at every combination of its varied parameters."""

from __future__ import annotations

import gc
import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import xarray as xr

from mitsuba_taxel import stages
from mitsuba_taxel.errors import ComputationError, InputError
from mitsuba_taxel.optics import Scene, find_scene, measure, points_for
from mitsuba_taxel.optics.readings import DEFAULT_TARGET_ERROR, check_request, prepare
from mitsuba_taxel.studies.dataset import Result, assemble
from mitsuba_taxel.studies.deformation import deformed_pads, mesh_key, write_mesh
from mitsuba_taxel.studies.files import make_empty_folder
from mitsuba_taxel.studies.vary import combinations, curve_parameter, parse_values


def sweep(
    source: str | Path,
    vary: Mapping[str, str | Iterable[object]],
    defines: Mapping[str, object] | None = None,
    *,
    target_error: float | None = None,
    points: int | None = None,
    seed: int = 0,
    output: str | Path | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> xr.Dataset:
    """Read a scene at every combination of the varied parameters.

    All readings use the same seed and the same number of points, so that neighbouring ones share their random
    numbers and a slope between them is not noise.

    Parameters
    ----------
    source : path of a scene, or the name of a shipped one
    vary : by parameter, ``"start:stop:step"`` (stop included), ``"a,b,c"``, or the values themselves
    defines : values for other parameters of the scene
    target_error : relative standard error wanted for the worst taxel of the first, middle and last scene of
        each curve (default 0.005)
    points : light paths for each taxel and randomisation, instead of a target
    seed : whole number from 0 to 2**32 - 1
    output : folder for ``readings.nc``, ``readings.csv``, ``summary.csv``, ``power.png`` and, where the scene
        holds pads, ``meshes/``; must be empty or not exist
    progress : called with (jobs done, jobs in all)

    Returns
    -------
    Over the varied parameters and ``taxel``: ``power`` and ``standard_error`` in W; ``replicate_power`` in W,
    also over ``replicate``; ``seconds`` by ``stage``; ``mesh``, the file of the pad. Attributes are seed,
    points, versions, the other parameters, and the seconds of the pilot runs that chose the points.

    Raises
    ------
    InputError
        if a parameter, a value or the folder is refused.
    ComputationError
        if a scene could not be computed; the message names its values.
    """
    file = find_scene(source)
    fixed = {name: str(value) for name, value in (defines or {}).items()}
    varied = {name: parse_values(name, values) for name, values in vary.items()}
    _check(file, varied, fixed)
    check_request(target_error, points, seed)
    jobs = list(combinations(varied))
    folder = None if output is None else Path(output)
    if folder is not None:
        make_empty_folder(folder)

    pilots: dict[str, float] = {}
    if points is None:
        with stages.record() as pilots:
            points = _points_for_all(file, fixed, varied, target_error or DEFAULT_TARGET_ERROR, seed)
    results: dict[tuple[int, ...], Result] = {}
    meshes: dict[str, str] = {}
    for index, values in jobs:
        with _naming(values):
            results[index] = _read(Scene(file, {**fixed, **values}), points, seed, folder, meshes)
        if progress is not None:
            progress(len(results), len(jobs))
    study = assemble(Scene(file, {**fixed}), varied, results)
    study.attrs["pilot_seconds"] = json.dumps(pilots)
    if folder is not None:
        from mitsuba_taxel.studies.store import write_study

        write_study(study, folder)
    return study


def _check(file: Path, varied: Mapping[str, list[str]], fixed: Mapping[str, str]) -> None:
    if not varied:
        raise InputError("nothing is varied: at least one parameter is needed.")
    for name in varied:
        if name in fixed:
            raise InputError(f"{name} is both varied and given a value.")
    Scene(file, {**fixed, **{name: values[0] for name, values in varied.items()}})


def _points_for_all(
    file: Path, fixed: Mapping[str, str], varied: Mapping[str, list[str]], target_error: float, seed: int
) -> int:
    """Points that reach the target at the first, middle and last scene of each curve."""
    curve = curve_parameter(varied)
    count = len(varied[curve])
    pilots = {**varied, curve: [varied[curve][i] for i in sorted({0, count // 2, count - 1})]}
    points = 0
    for _, values in combinations(pilots):
        with _naming(values):
            with stages.stage("optics"):
                points = max(points, points_for(Scene(file, {**fixed, **values}), target_error, seed))
        gc.collect()
    return points


def _read(scene: Scene, points: int, seed: int, folder: Path | None, meshes: dict[str, str]) -> Result:
    """One job: its readings; its pads are written unless an earlier job did (``meshes``: key -> file)."""
    with stages.record() as seconds:
        ready = prepare(scene)
        readings = measure(ready, points=points, seed=seed)
        names = []
        if folder is not None:
            with stages.stage("meshes"):
                for pad in deformed_pads(ready.scene):
                    key = mesh_key(pad)
                    if key not in meshes:
                        meshes[key] = f"meshes/pad_{len(meshes) + 1:04d}.ply"
                        (folder / "meshes").mkdir(exist_ok=True)
                        write_mesh(pad, folder / meshes[key])
                    names.append(meshes[key])
    del ready
    gc.collect()  # a scene that lives on adds its plugins to the kernels of the next one
    return Result(readings, seconds, " ".join(names))


@contextmanager
def _naming(values: Mapping[str, str]) -> Iterator[None]:
    """Put the values of a scene before the message of its error."""
    try:
        yield
    except (InputError, ComputationError) as error:
        words = ", ".join(f"{name}={value}" for name, value in values.items())
        raise type(error)(f"{words}: {error}") from error
