"""What not every operating system has: limits of a process, its end with its parent, and whether another one lives."""

from __future__ import annotations

import math
import os
import platform
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from mitsuba_taxel.base.processes import system

FILE = Path(system.__file__)


def python(code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run code in which ``system`` is the module, without this package."""
    begin = f"import os, runpy, sys, time, types; system = types.SimpleNamespace(**runpy.run_path({str(FILE)!r}));"
    return subprocess.run([sys.executable, "-c", begin + code, *arguments], capture_output=True, text=True)


@pytest.mark.skipif(sys.platform != "linux", reason="other systems may refuse the limit")
@pytest.mark.parametrize("kind", ["AS", "DATA"])
def test_memory_beyond_the_limit_is_an_error(kind):
    taken = f"system.confine(2**30, {kind!r}); print(len(bytearray(2**28))); bytearray(2**31)"
    done = python(taken)
    assert done.stdout == f"{2**28}\n" and "MemoryError" in done.stderr


def test_a_limit_does_not_exceed_that_of_this_process():
    pytest.importorskip("resource")
    code = "import resource; resource.setrlimit(resource.RLIMIT_AS, (2**33, 2**33));"
    assert python(f"{code} print(system.memory_limit(2**40), system.memory_limit(2**30))").stdout.split() == [
        str(2**33), str(2**30),
    ]  # fmt: skip


def test_a_process_ends_after_its_time():
    start = time.monotonic()
    done = python("system.stop_after(1); time.sleep(60)")
    assert done.returncode != 0 and 0.9 < time.monotonic() - start < 50


@pytest.mark.parametrize("watched", ["by the system", "by a thread"])
def test_a_process_ends_with_its_parent(tmp_path, watched):
    """As on Linux, and as elsewhere, by a look at the parent each second."""
    by_thread = "system.confine.__globals__['sys'] = types.SimpleNamespace(platform='darwin');"
    child = f"import runpy, sys, time, types; system = types.SimpleNamespace(**runpy.run_path({str(FILE)!r}));"
    child += by_thread if watched == "by a thread" else ""
    child += "system.confine(2**40); print(1, flush=True); time.sleep(60)"
    parent = (
        "import subprocess, sys, time;"
        f"child = subprocess.Popen([sys.executable, '-c', {child!r}], stdout=subprocess.PIPE);"
        "child.stdout.readline(); print(child.pid, flush=True); time.sleep(60)"
    )
    started = subprocess.Popen([sys.executable, "-c", parent], stdout=subprocess.PIPE, text=True)
    assert started.stdout is not None
    number = int(started.stdout.readline())
    assert system.is_alive(number)
    started.kill()
    started.communicate()
    deadline = time.monotonic() + 50
    while system.is_alive(number) and not is_zombie(number):
        assert time.monotonic() < deadline
        time.sleep(0.05)


def is_zombie(number: int) -> bool:
    """Whether a process has ended without a parent that has asked for its end."""
    try:
        return ") Z" in Path(f"/proc/{number}/stat").read_text(encoding="utf-8")
    except OSError:
        return False


def test_which_processes_are_alive():
    child = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    assert system.is_alive(os.getpid()) and system.is_alive(child.pid)
    child.communicate(b"\n")
    assert not system.is_alive(child.pid)
    assert system.is_alive(1)  # of another user, unless the tests run as root


def test_memory_and_time_are_those_of_this_process():
    code = "taken = bytearray(3 * 10**8); start = time.process_time();\nwhile time.process_time() < start + 0.3: pass\n"
    code += "print(system.peak_memory(), system.processor_seconds(), system.processor_seconds(children_only=True))"
    memory, seconds, of_children = map(float, python(code).stdout.split())
    assert 286 < memory < 400
    assert 0.3 < seconds < 1.5 and of_children < 0.01
    before = system.processor_seconds(children_only=True)
    python("sum(range(10**7))")
    assert math.isclose(system.processor_seconds(children_only=True) - before, 0.3, abs_tol=0.29)
    assert system.peak_memory(of_children=True) >= system.peak_memory()


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="this system does not defer signals")
def test_signals_are_deferred_and_then_received():
    received: list[int] = []
    before = signal.signal(signal.SIGTERM, lambda number, frame: received.append(number))
    try:
        with system.deferred_signals():
            signal.pthread_kill(threading.get_ident(), signal.SIGTERM)  # other threads defer nothing
            assert received == []
        assert received == [signal.SIGTERM]
    finally:
        signal.signal(signal.SIGTERM, before)


UNIX = re.compile(
    r"^\s*(?:import|from) (?:resource|fcntl|pwd|grp|termios|posix)\b|CDLL\(None|/proc/|/sys/|/dev/|read_text\(\)|"
    r"\bos\.(?:fork|getuid|kill|killpg|setsid|uname|nice|sysconf|statvfs|sched_\w+|symlink|mkfifo|chown)\b|"
    r"\bsignal\.(?:alarm|setitimer|pthread_\w+|SIG(?!INT|TERM|_DFL|_IGN)\w+)",
    re.MULTILINE,
)
ELSEWHERE = {
    "mechanics/elements/memory.py": "what Linux reports, else nothing is known",
    "pads/imported/ftetwild.py": "on Linux only",
    "pads/imported/worker.py": "a copy in the place of a link",
    "studies/run/processes.py": "where there is a SIGHUP",
}
"""Files that use such names, and what they do without."""


def test_what_not_every_system_has_is_used_in_one_place():
    package = FILE.parents[2]
    found = {file.relative_to(package).as_posix() for file in package.rglob("*.py") if UNIX.search(text_of(file))}
    assert found == {*ELSEWHERE, FILE.relative_to(package).as_posix()}


def text_of(file: Path) -> str:
    return file.read_text(encoding="utf-8")


@pytest.mark.skipif(sys.platform != "linux" or platform.libc_ver()[0] != "glibc", reason="the C library is another one")
def test_scattered_memory_that_was_freed_is_returned():
    """Small arrays of which each second one remains; the C library keeps the others' memory until it is told."""
    program = """
import numpy as np
from mitsuba_taxel.base.processes.system import return_freed_memory
def resident(): return int(open("/proc/self/status").read().split("VmRSS:")[1].split()[0]) / 1024
arrays = [np.ones(12_500) for _ in range(2000)]
arrays = arrays[::2]
before = resident()
return_freed_memory()
print(before - resident(), all(array.sum() == 12_500 for array in arrays))
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    returned, intact = done.stdout.split()
    assert 70 < float(returned) < 110 and intact == "True"
