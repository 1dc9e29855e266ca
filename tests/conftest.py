"""Fixtures shared by all tests."""

from __future__ import annotations

import gc
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

settings.register_profile(
    "same everywhere",  # the same examples in each run, however slow the machine is
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)
settings.load_profile("same everywhere")

FALSE_ALARM_RATE = 1e-4
"""Chance that one call of a statistical check fails although all is well."""
LONGEST = {
    "docs", "test_material_fit.py", "test_other_systems.py", "test_pressed_ball.py", "test_readme.py",
    "test_thin_roof.py",
}  # fmt: skip
"""Folders and files with tests of up to half a minute each."""


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Garbage is neither collected while tests are, nor sought later in what that has made: 300 000 objects.

    Scenes seek garbage when they are loaded, which would take 0.3 s each time.
    """
    gc.disable()
    try:
        with after_the_first():
            return (yield)
    finally:
        gc.enable()
        gc.freeze()


@contextmanager
def after_the_first() -> Iterator[None]:
    """Of several processes, the first compiles what all import, and the others wait, as each would compile it all."""
    if "PYTEST_XDIST_WORKER" not in os.environ or sys.dont_write_bytecode:
        yield
        return
    try:
        import fcntl
    except ImportError:  # Windows
        yield
        return
    with Path(__file__).open(encoding="utf-8") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            fcntl.flock(file, fcntl.LOCK_SH)
        yield


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """The longest tests come first, so that none is left to one of two processes when the other is done."""
    items.sort(key=lambda item: LONGEST.isdisjoint(item.path.parts))


@pytest.fixture(autouse=True, scope="module")
def imported_is_no_garbage():
    """Nor is it sought in what the modules before have imported and kept."""
    gc.collect()
    gc.freeze()


@pytest.hookimpl(trylast=True)
def pytest_runtest_teardown():
    """A test that has failed keeps no scene alive, whose plugins would be in the kernels of those after it.

    Pytest leaves its traceback, and with it what the test holds, to debuggers.
    """
    for name in ("last_type", "last_value", "last_traceback", "last_exc"):
        vars(sys).pop(name, None)


@pytest.fixture(autouse=True, scope="session")
def share_of_the_cores():
    """Processes side by side keep to their share of the cores."""
    from cores import keep_to_share_of_cores

    keep_to_share_of_cores()


@pytest.fixture(autouse=True, scope="session")
def signals_reach_programs():
    """Programs do not inherit that signals are ignored, as they are where a shell runs the tests by nohup or &."""
    for number in (getattr(signal, name) for name in ("SIGINT", "SIGHUP") if hasattr(signal, name)):
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, lambda *_: None)


@pytest.fixture(autouse=True, scope="session")
def no_power_is_cut():
    """Files are not waited for until a disk holds them: 300 times in a test of an optimisation, 10 ms each."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda descriptor: None)
        yield


@pytest.fixture
def llvm_mono():
    """Mitsuba in the default variant (``MITSUBA_TAXEL_VARIANT``), whatever an earlier test has set."""
    from mitsuba_taxel.backend import default_variant  # first: it chooses the LLVM

    import mitsuba as mi  # isort: skip

    mi.set_variant(default_variant())
    return mi


@pytest.fixture(scope="module")
def mechanics_error_unknown():
    """Deformed pads state no error: where a mesh is coarse, the second one that tells it takes most of the time."""
    with pytest.MonkeyPatch.context() as patch:
        _leave_out_second_meshes(patch)
        yield


@pytest.fixture
def error_unknown_here(monkeypatch):
    """The same for a single test."""
    _leave_out_second_meshes(monkeypatch)


def _leave_out_second_meshes(patch: pytest.MonkeyPatch) -> None:
    meshes = import_module("mitsuba_taxel.mechanics.errors.second_meshes").SecondMeshes
    for others in ("__iter__", "coarsest"):
        patch.setattr(meshes, others, lambda meshes: iter(()))


@pytest.fixture(autouse=True, scope="session")
def blank_figures():
    """Figures are written blank; gives the function that paints."""
    from blank_figures import blank_figures

    with blank_figures() as paint:
        yield paint


@pytest.fixture
def painted_figures(blank_figures, monkeypatch):
    """Figures are painted, where a test is about them."""
    from matplotlib.figure import Figure

    monkeypatch.setattr(Figure, "savefig", blank_figures)


@pytest.fixture
def own_solutions(tmp_path_factory, monkeypatch):
    """Keep the solutions of a test away from the user's, for others like it."""
    monkeypatch.setenv("MITSUBA_TAXEL_CACHE", str(tmp_path_factory.getbasetemp() / "solutions"))


@pytest.fixture
def agree():
    """A check that estimates with standard errors agree with references, by Z-tests with Sidak's correction.

    The statistic has Student's distribution with ``replicates - 1`` degrees of freedom, as standard errors are
    themselves estimates.
    """
    from scipy import stats

    def check(value, error, reference, reference_error=0.0, replicates=32):
        value, reference = np.atleast_1d(value), np.atleast_1d(reference)
        combined = np.sqrt(np.square(error) + np.square(reference_error))
        z = (value - reference) / combined
        significance = 1 - (1 - FALSE_ALARM_RATE) ** (1 / z.size)
        limit = stats.t.isf(significance / 2, df=replicates - 1)
        assert np.all(np.abs(z) < limit), f"Z = {z}, allowed +-{limit:.2f}: {value} against {reference}"

    return check
