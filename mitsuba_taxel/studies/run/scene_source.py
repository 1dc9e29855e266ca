"""The scene file of a study whose scene is a `Scene`, read from a file or made in Python."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.files.atomic import WriteError, write_text
from mitsuba_taxel.sensing import Scene
from mitsuba_taxel.studies.plan.files import make_folder
from mitsuba_taxel.studies.store.changes import changed_scene
from mitsuba_taxel.studies.store.folder import SCENE, Store


@contextmanager
def file_of(source: Scene, folder: Path | None) -> Iterator[tuple[Path, dict[str, str]]]:
    """Provide a `Scene` as a file: its own file, or a new file for a scene made in Python.

    A scene made in Python is written to the folder of results, where it stays, or else to a temporary folder.

    Parameters
    ----------
    source : Scene
        The scene.
    folder : Path or None
        Folder of results.

    Yields
    ------
    file : Path
        Scene file (XML).
    values : dict[str, str]
        Values by parameter that differ from the defaults in the file; empty for a scene made in Python.

    Raises
    ------
    InputError
        if the folder holds results of another scene, or cannot be written.
    """
    if isinstance(source.source, Path):
        yield source.source, {n: word for n, word in source.parameters.items() if source.defaults.get(n) != word}
    elif folder is None:
        with tempfile.TemporaryDirectory() as temporary:
            source.write_xml(file := Path(temporary) / "scene.xml")
            yield file, {}
    else:
        make_folder(folder)
        file, store = folder / SCENE, Store(folder)
        text = source.as_xml(folder)
        if store.done() and store.scene != text:
            about = changed_scene(text, store.scene) or "another scene"
            raise InputError(f"output folder {folder} holds another study ({about}): choose another folder.")
        try:
            write_text(file, text)
        except WriteError as error:
            raise InputError(str(error)) from error
        yield file, {}
