"""A scene as the text of an XML file, with its values as `<default>` elements."""

from __future__ import annotations

import copy
import re
import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from mitsuba_taxel.backend.plugin_objects import resolved_path
from mitsuba_taxel.sensing.scene.left_out import NONE, left_out, used_by
from mitsuba_taxel.specification import specifications

if TYPE_CHECKING:
    import mitsuba as mi

COMPONENTS = {
    name: (quantity, index)
    for quantity, names in (("force", ("fx", "fy", "fz")), ("displacement", ("ux", "uy", "uz")))
    for index, name in enumerate(names)
}
"""Quantity and index of the components of loads, by the names of their parameters."""
_AXES = ("x", "y", "z")
_NUMBERS = ("float", "integer")
_VECTORS = ("vector", "point")
_WORDS = ("string", "boolean")
_SHARED = ("rows", "columns", "pitch")
"""Quantities for which a pad and its photo-reflectors share one parameter if their values are equal."""
_NOT_NAMED = ("meshed_as",)
"""Words that do not become parameters, because every scene has a parameter of this name."""


def scene_text(
    state: mi.parser.ParserState,
    config: mi.parser.ParserConfig,
    folder: Path,
    file: Path | None,
    parameters: Mapping[str, str],
    most: int,
) -> str:
    """Convert a parsed scene to XML text that Mitsuba parses to the same values.

    Parameters
    ----------
    state : mi.parser.ParserState
        The parsed scene.
    config : mi.parser.ParserConfig
        Settings of the parser.
    folder : Path
        Folder of the file that will hold the text. Files that are not found relative to it are named by their full
        paths.
    file : Path or None
        The XML file of the scene, whose parameters are kept; None for a scene made in Python. In a scene made in
        Python, each number of a plugin, and each word of a plugin of this package, becomes a parameter of the same
        name. Components of forces become fx, fy, fz, those of displacements ux, uy, uz, and those of other vectors
        names such as `body_x`. If several plugins have a parameter of the same name, and always for a `wall`, the keys
        of the dictionary precede the name, as in `roof_reflectance`.
    parameters : Mapping[str, str]
        Values of the parameters of a scene from a file, by name.
    most : int
        Largest number of parameters.

    Returns
    -------
    str
        The XML document. If objects are shared in a way that parameters cannot represent, it has no parameters, so that
        Mitsuba reads the right values.
    """
    import mitsuba as mi

    plain = _without_defaults(ElementTree.fromstring(mi.parser.write_string(state)))
    named = copy.deepcopy(plain)
    if file is None:
        defaults = _name_values(named, most)
    else:
        _put_back(named, file, parameters)
        used = set().union(*(used_by(element.attrib) for element in named.iter()))
        defaults = {name: value for name, value in parameters.items() if name in used}
    for number, (name, value) in enumerate(defaults.items()):
        named.insert(number, ElementTree.Element("default", {"name": name, "value": value}))
    again = mi.parser.parse_string(config, ElementTree.tostring(named, encoding="unicode"))
    read = _without_defaults(ElementTree.fromstring(mi.parser.write_string(again)))
    root = named if ElementTree.tostring(read) == ElementTree.tostring(plain) else plain
    _name_files_in_full(root, folder)
    ElementTree.indent(root, "    ")
    return ElementTree.tostring(root, encoding="unicode").replace(" />", "/>") + "\n"


def _without_defaults(root: ElementTree.Element) -> ElementTree.Element:
    """Replace the parameters that Mitsuba's writer invents, such as `resx` for any width, by their values."""
    values = {element.get("name", ""): element.get("value", "") for element in root.findall("default")}
    for element in root.findall("default"):
        root.remove(element)
    for element in root.iter():
        element.text = element.tail = None
        for key, word in element.attrib.items():
            value = values[word[1:]] if word.startswith("$") else word
            if element.tag in ("float", *_VECTORS, "translate", "scale", "rotate") and key != "name":
                value = repr(float(value)).removesuffix(".0")
            element.set(key, value)
    return root


