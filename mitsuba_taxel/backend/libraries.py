"""Folders from which plugins may be loaded as libraries: a scene is data and must not contain code.

Mitsuba searches for the library of a plugin, ``plugins/<type>.so``, in every folder of its file resolver. These include
the folder of the scene, those of its ``<path>`` elements, and the working directory. It loads the library before it
checks which library it is.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from pathlib import Path

import mitsuba as mi

from mitsuba_taxel.base.errors import InputError

VARIABLE = "MITSUBA_TAXEL_LIBRARIES"
"""Environment variable with additional trusted folders, separated as in ``PATH``; their subfolder ``plugins`` contains
libraries."""
_ENDINGS = (".so", ".dylib", ".dll")


def put_own_libraries_first(resolver: mi.FileResolver) -> None:
    """Set the order of the folders in which Mitsuba searches for the library of a plugin.

    The first is the folder of the package mitsuba, so that no library of a scene replaces one of Mitsuba's. Next are
    the folders that the resolver has already, such as that of the scene. The last are those of :data:`VARIABLE`.

    Parameters
    ----------
    resolver : mi.FileResolver
        The file resolver, whose folders are put in this order in place.

    Raises
    ------
    InputError
        if the name of a folder is not in UTF-8.
    """
    try:
        scene = [Path(str(folder)) for folder in resolver]
    except UnicodeDecodeError as error:
        raise InputError(
            "the scene's folder is not allowed: a name in UTF-8 is needed; rename it, or move the scene."
        ) from error
    resolver.clear()
    for folder in dict.fromkeys((_mitsuba_folder(), *scene, *_trusted_folders())):
        resolver.append(str(folder))


def check_plugin_types(types: Iterable[str]) -> None:
    """Raise unless each plugin type is a name whose library, if there is one, lies in a trusted folder.

    Parameters
    ----------
    types : iterable of str
        Names of plugins in a scene.

    Raises
    ------
    InputError
        if a name has characters other than letters, digits and ``_``, or if Mitsuba would load a library from a folder
        of the scene or the working directory.
    """
    # Most folders hold no plugins. Those that do are resolved once for all types.
    holding = [folder for folder in (*map(str, mi.file_resolver()), ".") if os.path.lexists(f"{folder}/plugins")]
    mitsuba_folder, *others = dict.fromkeys(folder.resolve() for folder in (_mitsuba_folder(), *_trusted_folders()))
    searched = dict.fromkeys(Path(folder).resolve() for folder in holding)
    untrusted = [folder for folder in searched if folder != mitsuba_folder and folder not in others]
    for name in dict.fromkeys(types):
        if not re.fullmatch(r"\w+", name, re.ASCII):
            raise InputError(
                f"type = {name!r} is not allowed: the name of a plugin, of letters, digits and _, is needed."
            )
        libraries = [library for folder in untrusted for library in _libraries(folder, name)]
        if libraries and not _libraries(mitsuba_folder, name):
            library = libraries[0]
            raise InputError(
                f"type = {name!r} is not allowed: {library} is a library, which a scene must not contain; if you trust "
                f"it, set {VARIABLE}={library.parents[1]}."
            )


def _mitsuba_folder() -> Path:
    """The folder of the package mitsuba."""
    return Path(mi.__file__).parent


def _trusted_folders() -> list[Path]:
    """The folders of :data:`VARIABLE`."""
    return [Path(folder).absolute() for folder in os.environ.get(VARIABLE, "").split(os.pathsep) if folder]


def _libraries(folder: Path, name: str) -> list[Path]:
    """Paths of the existing libraries of a plugin in a folder, such as ``plugins/bsdf.so``."""
    files = (os.path.join(folder, "plugins", f"{name}{ending}") for ending in _ENDINGS)
    return [Path(file) for file in files if os.path.lexists(file)]
