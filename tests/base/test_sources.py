"""Keys of what is kept on disk know all the code that it depends on."""

from __future__ import annotations

import ast
import shutil
from pathlib import Path

import pytest

import mitsuba_taxel
from mitsuba_taxel.base import sources
from mitsuba_taxel.base.sources import code_digest
from mitsuba_taxel.mechanics.path import cache
from mitsuba_taxel.studies.run import provenance

SHOWING = {"plots", "characterise"}
"""Rooms that the others ask for pictures, files and words alone."""


@pytest.fixture
def copied(tmp_path, monkeypatch):
    """A copy of the package that digests are made of; returns its folder."""
    package = Path(mitsuba_taxel.__file__).parent
    place = tmp_path / "mitsuba_taxel"
    shutil.copytree(package, place, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(sources, "_folder", lambda name: place.joinpath(*name.split(".")[1:]))
    return place


def digest(rooms):
    code_digest.cache_clear()
    return code_digest(*rooms)


@pytest.fixture(autouse=True)
def forgotten():
    yield
    code_digest.cache_clear()


@pytest.mark.parametrize("rooms", [cache.ROOMS, provenance.ROOMS])
def test_a_changed_file_anywhere_changes_the_digest(copied, rooms):
    deep = copied / rooms[-1] / "one" / "two"
    deep.mkdir(parents=True)
    (deep / "table.csv").write_text("1,2\n")
    files = [*copied.glob("*.py"), *(file for room in rooms for file in (copied / room).rglob("*") if file.is_file())]
    assert len(files) > 60 and copied / "base" / "convergence.py" in files
    first = digest(rooms)
    assert {file for _, file in sources._files(rooms)} == set(files)  # all are read alike
    for file in {(file.parent, file.suffix): file for file in files}.values():  # of each folder and kind the last
        before = file.read_bytes()
        file.write_bytes(before + b"#")
        assert digest(rooms) != first, file
        file.write_bytes(before)
    assert digest(rooms) == first


def test_a_moved_file_changes_the_digest(copied):
    first = digest(cache.ROOMS)
    inner = copied / "mechanics" / "inner"
    inner.mkdir()
    moved = (copied / "mechanics" / "path" / "load_path.py").rename(inner / "load_path.py")
    assert digest(cache.ROOMS) not in ("", first)
    second = digest(cache.ROOMS)
    moved.write_text(moved.read_text() + "#")
    assert digest(cache.ROOMS) != second


def test_what_python_leaves_beside_sources_does_not_count(copied):
    first = digest(cache.ROOMS)
    (copied / "mechanics" / "__pycache__").mkdir()
    (copied / "mechanics" / "__pycache__" / "path.pyc").write_bytes(b"1")
    (copied / "mechanics" / ".path.py.swp").write_bytes(b"1")
    assert digest(cache.ROOMS) == first


def test_a_room_that_is_gone_is_an_error():
    with pytest.raises(ImportError, match="mitsuba_taxel.cellar"):
        code_digest("mechanics", "cellar")


@pytest.mark.parametrize("rooms", [cache.ROOMS, provenance.ROOMS])
def test_digests_know_all_that_their_rooms_import(rooms):
    """Nothing outside the rooms that a key covers, other than modules beside them, decides what is kept under it."""
    package = Path(mitsuba_taxel.__file__).parent
    known = {*rooms, *SHOWING, *(file.stem for file in package.glob("*.py"))}
    for file in (file for room in rooms for file in (package / room).rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text())):
            names = [node.module] if isinstance(node, ast.ImportFrom) and node.module else []
            names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            used = {name.split(".")[1] for name in names if name.startswith("mitsuba_taxel.")}
            assert used <= known, (file, used - known)
