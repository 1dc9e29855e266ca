"""Replacements for all functions that some operating systems lack.

Functions of the standard library that exist on Unix only, or have another meaning on Windows, are called in this file
only. The exception is the free memory that Linux reports (:mod:`mitsuba_taxel.mechanics.elements.memory`). The file
imports nothing but the standard library, so that a worker can run it without this package.
"""

from __future__ import annotations

import ctypes
import math
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

if sys.platform == "win32":
    import _winapi
else:
    import resource

ENDING = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP", "SIGBREAK") if hasattr(signal, name))
"""Signals that end a program, besides the interrupt: Windows has no SIGHUP, other systems have no SIGBREAK."""
FROM_TERMINAL = (signal.SIGINT, *ENDING[1:])
"""Signals that a terminal sends to all its processes."""
_FOLLOWED = 1.0
"""Seconds between two checks of a parent process, on systems that do not end a process with its parent."""


@contextmanager
def deferred_signals() -> Iterator[None]:
    """Defer signals of this thread that end the process; on Windows they are not deferred.

    Yields
    ------
    None
        Nothing, while signals are deferred.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, *ENDING))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def memory_limit(most: int, kind: str = "AS") -> int:
    """The lower of a requested memory limit and the memory limit of this process, for a new process.

    Parameters
    ----------
    most : int
        Limit in bytes.
    kind : str
        Limited memory: the address space ("AS") or the data ("DATA").

    Returns
    -------
    int
        Limit in bytes. On Windows it is ``most``.
    """
    if sys.platform == "win32":
        return most
    current = resource.getrlimit(getattr(resource, f"RLIMIT_{kind}"))
    return min([most, *(limit for limit in current if limit != resource.RLIM_INFINITY)])


def confine(memory: int, kind: str = "AS") -> None:
    """Limit the memory of this process, disable its core dump, and end it when its parent process ends.

    Windows has no such limit, and macOS may refuse it: on these systems, a process that takes too much memory is not
    stopped.

    Parameters
    ----------
    memory : int
        Limit in bytes.
    kind : str
        Limited memory: the address space ("AS") or the data ("DATA").
    """
    if sys.platform != "win32":
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        with suppress(*(() if sys.platform == "linux" else (ValueError, OSError))):
            resource.setrlimit(getattr(resource, f"RLIMIT_{kind}"), (memory, memory))
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG: even if the parent is killed
    else:
        threading.Thread(target=_follow, args=(os.getppid(),), daemon=True).start()


def stop_after(seconds: int) -> None:
    """End this process after a time, even within a compiled library; on Windows, only after the library returns to
    Python.

    Parameters
    ----------
    seconds : int
        Wall time in s.
    """
    if hasattr(signal, "alarm"):
        signal.alarm(seconds)
        return
    timer = threading.Timer(seconds, os._exit, (1,))
    timer.daemon = True
    timer.start()


def _follow(parent: int) -> None:
    """Wait until the parent has ended, then end this process."""
    while os.getppid() == parent and is_alive(parent):  # the id of a parent that has ended changes on Unix only
        time.sleep(_FOLLOWED)
    os._exit(1)


def is_alive(process: int) -> bool:
    """Whether a process of any user exists.

    Parameters
    ----------
    process : int
        Process ID.

    Returns
    -------
    bool
        False if there is no process with this ID; True if there is one, or if the system does not tell.
    """
    try:
        if sys.platform == "win32":  # os.kill(process, 0) would interrupt the process
            handle = _winapi.OpenProcess(_winapi.SYNCHRONIZE, False, process)
            try:
                return _winapi.WaitForSingleObject(handle, 0) == _winapi.WAIT_TIMEOUT
            finally:
                _winapi.CloseHandle(handle)
        os.kill(process, 0)
        return True
    except ProcessLookupError:
        return False
    except OSError as error:  # the process is another user's, or on Windows does not exist
        return getattr(error, "winerror", None) != 87  # ERROR_INVALID_PARAMETER


def peak_memory(of_children: bool = False) -> float:
    """Peak memory of this process until now.

    Parameters
    ----------
    of_children : bool
        Whether ended child processes are included; the largest peak of all processes is returned.

    Returns
    -------
    float
        Peak memory in MB; NaN on Windows.
    """
    if sys.platform == "win32":
        return math.nan
    unit = 2**20 if sys.platform == "darwin" else 2**10
    children = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / unit if of_children else 0.0
    if sys.platform != "linux":
        return max(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit, children)
    # Other counters of Linux include the memory of the parent when it started this process.
    status = Path("/proc/self/status").read_text(encoding="utf-8")
    return max(int(status.split("VmHWM:")[1].split()[0]) / 1024, children)


def return_freed_memory() -> None:
    """Return memory that this process has freed to the system, where the C library keeps it for later use (Linux).

    Much of it is too scattered for large matrices, which would be allocated beside it.
    """
    if sys.platform == "linux":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # of glibc
        if trim is not None:
            trim(0)


def processor_seconds(children_only: bool = False) -> float:
    """Processor time of this process and of its ended child processes.

    Parameters
    ----------
    children_only : bool
        Whether only the time of child processes counts.

    Returns
    -------
    float
        Processor time in s; NaN on Windows, which does not count children.
    """
    if sys.platform == "win32":
        return math.nan
    processes = (resource.RUSAGE_CHILDREN,) if children_only else (resource.RUSAGE_CHILDREN, resource.RUSAGE_SELF)
    usages = map(resource.getrusage, processes)
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)


def flush_folder(folder: Path) -> None:
    """Write the entries of a folder to the disk, so that a renaming survives a power failure; Windows has no such call.

    Parameters
    ----------
    folder : Path
        An existing folder.
    """
    if sys.platform == "win32":
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
