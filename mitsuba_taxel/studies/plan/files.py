"""Output files and folders, checked before anything is computed."""

from __future__ import annotations

import tempfile
from contextlib import suppress
from pathlib import Path

from mitsuba_taxel.base.arguments import path_of
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.files.atomic import remove_stale


def make_folder(folder: Path) -> None:
    """Create ``folder`` and its parents if missing, and check that it is writable.

    Parameters
    ----------
    folder : Path
        Folder, which need not exist.

    Raises
    ------
    InputError
        if it cannot be created or written to.
    """
    path_of("output folder", folder)
    try:
        if folder.is_file():
            raise InputError(f"output folder {folder} is a file: a folder is needed.")
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
        remove_stale(folder)
    except OSError as error:
        raise InputError(f"output folder {folder} cannot be written: {error.strerror or error}.") from error


def make_empty_folder(folder: Path) -> None:
    """Create ``folder`` as :func:`make_folder` does, and check that it is empty: results of two studies never mix.

    Raises
    ------
    InputError
        if it cannot be created or written to, or holds anything.
    """
    make_folder(folder)
    if any(folder.iterdir()):
        raise InputError(
            f"output folder {folder} is not empty: results of two studies would mix; choose an empty folder."
        )


def check_new_file(file: Path, *suffixes: str) -> None:
    """Check that ``file`` will be writable.

    Parameters
    ----------
    file : Path
        File to be written; it may exist.
    *suffixes : str
        Allowed suffixes, in lower case with their dot.

    Raises
    ------
    InputError
        if its suffix is none of ``suffixes``, it is a folder, or its folder is missing or not writable.
    """
    if file.suffix.lower() not in suffixes:
        raise InputError(f"output {file} must end in {' or '.join(suffixes)}.")
    path_of("output", file)
    try:
        if file.is_dir():
            raise InputError(f"output {file} is a folder: a file is needed.")
        with suppress(FileNotFoundError, NotADirectoryError):
            file.parent.stat()  # refused where it may not be seen, which Python 3.14 would take for a missing folder
        if not file.parent.is_dir():
            raise InputError(f"output {file} cannot be written: there is no folder {file.parent}.")
        with tempfile.TemporaryFile(dir=file.parent):
            pass
        remove_stale(file.parent)
    except OSError as error:
        raise InputError(f"output {file} cannot be written: {error.strerror or error}.") from error
