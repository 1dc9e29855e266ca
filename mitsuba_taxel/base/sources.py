"""Digests of sources, by which results of other code are recognised as stale."""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from types import CodeType

from mitsuba_taxel.base.caches import kept

PACKAGE = "mitsuba_taxel"


@kept(None)
def code_digest(*rooms: str) -> str:
    """Hexadecimal digest of every file of some sub-packages, however deep it lies, and of the modules beside them.

    Parameters
    ----------
    *rooms : str
        Names of the sub-packages.

    Returns
    -------
    str
        Of 64 digits.

    Raises
    ------
    ImportError
        if there is no such sub-package, so that one that was moved is not silently dropped from a key.
    """
    digest = hashlib.sha256()
    for name, file in _files(rooms):
        digest.update(f"{name}\n{hashlib.sha256(file.read_bytes()).hexdigest()}\n".encode())
    return digest.hexdigest()


@kept(None)
def own_code(own: type) -> str:
    """Hexadecimal digest of the code outside this package by which a class is defined; empty if there is none.

    Parameters
    ----------
    own : type
        A class of a user, say. Of each class outside this package that it derives from, the whole file counts, with the
        functions and constants that it may use; where there is no file, as in a notebook, its methods.

    Returns
    -------
    str
        Of 64 digits, or empty.
    """
    digest, foreign = hashlib.sha256(), False
    for base in own.__mro__:
        root = base.__module__.partition(".")[0]
        if root == PACKAGE or root in sys.stdlib_module_names:
            continue
        foreign = True
        file = getattr(sys.modules.get(base.__module__), "__file__", None)
        if file and Path(file).is_file():
            digest.update(hashlib.sha256(Path(file).read_bytes()).digest())
        else:
            digest.update("\n".join(_code_of(base)).encode())
    return digest.hexdigest() if foreign else ""


def _code_of(own: type) -> Iterator[str]:
    """What the methods and constants of a class are, as far as it does not depend on where they are in memory."""
    for name, value in sorted(vars(own).items()):
        if isinstance(value, property):
            value = value.fget
        code = getattr(getattr(value, "func", getattr(value, "__func__", value)), "__code__", None)
        if code is not None:
            yield f"{name} {_instructions(code)}"
        elif isinstance(value, bool | int | float | str | tuple) and not name.startswith("__"):
            yield f"{name} {value!r}"


def _instructions(code: CodeType) -> list[object]:
    """Instructions, names and constants of a function, and of those within it."""
    constants = [
        _instructions(constant) if isinstance(constant, CodeType) else repr(constant) for constant in code.co_consts
    ]
    return [code.co_code.hex(), code.co_names, code.co_varnames, constants]


def _files(rooms: tuple[str, ...]) -> Iterator[tuple[str, Path]]:
    """Files by their names within the package, wherever it is installed."""
    for file in sorted(_folder(PACKAGE).glob("*.py")):
        yield file.name, file
    for room in sorted(rooms):
        folder = _folder(f"{PACKAGE}.{room}")
        for file in sorted(folder.rglob("*")):
            inside = file.relative_to(folder)
            if file.is_file() and not any(part == "__pycache__" or part.startswith(".") for part in inside.parts):
                yield f"{room}/{inside}", file


def _folder(package: str) -> Path:
    spec = find_spec(package)
    if spec is None or not spec.submodule_search_locations:
        raise ImportError(f"{package} is not installed: install the project with pip.")
    return Path(spec.submodule_search_locations[0])
