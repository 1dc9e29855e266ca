"""The folder of a study: its definition, and one file for each job that is done or has failed.

``study.toml`` holds the definition of the study and the versions, ``study_scene.xml`` its scene; ``jobs/000042.npz`` is
a result, complete or absent, and ``failed/000042.json`` the reason of a failure. Everything else in the folder is
derived from them.
"""

from __future__ import annotations

import json
import math
import os
import re
import shutil
import socket
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import tomli_w

from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.base.files import archive, toml
from mitsuba_taxel.base.files.atomic import PREFIX, WriteError, reason_of, remove_stale, replacing, write_text
from mitsuba_taxel.mechanics import RoofError
from mitsuba_taxel.sensing import Readings
from mitsuba_taxel.sensing.reading.contact_value import FirstContact
from mitsuba_taxel.sensing.reading.derivative_values import Derivatives
from mitsuba_taxel.sensing.reading.pad_results import Estimate
from mitsuba_taxel.sensing.reading.prepared_scenes import Settings
from mitsuba_taxel.sensing.reading.runs import MOST_POINTS, REPLICATES
from mitsuba_taxel.studies.plan.files import make_folder
from mitsuba_taxel.studies.plan.growth import TARGETS, moves
from mitsuba_taxel.studies.plan.job import MAPS, MESHES, Failure, Job, JobResult
from mitsuba_taxel.studies.store.changes import changed_study

STUDY, LOCK, RUN, CHOICE = "study.toml", ".lock", "run.json", "points.json"
SCENE = "study_scene.xml"
"""The scene at the start of the study. For a scene made in Python, it is the file that jobs read."""
JOBS, FAILED = "jobs", "failed"
GROWING, GROWN = ".growing", ".grown"
"""Folders of a study that is being extended: incomplete, and complete."""
HEADING = "# The study whose results lie beside this file; it can be run again into another folder.\n"


class StoreError(ComputationError):
    """Results cannot be written; no further jobs are computed."""


class StoredResult(NamedTuple):
    """The result of a job as it is stored on disk: readings, computing time in s by stage, and the names of its files
    in the folder.
    """

    readings: Readings
    seconds: dict[str, float]
    files: list[str]


