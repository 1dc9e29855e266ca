"""Check of a scene before rendering."""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import Any

import mitsuba as mi

from mitsuba_taxel.backend import activate_variant, in_turn
from mitsuba_taxel.base.errors import InputError, UnusedDefault
from mitsuba_taxel.check.camera import check_camera, has_camera
from mitsuba_taxel.check.document import Element, Unreadable, leave_out, read_document
from mitsuba_taxel.check.finding import Finding
from mitsuba_taxel.check.geometry import check_geometry
from mitsuba_taxel.check.light import check_light, check_modelled, check_prepared
from mitsuba_taxel.check.parameters import check_names, defaults_given_twice
from mitsuba_taxel.check.parts import make_objects
from mitsuba_taxel.check.units import check_units
from mitsuba_taxel.check.values import refused_values
from mitsuba_taxel.sensing.scene.description import Scene
from mitsuba_taxel.sensing.scene.finding import find_scene
from mitsuba_taxel.sensing.scene.left_out import left_out, parse_scene
from mitsuba_taxel.sensing.scene.parsing import parser_config


@in_turn
def check_scene(source: str | Path, /, **parameters: object) -> list[Finding]:
    """Check a scene for errors and likely mistakes, without computing its readings.

    The file, the parameters and the geometry are checked first. If there are no errors, the scene is prepared as
    `measure` does: pads are deformed, and their solutions are cached on disk. A few rays show whether light paths end,
    and whether the integrator `taxel_path` finds light.

    Parameters
    ----------
    source : str or Path
        Path of an XML scene, or the name of a shipped one.
    **parameters : object
        Values for the ``<default>``s of the file, by name.

    Returns
    -------
    list[Finding]
        All findings, in the order of the file.

    Raises
    ------
    InputError
        if there is no such file, or a parameter is not one of the scene's.
    """
    # Read the file. Findings on its structure end the check.
    path = find_scene(source)
    if path.suffix == ".toml":
        raise InputError(f"{path.name} is a study: a scene is needed; `taxel sweep` checks a study as it starts.")
    try:
        root = read_document(path)
    except Unreadable as error:
        return [error.finding]
    duplicates = list(defaults_given_twice(root))
    if duplicates:
        return duplicates
    # Insert the parameters, and check names and values in the file.
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnusedDefault)  # `check_names` reports them, with their lines
        scene = Scene(path, parameters)
    leave_out(root, left_out(scene.parameters))
    activate_variant()
    findings = list(check_names(root, scene.parameters))
    # Create the objects, check units, positions and light, and prepare the scene if it has no errors.
    with scene.files_beside_it():
        state = _parse(scene, path, root, findings)
        if state is not None:
            objects = make_objects(state, root, scene.parameters)
            findings += objects.findings
            camera = has_camera(objects)
            for check in (check_units,) if camera else (check_units, check_geometry, check_light):
                findings += check(objects)
            if not (camera or any(finding.severity == "error" for finding in findings)):
                findings += check_modelled(objects)
            valid = objects.valid and not any(finding.severity == "error" for finding in findings)
            prepared = check_camera if camera else check_prepared
            findings += prepared(scene, objects) if valid else []
    return sorted(dict.fromkeys(findings), key=lambda f: (f.file != path.name, f.file, f.line, f.severity != "error"))


def _parse(scene: Scene, path: Path, root: Element, findings: list[Finding]) -> Any:
    """The scene as parsed by Mitsuba; None if that fails, and ``findings`` is extended by the errors."""
    config = parser_config(mi.variant())
    try:
        state = parse_scene(config, path, scene.parameters)
        mi.parser.transform_all(config, state)
        return state
    except InputError as error:  # a plugin's library; `check_names` has seen those that lie beside the scene
        if str(error) not in {finding.message for finding in findings}:
            findings.append(Finding("error", str(error), path.name, 0))
        return None
    except RuntimeError as error:
        message = str(error)
    for finding in (*refused_values(root, scene.parameters), _of_parser(message, path)):
        if not any((f.file, f.line, f.severity) == (finding.file, finding.line, "error") for f in findings):
            findings.append(finding)
    return None


def _of_parser(message: str, path: Path) -> Finding:
    """Convert an error message of Mitsuba's parser to a finding, at the file and line that it names."""
    text = re.sub(r"^\[[^\]]*\] ", "", " ".join(message.split()))
    match = re.search(r"(?:^|\s)\"?([^\s\"]*)\"? \(line (\d+), col \d+\): (.*)", text)
    if match is None:
        return Finding("error", f"{text.removesuffix('.')}.", path.name, 0)
    return Finding("error", f"{match[3].removesuffix('.')}.", Path(match[1]).name, int(match[2]))
