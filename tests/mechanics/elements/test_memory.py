"""Memory that ends is one line, before a compiled solver ends the process."""

from __future__ import annotations

import math
import subprocess
import sys

import numpy as np
import pytest
import scipy.sparse as sparse

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.mechanics import NeoHookean, linearise, load_path
from mitsuba_taxel.mechanics.continuation.pad_path import PadPath
from mitsuba_taxel.mechanics.elements import memory, solvers
from mitsuba_taxel.pads import Pad

PAD = Pad("hemispheric", rows=1, columns=1)
FORCES = [(0, 0, -0.3)]
WORDS = (
    r"^there is not enough memory for {} \(.* GB, and 0.09 GB are free\): larger finite elements or fewer cells need"
)


@pytest.fixture
def no_memory(monkeypatch):
    monkeypatch.setattr(memory, "free_memory", lambda: 9e7)


def test_a_pad_that_memory_does_not_suffice_for_is_an_error_in_one_line(fresh, no_memory):
    with pytest.raises(ComputationError, match=WORDS.format("a pad of finite elements of 1.2 mm")) as caught:
        load_path(PAD, NeoHookean(), FORCES, mesh_size=1.2)
    assert "\n" not in str(caught.value)


def test_so_are_its_derivatives(monkeypatch):
    (state,) = load_path(PAD, NeoHookean(), FORCES, mesh_size=1.2)
    monkeypatch.setattr(memory, "free_memory", lambda: 9e7)
    with pytest.raises(ComputationError, match=WORDS.format("the tangent of the pad")):
        linearise(state)


def test_memory_that_ends_on_a_second_mesh_leaves_the_state_with_an_unknown_error(fresh, monkeypatch):
    solve = PadPath.canonical

    def on_the_first_alone(path, *args):
        if not path.judged:
            raise MemoryError("a factored matrix takes 9 GB, and 1 GB are free")
        return solve(path, *args)

    monkeypatch.setattr(PadPath, "canonical", on_the_first_alone)
    (state,) = load_path(PAD, NeoHookean(), FORCES, mesh_size=1.2)
    assert state.error is None and state.deviations is None and state.displacement[:, 2].min() < -0.001


@pytest.mark.parametrize("error", [MemoryError("Unable to allocate 2 GiB"), RuntimeError("can't start new thread")])
def test_so_is_memory_that_ends_anywhere_else(fresh, monkeypatch, error):
    def fail(*arguments):
        raise error

    monkeypatch.setattr(solvers.Rslab, "factor", fail)
    with pytest.raises(ComputationError, match=f"there is not enough memory .*{error}"):
        load_path(PAD, NeoHookean(), FORCES, mesh_size=1.2)


@pytest.mark.parametrize("kind", ["RLIMIT_AS", "RLIMIT_DATA"])
def test_free_memory_follows_the_limit_of_the_process(kind):
    """What is filled is no longer free; without a limit, the machine's memory is what counts."""
    assert 1e8 < memory.free_memory() < math.inf
    program = f"""
import resource
import numpy as np
from mitsuba_taxel.mechanics.elements.memory import free_memory
taken = {{"RLIMIT_AS": 0, "RLIMIT_DATA": 5}}["{kind}"]
with open("/proc/self/statm") as pages:  # addresses that a driver has reserved do not count
    limit = int(pages.read().split()[taken]) * resource.getpagesize() + 2**32
resource.setrlimit(resource.{kind}, (limit, limit))
before = free_memory()
filled = np.ones({2**26})
print(before, before - free_memory())
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    before, less = map(float, done.stdout.split())
    assert 0 < before < 5 * 2**30 or before == pytest.approx(memory.free_memory(), rel=0.5)
    assert less == pytest.approx(2**29, rel=0.2)


def test_reserved_memory_is_not_free():
    """An array that nobody has written to takes none of the machine's memory, but all of its size from the limit."""
    program = """
import resource
import numpy as np
from mitsuba_taxel.mechanics.elements.memory import free_memory
with open("/proc/self/statm") as pages:
    limit = int(pages.read().split()[5]) * resource.getpagesize() + 2**32
resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))
before = free_memory()
reserved = np.empty(3 * 2**27)
after = free_memory()
try:
    np.empty(int(after) // 8 + 2**24)
except MemoryError:
    print(before, after)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    before, after = map(float, done.stdout.split())
    assert before == pytest.approx(2**32, rel=0.05) and before - after == pytest.approx(3 * 2**30, rel=0.01)


@pytest.mark.parametrize("megabytes", [50, 120, 170, 220, 300])
def test_a_factor_beyond_the_limit_is_an_error_before_the_solver_ends_the_process(megabytes):
    program = f"""
