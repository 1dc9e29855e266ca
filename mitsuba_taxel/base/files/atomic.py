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

PREFIX = ".taxel-"
MARGIN = 1 << 18
"""Bytes that must be free beyond a file: the buffers of libraries are smaller."""
_FULL = [os.strerror(code) for code in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EROFS)]


class WriteError(ComputationError):
    """A file could not be written; ``reason`` says why."""

    def __init__(self, file: Path, reason: str) -> None:
        super().__init__(f"{file} cannot be written: {reason}.")
        self.file, self.reason = file, reason

    def __reduce__(self) -> tuple[type, tuple[Path, str]]:
        return type(self), (self.file, self.reason)


@contextmanager
def replacing(file: Path) -> Iterator[Path]:
    """A temporary path beside ``file``, which replaces it atomically on success and is removed on failure.

    Parameters
    ----------
    file : Path
        The file to be written, in an existing folder.

    Yields
    ------
    Path
        Where to write; of the same suffix.

    Raises
    ------
    WriteError
        if the file cannot be written.
    """
    try:
        handle, name = tempfile.mkstemp(prefix=_prefix(), suffix=file.suffix, dir=file.parent)
        os.close(handle)
        temporary = Path(name)
        try:
            yield temporary
            with temporary.open("rb+") as written:
                _refuse_full_disk(written)
                os.fsync(written.fileno())
            temporary.chmod(0o666 & ~_umask())
            temporary.replace(file)
            _flush_folder(file.parent)
        finally:
            temporary.unlink(missing_ok=True)
    except Exception as error:
        reason = reason_of(error)
        if reason is None:
            raise
        raise WriteError(file, reason) from error


def _refuse_full_disk(written: BinaryIO) -> None:
    """Raise if a file cannot grow: compiled libraries say nothing when the disk refuses the last of their buffers."""
    size = written.seek(0, os.SEEK_END)
    try:
        written.write(bytes(MARGIN))
        written.flush()
    finally:
        os.ftruncate(written.fileno(), size)


def write_text(file: Path, text: str) -> None:
    """Write a text in UTF-8, as :func:`replacing` does.

    Parameters
    ----------
    file : Path
        The file to be written, in an existing folder.
    text : str
        Its content.

    Raises
    ------
    WriteError
        if it cannot be written.
    """
    with replacing(file) as temporary:
        temporary.write_text(text, encoding="utf-8")


def reason_of(error: Exception) -> str | None:
    """Why a file cannot be written, if that caused an error: compiled libraries raise their own exceptions.

    Parameters
    ----------
    error : Exception
        Raised while a file was written.

    Returns
    -------
    str or None
        Such as "No space left on device"; None if another reason caused it.
    """
    if isinstance(error, WriteError):
        return error.reason
    if isinstance(error, OSError):
        return error.strerror or str(error)
    return next((reason for reason in _FULL if reason in str(error)), None)


def remove_stale(folder: Path) -> None:
    """Remove the temporary files that processes of this machine left in a folder when they were killed.

    Parameters
    ----------
    folder : Path
        An existing folder.
    """
    for file in folder.glob(f"{PREFIX}*"):
        owner = re.match(rf"{re.escape(PREFIX)}{re.escape(_host())}-(\d+)-", file.name)
        if owner and not file.is_dir() and not _is_alive(int(owner[1])):
            file.unlink(missing_ok=True)


def _prefix() -> str:
    return f"{PREFIX}{_host()}-{os.getpid()}-"


def _host() -> str:
    return re.sub(r"\W", "", socket.gethostname())[:32]


def _is_alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:  # another user's
        pass
    return True


def _flush_folder(folder: Path) -> None:
    """Make a renaming survive a power cut."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
