"""Results on disk: places checked before anything is computed, files that are whole or not there."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mitsuba_taxel.errors import InputError


def make_folder(folder: Path) -> None:
    """Make ``folder`` and its parents where they are missing, and check that files can be made in it.

    Raises
    ------
    InputError
        if it cannot be made or written to.
    """
    try:
        if folder.is_file():
            raise InputError(f"output folder {folder} is a file: a folder is needed.")
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise InputError(f"output folder {folder} cannot be written: {error.strerror or error}.") from error


def make_empty_folder(folder: Path) -> None:
    """The same for a folder that must hold nothing yet, so that two studies never mix."""
    make_folder(folder)
    if any(folder.iterdir()):
        raise InputError(f"output folder {folder} is not empty: results of two studies would mix.")


def check_new_file(file: Path, *suffixes: str) -> None:
    """Check that ``file`` can be written later.

    Raises
    ------
    InputError
        if its name ends in none of ``suffixes``, it is a folder, or its folder cannot be written to.
    """
    if file.suffix.lower() not in suffixes:
        raise InputError(f"output {file} must end in {' or '.join(suffixes)}.")
    try:
        if file.is_dir():
            raise InputError(f"output {file} is a folder: a file is needed.")
        if not file.parent.is_dir():
            raise InputError(f"output {file} cannot be written: there is no folder {file.parent}.")
        with tempfile.TemporaryFile(dir=file.parent):
            pass
    except OSError as error:
        raise InputError(f"output {file} cannot be written: {error.strerror or error}.") from error


@contextmanager
def replacing(file: Path) -> Iterator[Path]:
    """A temporary path beside ``file``, which takes its place at once on success and vanishes on failure."""
    handle, name = tempfile.mkstemp(prefix=f".{file.stem}-", suffix=file.suffix, dir=file.parent)
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        with temporary.open("rb+") as written:
            os.fsync(written.fileno())
        temporary.chmod(0o666 & ~_umask())
        temporary.replace(file)
        _flush_folder(file.parent)
    finally:
        temporary.unlink(missing_ok=True)


def _flush_folder(folder: Path) -> None:
    """See that a renaming outlasts a power cut."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
