"""Progress of a study on disk, seen from another process."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from mitsuba_taxel.studies.plan.vary import combinations, make_axes
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
    seconds_left : float or None
        Estimated from the pace of this run; None if nothing runs or nothing is done yet.
    """

    name: str
    done: int
    failed: int
    total: int
    error: float
    running: bool
    seconds_left: float | None


def study_status(folder: str | Path) -> list[Status]:
    """Progress of each scene of the study in a folder; raises `InputError` if it holds none."""
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
    store, values = Store(folder), dict(enumerate(values for _, values in combinations(_axes(scenes[0]))))
    fixed = study["provenance"]["parameters"]
    numbers = values.keys() & store.done()
    kept = [result for number in numbers if (result := store.load(number, {**fixed, **values[number]}))]
    done, failed, running = len(kept), len(values.keys() & store.failures()), _is_running(folder)
    left = _seconds_left(folder, done + failed, len(values)) if running else None
    error = max((result.readings.relative_total_error for result in kept), default=0.0)
    yield Status(name, done, failed, len(values), error, running, left)


def _axes(scene: dict):
    return make_axes(scene.get("vary", {}), scene.get("together"))


def _size(scene: dict) -> int:
    return sum(1 for _ in combinations(_axes(scene)))


def _is_running(folder: Path) -> bool:
    from filelock import FileLock, Timeout

    try:
        with FileLock(folder / LOCK, timeout=0):
            return False
    except Timeout:
        return True


def _seconds_left(folder: Path, finished: int, total: int) -> float | None:
    try:
        run = json.loads((folder / RUN).read_text(encoding="utf-8"))
        now, seconds = finished - run["finished_before"], time.time() - run["started"]
    except (OSError, ValueError, TypeError, KeyError, RecursionError):  # not written yet, or damaged
        return None
    return seconds / now * (total - finished) if now > 0 else None
