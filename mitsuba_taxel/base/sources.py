"""Digests of source code, by which results of other code are recognised."""

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
    """Digest of the source code of sub-packages, including nested folders, and of the top-level modules.

    Parameters
    ----------
    *rooms : str
        Names of the sub-packages.

    Returns
    -------
    str
        64 hexadecimal digits.

    Raises
    ------
    ImportError
        if there is no such sub-package, so that a moved sub-package is not silently missing from a key.
    """
    digest = hashlib.sha256()
    for name, file in _files(rooms):
        digest.update(f"{name}\n{hashlib.sha256(file.read_bytes()).hexdigest()}\n".encode())
    return digest.hexdigest()


@kept(None)
def own_code(own: type) -> str:
    """Digest of the code outside this package that defines a class.

    The digest contains the complete file of the class, and of each base class outside this package, as the class may
    use functions and constants of these files. Without a file, as in a notebook, it contains the methods.

    Parameters
    ----------
    own : type
        A class, such as a class of a user.

    Returns
    -------
    str
        64 hexadecimal digits; empty for a class of this package.
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
    """Text of the code of a class for its digest: the methods, and the values of the constants, without addresses in
    memory."""
    for name, value in sorted(vars(own).items()):
        if isinstance(value, property):
            value = value.fget
        code = getattr(getattr(value, "func", getattr(value, "__func__", value)), "__code__", None)
        if code is not None:
            yield f"{name} {_instructions(code)}"
        elif isinstance(value, bool | int | float | str | tuple) and not name.startswith("__"):
            yield f"{name} {value!r}"


def _instructions(code: CodeType) -> list[object]:
    """Instructions, names and constants of a function and its nested functions."""
    constants = [
        _instructions(constant) if isinstance(constant, CodeType) else repr(constant) for constant in code.co_consts
    ]
    return [code.co_code.hex(), code.co_names, code.co_varnames, constants]


def _files(rooms: tuple[str, ...]) -> Iterator[tuple[str, Path]]:
    """Names within the package, and paths, of all files of sub-packages and of the top-level modules."""
    for file in sorted(_folder(PACKAGE).glob("*.py")):
        yield file.name, file
    for room in sorted(rooms):
        folder = _folder(f"{PACKAGE}.{room}")
        for file in sorted(folder.rglob("*")):
            relative = file.relative_to(folder)
            if file.is_file() and not any(name == "__pycache__" or name.startswith(".") for name in relative.parts):
                yield f"{room}/{relative}", file


def _folder(package: str) -> Path:
    """Folder of a package."""
    spec = find_spec(package)
    if spec is None or not spec.submodule_search_locations:
        raise ImportError(f"{package} is not installed: install the project with pip.")
    return Path(spec.submodule_search_locations[0])
