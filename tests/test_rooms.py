"""The rooms of the package, from the ground up, and what may import what."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FLOORS = re.findall(r"^\| `(?:mitsuba_taxel/)?(\w+)` \|", (ROOT / "CONTRIBUTING.md").read_text(), re.MULTILINE)
"""Rooms in the order of the table of CONTRIBUTING.md: each may import those above it there."""


def folder_of(room: str) -> Path:
    """Plugins and scenes are at the top of the tree."""
    beside = ROOT / room
    return beside if beside.is_dir() else ROOT / "mitsuba_taxel" / room


def imported(file: Path) -> Iterator[str]:
    """Modules of this package that a file imports, at its head or within a function."""
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        else:
            continue
        yield from (name for name in names if name.split(".")[0] == "mitsuba_taxel")


def test_the_table_names_every_room():
    inside = {place.name for place in (ROOT / "mitsuba_taxel").iterdir() if (place / "__init__.py").is_file()}
    assert inside <= set(FLOORS)


@pytest.mark.parametrize("room", FLOORS[: FLOORS.index("cli") + 1])
def test_no_import_leads_up(room):
    up = set(FLOORS[FLOORS.index(room) + 1 :])
    arrows = [(file.name, name) for file in folder_of(room).rglob("*.py") for name in imported(file)]
    assert [arrow for arrow in arrows if up.intersection(arrow[1].split(".")[1:2])] == []
