"""The file of a scene: a path, or the name of a scene that ships with the package."""

from __future__ import annotations

from pathlib import Path

from mitsuba_taxel.base.arguments import path_of
from mitsuba_taxel.base.errors import InputError


def find_scene(source: str | Path) -> Path:
    """Find the file of a scene from a path, or from the name of a scene that ships with the package.

    Parameters
    ----------
    source : str or Path
        Path or name, as a user writes it.

    Returns
    -------
    Path
        Path of an existing file.

    Raises
    ------
    InputError
        if there is no such file and no shipped scene of this name.
    """
    path = path_of("scene", source)
    if is_file(path):
        return path
    folder = shipped_scenes()
    shipped = folder / path.name
    if path.parent == Path(".") and is_file(shipped):
        return shipped
    reason = why_unreadable(path)
    if reason:
        raise InputError(f"scene {str(source)!r} cannot be read: {reason}.")
    names = ", ".join(sorted(file.name for file in folder.glob("*.xml")))
    raise InputError(f"scene {str(source)!r} does not exist: a file, or one of the shipped scenes {names}, is needed.")


def why_unreadable(path: Path) -> str | None:
    """Reason why an existing path, or a parent of it, cannot be read as a file; None if it does not exist.

    Parameters
    ----------
    path : Path
        Any path.

    Returns
    -------
    str or None
        Reason as a part of a sentence.
    """
    try:
        path.stat()
    except FileNotFoundError:
        return None
    except OSError as error:
        return error.strerror
    return "it is a folder" if path.is_dir() else None if path.is_file() else "it is a pipe, a device or a socket"


def is_file(path: Path) -> bool:
    """Whether a path is an existing file; False for a path that is too long for the system.

    Parameters
    ----------
    path : Path
        Path of any length.

    Returns
    -------
    bool
        True for an existing file; symbolic links are followed.
    """
    try:
        return path.is_file()
    except OSError:
        return False


def shipped_scenes() -> Path:
    """The folder of the scenes that ship with the package.

    Returns
    -------
    Path
        Absolute path of the folder.
    """
    from importlib.resources import files

    return Path(str(files("mitsuba_taxel.scenes"))).resolve()
