"""The XML file of a scene, and the files that it includes."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.files.text import read_bytes

DEEPEST = 16
"""Largest nesting depth of a scene: Mitsuba's parser is recursive."""
DEEPEST_INCLUDE = 14
"""Largest depth of files that include one another; it is the limit of Mitsuba's parser."""
MOST_INCLUDED = 200
"""Largest number of included files, each counted as often as it is included. Without a limit, a few files that include
each other twice would take practically forever."""
LARGEST_SCENE = 1 << 26
"""Bytes of the largest file of a scene."""


def read_scene_file(path: Path) -> Iterator[tuple[Path, ElementTree.Element]]:
    """Read the XML file of a scene, and then all files that it includes.

    Parameters
    ----------
    path : Path
        Path of the XML file.

    Yields
    ------
    tuple[Path, ElementTree.Element]
        Path and root element of each file.

    Raises
    ------
    InputError
        if a file cannot be read, is not XML, is nested too deeply for Mitsuba, or includes itself, or if there are more
        than :data:`MOST_INCLUDED` files.
    """
    for number, read in enumerate(_read(path, ())):
        if number > MOST_INCLUDED:
            raise InputError(f"{path.name} is not allowed: it includes more than {MOST_INCLUDED} files; join some.")
        yield read


def _read(path: Path, around: tuple[Path, ...]) -> Iterator[tuple[Path, ElementTree.Element]]:
    """Read a file and the files that it includes; ``around`` are the files that include it."""
    if path.resolve() in around:
        raise InputError(f"{path.name} is not allowed: it includes itself; take that include out.")
    if len(around) > DEEPEST_INCLUDE:
        raise InputError(f"{path.name} is not allowed: over {DEEPEST_INCLUDE} files include one another; join some.")
    try:
        root = ElementTree.fromstring(read_bytes(path, LARGEST_SCENE))
    except ElementTree.ParseError as error:
        raise InputError(f"{path.name} is not valid XML: {error}.") from error
    except (OSError, LookupError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        within = f", which {around[-1].name} includes," if around else ""
        raise InputError(f"{path}{within} cannot be read: {reason}.") from error
    if _depth(root) > DEEPEST:
        raise InputError(f"{path.name} is not allowed: its elements are nested more than {DEEPEST} deep.")
    yield path, root
    for include in root.iter("include"):
        yield from _read(path.parent / include.get("filename", ""), (*around, path.resolve()))


def _depth(root: ElementTree.Element) -> int:
    depth, level = 0, [root]
    while level and depth <= DEEPEST:
        depth, level = depth + 1, [child for element in level for child in element]
    return depth
