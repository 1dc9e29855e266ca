"""The cache on disk: used where it is whole and fits, ignored where it does not."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
import warnings
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
from started_process import started

from mitsuba_taxel.mechanics import NeoHookean, cache, load_path
from mitsuba_taxel.mechanics.continuation.pad_path import shared
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import LoadedPad
from mitsuba_taxel.pads import Pad

PAD = Pad("cylindrical", rows=1, columns=1)
FILES = 3
"""Its mesh, a normal segment and a tangential one."""


def displacement(material=None, size=2.0, pad=PAD):
    return load_path(pad, material or NeoHookean(), [(0.1, 0, -0.5)], mesh_size=size)[0].displacement


def files():
    return sorted(cache.folder().glob("*.npz"))


@pytest.fixture(scope="module")
def solved(tmp_path_factory):
    """A cache with one solution, and that solution."""
    folder = tmp_path_factory.mktemp("solved")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MITSUBA_TAXEL_CACHE", str(folder))
        shared.cache_clear()
        solution = displacement()
    shared.cache_clear()
    return folder, solution


@pytest.fixture
def first(fresh, solved):
    """The solution that the cache on disk holds, and memory does not."""
    folder, solution = solved
    shutil.copytree(folder, cache.folder())
    return solution


def test_a_kept_solution_is_used(first, monkeypatch):
    assert len(files()) == FILES
    monkeypatch.setattr(LoadedPad, "solve_symmetric", None)
    monkeypatch.setitem(sys.modules, "netgen", None)
    np.testing.assert_array_equal(displacement(), first)


@pytest.mark.parametrize("harm", ["truncated", "emptied", "flipped", "foreign"])
def test_damaged_files_are_replaced(first, harm):
    for file in files():
        content = bytearray(file.read_bytes())
        if harm == "truncated":
            content = content[: len(content) // 2]
        elif harm == "emptied":
            content = bytearray()
        elif harm == "flipped":
            content[len(content) // 2] ^= 1
        else:
            content = bytearray(b"not a solution at all" * 10)
        file.write_bytes(content)
    damaged = {file: file.read_bytes() for file in files()}
    np.testing.assert_array_equal(displacement(), first)
    assert all(file.read_bytes() != content for file, content in damaged.items())


@pytest.mark.parametrize(
    "change",
    [
        {"material": NeoHookean(4.16, 0.48)},
        {"material": NeoHookean(4.2, 0.49)},
        {"size": 2.3},
        {"pad": Pad("cylindrical", rows=1, columns=1, wall=1.1)},
    ],
)
def test_another_question_gets_another_answer(first, change):
    before = set(files())
    other = displacement(**change)
    assert set(files()) > before
    assert other.shape != first.shape or not np.array_equal(other, first)


def test_the_key_knows_the_last_bit_and_the_code():
    assert cache.key(0.1) != cache.key(np.nextafter(0.1, 1))
    assert cache.key(0.1) == cache.key(0.1)


def test_a_folder_that_cannot_be_written_does_not_stop_the_run(first, monkeypatch, tmp_path):
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("MITSUBA_TAXEL_CACHE", str(tmp_path / "file" / "cache"))
    with pytest.warns(UserWarning, match="cannot be written"):
        second = displacement()
    np.testing.assert_array_equal(first, second)


def test_it_is_said_once_wherever_it_is_found(monkeypatch, tmp_path):
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("MITSUBA_TAXEL_CACHE", str(tmp_path / "file" / "cache"))
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("default")
        cache.store("here", {})
        cache.store("there", {})
    assert len(said) == 1


def test_no_temporary_files_are_left(fresh):
    """No locks either: there was one for each entry."""
    displacement()
    assert [file.suffix for file in cache.folder().iterdir() if file.is_file()] == [".npz"] * FILES
    assert list((cache.folder() / "locks").iterdir()) == []


def test_locks_of_ended_processes_are_removed(filled):
    """Not those that are held, nor new ones."""
    folder, names, _ = filled
    ended, new = folder / "locks" / names[3], folder / "locks" / names[4]
    with cache.alone(names[1]):
        held = folder / "locks" / names[1]
        for lock in (ended, new):
            lock.touch()
        for lock in (held, ended):
            os.utime(lock, (1e9, 1e9))
        cache.remove_least_recently_used(10**9)
        assert held.exists() and new.exists() and not ended.exists()
    assert not held.exists()


def test_an_error_while_an_entry_is_computed_frees_its_lock(filled):
    folder, names, _ = filled
    with pytest.raises(ZeroDivisionError), cache.alone(names[0]):
        raise ZeroDivisionError
    assert not cache.is_locked(names[0]) and list((folder / "locks").iterdir()) == []


def test_where_the_cache_lies(monkeypatch):
    monkeypatch.delenv("MITSUBA_TAXEL_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", "/somewhere")
    assert cache.folder() == Path("/somewhere/mitsuba_taxel")
    monkeypatch.delenv("XDG_CACHE_HOME")
    assert cache.folder() == Path.home() / ".cache" / "mitsuba_taxel"


def test_processes_may_solve_the_same_at_once(fresh):
    code = (
        "from mitsuba_taxel.mechanics import load_path, NeoHookean; from mitsuba_taxel.pads import Pad; import hashlib;"
        "s = load_path(Pad('cylindrical', rows=1, columns=1), NeoHookean(), [(0.1, 0, -0.5)], mesh_size=2.0)[0];"
        "print(hashlib.sha256(s.displacement.tobytes()).hexdigest())"
    )
    with ExitStack() as stack:
        command, how = [sys.executable, "-c", code], {"stdout": subprocess.PIPE, "env": dict(os.environ), "text": True}
        runs = [stack.enter_context(started(command, **how)) for _ in range(2)]
        digests = {run.communicate()[0] for run in runs}
    assert all(run.returncode == 0 for run in runs)
    assert len(digests) == 1


@pytest.fixture
def filled(tmp_path, monkeypatch):
    """Five entries of the same size, used one hour after the other, and a file of somebody else's."""
    monkeypatch.setenv("MITSUBA_TAXEL_CACHE", str(tmp_path))
    names = [cache.key(number) for number in range(5)]
    for age, name in zip((5, 4, 3, 2, 1), names, strict=True):
        cache.store(name, {"values": np.zeros(1000)})
        then = time.time() - 3600 * age
        os.utime(tmp_path / f"{name}.npz", (then, then))
    (tmp_path / "notes.npz").write_bytes(bytes(10**6))
    return tmp_path, names, (tmp_path / f"{names[0]}.npz").stat().st_size


