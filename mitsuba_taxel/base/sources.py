"""Digest of this package's sources, by which results of other code are recognised as stale."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

from mitsuba_taxel.base.caches import kept

PACKAGE = "mitsuba_taxel"


@kept(None)
def code_digest(*rooms: str) -> str:
    """Hexadecimal digest of every file of some sub-packages, however deep it lies, and of the modules beside them.

    Raises
    ------
    ImportError
        if there is no such sub-package, so that one that was moved is not silently dropped from a key.
    """
    digest = hashlib.sha256()
    for name, file in _files(rooms):
        digest.update(f"{name}\n{hashlib.sha256(file.read_bytes()).hexdigest()}\n".encode())
    return digest.hexdigest()


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
