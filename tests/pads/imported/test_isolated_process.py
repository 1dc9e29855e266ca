"""Meshing in a process of its own: it may crash, hang, or take too much, and nothing is left of it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.geometry.geometry_error import GeometryError
from mitsuba_taxel.pads.imported import isolated_process

BEGINNING = "import ctypes, io, os, sys, time\nimport numpy as np\nsys.stdin.buffer.read()\n"


@pytest.fixture
def worker(tmp_path, monkeypatch):
    """A function that puts a program in place of the worker."""

    def write(program: str):
        path = tmp_path / "worker.py"
        path.write_text(BEGINNING + program)
        monkeypatch.setattr(isolated_process, "WORKER", path)

    return write


@pytest.mark.parametrize(
    ("program", "what"),
    [
        ("ctypes.string_at(0)", "crashed .SIGSEGV.: choose another mesh_size"),
        ("os.abort()", "crashed .SIGABRT."),
        ("sys.exit('one line\\nand another')", "failed .and another."),
        ("sys.exit('OpenBLAS error: Memory allocation still failed')", "more than 8 GB"),
        ("raise MemoryError", "more than 8 GB of memory: choose a greater mesh_size"),
        ('print("terminate: what(): std::bad_alloc", file=sys.stderr)\nos.abort()', "more than 8 GB"),
        ("time.sleep(60)", "stopped after 0.5 s"),
    ],
)
def test_whatever_befalls_the_process_is_one_line(worker, monkeypatch, capfd, program, what):
    worker(program)
    if "sleep" in program:
        monkeypatch.setattr(isolated_process, "MOST_SECONDS", 0.5)
    with pytest.raises(ComputationError, match=f"^meshing the pad .*{what}") as caught:
        isolated_process.run_isolated("any", {"a": np.zeros(3)})
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")
    assert caught.value.__cause__ is not None


def test_memory_beyond_the_limit_is_refused_to_the_process(monkeypatch, box):
    """Its libraries alone need more. Now and then one of them waits for ever, and is stopped."""
    monkeypatch.setattr(isolated_process, "MOST_MEMORY", 2**26)
    monkeypatch.setattr(isolated_process, "MOST_SECONDS", 10.0)
    with pytest.raises(ComputationError, match="^meshing the pad (needed more than 0.0625 GB|was stopped after 10 s)"):
        isolated_process.run_isolated("tetrahedralise", _arguments(box()))


def test_the_process_keeps_a_lower_limit_of_its_caller(box):
    """Nobody may raise a limit again that another has set."""
    arguments = _arguments(box())
    del arguments["epsilon"]
    program = (
        "import resource, sys\n"
        "from mitsuba_taxel.pads.imported import isolated_process\n"
        "resource.setrlimit(resource.RLIMIT_AS, (4 * 2**30,) * 2)\n"
        "print(len(isolated_process.run_isolated('fill', isolated_process._unpacked(sys.stdin.buffer.read()))['tets']))"
    )
    command = [sys.executable, "-c", program]
    on_cpus = {**os.environ, "MITSUBA_TAXEL_VARIANT": "llvm_ad_mono"}  # a graphics card cannot be opened in so little
    done = subprocess.run(command, input=isolated_process._packed(arguments), capture_output=True, env=on_cpus)
    assert done.returncode == 0, done.stderr.decode()
    assert int(done.stdout) > 10


def test_errors_that_the_process_finds_are_told_apart(worker):
    worker("np.savez(sys.stdout.buffer, error='it is round')")
    with pytest.raises(GeometryError, match="it is round"):
        isolated_process.run_isolated("any", {})


def _arguments(corners):
    vertices, triangles = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    return {"vertices": vertices, "triangles": triangles.reshape(-1, 3), "mesh_size": 1.0, "epsilon": 0.02}


def test_the_process_imports_nothing_of_this_package_and_leaves_no_file(box, tmp_path):
    command = [sys.executable, "-X", "importtime", str(isolated_process.WORKER), "tetrahedralise", str(2**33), "60"]
    environment = {**os.environ, "TMPDIR": str(tmp_path), "PYTHONSAFEPATH": "1"}  # which `taxel` sets
    content = isolated_process._packed(_arguments(box()))
    done = subprocess.run(command, input=content, capture_output=True, check=True, env=environment, cwd=tmp_path)
    imported = {line.split("|")[-1].strip().split(".")[0] for line in done.stderr.decode().splitlines()}
    assert "pytetwild" in imported
    assert not imported & {"mitsuba", "mitsuba_taxel", "drjit", "trimesh", "netgen", "vtkmodules"}
    assert set(isolated_process._unpacked(done.stdout)) == {"points", "tets"}
    assert list(tmp_path.iterdir()) == []


def test_an_interrupt_ends_the_process_too(tmp_path):
    (tmp_path / "worker.py").write_text(
        "import os, pathlib, signal, time\n"
        "signal.signal(signal.SIGINT, signal.SIG_IGN)\n"
        f"pathlib.Path({str(tmp_path)!r}, 'started').write_text(str(os.getpid()))\n"
        "time.sleep(60)\n"
    )
    code = (
        "import pathlib; from mitsuba_taxel.pads.imported import isolated_process; "
        f"isolated_process.WORKER = pathlib.Path({str(tmp_path)!r}, 'worker.py'); "
        "isolated_process.run_isolated('any', {})"
    )
    parent = subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.PIPE)
    deadline = time.monotonic() + 60
    while not (tmp_path / "started").exists() or not (tmp_path / "started").read_text():
        assert time.monotonic() < deadline and parent.poll() is None
        time.sleep(0.02)
    parent.send_signal(signal.SIGINT)
    assert b"KeyboardInterrupt" in parent.communicate(timeout=60)[1]
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "started").read_text()), 0)
