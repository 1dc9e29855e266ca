"""Files as users name them: regular ones of a sane size, whose text is UTF-8 or what spreadsheets make of it."""

from __future__ import annotations

import codecs
import errno
import os
import stat
from pathlib import Path

from mitsuba_taxel.base.errors import InputError

LARGEST_TEXT = 1 << 28
"""Bytes of the largest text that is read."""
_LATIN = frozenset("µ°".encode("latin-1"))
"""Signs of units in the encoding of spreadsheets on Windows."""


def check_regular(file: Path, largest: int) -> None:
    """Refuse a file that is not read: a pipe or a device may have no end, and be waited for.

    Parameters
    ----------
    file : Path
        Of any kind.
    largest : int
        In bytes.

    Raises
    ------
    OSError
        that says why.
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

    Files in UTF-16 with such a mark, as spreadsheets write them, and those whose only letters beyond ASCII are the
    signs of µA and degrees in Latin-1, are read as well.

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
        content = read_bytes(file)
    except (OSError, ValueError) as error:  # the latter of names that no file can have
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
