"""Worker processes: they share the cores of this machine, ignore interrupts, and end with their parent."""

# Why not `loky` or `joblib`: their executors fail as a whole when one process dies, and give no choice of the process
# for a job. The code in this file (executors of one process each, shared cores, ignored signals, the end with the
# parent) would be needed on top of them as well.

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import warnings
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import resource_tracker
from multiprocessing.process import BaseProcess

from mitsuba_taxel.base.errors import UnusedDefault
from mitsuba_taxel.base.processes.system import FROM_TERMINAL
from mitsuba_taxel.base.processes.threads import set_thread_count


def start(count: int, sharing: int) -> ProcessPoolExecutor:
    """Create an executor of worker processes, each of which starts with its first job.

    Parameters
    ----------
    count : int
        Number of its processes.
    sharing : int
        Number of processes, of all executors, that share the cores.
    """
    _start_tracker()
    return ProcessPoolExecutor(count, multiprocessing.get_context("spawn"), _begin, (sharing,))


def _start_tracker() -> None:
    """Start Python's resource tracker such that it survives the closing of the terminal (SIGHUP); Windows has none."""
    if not hasattr(signal, "SIGHUP"):
        return
    if threading.current_thread() is not threading.main_thread():
        resource_tracker.ensure_running()
        return
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        resource_tracker.ensure_running()
    finally:
        signal.signal(signal.SIGHUP, before)


def end(*executors: ProcessPoolExecutor) -> None:
    """Terminate immediately all worker processes of executors."""
    for executor in executors:
        for process in list((executor._processes or {}).values()):
            process.terminate()
    for executor in executors:
        executor.shutdown(cancel_futures=True)


def share_of_cores(sharing: int) -> int:
    """Number of cores for each process if ``sharing`` processes share this machine."""
    return max(1, (os.cpu_count() or 1) // sharing)


def keep_to_share(sharing: int) -> None:
    """Limit the threads of this process to its share of the cores, as one of ``sharing`` processes: idle threads of
    Dr.Jit take time too.
    """
    import drjit as dr

    dr.set_thread_count(share_of_cores(sharing))
    set_thread_count(share_of_cores(sharing))


def _begin(sharing: int) -> None:
    """Prepare a worker process: set up signals, warnings and threads, and let it end when its parent ends."""
    for number in FROM_TERMINAL:  # the parent ends this process
        signal.signal(number, signal.SIG_IGN)
    threading.Thread(target=_follow, args=(multiprocessing.parent_process(),), daemon=True).start()
    warnings.simplefilter("ignore", UnusedDefault)  # the parent has warned
    keep_to_share(sharing)


def _follow(parent: BaseProcess) -> None:
    """End this process when its parent process has ended, even if the parent was killed."""
    parent.join()
    os._exit(1)