class Store:
    """The folder of results of a study of one scene: reads and writes its definition, results and failures.

    Attributes
    ----------
    results, suffix : str
        Name of the subfolder with a file for each result, and the suffix of these files.
    """

    results, suffix = JOBS, ".npz"

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.aims_higher = False
        """Whether the study now being written has a stricter target than the stored one."""

    @contextmanager
    def writing(self, content: Mapping[str, Any], scene: str, workers: str, processes: int) -> Iterator[None]:
        """Lock the folder for a run that starts or resumes a study.

        Parameters
        ----------
        content : Mapping[str, Any]
            Content of the study file, with its provenance.
        scene : str
            Text of its scene.
        workers : str
            Name of the pool that computes it.
        processes : int
            Number of jobs that are computed at the same time.

        Raises
        ------
        InputError
            if the folder cannot be written to, is in use by another run, or holds something else.
        """
        from filelock import FileLock, Timeout

        make_folder(self.folder)
        self._refuse_links()
        lock = FileLock(self.folder / LOCK)
        try:
            lock.acquire(timeout=0)
        except Timeout:
            raise InputError(
                f"output folder {self.folder} is in use by another run: wait for its end, or choose another folder."
            ) from None
        try:
            self._begin(content, scene)
            self._note_run(workers, processes)
            yield
        finally:
            lock.release()

    def _refuse_links(self) -> None:
        """Raise `InputError` for links and wrong kinds of files: a study writes only within its own folder."""
        for name in (LOCK, SCENE, self.results, FAILED, MESHES, MAPS, GROWING, GROWN):
            path = self.folder / name
            kind = "file" if name in (LOCK, SCENE) else "folder"
            if path.is_symlink():
                raise InputError(
                    f"output folder {self.folder} is not allowed: {name} in it is a link, not a {kind}; name another "
                    "folder."
                )
            if path.exists() and path.is_dir() is (kind == "file"):
                raise InputError(
                    f"output folder {self.folder} is not allowed: {name} in it is not a {kind}; name another folder."
                )

    def _begin(self, content: Mapping[str, Any], scene: str) -> None:
        """Write the definition of the study, or check that it agrees with the stored one, which it may extend."""
        self._finish_growing()
        if not (self.folder / STUDY).exists():
            if any(not file.name.startswith(".") and file.name != SCENE for file in self.folder.iterdir()):
                raise InputError(
                    f"output folder {self.folder} is not empty: results of two studies would mix; choose an empty one."
                )
            write_text(self.folder / STUDY, HEADING + tomli_w.dumps(content))

        # Another study is refused, unless it extends the stored one or that has no results.
        before = (self.folder / STUDY).read_text(encoding="utf-8", errors="replace").removeprefix(HEADING)
        difference = changed_study(tomli_w.dumps(content), before, scene, self.scene)
        if difference and not self._forget(content) and not self._grow(before, content):
            raise InputError(f"output folder {self.folder} holds another study ({difference}): choose another folder.")

        # Scene and folders of results.
        if self.scene != scene:
            write_text(self.folder / SCENE, scene)
        for name in (self.results, FAILED):
            make_folder(self.folder / name)
        for name in (MESHES, MAPS):
            remove_stale(self.folder / name)

    @property
    def _numbered_files(self) -> tuple[tuple[str, str], ...]:
        """Subfolders with a file for each job, and the suffixes of these files."""
        maps = [(MAPS, ".exr")] if any((self.folder / path / MAPS).is_dir() for path in ("", GROWN)) else []
        return (self.results, self.suffix), (FAILED, ".json"), *maps

    @property
    def scene(self) -> str:
        """Text of the scene at the start of the study; empty if it cannot be read."""
        try:
            return (self.folder / SCENE).read_text(encoding="utf-8", errors="replace")
        except OSError:
            return ""

    def _forget(self, content: Mapping[str, Any]) -> bool:
        """Replace the stored study by ``content`` if it has no result yet, and return True. Otherwise change nothing,
        and return False."""
        if self.done() or not (self.folder / self.results).is_dir():
            return False
        self.forget_failures()
        (self.folder / CHOICE).unlink(missing_ok=True)
        write_text(self.folder / STUDY, HEADING + tomli_w.dumps(content))
        return True

    def _grow(self, before: str, content: Mapping[str, Any]) -> bool:
        """Extend the stored study to a study that contains all its results, with new numbers.

        Returns False, and changes nothing, if it is another study. The extended study is prepared in a folder beside
        the results. Once that has its final name, the next run completes the extension if this one is killed.
        """
        # New numbers of the stored jobs; jobs with results must not be lost.
        try:
            stored = toml.loads(before)
            numbers = moves(stored, content)
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError, InputError):
            return False
        if numbers is None:
            return False
        left_out = {number for number, new_number in numbers.items() if new_number is None}
        if left_out.intersection(self.done()) or (left_out and not (self.folder / self.results).is_dir()):
            return False
        self.aims_higher = any(stored.get(name) != content.get(name) for name in TARGETS)

        # Copies of all files under their new numbers, then the switch to the extended study.
        ready = self.folder / GROWING
        shutil.rmtree(ready, ignore_errors=True)
        for name, suffix in self._numbered_files:
            (ready / name).mkdir(parents=True)
            for number, file in _numbered(self.folder / name, suffix).items():
                if numbers.get(number) is not None:
                    shutil.copy2(file, ready / name / f"{numbers[number]:06d}{suffix}")
        (ready / STUDY).write_text(HEADING + tomli_w.dumps(content), encoding="utf-8")
        ready.rename(self.folder / GROWN)
        self._finish_growing()
        return True

    def _finish_growing(self) -> None:
        """Replace the results by the extended study that :meth:`_grow` has prepared, if there is one."""
        ready = self.folder / GROWN
        if not ready.is_dir():
            return
        with replacing(self.folder / STUDY) as file:
            shutil.copyfile(ready / STUDY, file)
        # A run that is killed between two of these steps is completed by repeating them. Files of users in the old
        # folders are kept.
        for name, suffix in self._numbered_files:
            target, before = self.folder / name, ready / f"{name}_before"
            if (ready / name).is_dir():
                if target.is_dir() and not before.exists():
                    target.rename(before)
                (ready / name).rename(target)
            ours = {path.name for path in _numbered(before, suffix).values()}
            for foreign in before.iterdir() if before.is_dir() else ():
                if foreign.name not in ours and not foreign.name.startswith(PREFIX):
                    foreign.rename(target / foreign.name)
        shutil.rmtree(ready)

    def _note_run(self, workers: str, processes: int) -> None:
        """Record the process and start of this run, for :func:`study_status`."""
        about = {"started": time.time(), "finished_before": len(self.done()) + len(self.failures()), "workers": workers}
        about["processes"] = processes
        self._write_json(RUN, {**about, "host": socket.gethostname(), "process": os.getpid()})

    @property
    def choice(self) -> tuple[Settings, dict[str, float]] | None:
        """Settings chosen by pilot runs, and the seconds of these runs by stage; None before they have run.

        Raises
        ------
        InputError
            if the file is damaged: results of other settings would not match the stored results.
        """
        file = self.folder / CHOICE
        try:
            chosen = json.loads(file.read_text(encoding="utf-8"))
            settings, seconds = Settings(chosen["points"], chosen["mesh_size"]), chosen["pilot_seconds"]
            _require(isinstance(settings.points, int) and 0 <= settings.points <= MOST_POINTS)
            _require(settings.mesh_size is None or 0 < settings.mesh_size < math.inf)
            _require(_is_seconds(seconds))
        except OSError:
            return None
        except (ValueError, TypeError, KeyError, RecursionError) as error:
            raise InputError(f"{file} is damaged: remove it, and the results in {self.results} beside it.") from error
        return settings, seconds

    def keep_choice(self, settings: Settings, pilot_seconds: Mapping[str, float]) -> None:
        """Store the settings that pilot runs have chosen, and the seconds of these runs; :attr:`choice` returns them.
        """
        self._write_json(CHOICE, {**settings._asdict(), "pilot_seconds": dict(pilot_seconds)})

    def _write_json(self, name: str, content: Mapping[str, Any]) -> None:
        write_text(self.folder / name, json.dumps(content))

    def done(self) -> list[int]:
        """Numbers of the jobs whose results are stored."""
        return sorted(_numbered(self.folder / self.results, self.suffix))

    def failures(self) -> dict[int, Failure]:
        """Failures by job number; damaged files are skipped."""
        files = sorted(_numbered(self.folder / FAILED, ".json").items())
        read = {number: _failure(file) for number, file in files}
        return {number: failure for number, failure in read.items() if failure is not None}

    def forget_failures(self) -> None:
        """Remove all failures, so that their jobs are repeated."""
        for file in _numbered(self.folder / FAILED, ".json").values():
            file.unlink()

    def keep(self, job: Job, outcome: JobResult | Failure) -> None:
        """Store the outcome of a job on disk before this method returns.

        Raises
        ------
        StoreError
            if it cannot be written.
        """
        try:
            if isinstance(outcome, Failure):
                write_text(self._failed(job.number), json.dumps(asdict(outcome)))
                return
            self._keep_files(outcome.files)
            with replacing(self.file_of(job.number)) as file:
                file.write_bytes(archive.pack(_arrays(keepable(outcome))))
        except (OSError, WriteError) as error:
            raise self.not_stored(error) from error

    def not_stored(self, error: Exception) -> StoreError:
        """The error for a result that could not be written because of another error."""
        return StoreError(
            f"results cannot be stored in {self.folder} ({reason_of(error)}): {len(self.done())} jobs are stored; the "
            "same command resumes from there."
        )

    def _keep_files(self, files: Mapping[str, bytes]) -> None:
        for name, content in files.items():
            target = self.folder / name
            # Meshes have names of their content; the map of a job may be one with fewer points.
            if name.startswith(f"{MAPS}/") or not target.exists():
                target.parent.mkdir(exist_ok=True)
                with replacing(target) as file:
                    file.write_bytes(content)

    def load(self, number: int, parameters: Mapping[str, str]) -> StoredResult | None:
        """Load the stored result of job ``number``; None if it is missing, damaged or was computed with other
        parameters.
        """
        try:
            arrays = archive.unpack(self.file_of(number).read_bytes())
            kept = None if arrays is None else _kept(arrays)
        except Exception:  # missing, or in the format of another version
            return None
        if kept is None or kept.readings.parameters != parameters:
            return None
        # A study that has grown since has given the job another number.
        files = [f"{MAPS}/{number:06d}.exr" if name.startswith(f"{MAPS}/") else name for name in kept.files]
        return kept._replace(files=files)

    def file_of(self, number: int) -> Path:
        """Path of the file with the result of a job."""
        return self.folder / self.results / f"{number:06d}{self.suffix}"

    def _failed(self, number: int) -> Path:
        return self.folder / FAILED / f"{number:06d}.json"


