"""Progress of a study, read from its folder, also while another process computes it."""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Iterator, Mapping, Sequence, Set
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from mitsuba_taxel.base.units import FORCES
from mitsuba_taxel.studies.plan.batch import loads_among
from mitsuba_taxel.studies.plan.job import IMAGES
from mitsuba_taxel.studies.plan.vary import Axis, checked_places, combinations, curve_dimension, make_axes
from mitsuba_taxel.studies.store.folder import LOCK, RUN, STUDY, Store
from mitsuba_taxel.studies.store.opening import read_results


class Status(NamedTuple):
    """Progress of the study of one scene.

    Attributes
    ----------
    name : str
        Name of the scene in a study of several scenes, else blank.
    done, failed, total : int
        Numbers of jobs with a result, of failed jobs, and of all jobs.
    error : float
        Largest relative standard error of a reading, or of the pixels of an image, so far; NaN if one is unknown.
    running : bool
        Whether a run is in progress.
    seconds_left : tuple[float, float] or None
        Least and largest remaining time in s: each remaining scene takes as long as the fastest, or as the slowest,
        finished scene. Scenes whose mechanics error is computed are compared with such scenes only. None if no run is
        in progress or no scene is finished.
    """

    name: str
    done: int
    failed: int
    total: int
    error: float
    running: bool
    seconds_left: tuple[float, float] | None


def study_status(folder: str | Path) -> list[Status]:
    """Progress of each scene of the study in a folder.

    Parameters
    ----------
    folder : str or Path
        Folder that is the ``output`` of a study.

    Returns
    -------
    list[Status]
        One for each scene.

    Raises
    ------
    InputError
        if the folder holds no study.
    """
    return list(_states(Path(folder), ""))


def _states(folder: Path, name: str) -> Iterator[Status]:
    """Progress of the study in a folder, whose scene is called ``name``; for a folder of several scenes, the progress
    of each of them.
    """
    study = read_results(folder)
    scenes = study["scenes"]

    # Several scenes, each in a subfolder if it has been started.
    if scenes[0].get("name"):
        for scene in scenes:
            if (folder / scene["name"] / STUDY).exists():
                yield from _states(folder / scene["name"], scene["name"])
            else:
                yield Status(scene["name"], 0, 0, _size(scene), 0.0, False, None)
        return

    # One scene: all stored results with the parameters of their job count.
    axes = _axes(scenes[0], study["provenance"].get("forces", FORCES), study["provenance"].get("roles", {}))
    store, values = Store(folder), dict(enumerate(values for _, values in combinations(axes)))
    fixed = study["provenance"]["parameters"]
    seconds, errors = _finished(folder, {number: {**fixed, **own} for number, own in values.items()})
    failed, running = values.keys() & store.failures().keys(), _is_running(folder)
    seconds_left = _seconds_left(axes, seconds, failed, _processes(folder)) if running else None
    error = math.nan if any(map(math.isnan, errors)) else max(errors, default=0.0)
    yield Status(name, len(seconds), len(failed), len(values), error, running, seconds_left)


def _finished(folder: Path, parameters: Mapping[int, Mapping[str, str]]) -> tuple[dict[int, float], list[float]]:
    """Finished jobs of a study: the seconds of each by number, and the relative errors of readings, or of pixels of
    images, NaN if unknown."""
    seconds, errors = {}, []
    if (folder / IMAGES).is_dir():
        from mitsuba_taxel.studies.store.image_folder import ImageStore  # readings need nothing of it

        images = ImageStore(folder)
        for number in parameters.keys() & images.done():
            if facts := images.facts(number, parameters[number]):
                seconds[number] = sum(facts["seconds_by_stage"].values())
                error = facts.get("relative_total_error")
                errors.append(math.nan if error is None else error)
        return seconds, errors
    store = Store(folder)
    for number in parameters.keys() & store.done():
        if result := store.load(number, parameters[number]):
            seconds[number] = sum(result.seconds.values())
            errors.append(result.readings.relative_total_error)
    return seconds, errors


def _axes(scene: dict, forces: Collection[str] = FORCES, roles: Mapping[str, tuple[str, int]] = MappingProxyType({})):
    return make_axes(scene.get("vary", {}), scene.get("together"), forces=forces, loads=loads_among(roles))


def _size(scene: dict) -> int:
    """Number of jobs of one scene of a study."""
    return sum(1 for _ in combinations(_axes(scene)))


def _is_running(folder: Path) -> bool:
    """Whether a running process has locked the folder of a study."""
    from filelock import FileLock, Timeout

    try:
        with FileLock(folder / LOCK, timeout=0):
            return False
    except Timeout:
        return True


def _processes(folder: Path) -> int:
    """Number of jobs that the run computes at the same time; 1 if it is not recorded."""
    try:
        return max(1, int(json.loads((folder / RUN).read_text(encoding="utf-8"))["processes"]))
    except (OSError, ValueError, TypeError, KeyError, RecursionError):  # not written yet, or damaged
        return 1


def _seconds_left(
    axes: Sequence[Axis], seconds: Mapping[int, float], failed: Set[int], processes: int
) -> tuple[float, float] | None:
    """Least and most seconds that the remaining jobs take; None if no job is done.

    Parameters
    ----------
    axes : Sequence[Axis]
        Dimensions of the study.
    seconds : Mapping[int, float]
        Seconds of each finished job, by number.
    failed : Set[int]
        Numbers of failed jobs.
    processes : int
        Number of jobs that are computed at the same time.
    """
    if not seconds:
        return None
    curve = [axis.dim for axis in axes].index(curve_dimension(axes))
    checked = checked_places(axes[curve])
    checked_jobs = [index[curve] in checked for index, _ in combinations(axes)]
    least = most = 0.0
    # Jobs with and without an error of mechanics, each by the times of jobs of their kind, or of all if none is done.
    for kind in (True, False):
        jobs = [number for number, is_checked in enumerate(checked_jobs) if is_checked is kind]
        times = [seconds[number] for number in jobs if number in seconds] or list(seconds.values())
        remaining = sum(number not in seconds and number not in failed for number in jobs)
        least, most = least + remaining * min(times) / processes, most + remaining * max(times) / processes
    return least, most
