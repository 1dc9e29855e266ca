"""Reading of users' TOML files."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.files.text import read_bytes

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

loads = tomllib.loads
CHAIN = re.compile(r"""(?<![\w"'-])(?:[\w"'-]+[ \t]*\.[ \t]*){64}""")
"""A dotted key that is too long: parsing needs memory that is quadratic in its length."""


def read_toml(what: str, file: Path) -> dict[str, Any]:
    """Read a TOML file.

    Parameters
    ----------
    what : str
        Description of the file, at the beginning of messages.
    file : Path
        A file in UTF-8.

    Returns
    -------
    dict[str, Any]
        Tables and values.

    Raises
    ------
    InputError
        if the file cannot be read, is not valid TOML, or is nested too deeply.
    """
    try:
        text = read_bytes(file).decode("utf-8-sig")
        if CHAIN.search(text):
            raise RecursionError
        return loads(text)
    except OSError as error:
        raise InputError(f"{what} cannot be read: {error.strerror}.") from error
    except ValueError as error:
        raise InputError(f"{what} is not valid TOML: {' '.join(str(error).split())}.") from error
    except RecursionError as error:
        raise InputError(f"{what} is not allowed: it is nested too deeply; nest fewer tables.") from error