def keepable(result: JobResult) -> StoredResult:
    """Convert the result of a job to the form that is stored: the names of its files replace their contents."""
    return StoredResult(result.readings, result.seconds, list(result.files))


BY, CONTACT = "derivatives_", "contact_"
"""Prefixes of the names of the arrays of `Derivatives` and `FirstContact`."""
_OPTIONAL = ("responsivity", "deviation", "dark_error", "facets")


def _arrays(kept: StoredResult) -> dict[str, np.ndarray]:
    """Arrays of the file in which a result is stored; numbers, texts and lists are JSON in the array ``words``."""
    readings = kept.readings
    words = {
        "points": readings.points,
        "seed": readings.seed,
        "parameters": readings.parameters,
        "mesh_size": readings.mesh_size,
        "remarks": readings.remarks,
        "exceeded_limits": readings.exceeded_limits,
        "finishes": readings.finishes,
        "pads": readings.pads,
        "roof_errors": [None if error is None else asdict(error) for error in readings.roof_errors],
        "seconds": kept.seconds,
        "files": kept.files,
    }
    optional = {name: getattr(readings, name) for name in _OPTIONAL}
    arrays = {"replicates": readings.replicates, **_of_derivatives(readings.derivatives)}
    arrays |= {name: array for name, array in optional.items() if array is not None}
    if readings.positions is not None:
        arrays["positions"] = readings.positions
    arrays |= _of_contact(readings.contact)
    return {**arrays, "words": np.array(json.dumps(words))}


