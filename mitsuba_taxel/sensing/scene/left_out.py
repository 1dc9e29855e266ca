"""Elements of a scene that are left out, because they use a parameter with the value ``none``."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.sensing.scene.scene_file import read_scene_file

if TYPE_CHECKING:
    import mitsuba as mi

NONE = "none"
"""Value of a parameter whose elements are left out of the scene."""


def left_out(parameters: Mapping[str, str]) -> set[str]:
    """Find the parameters with the value ``none``.

    Parameters
    ----------
    parameters : Mapping[str, str]
        Values of a scene by name.

    Returns
    -------
    set[str]
        Names with the value `NONE`.
    """
    return {name for name, value in parameters.items() if value == NONE}


def used_by(attributes: Mapping[str, str]) -> set[str]:
    """Find the parameters that the attributes of an XML element use as ``$name``.

    Parameters
    ----------
    attributes : Mapping[str, str]
        Attributes of an XML element.

    Returns
    -------
    set[str]
        Names of parameters.
    """
    return {name for value in attributes.values() if "$" in value for name in re.findall(r"\$(\w+)", value)}


def parse_scene(config: mi.parser.ParserConfig, path: Path, parameters: Mapping[str, str]) -> mi.parser.ParserState:
    """Parse an XML scene without the elements that use a parameter with the value ``none``.

    Parameters
    ----------
    config : mi.parser.ParserConfig
        Settings of the parser for the variant that will build the scene.
    path : Path
        Path of the XML file.
    parameters : Mapping[str, str]
        Values by name.

    Returns
    -------
    mi.parser.ParserState
        All nodes of the description; the first is the scene.

    Raises
    ------
    InputError
        if an included file uses a parameter with the value ``none``, or if the scene loads a library of plugins.
    """
    import mitsuba as mi

    from mitsuba_taxel.backend.libraries import check_plugin_types, put_own_libraries_first
    from mitsuba_taxel.sensing.scene.named_files import check_named_files, check_spectra

    check_spectra(path, parameters)
    state = _parsed(config, path, parameters)
    put_own_libraries_first(mi.file_resolver())  # a <path> stands before them
    check_plugin_types(node.props.plugin_name() for node in state.nodes)
    check_named_files(node.props for node in state.nodes)
    return state


def _parsed(config: mi.parser.ParserConfig, path: Path, parameters: Mapping[str, str]) -> mi.parser.ParserState:
    import mitsuba as mi

    absent = left_out(parameters)
    if not absent:
        return mi.parser.parse_file(config, str(path), **parameters)
    (_, root), *included = read_scene_file(path)
    _leave_out(root, absent)
    used = _used(root).union(*(_used(inner) for _, inner in included))
    for name in sorted(absent & used):
        raise InputError(f"{name} = {NONE} is not allowed: a file that {path.name} includes uses it; give it a value.")
    return mi.parser.parse_string(config, ElementTree.tostring(root, encoding="unicode"), **parameters)


def _leave_out(element: ElementTree.Element, absent: set[str]) -> None:
    for child in list(element):
        if used_by(child.attrib) & absent:
            element.remove(child)
        else:
            _leave_out(child, absent)


def _used(root: ElementTree.Element) -> set[str]:
    return set().union(*(used_by(element.attrib) for element in root.iter()))
