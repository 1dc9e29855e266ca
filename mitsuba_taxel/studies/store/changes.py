"""Messages that name the first difference between a stored study and the study to be written into its folder."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from itertools import zip_longest

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.files import toml
from mitsuba_taxel.studies.store.provenance import PLUGIN

MOST_LETTERS = 200
"""Largest number of characters of a study file's line in a message."""
_LIST = re.compile(r"\[\n(.*?)\n\]", re.DOTALL)


def changed_study(now: str, before: str, scene_now: str, scene_before: str) -> str:
    """Describe the first difference between two study files; empty if there is none.

    Parameters
    ----------
    now, before : str
        Texts of the requested and of the stored study file (TOML).
    scene_now, scene_before : str
        Texts of their scenes (XML); empty if not available.

    Returns
    -------
    str
        A clause about the stored study, for an error message.
    """
    if now == before:
        return ""

    # Equal definitions: the difference is in the code, or in a file that the scene names.
    try:
        studies = [toml.loads(text) for text in (now, before)]
        origins = [study.pop("provenance") for study in studies]
        if studies[0] == studies[1]:
            new, old = origins
            if new["code"] != old["code"]:
                return f"another version of the program computed it, of code {old['code']} instead of {new['code']}"
            if new["scene_content"] != old["scene_content"]:
                return changed_files(new["scene_content"], old["scene_content"], scene_now, scene_before)
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError, InputError):  # damaged, or of old code
        pass

    # Else the first line that differs, a list being one line.
    pairs = zip_longest(*(_LIST.sub(_on_one_line, text).splitlines() for text in (now, before)), fillvalue="nothing")
    line, line_before = next(((new, old) for new, old in pairs if new != old), ("", ""))
    return f"it has {_short(line_before)} instead of {_short(line)}"


def changed_files(now: dict[str, str], before: dict[str, str], scene_now: str, scene_before: str) -> str:
    """The first file whose digest differs; for the scene, its first difference as well. Empty if no file differs.

    Parameters
    ----------
    now, before : dict[str, str]
        Digests by file name, of the requested and of the stored study; the scene is the first.
    scene_now, scene_before : str
        Texts of their scenes (XML).
    """
    for name in {**before, **now}:
        if name not in now:
            plugin = name.removeprefix(f"{PLUGIN} ")
            return f"it needs --plugin {plugin}" if plugin != name else f"its scene names {name}, this one does not"
        if name not in before:
            return f"it had no {name}"
        if now[name] != before[name]:
            about = changed_scene(scene_now, scene_before) if name == next(iter(now)) else ""
            return f"{name} has changed since{f': {about}' if about else ''}"
    return ""


def changed_scene(now: str, before: str) -> str:
    """The first value that differs between two scenes (XML texts), or else the first line; empty if there is none."""
    try:
        pairs = [list(_values(ElementTree.fromstring(text))) for text in (now, before)]
    except (ElementTree.ParseError, RecursionError):
        return ""
    for (name, value), (name_before, value_before) in zip(*pairs, strict=False):
        if name != name_before:
            break
        if value != value_before:
            return f"{name} is {_short(value)} instead of {_short(value_before)}"
    lines = zip_longest(*([line.strip() for line in text.splitlines()] for text in (now, before)), fillvalue="")
    for number, (line, line_before) in enumerate(lines, start=1):
        if line != line_before:
            return f"line {number} is {_short(line)!r} instead of {_short(line_before)!r}"
    return ""


def _values(element: ElementTree.Element, around: str = "") -> list[tuple[str, str]]:
    """Iterate over the values of an XML element and its children, in the order of the text, each with a description of
    its position.

    A description is, for instance, ``wall of deformable_pad``; ``around`` is the name of the enclosing element.
    """
    named = element.get("name") or element.get("id") or element.get("type") or element.tag
    if element.tag == "default":
        return [(f"the <default> {named}", element.get("value", ""))]
    own = [(f"{key} of {named}" if around else key, word) for key, word in element.attrib.items() if key != "name"]
    if "value" in element.attrib:
        own = [(f"{named} of {around}", element.get("value", ""))]
    inner = element.get("type") or named
    return [*own, *(value for child in element for value in _values(child, inner))]


def _on_one_line(match: re.Match[str]) -> str:
    """Write a list of a TOML file, which has one line for each value, on a single line."""
    return f"[{', '.join(line.strip().removesuffix(',') for line in match[1].splitlines())}]"


def _short(line: str) -> str:
    return line if len(line) <= MOST_LETTERS else f"{line[:MOST_LETTERS]} ..."
