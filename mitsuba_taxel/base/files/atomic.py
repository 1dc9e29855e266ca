"""Atomic writing of files: complete or absent, even if a run is killed or the disk is full."""

from __future__ import annotations

import errno
import os
import re
import socket
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.base.processes.system import flush_folder, is_alive

PREFIX = ".taxel-"
MARGIN = 1 << 18
"""Bytes that must be free on the disk after a file is written; they exceed the buffers of libraries."""
_FULL = [os.strerror(code) for code in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EROFS)]


class WriteError(ComputationError):
    """A file cannot be written; ``reason`` states why."""

    def __init__(self, file: Path, reason: str) -> None:
        super().__init__(f"{file} cannot be written: {reason}.")
        self.file, self.reason = file, reason

    def __reduce__(self) -> tuple[type, tuple[Path, str]]:
        return type(self), (self.file, self.reason)


@contextmanager
def replacing(file: Path) -> Iterator[Path]:
    """Write a file atomically: a temporary file replaces it on success, and is removed on failure.

    Parameters
    ----------
    file : Path
        The file to be written, in an existing folder.

    Yields
    ------
    Path
        Temporary path for the content, with the same suffix.

    Raises
    ------
    WriteError
        if the file cannot be written.
    """
    try:
        handle, name = tempfile.mkstemp(prefix=f"{PREFIX}{_host()}-{os.getpid()}-", suffix=file.suffix, dir=file.parent)
        os.close(handle)
        temporary = Path(name)
        try:
            yield temporary
            with temporary.open("rb+") as written:
                _refuse_full_disk(written)
                os.fsync(written.fileno())
            temporary.chmod(0o666 & ~_umask())
            temporary.replace(file)
            flush_folder(file.parent)
        finally:
            temporary.unlink(missing_ok=True)
    except Exception as error:
        reason = reason_of(error)
        if reason is None:
            raise
        raise WriteError(file, reason) from error


def _refuse_full_disk(written: BinaryIO) -> None:
    """Raise if a file cannot grow: compiled libraries do not report if the disk refuses their last buffer."""
    size = written.seek(0, os.SEEK_END)
    try:
        written.write(bytes(MARGIN))
        written.flush()
    finally:
        os.ftruncate(written.fileno(), size)


def write_text(file: Path, text: str) -> None:
    """Write a text file in UTF-8 atomically; see :func:`replacing`.

    Parameters
    ----------
    file : Path
        The file to be written, in an existing folder.
    text : str
        Content of the file.

    Raises
    ------
    WriteError
        if the file cannot be written.
    """
    with replacing(file) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")  # the same file on every system


def reason_of(error: Exception) -> str | None:
    """Reason why a file cannot be written, from an error, which may be an exception of a compiled library.

    Parameters
    ----------
    error : Exception
        Error that was raised while a file was written.

    Returns
    -------
    str or None
        Text such as "No space left on device"; None if the error has another cause.
    """
    if isinstance(error, WriteError):
        return error.reason
    if isinstance(error, OSError):
        return error.strerror or str(error)
    return next((reason for reason in _FULL if reason in str(error)), None)


def remove_stale(folder: Path) -> None:
    """Remove temporary files of killed processes of this machine.

    Parameters
    ----------
    folder : Path
        An existing folder.
    """
    for file in folder.glob(f"{PREFIX}*"):
        owner = re.match(rf"{re.escape(PREFIX)}{re.escape(_host())}-(\d+)-", file.name)
        if owner and not file.is_dir() and not is_alive(int(owner[1])):
            file.unlink(missing_ok=True)


def _host() -> str:
    """Name of this machine for file names."""
    return re.sub(r"\W", "", socket.gethostname())[:32]


def _umask() -> int:
    """Mask of permissions of new files."""
    mask = os.umask(0)
    os.umask(mask)
    return mask