def _name_values(root: ElementTree.Element, most: int) -> dict[str, str]:
    """Replace values of plugins by parameters, and return the values by name of the parameter."""
    values = [value for plugin in root for value in _values_of(plugin, ()) if plugin.tag != "scene"]
    shared = {(path[-1], element.get(key, "")) for element, key, path, kind in values if kind == "deformable_pad"}
    shared &= {(path[-1], element.get(key, "")) for element, key, path, kind in values if kind == "photo_reflector"}
    kinds = Counter(path[-1] for _, _, path, kind in values if kind in ("deformable_pad", "photo_reflector"))
    endings = Counter("_".join(path[i:]) for _, _, path, _ in values for i in range(len(path)))
    defaults: dict[str, str] = {}
    for element, key, path, kind in values:
        word = element.get(key, "")
        is_shared = kind in ("deformable_pad", "photo_reflector") and path[-1] in _SHARED and (path[-1], word) in shared
        # The shortest unique name: that of the parameter, preceded by as many names of outer objects as needed.
        names = ["_".join(path[i:]) for i in reversed(range(len(path) - (kind == "wall")))]
        if is_shared and kinds[path[-1]] == endings[path[-1]] == 2:
            name: str | None = path[-1]
        else:
            name = next((candidate for candidate in names if endings[candidate] == 1), None)
        if name is not None and (name in defaults or len(defaults) < most):
            defaults[name] = word
            element.set(key, f"${name}")
    return defaults


def _values_of(
    plugin: ElementTree.Element, outer_names: tuple[str, ...]
) -> Iterator[tuple[ElementTree.Element, str, tuple[str, ...], str]]:
    """Iterate over the values of a plugin that can be parameters: XML element, attribute, names from the outermost
    object to the value, and kind of plugin."""
    kind = plugin.get("type", "")
    is_own = specifications().get(kind) is not None
    path = (*outer_names, _word(plugin.get("name") or plugin.get("id") or kind))
    for child in plugin:
        name = child.get("name", "")
        if child.get("type"):
            yield from _values_of(child, path)
        elif child.tag in _VECTORS:
            of_load = [component for component, (quantity, _) in COMPONENTS.items() if quantity == name]
            for number, axis in enumerate(_AXES):
                if axis in child.attrib:
                    yield child, axis, (*path, of_load[number] if of_load else f"{_word(name)}_{axis}"), kind
        elif child.tag in _NUMBERS or (child.tag in _WORDS and is_own and name not in _NOT_NAMED):
            if child.get("value", NONE) != NONE:
                yield child, "value", (*path, _word(name)), kind


def _word(name: str) -> str:
    return re.sub(r"\W", "_", name, flags=re.ASCII)


def _put_back(root: ElementTree.Element, file: Path, parameters: Mapping[str, str]) -> None:
    """Replace values in the text of a scene by the parameters that the scene's file uses for them, plugin by plugin."""
    # Plugins of one kind are in the same order in both texts.
    plugins: dict[tuple[str, str], list[ElementTree.Element]] = {}
    for plugin in (element for element in root.iter() if element.get("type")):
        plugins.setdefault((plugin.tag, plugin.get("type", "")), []).append(plugin)
    originals: dict[tuple[str, str], list[ElementTree.Element]] = {}
    for plugin in _plugins_of(ElementTree.fromstring(file.read_bytes()), file, left_out(parameters)):
        kind = re.sub(r"\$(\w+)", lambda match: parameters.get(match[1], match[0]), plugin.get("type", ""))
        originals.setdefault((plugin.tag, kind), []).append(plugin)
    for key, written in plugins.items():
        if len(written) != len(originals.get(key, [])):
            continue
        for plugin, original in zip(written, originals[key], strict=True):
            plugin.set("type", original.get("type", ""))
            for child in original:
                if child.get("type") or not any(used_by(element.attrib) for element in child.iter()):
                    continue
                for number, value in enumerate(plugin):
                    if value.get("name", "") == child.get("name", "") and not value.get("type"):
                        plugin[number] = _without_space(child)


def _plugins_of(element: ElementTree.Element, file: Path, absent: set[str]) -> Iterator[ElementTree.Element]:
    """Iterate over the objects of a scene in the order of the text; those of included files come where they are
    included."""
    for child in element:
        if child.tag == "include":
            inner = file.parent / child.get("filename", "")
            yield from _plugins_of(ElementTree.fromstring(inner.read_bytes()), inner, absent)
        elif not used_by(child.attrib) & absent:
            if child.get("type"):
                yield child
            yield from _plugins_of(child, file, absent)


def _without_space(element: ElementTree.Element) -> ElementTree.Element:
    copied = copy.deepcopy(element)
    for inner in copied.iter():
        inner.text = inner.tail = None
    return copied


def _name_files_in_full(root: ElementTree.Element, folder: Path) -> None:
    """Replace names of existing files by their full paths, unless they are found from the folder."""
    for element in root.iter():
        word = element.get("value", "")
        if element.tag not in ("string", "default") or not Path(word).suffix or Path(word).is_absolute():
            continue
        file = resolved_path(word)
        try:
            if file.is_file() and not (folder / word).is_file():
                element.set("value", str(file.resolve()))
        except (OSError, ValueError):  # it is no name of a file
            continue