def kept(names):
    return [number for number, name in enumerate(names) if cache.holds(name)]


def test_what_was_used_longest_ago_goes_first(filled):
    folder, names, size = filled
    cache.load(names[0])
    assert cache.remove_least_recently_used(3 * size) == (2, 2 * size)
    assert kept(names) == [0, 3, 4] and (folder / "notes.npz").exists()
    assert cache.remove_least_recently_used(0) == (2, 2 * size) and kept(names) == [0]


def test_what_is_in_use_stays(filled):
    """What a process computes, under its lock, and what was stored just now."""
    folder, names, size = filled
    computing = f"""
from mitsuba_taxel.mechanics import cache
with cache.alone({names[1]!r}):
    print(flush=True)
    input()
"""
    with started([sys.executable, "-c", computing], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        process.stdout.readline()
        cache.store(names[2], {"values": np.ones(1000)})
        cache.remove_least_recently_used(0)
        assert kept(names) == [1, 2]


def test_storing_keeps_the_folder_below_its_limit(filled, monkeypatch):
    folder, names, size = filled
    monkeypatch.setattr(cache, "LARGEST", 3 * size)
    monkeypatch.setattr(cache, "cache_limit", cache._Limit())
    cache.store(cache.key("new"), {"values": np.zeros(1000)})
    assert kept(names) == [3, 4] and cache.holds(cache.key("new"))
    assert cache.load(names[3]) is not None
