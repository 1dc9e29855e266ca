"""Cache of arrays on disk, under a key of everything that determines them.

Files are written atomically; damaged ones are ignored. A folder that cannot be written costs time only.
"""

from __future__ import annotations

import hashlib
import json
import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from mitsuba_taxel.base import archive
from mitsuba_taxel.base.atomic import WriteError, reason_of, remove_stale, replacing
from mitsuba_taxel.base.sources import code_digest

ROOMS = ("parameters", "base", "geometry", "pads", "mechanics")
"""The code that solutions depend on."""


def folder() -> Path:
    """``MITSUBA_TAXEL_CACHE``, or ``mitsuba_taxel`` in the user's cache folder."""
    chosen = os.environ.get("MITSUBA_TAXEL_CACHE")
    if chosen:
        return Path(chosen)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "mitsuba_taxel"


def key(*parts: object) -> str:
    """Hexadecimal digest of JSON values (floats exactly), and of the code that uses them."""
    text = json.dumps([code_digest(*ROOMS), *parts], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def load(name: str) -> dict[str, np.ndarray] | None:
    """The arrays stored under ``name``, or None if missing or damaged."""
    try:
        content = (folder() / f"{name}.npz").read_bytes()
    except OSError:
        return None
    return archive.unpack(content)


def holds(name: str) -> bool:
    """Whether something is stored under ``name``, even if damaged."""
    return (folder() / f"{name}.npz").is_file()


@contextmanager
def alone(name: str) -> Iterator[None]:
    """Lock ``name`` against other processes, so that its arrays are computed once."""
    from filelock import FileLock

    lock = FileLock(folder() / "locks" / name)
    try:
        Path(lock.lock_file).parent.mkdir(parents=True, exist_ok=True)
        lock.acquire()
    except OSError:
        pass  # nothing can be stored there either
    try:
        yield
    finally:
        lock.release()


def store(name: str, arrays: dict[str, np.ndarray]) -> None:
    """Store ``arrays`` under ``name``; warns if that is not possible."""
    try:
        folder().mkdir(parents=True, exist_ok=True)
        remove_stale(folder())
        with replacing(folder() / f"{name}.npz") as file:
            file.write_bytes(archive.pack(arrays))
    except (OSError, WriteError) as error:
        # Here, and not where it is called, so that it is said once.
        warnings.warn(f"solutions are not kept: {folder()} cannot be written ({reason_of(error)}).", stacklevel=1)


def arrays_of(state: Any) -> dict[str, np.ndarray]:
    """The fields of a dataclass of arrays and numbers by name, to be stored."""
    return {field.name: np.array(getattr(state, field.name)) for field in fields(state)}


def values_of(arrays: dict[str, np.ndarray]) -> dict[str, Any]:
    """The inverse of :func:`arrays_of`: the arrays, and numbers as such."""
    return {name: array if array.ndim else array.item() for name, array in arrays.items()}
