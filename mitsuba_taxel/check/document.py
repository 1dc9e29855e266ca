"""The XML of a scene, with the line of each element."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from xml.parsers import expat

from mitsuba_taxel.base.files.text import read_bytes
from mitsuba_taxel.check.finding import Finding
from mitsuba_taxel.sensing.scene.finding import is_file
from mitsuba_taxel.sensing.scene.left_out import used_by
from mitsuba_taxel.sensing.scene.scene_file import DEEPEST, DEEPEST_INCLUDE, LARGEST_SCENE, MOST_INCLUDED

KINDS = (
    "integrator", "shape", "bsdf", "emitter", "sensor", "film", "rfilter", "sampler", "texture", "medium", "phase",
    "volume",
)  # fmt: skip
"""Elements of a Mitsuba scene that are objects of plugins."""

ELEMENTS = {
    "float": ("float", "integer"),
    "int": ("integer",),
    "boolean": ("boolean",),
    "string": ("string",),
    "vector": ("vector", "point"),
    "transform": ("transform",),
}
"""XML elements that may give a parameter of each type."""


@dataclass
class Element:
    """One XML element of a scene file.

    Attributes
    ----------
    tag, attributes : str and dict[str, str]
        Tag and attributes as written.
    file, line : Path and int
        File, and line number in it.
    offset : int
        Number of bytes before the ``<`` of the element.
    children : list of Element
        Nested elements; those of an included file are children of the ``include``.
    """

    tag: str
    attributes: dict[str, str]
    file: Path
    line: int
    offset: int
    children: list[Element] = field(default_factory=list)

    def walk(self) -> Iterator[Element]:
        """Iterate over this element and all nested ones, in the order of the file."""
        yield self
        for child in self.children:
            yield from child.walk()

    def finding(self, severity: str, message: str) -> Finding:
        """A finding at the line of the element.

        Parameters
        ----------
        severity : str
            One of `mitsuba_taxel.check.finding.SEVERITIES`.
        message : str
            Description of the error, and the remedy.
        """
        return Finding(severity, message, self.file.name, self.line)


class Unreadable(Exception):
    """A scene file is not XML, or is no scene. The exception carries the finding with the reason."""

    def __init__(self, finding: Finding) -> None:
        super().__init__(finding.message)
        self.finding = finding


def read_document(path: Path) -> Element:
    """Read an XML file and its included files; returns the root element.

    Raises
    ------
    Unreadable
        if a file does not exist, is not XML, is nested too deeply for Mitsuba or includes itself, or if there are too
        many files.
    """
    return _read(path, (), count(1))


def _read(path: Path, around: tuple[Path, ...], numbers: Iterator[int]) -> Element:
    """Parse one file of a scene; returns its root element. ``around`` are the files that include this file, and
    ``numbers`` counts all included files."""
    # Parse the file into a tree of elements.
    reader = _Reader(path)
    parser = expat.ParserCreate()
    parser.StartElementHandler = reader.start
    parser.EndElementHandler = reader.end
    reader.parser = parser
    try:
        parser.Parse(read_bytes(path, LARGEST_SCENE), True)
    except expat.ExpatError as error:
        line = getattr(error, "lineno", 0)
        reason = expat.errors.messages.get(error.code, str(error))
        raise Unreadable(Finding("error", f"the file is not valid XML: {reason}.", path.name, line)) from error
    except (OSError, LookupError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise Unreadable(Finding("error", f"the file cannot be read: {why}.", path.name, 0)) from error
    # Included files become children of their <include> element.
    assert reader.root is not None
    around = (*around, path.resolve())
    for element in [element for element in reader.root.walk() if element.tag == "include"]:
        element.children.append(_included(element, around, numbers))
    return reader.root


def _included(element: Element, around: tuple[Path, ...], numbers: Iterator[int]) -> Element:
    """The root of the file that an ``<include>`` element names, within the limits of Mitsuba's parser."""
    name = element.attributes.get("filename", "")
    inner = element.file.parent / name
    if not is_file(inner):
        raise Unreadable(
            element.finding(
                "error", f"filename = {name!r} does not exist: a file in the folder of this file is needed."
            )
        )
    if inner.resolve() in around:
        raise Unreadable(element.finding("error", f"filename = {name!r} is not allowed: the file includes itself."))
    if len(around) > DEEPEST_INCLUDE:
        message = f"filename = {name!r} is not allowed: more than {DEEPEST_INCLUDE} files include one another."
        raise Unreadable(element.finding("error", message))
    if next(numbers) > MOST_INCLUDED:
        message = f"filename = {name!r} is not allowed: more than {MOST_INCLUDED} files are included in total."
        raise Unreadable(element.finding("error", message))
    return _read(inner, around, numbers)


def leave_out(element: Element, absent: set[str]) -> None:
    """Remove nested elements that refer to absent parameters, and ``<default>``s that are then unused.

    Parameters
    ----------
    element : Element
        Root of the tree, which is changed.
    absent : set[str]
        Names of the absent parameters.
    """
    before = used_names(element)
    _take_out(element, absent)
    unused = before - used_names(element)
    for inner in element.walk():
        inner.children = [c for c in inner.children if c.tag != "default" or c.attributes.get("name") not in unused]


def _take_out(element: Element, absent: set[str]) -> None:
    element.children = [child for child in element.children if not used_by(child.attributes) & absent]
    for child in element.children:
        _take_out(child, absent)


def used_names(root: Element) -> set[str]:
    """Names of all ``$name`` references in a file."""
    return set().union(*(used_by(element.attributes) for element in root.walk()))


def filled_in(value: str, parameters: Mapping[str, str]) -> str:
    """Replace the ``$name`` references of an attribute by their values.

    Parameters
    ----------
    value : str
        Text of the attribute.
    parameters : Mapping[str, str]
        Values by name; references to other names are left as they are.
    """
    return re.sub(r"\$(\w+)", lambda match: parameters.get(match[1], match[0]), value)


class _Reader:
    """Builds the tree of elements from the events of ``parser``, which is assigned after construction."""

    parser: expat.XMLParserType

    def __init__(self, path: Path) -> None:
        self.path = path
        self.root: Element | None = None
        self.open: list[Element] = []

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        line, offset = self.parser.CurrentLineNumber, self.parser.CurrentByteIndex
        element = Element(tag, attributes, self.path, line, offset)
        if len(self.open) >= DEEPEST:
            raise Unreadable(element.finding("error", f"elements are nested more than {DEEPEST} deep: nest fewer."))
        if self.open:
            self.open[-1].children.append(element)
        else:
            self.root = element
        self.open.append(element)

    def end(self, tag: str) -> None:
        self.open.pop()
