"""Keys of what is kept on disk know all the code that it depends on."""

from __future__ import annotations

import importlib.util
import re
import shutil
import sys
from pathlib import Path

import pytest

import mitsuba_taxel
from mitsuba_taxel.base import sources
from mitsuba_taxel.base.sources import code_digest, own_code
from mitsuba_taxel.mechanics import cache
from mitsuba_taxel.studies.store import provenance

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
    moved = (copied / "mechanics" / "load_paths.py").rename(inner / "load_paths.py")
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
        used = set(re.findall(r"^ *(?:from|import) mitsuba_taxel\.(\w+)", file.read_text(), re.MULTILINE))
        assert used <= known, (file, used - known)


HELPER = """
from mitsuba_taxel.mechanics.materials.laws.material import Material
FACTOR = {factor}

def helped(i1):
    return FACTOR * (i1 - 3)

class Own(Material):
    shear = {shear}

    def strain_energy(self, i1, i2):
        scale = lambda one: {scale} * one
        return scale(helped(i1))
"""


def in_file(file, monkeypatch, **numbers):
    file.write_text(HELPER.format(**{"factor": 1.0, "shear": 2.0, "scale": 3.0} | numbers))
    spec = importlib.util.spec_from_file_location(file.stem, file)
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, file.stem, module)
    spec.loader.exec_module(module)
    return own_code(module.Own)


def in_notebook(**numbers):
    space = {"__name__": "a_cell_of_a_notebook"}
    exec(HELPER.format(**{"factor": 1.0, "shear": 2.0, "scale": 3.0} | numbers), space)
    return own_code(space["Own"])


def test_a_class_of_ones_own_has_its_code_in_keys(tmp_path, monkeypatch):
    """With what stands beside it in its file; of a notebook, its own methods and constants."""
    same = [in_file(tmp_path / "own_law.py", monkeypatch) for _ in range(2)]
    others = [in_file(tmp_path / "own_law.py", monkeypatch, **{name: 7.0}) for name in ("factor", "shear", "scale")]
    assert same[0] == same[1] and len({same[0], *others}) == 4
    cells = [in_notebook() for _ in range(2)]
    changed = [in_notebook(**{name: 7.0}) for name in ("shear", "scale")]
    assert cells[0] == cells[1] and len({cells[0], *changed}) == 3


def test_classes_of_the_package_need_no_code_in_keys_beside_that_of_all_of_it():
    from mitsuba_taxel.mechanics import NeoHookean, SpreadForce

    assert own_code(NeoHookean) == own_code(SpreadForce) == own_code(dict) == ""