def _of_derivatives(derivatives: Derivatives | None) -> dict[str, np.ndarray]:
    if derivatives is None:
        return {}
    return {f"{BY}{name}": np.array(values) for name, values in vars(derivatives).items()}


def _of_contact(contact: FirstContact | None) -> dict[str, np.ndarray]:
    return {} if contact is None else {f"{CONTACT}{name}": np.array(value) for name, value in vars(contact).items()}


def _contact(arrays: Mapping[str, np.ndarray]) -> FirstContact | None:
    """Restore the first contact from a result's file, None if it has none; raises an error if it is damaged."""
    fields = {name.removeprefix(CONTACT): array for name, array in arrays.items() if name.startswith(CONTACT)}
    if not fields:
        return None
    _require(fields["rates"].ndim == 1 and fields["rates"].dtype == float)
    return FirstContact(float(fields["value"]), fields["rates"], str(fields["touched"]), str(fields["ended"]))


def _derivatives(arrays: Mapping[str, np.ndarray], taxels: int) -> Derivatives | None:
    """Restore the derivatives from a result's file, None if it has none; raises an error if they are damaged."""
    fields = {name.removeprefix(BY): array for name, array in arrays.items() if name.startswith(BY)}
    if not fields:
        return None
    names, units = (tuple(fields.pop(name).tolist()) for name in ("parameters", "units"))
    strain, clearance = (float(fields.pop(name)) for name in ("strain", "clearance"))
    kept = Derivatives(names, units, strain=strain, clearance=clearance, method=str(fields.pop("method")), **fields)
    _require(kept.values.shape == kept.standard_errors.shape == (taxels, len(names)))
    _require(kept.power.shape == kept.power_errors.shape == (taxels,))
    _require(kept.strain_rates.shape == kept.clearance_rates.shape == (len(names),))
    return kept


