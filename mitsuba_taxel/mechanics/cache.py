"""Cache of arrays on disk, under a key that contains everything the arrays depend on.

Files are written atomically; damaged files are ignored. A folder that cannot be written only costs time.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mitsuba_taxel.base.files import archive
from mitsuba_taxel.base.files.atomic import WriteError, reason_of, remove_stale, replacing
from mitsuba_taxel.base.sources import code_digest

LARGEST = 10 * 10**9
"""Largest size of the folder in bytes."""
SPARED = 600.0
"""Seconds after the last use of an entry during which it is not removed."""
_OURS = re.compile(r"[0-9a-f]{64}\.npz")
ROOMS = ("parameters", "base", "geometry", "pads", "mechanics")
"""Subpackages of `mitsuba_taxel` whose code determines solutions; their digest is part of every key."""


def folder() -> Path:
    """Folder of the cache: ``MITSUBA_TAXEL_CACHE``, or ``mitsuba_taxel`` in the user's cache folder."""
    variable = os.environ.get("MITSUBA_TAXEL_CACHE")
    if variable:
        return Path(variable)
    cache = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA")  # Windows sets LOCALAPPDATA
    return (Path(cache) if cache else Path.home() / ".cache") / "mitsuba_taxel"


def key(*parts: object) -> str:
    """Name of a cache entry: the SHA-256 digest of JSON values and of the code of :data:`ROOMS`, in hexadecimal."""
    text = json.dumps([code_digest(*ROOMS), *parts], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def load(name: str) -> dict[str, np.ndarray] | None:
    """The arrays stored under ``name``; None if the file is missing or damaged."""
    file = folder() / f"{name}.npz"
    try:
        content = file.read_bytes()
        with suppress(OSError):  # a file of another user cannot be changed
            os.utime(file, ns=(time.time_ns(), file.stat().st_mtime_ns))  # few file systems record the time of reading
    except OSError:
        return None
    return archive.unpack(content)


def holds(name: str) -> bool:
    """Whether the cache has a file called ``name``, even a damaged one."""
    return (folder() / f"{name}.npz").is_file()


@contextmanager
def alone(name: str) -> Iterator[None]:
    """Context in which this process alone may compute the arrays called ``name``: other processes wait, so that the
    arrays are computed only once.

    Parameters
    ----------
    name : str
        Name of the entry; see :func:`key`.

    Yields
    ------
    None
        Nothing; the context begins when no other process computes the arrays. A folder that cannot be written is not
        locked.
    """
    from filelock import FileLock

    lock = FileLock(folder() / "locks" / name)
    try:
        Path(lock.lock_file).parent.mkdir(parents=True, exist_ok=True)
        lock.acquire()
    except OSError:
        pass  # arrays cannot be stored there either
    try:
        yield
    finally:
        if lock.is_locked:
            # A process that waits for the removed file gets its lock and finds the arrays. Only without arrays, as
            # after an error, may another process compute them at the same time, which does no harm.
            with suppress(OSError):
                os.unlink(lock.lock_file)
        lock.release()


class _Limit:
    """Keeps the size of the cache folder below :data:`LARGEST`. The size is measured at the first call, and again after
    every 1 % of the limit that has been stored."""

    def __init__(self) -> None:
        self._since = LARGEST

    def stored(self, size: int) -> None:
        self._since += size
        if self._since > LARGEST // 100:
            self._since = 0
            remove_least_recently_used(LARGEST)


cache_limit = _Limit()


def remove_least_recently_used(largest: int, spared: float = SPARED) -> tuple[int, int]:
    """Remove the least recently used entries until the remaining ones have at most ``largest`` bytes together.

    Entries that a process is computing, or has used in the last ``spared`` seconds, are kept, and so are their locks.
    Locks of processes that have ended are removed.

    Parameters
    ----------
    largest : int
        Bytes.
    spared : float
        Seconds.

    Returns
    -------
    count : int
        Number of entries removed.
    size : int
        Their bytes.
    """
    now, removed = time.time(), [0, 0]
    for lock in (folder() / "locks").glob("*"):
        with suppress(OSError):
            if now - lock.stat().st_mtime >= spared and not is_locked(lock.name):
                lock.unlink()
    files = [(file.stat(), file) for file in entries()]
    total = sum(about.st_size for about, _ in files)
    for about, file in sorted(files, key=lambda entry: max(entry[0].st_atime, entry[0].st_mtime)):
        if total <= largest or now - max(about.st_atime, about.st_mtime) < spared:
            break
        if not is_locked(file.name.removesuffix(".npz")):
            with suppress(OSError):
                os.unlink(file.path)
                total, removed = total - about.st_size, [removed[0] + 1, removed[1] + about.st_size]
    return removed[0], removed[1]


def store(name: str, arrays: dict[str, np.ndarray]) -> None:
    """Store ``arrays`` on disk under ``name``; warns if that is not possible."""
    try:
        folder().mkdir(parents=True, exist_ok=True)
        remove_stale(folder())
        with replacing(folder() / f"{name}.npz") as file:
            file.write_bytes(archive.pack(arrays))
        cache_limit.stored((folder() / f"{name}.npz").stat().st_size)
    except (OSError, WriteError) as error:
        # The location of the warning is here, not at the caller, so that it is shown once.
        warnings.warn(
            f"solutions are not kept: {folder()} cannot be written ({reason_of(error)}); set MITSUBA_TAXEL_CACHE to a "
            "folder that can be.",
            stacklevel=1,
        )


def entries() -> list[os.DirEntry[str]]:
    """The files in the cache's folder that this cache has written."""
    try:
        with os.scandir(folder()) as files:
            return [file for file in files if _OURS.fullmatch(file.name) and file.is_file(follow_symlinks=False)]
    except OSError:
        return []


def is_locked(name: str) -> bool:
    """Whether a process is computing the arrays that will be stored as ``name``."""
    from filelock import FileLock, Timeout

    file = folder() / "locks" / name
    if not file.is_file():
        return False
    try:
        with FileLock(file, timeout=0):
            return False
    except (Timeout, OSError):
        return True


def arrays_of(state: Any) -> dict[str, np.ndarray]:
    """The fields of a dataclass of arrays and numbers, as arrays by name, for :func:`store`.

    Fields of a dataclass within it are named "outer.inner"; fields that are None are left out.
    """
    arrays: dict[str, np.ndarray] = {}
    for field in fields(state):
        value = getattr(state, field.name)
        if is_dataclass(value):
            arrays |= {f"{field.name}.{name}": array for name, array in arrays_of(value).items()}
        elif value is not None:
            arrays[field.name] = np.array(value)
    return arrays


def values_of(arrays: dict[str, np.ndarray]) -> dict[str, Any]:
    """Restore a dictionary from the arrays of :func:`arrays_of`: arrays and numbers by name, inner dataclasses as
    dictionaries.
    """
    values: dict[str, Any] = {}
    for name, array in arrays.items():
        group, _, inner = name.rpartition(".")
        (values.setdefault(group, {}) if group else values)[inner] = array if array.ndim else array.item()
    return values
