"""Mitsuba plugins in Python files of the user, for this process and its workers.

Only files that the user passes are run; files named in a scene, a study or a folder of results are never run.
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

from mitsuba_taxel.backend.registry import activate_variant
from mitsuba_taxel.base.arguments import path_of
from mitsuba_taxel.base.errors import InputError

_LOADED: dict[Path, None] = {}
"""Files that have been run, in this order."""


def load_plugins(*files: str | Path) -> None:
    """Run Python files that register Mitsuba plugins, for example by ``mi.register_bsdf``; each runs once per process.

    Worker processes and Dask workers of studies run the same files, from the same paths. Results on disk belong to the
    contents of the files: after a file has changed, a study in the same folder is refused.

    Parameters
    ----------
    *files : str or Path
        Paths of the files. A file runs in the current variant of Mitsuba, which it must not change, and may import
        installed packages.

    Raises
    ------
    InputError
        if a file does not exist, is not Python, raises an exception or changes the variant.
    """
    for file in files:
        path = path_of("plugin", file).absolute()
        if path.suffix != ".py" or not _is_file(path):
            raise InputError(f"plugin = {str(file)!r} is not allowed: an existing file that ends in .py is needed.")
        if path not in _LOADED:
            _run(path)
            _LOADED[path] = None


def loaded_plugins() -> tuple[Path, ...]:
    """The files that :func:`load_plugins` has run.

    Returns
    -------
    tuple[Path, ...]
        Files in the order in which they were run.
    """
    return tuple(_LOADED)


def _is_file(path: Path) -> bool:
    """Whether a path is a file; False for a name that is too long."""
    try:
        return path.is_file()
    except OSError:
        return False


def _run(path: Path) -> None:
    """Run a file as a module with a unique name; raises `InputError`."""
    import mitsuba as mi

    variant = activate_variant()
    name = f"own_plugin_{len(_LOADED)}_{path.stem}"
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        del sys.modules[name]
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise InputError(f"plugin = {path.name!r} cannot be run: {reason}; correct the file.") from error
    if mi.variant() != variant:
        mi.set_variant(variant)
        raise InputError(
            f"plugin = {path.name!r} is not allowed: it changes the variant, which must stay {variant}; take that out."
        )
