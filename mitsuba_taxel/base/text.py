"""Text files as users write them."""

from __future__ import annotations

from pathlib import Path

from mitsuba_taxel.base.errors import InputError


def read_text(what: str, file: Path, needed: str = "a CSV file") -> str:
    """The text of a file in UTF-8, without a byte order mark; messages begin with ``what``.

    Raises
    ------
    InputError
        if it cannot be read, or is not text.
    """
    try:
        return file.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{what} is not text: {needed} is needed.") from error
    except (OSError, ValueError) as error:  # the latter of names that no file can have
        reason = error.strerror if isinstance(error, OSError) else error
        raise InputError(f"{what} cannot be read ({reason}): {needed} is needed.") from error
