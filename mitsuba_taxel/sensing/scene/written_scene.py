"""The text of a scene as XML, with its parameters as `<default>`s: those of its file, or those of its parts."""

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
"""Names of load components for which a scene has no parameters of these names."""
_AXES = ("x", "y", "z")
_NUMBERS = ("float", "integer")
_VECTORS = ("vector", "point")
_WORDS = ("string", "boolean")
_SHARED = ("rows", "columns", "pitch")
"""Of a pad and of its photo-reflectors: one parameter, as long as they are equal."""
_NOT_NAMED = ("meshed_as",)
"""A parameter that every scene has."""


def scene_text(
    state: mi.parser.ParserState,
    config: mi.parser.ParserConfig,
    folder: Path,
    file: Path | None,
    parameters: Mapping[str, str],
    most: int,
) -> str:
    """XML that Mitsuba parses to the same values.

    Parameters
    ----------
    state : mi.parser.ParserState
        The parsed scene.
    config : mi.parser.ParserConfig
        Settings of the parser.
    folder : Path
        Where the text shall lie: files that are not found from there are named by their full paths.
    file : Path or None
        The XML file that the scene is from; None for one made in Python. Its uses of parameters are kept. Of a scene
        made in Python, each number of a part, and each word of one of this package's, is a parameter: named as such,
        components of forces fx, fy, fz and of displacements ux, uy, uz, of other vectors as `body_x`; preceded by the
        names of the dictionary, as `roof_reflectance`, where several parts have it, and always of a `wall`.
    parameters : Mapping[str, str]
        Their values, for a scene from a file.
    most : int
        Largest number of parameters.

    Returns
    -------
    The text. Where Mitsuba would read other values with parameters than without, as where parts are shared in a way
    that cannot be followed, it has none.
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
    """Mitsuba's text with the values of the parameters that it makes up, such as `resx` for any width."""
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
    """Replace values of parts by parameters; returns their values."""
    values = [value for part in root for value in _values_of(part, ()) if part.tag != "scene"]
    shared = {(path[-1], element.get(key, "")) for element, key, path, kind in values if kind == "deformable_pad"}
    shared &= {(path[-1], element.get(key, "")) for element, key, path, kind in values if kind == "photo_reflector"}
    kinds = Counter(path[-1] for _, _, path, kind in values if kind in ("deformable_pad", "photo_reflector"))
    endings = Counter("_".join(path[i:]) for _, _, path, _ in values for i in range(len(path)))
    defaults: dict[str, str] = {}
    for element, key, path, kind in values:
        word = element.get(key, "")
        one = kind in ("deformable_pad", "photo_reflector") and path[-1] in _SHARED and (path[-1], word) in shared
        names = ["_".join(path[i:]) for i in reversed(range(len(path) - (kind == "wall")))]
        if one and kinds[path[-1]] == endings[path[-1]] == 2:
            name: str | None = path[-1]
        else:
            name = next((each for each in names if endings[each] == 1), None)
        if name is not None and (name in defaults or len(defaults) < most):
            defaults[name] = word
            element.set(key, f"${name}")
    return defaults


def _values_of(
    part: ElementTree.Element, around: tuple[str, ...]
) -> Iterator[tuple[ElementTree.Element, str, tuple[str, ...], str]]:
    """Each value of a part that can be a parameter: element, attribute, names from the outside, kind of the part."""
    kind = part.get("type", "")
    stated = specifications().get(kind)
    path = (*around, _word(part.get("name") or part.get("id") or kind))
    for child in part:
        name = child.get("name", "")
        if child.get("type"):
            yield from _values_of(child, path)
        elif child.tag in _VECTORS:
            of_load = [each for each, (quantity, _) in COMPONENTS.items() if quantity == name]
            for number, axis in enumerate(_AXES):
                if axis in child.attrib:
                    yield child, axis, (*path, of_load[number] if of_load else f"{_word(name)}_{axis}"), kind
        elif child.tag in _NUMBERS or (child.tag in _WORDS and stated is not None and name not in _NOT_NAMED):
            if child.get("value", NONE) != NONE:
                yield child, "value", (*path, _word(name)), kind


def _word(name: str) -> str:
    return re.sub(r"\W", "_", name, flags=re.ASCII)


def _put_back(root: ElementTree.Element, file: Path, parameters: Mapping[str, str]) -> None:
    """Replace values by the parameters of the file that the scene is from, part by part."""
    parts: dict[tuple[str, str], list[ElementTree.Element]] = {}
    for part in (element for element in root.iter() if element.get("type")):
        parts.setdefault((part.tag, part.get("type", "")), []).append(part)
    originals: dict[tuple[str, str], list[ElementTree.Element]] = {}
    for part in _parts_of(ElementTree.fromstring(file.read_bytes()), file, left_out(parameters)):
        kind = re.sub(r"\$(\w+)", lambda match: parameters.get(match[1], match[0]), part.get("type", ""))
        originals.setdefault((part.tag, kind), []).append(part)
    for key, written in parts.items():
        if len(written) != len(originals.get(key, [])):
            continue
        for part, original in zip(written, originals[key], strict=True):
            part.set("type", original.get("type", ""))
            for child in original:
                if child.get("type") or not any(used_by(element.attrib) for element in child.iter()):
                    continue
                for number, value in enumerate(part):
                    if value.get("name", "") == child.get("name", "") and not value.get("type"):
                        part[number] = _without_space(child)


def _parts_of(element: ElementTree.Element, file: Path, absent: set[str]) -> Iterator[ElementTree.Element]:
    """The objects of a scene in the order of the text, with those of included files where they are included."""
    for child in element:
        if child.tag == "include":
            inner = file.parent / child.get("filename", "")
            yield from _parts_of(ElementTree.fromstring(inner.read_bytes()), inner, absent)
        elif not used_by(child.attrib) & absent:
            if child.get("type"):
                yield child
            yield from _parts_of(child, file, absent)


def _without_space(element: ElementTree.Element) -> ElementTree.Element:
    copied = copy.deepcopy(element)
    for each in copied.iter():
        each.text = each.tail = None
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