import resource
import numpy as np, rslab, scipy.sparse as sparse
from mitsuba_taxel.mechanics.elements import memory, solvers
chain = sparse.diags([1.0, 1.0, 1.0], [-1, 0, 1], shape=(20, 20))
grid = sparse.kron(sparse.kron(sparse.kron(chain, chain), chain), np.ones((3, 3)))
matrix = sparse.csc_matrix(sparse.tril(grid) + 300 * sparse.eye(grid.shape[0]))
with open("/proc/self/statm") as pages:
    limit = int(pages.read().split()[5]) * resource.getpagesize() + {megabytes} * 10**6 + int(memory.ROOM)
resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))
try:
    print(np.ptp(solvers.Rslab().factor(matrix).solve(solvers.symmetric_product(matrix, np.ones(24000)))))
except MemoryError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-300:]
    if "GB are free" not in done.stdout:
        assert megabytes > 120 and float(done.stdout) < 1e-9


@pytest.mark.parametrize("limited", [False, True])
def test_one_thread_analyses_a_matrix_under_a_limit(limited, monkeypatch):
    """Each reserves a stack; the factor does not depend on their number."""
    rslab = pytest.importorskip("rslab")
    seen, analyse = [], rslab.analyze
    monkeypatch.setattr(rslab, "analyze", lambda *given, **chosen: seen.append(chosen) or analyse(*given, **chosen))
    monkeypatch.setattr(solvers, "is_limited", lambda: limited)
    size = 31 + limited  # patterns of small matrices are kept
    full = np.diag(np.where(np.arange(size) % 3, 4.0, -4.0)) + np.eye(size, k=1) + np.eye(size, k=-1)
    factor = solvers.Rslab().factor(sparse.csc_matrix(np.tril(full)))
    assert [settings.get("threads") for settings in seen] == [1 if limited else None]
    assert factor.negative_pivots == np.count_nonzero(np.linalg.eigvalsh(full) < 0)
    np.testing.assert_allclose(full @ factor.solve(np.ones(size)), 1.0, rtol=1e-12)


def test_a_stated_need_is_what_a_factor_takes():
    """By the growth of the process, in one that has done nothing else."""
    program = """
import numpy as np, rslab, scipy.sparse as sparse
from mitsuba_taxel.mechanics.elements import solvers
chain = sparse.diags([1.0, 1.0, 1.0], [-1, 0, 1], shape=(20, 20))
grid = sparse.kron(sparse.kron(sparse.kron(chain, chain), chain), np.ones((3, 3)))
matrix = sparse.csc_matrix(sparse.tril(grid) + 300 * sparse.eye(grid.shape[0]))
needs = []
solvers.require_memory = lambda size, purpose: needs.append(size)
def kilobytes(name): return int(open("/proc/self/status").read().split(name + ":")[1].split()[0])
open("/proc/self/clear_refs", "w").write("5")  # the most so far is what it takes now
before = kilobytes("VmRSS")
factor = solvers.Rslab().factor(matrix)
print(needs[-1], 1024 * (kilobytes("VmHWM") - before))
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    stated, taken = map(float, done.stdout.split())
    assert 0.7 * taken - memory.ROOM < stated < 1.3 * taken
