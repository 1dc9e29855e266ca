"""Which folders plugins may be loaded from as libraries: a scene is data, and never brings code.

Mitsuba looks for the library of a plugin, ``plugins/<type>.so``, in every folder of its file resolver, which are those
of the scene, of its ``<path>`` elements and the working directory as well, and loads it before it knows what it is.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from itertools import chain
from pathlib import Path

import mitsuba as mi

from mitsuba_taxel.base.errors import InputError

VARIABLE = "MITSUBA_TAXEL_LIBRARIES"
"""Environment variable with further folders whose subfolder ``plugins`` holds libraries, separated as in ``PATH``."""
_ENDINGS = (".so", ".dylib", ".dll")


def put_own_libraries_first(resolver: mi.FileResolver) -> None:
    """Have Mitsuba's libraries come before files of the same name elsewhere, and those of :data:`VARIABLE` last.

    Parameters
    ----------
    resolver : mi.FileResolver
        Whose folders are put in order.

    Raises
    ------
    InputError
        if the name of a folder is not in UTF-8.
    """
    try:
        scene = [Path(str(folder)) for folder in resolver]
    except UnicodeDecodeError as error:
        raise InputError("the scene's folder is not allowed: a name in UTF-8 is needed.") from error
    resolver.clear()
    for folder in dict.fromkeys((_mitsuba(), *scene, *_stated())):
        resolver.append(str(folder))


def check_plugin_types(types: Iterable[str]) -> None:
    """Raise unless each type of plugin is a name, whose library, if any, lies in a folder that is trusted.

    Parameters
    ----------
    types : iterable of str
        Names of plugins in a scene.

    Raises
    ------
    InputError
        if one has other characters than letters, digits and ``_``, or Mitsuba would load a library from a folder of the
        scene or the working directory.
    """
    trusted = {folder.resolve() for folder in (_mitsuba(), *_stated())}
    for name in dict.fromkeys(types):
        if not re.fullmatch(r"\w+", name, re.ASCII):
            raise InputError(f"type = {name!r} is not allowed: a plugin's name, of letters, digits and _, is needed.")
        if _libraries(_mitsuba(), name):
            continue
        folders = {Path(str(folder)).resolve(): None for folder in (*mi.file_resolver(), ".")}
        for library in chain.from_iterable(_libraries(folder, name) for folder in folders if folder not in trusted):
            raise InputError(
                f"type = {name!r} is not allowed: {library} is a library, which a scene must not bring; if you trust "
                f"it, set {VARIABLE}={library.parents[1]}."
            )


def _mitsuba() -> Path:
    return Path(mi.__file__).parent


def _stated() -> list[Path]:
    return [Path(folder).absolute() for folder in os.environ.get(VARIABLE, "").split(os.pathsep) if folder]


def _libraries(folder: Path, name: str) -> list[Path]:
    files = (folder / "plugins" / f"{name}{ending}" for ending in _ENDINGS)
    return [file for file in files if os.path.lexists(file)]
