"""Provenance of results: versions, the package's code, and the content of a scene and its files."""

from __future__ import annotations

import hashlib
import os
import re
from pathlib import Path
from typing import Any

from mitsuba_taxel.backend import versions
from mitsuba_taxel.backend.own_plugins import loaded_plugins
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.files.text import read_bytes
from mitsuba_taxel.base.sources import code_digest
from mitsuba_taxel.sensing.scene.finding import is_file
from mitsuba_taxel.sensing.scene.named_files import LARGEST_FILE
from mitsuba_taxel.sensing.scene.parameter_units import units_of_parameters
from mitsuba_taxel.sensing.scene.scene_file import read_scene_file
from mitsuba_taxel.studies.plan.batch import Batch

ROOMS = (
    "backend", "base", "geometry", "parameters", "parts", "pads", "mechanics", "transport", "specification", "kernels",
    "electronics", "sensing", "plugins", "studies",
)  # fmt: skip
"""Packages whose sources readings of a study depend on."""
PLUGIN = "plugin"
"""Word before the name of a file of the user's plugins, among the digests."""


def provenance(batch: Batch) -> dict[str, Any]:
    """Collect everything, other than the varied values, on which the results of a batch depend.

    Parameters
    ----------
    batch : Batch
        The batch of scenes.

    Returns
    -------
    dict[str, Any]
        ``scene_content``, digests by file name of the scene, of the files that it or a value names, and of the user's
        plugins; ``code``, digest of the sources that readings depend on; ``versions`` of packages by name;
        ``parameters``, values of the parameters that are not varied; ``units`` of parameters with a unit; ``forces``,
        component of the force and sign by parameter; and ``roles``, role and sign by parameter.
    """
    first = {name: words[0] for axis in batch.axes for name, words in axis.values.items()}
    parameters = batch.parameters(first)
    words = [*parameters.values(), *(word for axis in batch.axes for words in axis.values.values() for word in words)]
    return {
        "scene_content": _digests(batch.file, set(words)),
        "code": own_code(),
        "versions": dict(versions()),
        "parameters": {name: value for name, value in parameters.items() if name not in first},
        "units": units_of_parameters(batch.file),
        "forces": {name: list(role) for name, role in batch.forces.items()},
        "roles": {name: list(role) for name, role in batch.roles.items()},
    }


def own_code() -> str:
    """Digest of the source code of this package on which readings depend."""
    return code_digest(*ROOMS)[:16]


def _files_of(scene: Path, values: set[str]) -> list[Path]:
    """All files on which a scene depends: its own file, files that it or a value of its parameters names, and files
    that scenes among these name.

    Parameters
    ----------
    scene : Path
        Scene file; names are relative to its folder.
    values : set[str]
        Values of its parameters.
    """
    files = {scene: None}
    scenes = [(scene, values)]
    while scenes:
        scene, values = scenes.pop()
        _, root = next(read_scene_file(scene))
        words = {word for element in root.iter() for word in element.attrib.values()}
        for word in sorted(words | values):
            file = scene.parent / re.sub(r"^@", "", word)
            if word and file not in files and is_file(file):
                files[file] = None
                scenes += [(file, set())] if file.suffix == ".xml" else []
    return list(files)


def _digests(scene: Path, values: set[str]) -> dict[str, str]:
    """Digests of the contents of files by their names, relative to the scene's folder, and of plugins."""
    files = {os.path.relpath(file, scene.parent): file for file in _files_of(scene, values)}
    files |= {f"{PLUGIN} {file.name}": file for file in loaded_plugins()}
    digests = {}
    for name, file in files.items():
        try:
            digests[name] = hashlib.sha256(read_bytes(file, LARGEST_FILE)).hexdigest()[:16]
        except OSError as error:
            raise InputError(f"{file}, which the scene names, cannot be read ({error.strerror}).") from error
    return digests
