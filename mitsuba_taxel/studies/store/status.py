"""Progress of a study on disk, seen from another process."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator, Mapping, Sequence, Set
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from mitsuba_taxel.base.units import FORCES
from mitsuba_taxel.studies.plan.batch import loads_among
from mitsuba_taxel.studies.plan.vary import Axis, checked_places, combinations, curve_dimension, make_axes
from mitsuba_taxel.studies.store.folder import LOCK, RUN, STUDY, Store
from mitsuba_taxel.studies.store.opening import read_results


class Status(NamedTuple):
    """Progress of the study of one scene.

    Attributes
    ----------
    name : str
        Of the scene in a study of several scenes, else blank.
    done, failed, total : int
        Jobs with a result, failed jobs, and all jobs.
    error : float
        Largest relative standard error of a reading so far.
    running : bool
        Whether a run is in progress.
    seconds_left : tuple[float, float] or None
        If the scenes that are left take as long as the fastest, and as the slowest, that are done; None if nothing runs
        or nothing is done yet. Scenes whose error of mechanics is computed, and others, are counted apart.
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
        That is the ``output`` of a study.

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
    study = read_results(folder)
    scenes = study["scenes"]
    if scenes[0].get("name"):
        for scene in scenes:
            if (folder / scene["name"] / STUDY).exists():
                yield from _states(folder / scene["name"], scene["name"])
            else:
                yield Status(scene["name"], 0, 0, _size(scene), 0.0, False, None)
        return
    axes = _axes(scenes[0], study["provenance"].get("forces", FORCES), study["provenance"].get("roles", {}))
    store, values = Store(folder), dict(enumerate(values for _, values in combinations(axes)))
    fixed = study["provenance"]["parameters"]
    numbers = values.keys() & store.done()
    kept = {number: result for number in numbers if (result := store.load(number, {**fixed, **values[number]}))}
    failed, running = values.keys() & store.failures().keys(), _is_running(folder)
    seconds = {number: sum(result.seconds.values()) for number, result in kept.items()}
    left = _seconds_left(axes, seconds, failed, _processes(folder)) if running else None
    error = max((result.readings.relative_total_error for result in kept.values()), default=0.0)
    yield Status(name, len(kept), len(failed), len(values), error, running, left)


def _axes(scene: dict, forces: Collection[str] = FORCES, roles: Mapping[str, tuple[str, int]] = MappingProxyType({})):
    return make_axes(scene.get("vary", {}), scene.get("together"), forces=forces, loads=loads_among(roles))


def _size(scene: dict) -> int:
    return sum(1 for _ in combinations(_axes(scene)))


def _is_running(folder: Path) -> bool:
    from filelock import FileLock, Timeout

    try:
        with FileLock(folder / LOCK, timeout=0):
            return False
    except Timeout:
        return True


def _processes(folder: Path) -> int:
    """Jobs that are computed at once."""
    try:
        return max(1, int(json.loads((folder / RUN).read_text(encoding="utf-8"))["processes"]))
    except (OSError, ValueError, TypeError, KeyError, RecursionError):  # not written yet, or damaged
        return 1


def _seconds_left(
    axes: Sequence[Axis], seconds: Mapping[int, float], failed: Set[int], processes: int
) -> tuple[float, float] | None:
    """The least and most seconds for the jobs that are left, from those of the jobs that are done, by number."""
    if not seconds:
        return None
    curve = [axis.dim for axis in axes].index(curve_dimension(axes))
    checked = checked_places(axes[curve])
    kinds = [place[curve] in checked for place, _ in combinations(axes)]
    least = most = 0.0
    for kind in (True, False):
        own = [taken for number, taken in seconds.items() if kinds[number] is kind] or list(seconds.values())
        left = sum(each is kind and number not in seconds and number not in failed for number, each in enumerate(kinds))
        least, most = least + left * min(own) / processes, most + left * max(own) / processes
    return least, most
