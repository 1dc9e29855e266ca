"""The XML file of a scene, and the files that it includes."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path

from mitsuba_taxel.base.errors import InputError

DEEPEST = 16
"""Largest nesting depth of a scene: Mitsuba's parser is recursive."""


def read_scene_file(path: Path, around: tuple[Path, ...] = ()) -> Iterator[tuple[Path, ElementTree.Element]]:
    """The file and its root, then those of all files that it includes; ``around`` are the files including it.

    Raises
    ------
    InputError
        if one of them cannot be read, is not XML, is nested too deeply for Mitsuba, or includes itself.
    """
    if path.resolve() in around:
        raise InputError(f"{path.name} is not allowed: it includes itself.")
    try:
        root = ElementTree.parse(path).getroot()
    except ElementTree.ParseError as error:
        raise InputError(f"{path.name} does not parse as XML: {error}.") from error
    except (OSError, LookupError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        within = f", which {around[-1].name} includes," if around else ""
        raise InputError(f"{path}{within} cannot be read: {reason}.") from error
    if _depth(root) > DEEPEST:
        raise InputError(f"{path.name} is not allowed: more than {DEEPEST} of its elements lie one in the other.")
    yield path, root
    for include in root.iter("include"):
        yield from read_scene_file(path.parent / include.get("filename", ""), (*around, path.resolve()))


def _depth(root: ElementTree.Element) -> int:
    depth, level = 0, [root]
    while level and depth <= DEEPEST:
        depth, level = depth + 1, [child for element in level for child in element]
    return depth
