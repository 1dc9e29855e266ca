"""The rooms of the package, from the ground up, what may import what, and where tests are."""

from __future__ import annotations

import importlib
import re
from importlib import import_module
from pathlib import Path

import pytest

pytestmark = pytest.mark.quick

ROOT = Path(__file__).parents[1]
FLOORS = re.findall(r"^\| `(?:mitsuba_taxel/)?(\w+)` \|", (ROOT / "CONTRIBUTING.md").read_text(), re.MULTILINE)
"""Rooms in the order of the table of CONTRIBUTING.md: each may import those above it there."""

TOGETHER = {
    "check": {"broken_scenes"},
    "cli": {"bad_input", "ends", "program"},
    "docs": {"docstrings", "engine_stubs", "pages"},
    "mechanics": {
        "benchmarks_of_the_literature", "block", "closed_forms", "contact_with_packages", "energy",
        "shape_sensitivities", "softened_path", "symmetric_solid", "touching_under_indenters", "wrench",
    },
    "optimum": {"thin_roof"},
    "pads": {"blunt_edges", "file_meshing"},
    "plugins": {"led_on_rectangle"},
    "sensing": {
        "camera_lights", "coat_normals", "coat_regions", "finish", "image_errors", "own_coat", "prints", "touch_maps",
    },
    "surrogates": {"contact_forms"},
}  # fmt: skip
"""Tests of what several files of a room do together; all of ``tests/properties`` are."""


def folder_of(room: str) -> Path:
    """Plugins and scenes are at the top of the tree."""
    beside = ROOT / room
    return beside if beside.is_dir() else ROOT / "mitsuba_taxel" / room


def test_the_table_names_every_room():
    inside = {place.name for place in (ROOT / "mitsuba_taxel").iterdir() if (place / "__init__.py").is_file()}
    assert inside <= set(FLOORS)


def test_the_table_has_the_order_that_imports_are_checked_by():
    layers = re.search(r"^layers = \[(.*?)^\]", (ROOT / "pyproject.toml").read_text(), re.MULTILINE | re.DOTALL)
    checked = re.findall(r'"(\w+)"', layers[1])
    assert [room for room in FLOORS if room in checked] == checked[::-1]


TESTED = sorted({file.relative_to(ROOT / "tests").parts[0] for file in (ROOT / "tests").glob("*/**/test_*.py")})


@pytest.mark.parametrize("room", [room for room in TESTED if room != "properties"])
def test_tests_have_the_names_of_files(room):
    """Or of folders, of scenes that they read, or they are known to be of several files."""
    names = {place.stem for folder in (folder_of(room), ROOT / "scenes") for place in folder.rglob("*")}
    tests = {file.stem.removeprefix("test_") for file in (ROOT / "tests" / room).rglob("test_*.py")}
    assert tests - names == TOGETHER.get(room, set())


@pytest.mark.parametrize("stub", sorted((ROOT / "mitsuba_taxel").rglob("__init__.pyi")), ids=lambda s: s.parent.name)
def test_what_a_room_publishes_is_where_its_stub_says(stub):
    """Names are loaded lazily, so that a file that has moved is missed by no import."""
    package = importlib.import_module(".".join(stub.parent.relative_to(ROOT).parts))
    for name in package.__all__:
        assert getattr(package, name) is not None


@pytest.mark.parametrize("room", TESTED)
def test_every_room_has_quick_tests(room):
    """`pytest -m quick` runs them."""
    texts = [file.read_text() for file in (ROOT / "tests" / room).rglob("test_*.py")]
    assert any("pytest.mark.quick" in text for text in texts)


def test_no_file_of_tests_is_long():
    lines = {str(file): file.read_text().count("\n") for file in (ROOT / "tests").rglob("*.py")}
    assert [file for file, count in lines.items() if count > 400] == []


def test_units_keep_their_case_at_the_start_of_a_sentence():
    """Mm is a megametre."""
    texts = {file: file.read_text() for room in ("mitsuba_taxel", "plugins") for file in (ROOT / room).rglob("*.py")}
    assert [str(file) for file, text in texts.items() if re.search(r"\b(Mm|MPA|Nm|Mw)\b", text)] == []


def test_what_rooms_offer_exists():
    """Names of stubs are looked up when they are first used."""
    missing = []
    for stub in sorted((ROOT / "mitsuba_taxel").rglob("__init__.pyi")):
        room = import_module(".".join(stub.parent.relative_to(ROOT).parts))
        for name in room.__all__:
            try:
                getattr(room, name)
            except (ImportError, AttributeError) as error:
                missing.append(f"{room.__name__}.{name}: {error}")
    assert missing == []
