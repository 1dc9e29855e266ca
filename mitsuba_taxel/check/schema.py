"""RELAX NG schema of scenes from the plugins' parameter tables, for completion and validation in editors."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from mitsuba_taxel.backend import plugin_kind
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.files.atomic import write_text
from mitsuba_taxel.check.document import ELEMENTS, KINDS
from mitsuba_taxel.parameters import Choice, Parameter, Switch
from mitsuba_taxel.specification import specification_of
from mitsuba_taxel.specification.plugin_pages import plain, plugin_names, plugin_page
from mitsuba_taxel.studies.plan.files import check_new_file

_NUMBER = r"[+\-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+\-]?[0-9]+)?"
_PATTERNS = {
    "reference": r".*[$].*",
    "integer_text": r"\s*\-?[0-9]+\s*",
    "number": rf"\s*{_NUMBER}\s*",
    "vector_text": rf"[\s,]*{_NUMBER}(([\s,]+{_NUMBER}){{2}})?[\s,]*",
}
"""Patterns of attributes, as Mitsuba reads them; a reference is the name of a <default>, as $name."""
_TEXTS = {"int": "integer_text", "float": "number", "vector": "vector_text"}
_VALUE_ELEMENTS = ("integer", "float", "string", "boolean", "point", "vector", "rgb", "spectrum")
_TRANSFORMATIONS = ("translate", "rotate", "scale", "lookat", "matrix")
_HEADER = """
  Schema of scenes of mitsuba_taxel, written by taxel check, option schema, from the plugins' tables.
  Put it beside a scene whose first line is
  <?xml-model href="taxel.rng" schematypens="http://relaxng.org/ns/structure/1.0"?>
  VS Code (extension XML) and oXygen use it directly; for Emacs convert it to compact form by trang.
"""


def schema() -> str:
    """RELAX NG schema of scene files, as text in XML syntax.

    Parameters of this package's plugins must match their tables; those of Mitsuba's own plugins are unrestricted. Every
    value may be a ``$name``.
    """
    grammar = Element(
        "grammar",
        {
            "xmlns": "http://relaxng.org/ns/structure/1.0",
            "xmlns:a": "http://relaxng.org/ns/compatibility/annotations/1.0",
            "datatypeLibrary": "http://www.w3.org/2001/XMLSchema-datatypes",
        },
    )
    scene = SubElement(SubElement(grammar, "start"), "element", name="scene")
    SubElement(scene, "attribute", name="version")
    _any_of(scene, ("declaration", "object", "value", "reference_to_object"))
    _define_texts(grammar)
    _define_declarations(grammar)
    _define_values(grammar)
    for kind in KINDS:
        _define_kind(grammar, kind)
    _choice(_define(grammar, "object"), KINDS)
    for name in plugin_names():
        _define_plugin(grammar, name)
    ElementTree.indent(grammar)
    text = ElementTree.tostring(grammar, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n<!--{_HEADER}-->\n{text}\n'


def write_schema(file: str | Path) -> None:
    """Write the schema of scenes to a file.

    Parameters
    ----------
    file : str or Path
        File whose name ends in ``.rng``.

    Raises
    ------
    InputError
        if it has another ending, or its folder is missing.
    """
    file = Path(file)
    if file.suffix != ".rng":
        raise InputError(f"schema = {str(file)!r} is not allowed: the name of a .rng file is needed.")
    check_new_file(file, ".rng")
    write_text(file, schema())


def _define(grammar: Element, name: str) -> Element:
    return SubElement(grammar, "define", name=name)


def _ref(parent: Element, name: str) -> None:
    SubElement(parent, "ref", name=name)


def _choice(parent: Element, names: Iterable[str]) -> Element:
    choice = SubElement(parent, "choice")
    for name in names:
        _ref(choice, name)
    return choice


def _any_of(parent: Element, names: Iterable[str]) -> Element:
    return _choice(SubElement(parent, "zeroOrMore"), names)


def _document(parent: Element, text: str) -> None:
    SubElement(parent, "a:documentation").text = text


def _pattern(parent: Element, pattern: str) -> Element:
    data = SubElement(parent, "data", type="string")
    SubElement(data, "param", name="pattern").text = pattern
    return data


def _define_texts(grammar: Element) -> None:
    for name, pattern in _PATTERNS.items():
        _pattern(_define(grammar, name), pattern)
    anything = SubElement(_define(grammar, "any_attributes"), "zeroOrMore")
    SubElement(SubElement(anything, "attribute"), "anyName")


def _define_declarations(grammar: Element) -> None:
    """Define declarations, elements that are neither objects nor values, and references to objects."""
    contents = {"default": ("name", "value"), "include": ("filename",), "path": ("value",), "alias": ("id", "as")}
    choice = SubElement(_define(grammar, "declaration"), "choice")
    for tag, attributes in contents.items():
        element = SubElement(choice, "element", name=tag)
        for attribute in attributes:
            SubElement(element, "attribute", name=attribute)
    reference = SubElement(_define(grammar, "reference_to_object"), "element", name="ref")
    SubElement(reference, "attribute", name="id")
    _optional_attributes(reference, ("name",))


def _define_values(grammar: Element) -> None:
    """Define values with any attributes, which Mitsuba's own plugins accept, and transformations."""
    choice = SubElement(_define(grammar, "value"), "choice")
    for tag in _VALUE_ELEMENTS:
        _ref(SubElement(choice, "element", name=tag), "any_attributes")
    _transform(choice)
    steps = SubElement(_define(grammar, "transformation"), "choice")
    for tag in _TRANSFORMATIONS:
        _ref(SubElement(steps, "element", name=tag), "any_attributes")


