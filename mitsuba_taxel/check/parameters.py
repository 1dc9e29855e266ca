"""Unknown names and values in the wrong element, from the XML file alone."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import mitsuba as mi

from mitsuba_taxel.backend import plugin_kind
from mitsuba_taxel.backend.libraries import check_plugin_types
from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.base.errors import InputError, did_you_mean
from mitsuba_taxel.check.document import ELEMENTS, KINDS, Element, filled_in, used_names
from mitsuba_taxel.check.finding import Finding
from mitsuba_taxel.sensing.scene.left_out import used_by
from mitsuba_taxel.specification import Specification, specifications

_VALUES = ("integer", "float", "string", "boolean", "point", "vector", "rgb", "spectrum", "transform")
_TRANSFORMATIONS = ("translate", "rotate", "scale", "lookat", "matrix")
_TAGS = (*KINDS, *_VALUES, *_TRANSFORMATIONS, "scene", "default", "include", "path", "alias", "ref")


def check_names(root: Element, parameters: Mapping[str, str]) -> Iterator[Finding]:
    """Find elements, plugins, parameters and ``$name`` references that do not exist, and elements of the wrong type.

    Parameters
    ----------
    root : Element
        Root of the file.
    parameters : Mapping[str, str]
        Values of the ``$name`` references, by name.
    """
    for element in root.walk():
        yield from _references(element, parameters)
        if element.tag not in _TAGS:
            message = f"<{element.tag}> is not an element of a Mitsuba scene{did_you_mean(element.tag, _TAGS)}."
            yield element.finding("error", message)
        if element.tag in KINDS and "type" in element.attributes:
            yield from _of_object(element, parameters)
        yield from _given_twice(element)
    yield from _unused_defaults(root, parameters)


def _references(element: Element, parameters: Mapping[str, str]) -> Iterator[Finding]:
    """Find ``$name`` references without a value."""
    for name in sorted(used_by(element.attributes)):
        if name not in parameters:
            yield element.finding(
                "error", f"${name} has no value{did_you_mean(name, parameters)}: a <default> of that name is needed."
            )


def defaults_given_twice(root: Element) -> Iterator[Finding]:
    """Find duplicate ``<default>``s in one file; an including file may override those of an included one."""
    seen = set()
    for element in root.walk():
        key = (element.file, element.attributes.get("name", ""))
        if element.tag == "default" and key in seen:
            yield element.finding("error", f"the <default> {key[1]} is given twice: take one of them out.")
        seen |= {key} if element.tag == "default" else set()


def _unused_defaults(root: Element, parameters: Mapping[str, str]) -> Iterator[Finding]:
    used = used_names(root)
    if used - set(parameters):  # a misspelt reference may mean one of them
        return
    for element in root.walk():
        name = element.attributes.get("name", "")
        if element.tag == "default" and name not in used:
            message = f"the <default> {name} is used nowhere: take it out, or write ${name} where it belongs."
            yield element.finding("warning", message)


def _given_twice(element: Element) -> Iterator[Finding]:
    """Find duplicate names in one object: Mitsuba refuses duplicate parameters, and uses one of duplicate objects."""
    seen: set[str] = set()
    for child in element.children:
        name = child.attributes.get("name", "") if child.tag != "default" else ""
        if name in seen:
            severity = "warning" if child.tag in KINDS else "error"
            yield child.finding(severity, f"{name} is given twice: take one of them out.")
        seen |= {name} - {""}


def _of_object(element: Element, parameters: Mapping[str, str]) -> Iterator[Finding]:
    message = error_in_plugin(element, parameters)
    specification = specifications().get(filled_in(element.attributes["type"], parameters))
    if message:
        yield element.finding("error", message)
    elif specification is not None:
        yield from _of_plugin(element, specification, parameters)


def error_in_plugin(element: Element, parameters: Mapping[str, str]) -> str:
    """Describe the error in the plugin type of an object; empty if the plugin exists and fits the element.

    Parameters
    ----------
    element : Element
        XML element of the object.
    parameters : Mapping[str, str]
        Values of the ``$name`` references, by name.
    """
    plugin = filled_in(element.attributes.get("type", ""), parameters)
    if plugin and "$" not in plugin:
        try:
            check_plugin_types([plugin])
        except InputError as error:
            return str(error)
    kind = plugin_kind(plugin) if plugin in specifications() else _kind_of(plugin)
    if kind not in ("", element.tag):
        return f"{plugin} is a plugin for <{kind}>, not for <{element.tag}>."
    if "$" in plugin or _exists(plugin):
        return ""
    ours = [name for name in specifications() if plugin_kind(name) == element.tag]
    return f"{plugin!r} is not a plugin{did_you_mean(plugin, (*ours, *_mitsuba_plugins()))}."


def _of_plugin(
    element: Element, specification: type[Specification], parameters: Mapping[str, str]
) -> Iterator[Finding]:
    for child in element.children:
        message = error_in(child, specification, parameters)
        if message:
            yield child.finding("error", message)


def error_in(child: Element, specification: type[Specification], parameters: Mapping[str, str]) -> str:
    """Describe the error in the name or the element of a parameter; empty if there is none.

    Parameters
    ----------
    child : Element
        XML element of the parameter; nested objects are not checked.
    specification : type[Specification]
        Parameters of the plugin, which is one of this package.
    parameters : Mapping[str, str]
        Values of the ``$name`` references, by name.
    """
    name = filled_in(child.attributes.get("name", ""), parameters)
    if child.tag not in _VALUES or not name:
        return ""
    values = specification.values()
    if name not in values:
        return specification.unknown_value(name)
    allowed = ELEMENTS[values[name].type]
    if child.tag not in allowed:
        return f"{name} of {specification.plugin} is given by a <{child.tag}>: a <{allowed[0]}> is needed."
    return ""


def _kind_of(plugin: str) -> str:
    """The tag of the elements of one of Mitsuba's own plugins; empty if the plugin is unknown."""
    kind = mi.PluginManager.instance().plugin_type(plugin).name if plugin else "Unknown"
    name = {"PhaseFunction": "phase", "ReconstructionFilter": "rfilter"}.get(kind, kind.lower())
    return name if name in KINDS else ""


def _exists(plugin: str) -> bool:
    """Whether Mitsuba has a plugin of that name, compiled or registered from Python."""
    if not plugin or _kind_of(plugin):
        return bool(plugin)
    try:
        mi.PluginManager.instance().create_object(mi.Properties(plugin))
    except Exception as error:
        return "not found" not in str(error)
    return True


@kept(None)
def _mitsuba_plugins() -> tuple[str, ...]:
    """Names of the plugins that come with Mitsuba."""
    return tuple(sorted(file.stem for file in (Path(mi.__file__).parent / "plugins").glob("*.so")))