def _kept(arrays: Mapping[str, np.ndarray]) -> StoredResult:
    """Restore the result of a job from the arrays of its file; raises an error if they are damaged."""
    words = json.loads(str(arrays["words"]))
    seconds, files = words.pop("seconds"), words.pop("files")
    errors = [None if error is None else RoofError(**error) for error in words.pop("roof_errors")]
    pads = {name: Estimate(*estimate) for name, estimate in words.pop("pads", {}).items()}
    replicates = arrays["replicates"]
    _require(replicates.ndim == 2 and replicates.dtype == float and len(replicates) == REPLICATES)
    for name in set(_OPTIONAL) & arrays.keys():
        _require(arrays[name].shape == replicates.shape[1:] and arrays[name].dtype == float)
    positions = arrays.get("positions")
    _require(positions is None or (positions.shape == (replicates.shape[1], 2) and positions.dtype == float))
    _require(all(isinstance(word, str) for word in (*words["remarks"], *files)) and _is_seconds(seconds))
    _require(all(isinstance(stretch, float) for stretch in words.get("exceeded_limits", {}).values()))
    _require(all(isinstance(finish, str) for finish in words.get("finishes", {}).values()))
    readings = Readings(
        replicates,
        seconds=seconds,
        responsivity=arrays.get("responsivity"),
        positions=positions,
        deviation=arrays.get("deviation"),
        dark_error=arrays.get("dark_error"),
        facets=arrays.get("facets"),
        derivatives=_derivatives(arrays, replicates.shape[1]),
        contact=_contact(arrays),
        roof_errors=errors,
        pads=pads,
        **words,
    )
    return StoredResult(readings, seconds, files)


def _require(condition: bool) -> None:
    if not condition:
        raise ValueError


def _is_seconds(seconds: object) -> bool:
    """Whether a value read from a file is a dictionary of times in s."""
    return isinstance(seconds, dict) and all(isinstance(time, (int, float)) for time in seconds.values())


def _numbered(folder: Path, suffix: str) -> dict[int, Path]:
    """The files of jobs in a folder by job number; other files are ignored."""
    return {int(file.stem): file for file in folder.glob(f"*{suffix}") if re.fullmatch("[0-9]{6}", file.stem)}


def _failure(file: Path) -> Failure | None:
    """Read the failure of a job from its file; None if the file is damaged."""
    try:
        failure = Failure(**json.loads(file.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError, RecursionError):
        return None
    return failure if isinstance(failure.message, str) else None


def begin_tree(folder: Path, study: Mapping[str, Any]) -> None:
    """Create the folder of results of a study of several scenes, with a subfolder for each scene.

    Parameters
    ----------
    folder : Path
        New, empty, or of the same study.
    study : Mapping[str, Any]
        Content of its study file.

    Raises
    ------
    InputError
        if it cannot be written to, or holds something else.
    """
    make_folder(folder)
    if any(folder.iterdir()) and not (folder / STUDY).exists():
        raise InputError(
            f"output folder {folder} is not empty: results of two studies would mix; choose an empty folder."
        )
    write_text(folder / STUDY, HEADING + tomli_w.dumps(study))