def _transform(parent: Element, name: str | None = None, text: str = "") -> None:
    element = SubElement(parent, "element", name="transform")
    if name is None:
        _ref(element, "any_attributes")
    else:
        _named(element, name, text)
    _any_of(element, ("transformation",))


def _define_kind(grammar: Element, kind: str) -> None:
    """Define the element of one kind of object, of a plugin of this package or of Mitsuba."""
    ours = [name for name in plugin_names() if plugin_kind(name) == kind]
    element = SubElement(_define(grammar, kind), "element", name=kind)
    _optional_attributes(element, ("name", "id"))
    _ref(element, f"any_{kind}")
    choice = _choice(_define(grammar, f"any_{kind}"), (f"{kind}_{name}" for name in ours))
    # Any other name is a plugin of Mitsuba, with any contents.
    group = SubElement(choice, "group")
    data = SubElement(SubElement(group, "attribute", name="type"), "data", type="string")
    exceptions = SubElement(SubElement(data, "except"), "choice")
    for name in plugin_names():
        SubElement(exceptions, "value", type="string").text = name
    _any_of(group, ("object", "value", "declaration", "reference_to_object"))


def _define_plugin(grammar: Element, name: str) -> None:
    """Define the contents of one plugin of this package: its parameters and nested objects."""
    specification = specification_of(name)
    define = _define(grammar, f"{plugin_kind(name)}_{name}")
    kind = SubElement(define, "attribute", name="type")
    _document(kind, plugin_page(name).title)
    SubElement(kind, "value", type="string").text = name
    objects = specification.objects()
    unnamed = sorted(nested.kind for nested in objects if not nested.by_name)
    content = _any_of(define, ("declaration", "reference_to_object", *unnamed))
    for parameter in specification.values().values():
        _parameter(content, parameter)
    for nested in objects:
        if nested.by_name:
            element = SubElement(content, "element", name=nested.kind)
            _named(element, nested.name, nested.description_with_unit)
            _optional_attributes(element, ("id",))
            _ref(element, f"any_{nested.kind}")


def _parameter(parent: Element, parameter: Parameter) -> None:
    """Add the elements that may give one parameter, with its description and allowed values."""
    if parameter.type == "transform":
        _transform(parent, parameter.name, parameter.description_with_unit)
        return
    for tag in ELEMENTS[parameter.type]:
        element = SubElement(parent, "element", name=tag)
        _named(element, parameter.name, parameter.description_with_unit)
        if parameter.type == "vector":
            _components(element)
            continue
        value = SubElement(element, "attribute", name="value")
        if isinstance(parameter, Choice | Switch):
            choice = _choice(value, ("reference",))
            for word in parameter.allowed:
                SubElement(choice, "value", type="string").text = word
            if isinstance(parameter, Choice) and parameter.suffix:
                _named_file(choice, parameter.suffix)
        elif parameter.type in _TEXTS:
            _choice(value, (_TEXTS[parameter.type], "reference"))


def _named_file(choice: Element, suffix: str) -> None:
    """Add names of files with a suffix to the allowed values."""
    data = SubElement(choice, "data", type="string")
    SubElement(data, "param", name="pattern").text = ".*" + suffix.replace(".", r"\.")


def _components(element: Element) -> None:
    """Add to an element the schema of three numbers, given in one attribute or in three."""
    choice = SubElement(element, "choice")
    _choice(SubElement(choice, "attribute", name="value"), ("vector_text", "reference"))
    group = SubElement(choice, "group")
    for name in "xyz":
        _choice(SubElement(group, "attribute", name=name), ("number", "reference"))


def _named(element: Element, name: str, text: str) -> None:
    attribute = SubElement(element, "attribute", name="name")
    _document(attribute, plain(text))
    SubElement(attribute, "value", type="string").text = name


def _optional_attributes(element: Element, names: Iterable[str]) -> None:
    for name in names:
        SubElement(SubElement(element, "optional"), "attribute", name=name)
