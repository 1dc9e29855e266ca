"""Files as users name them: regular ones of a sane size, whose text is UTF-8."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path

from mitsuba_taxel.base.errors import InputError

LARGEST_TEXT = 1 << 28
"""Bytes of the largest text that is read."""


def check_regular(file: Path, largest: int) -> None:
    """Raise an `OSError` that says why a file is not read: a pipe or a device may have no end, and be waited for.

    Parameters
    ----------
    largest : int
        In bytes.
    """
    about = file.stat()
    if stat.S_ISDIR(about.st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(file))
    if not stat.S_ISREG(about.st_mode):
        raise OSError(errno.EINVAL, "it is a pipe, a device or a socket, not a file", str(file))
    if about.st_size > largest:
        size = f"it has {about.st_size / 2**20:.0f} MB, but at most {largest / 2**20:.0f} MB can be read"
        raise OSError(errno.EFBIG, size, str(file))


def read_bytes(file: Path, largest: int = LARGEST_TEXT) -> bytes:
    """The content of a regular file.

    Parameters
    ----------
    file : Path
        Of any kind.
    largest : int
        Bytes that it may have.

    Returns
    -------
    bytes
        Its content.

    Raises
    ------
    OSError
        if it is a folder, a pipe or a device, or larger.
    """
    check_regular(file, largest)
    return file.read_bytes()


def read_text(what: str, file: Path, needed: str = "a CSV file") -> str:
    """The text of a file in UTF-8, without a byte order mark; messages begin with ``what``.

    Parameters
    ----------
    what : str
        What the file is, for messages.
    file : Path
        Of any kind.
    needed : str
        What is needed instead, for messages.

    Returns
    -------
    str
        With "\\n" at the end of lines.

    Raises
    ------
    InputError
        if it cannot be read, or is not text.
    """
    try:
        return read_bytes(file).decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError as error:
        raise InputError(f"{what} is not text: {needed} is needed.") from error
    except (OSError, ValueError) as error:  # the latter of names that no file can have
        reason = error.strerror if isinstance(error, OSError) else error
        raise InputError(f"{what} cannot be read ({reason}): {needed} is needed.") from error
