"""Checks of files that Mitsuba opens for a scene. Without them it would wait for a pipe, and never finish reading a
device."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path

import mitsuba as mi

from mitsuba_taxel.backend.plugin_objects import resolved_path
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.files.text import check_regular
from mitsuba_taxel.sensing.scene.scene_file import read_scene_file

LARGEST_FILE = 1 << 30
"""Bytes of the largest file that a scene may name."""


def check_spectra(scene: Path, parameters: Mapping[str, str]) -> None:
    """Check the files of spectra that Mitsuba's parser opens: they must be regular files, and not too large.

    Parameters
    ----------
    scene : Path
        The XML file.
    parameters : Mapping[str, str]
        Values by name.

    Raises
    ------
    InputError
        if a file is not allowed; the message names it.
    """
    for file, root in read_scene_file(scene):
        for element in root.iter("spectrum"):
            name = re.sub(r"\$(\w+)", lambda match: parameters.get(match[1], match[0]), element.get("filename", ""))
            if name:
                _check("filename", name, file.parent / name)
                _check("filename", name, resolved_path(name))


def check_named_files(plugins: Iterable[mi.Properties]) -> None:
    """Check the files that the plugins of a scene open: they must be regular files, and not too large.

    Parameters
    ----------
    plugins : Iterable[mi.Properties]
        Properties of each plugin.

    Raises
    ------
    InputError
        if a file is not allowed; the message names it.
    """
    for props in plugins:
        for name in props.keys():  # noqa: SIM118
            if props.type(name) == mi.Properties.Type.String:
                word = str(props[name])
                props.mark_queried(name, False)  # so that a plugin that does not know it is still reported
                _check(name, word, resolved_path(word))


def _check(name: str, word: str, file: Path) -> None:
    try:
        if not file.exists() or file.is_dir():
            return
    except (OSError, ValueError):  # it cannot be the name of a file
        return
    try:
        check_regular(file, LARGEST_FILE)
    except OSError as error:
        raise InputError(f"{name} = {word!r} is not allowed: {error.strerror}.") from error
