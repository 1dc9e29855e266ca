"""Reading of files named by users: regular files of limited size, with text in UTF-8 or an encoding of spreadsheets."""

from __future__ import annotations

import codecs
import errno
import os
import stat
from pathlib import Path

from mitsuba_taxel.base.errors import InputError

LARGEST_TEXT = 1 << 28
"""Largest size of a text file, in bytes."""
_LATIN = frozenset("µ°".encode("latin-1"))
"""Symbols of units in Latin-1, the encoding of spreadsheets on Windows."""


def check_regular(file: Path, largest: int) -> None:
    """Raise unless a file is regular and not too large: reading a pipe or a device may never end.

    Parameters
    ----------
    file : Path
        A file of any kind.
    largest : int
        Largest size in bytes.

    Raises
    ------
    OSError
        with the reason, if the file is not regular or too large.
    """
    status = file.stat()
    if stat.S_ISDIR(status.st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(file))
    if not stat.S_ISREG(status.st_mode):
        raise OSError(errno.EINVAL, "it is a pipe, a device or a socket, not a file", str(file))
    if status.st_size > largest:
        size = f"it has {status.st_size / 2**20:.0f} MB, but at most {largest / 2**20:.0f} MB can be read"
        raise OSError(errno.EFBIG, size, str(file))


def read_bytes(file: Path, largest: int = LARGEST_TEXT) -> bytes:
    """Read a regular file.

    Parameters
    ----------
    file : Path
        A file of any kind.
    largest : int
        Largest size in bytes.

    Returns
    -------
    bytes
        Content of the file.

    Raises
    ------
    OSError
        if the file is a folder, a pipe or a device, or is too large.
    """
    check_regular(file, largest)
    return file.read_bytes()


def read_text(what: str, file: Path, needed: str = "a CSV file") -> str:
    """Read a text file in UTF-8.

    Files in UTF-16 with a byte order mark, as written by spreadsheets, are read as well. So are files in Latin-1 whose
    only letters beyond ASCII are the symbols of micro and degrees.

    Parameters
    ----------
    what : str
        Description of the file, at the beginning of messages.
    file : Path
        A file of any kind.
    needed : str
        Description of the file that is needed, for messages.

    Returns
    -------
    str
        The text, without a byte order mark and with "\\n" at the end of lines.

    Raises
    ------
    InputError
        if the file cannot be read, or is not text.
    """
    try:
        content = read_bytes(file)
    except (OSError, ValueError) as error:  # ValueError for an invalid file name
        reason = error.strerror if isinstance(error, OSError) else error
        raise InputError(f"{what} cannot be read ({reason}): {needed} is needed.") from error
    encoding = "utf-16" if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) else "utf-8-sig"
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError as error:
        if not {byte for byte in content if byte > 127} <= _LATIN:
            raise InputError(f"{what} is not text: {needed} is needed.") from error
        text = content.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n")
