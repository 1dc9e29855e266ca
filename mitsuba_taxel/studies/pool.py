"""Where the jobs of a study are done: in this process, in processes of this machine, or on a Dask cluster.

A result depends on its job alone, and not on who does it, how many there are, or in which order.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from itertools import islice
from multiprocessing.process import BaseProcess
from typing import Protocol

from mitsuba_taxel.errors import InputError
from mitsuba_taxel.studies.job import Failure, Job, Result, failure_of, run

MOST_DEATHS = 2
"""A job is given up after so many workers have died on it."""
MOST_WORKERS = 256

Outcomes = Iterator[tuple[Job, "Result | Failure"]]


class Pool(Protocol):
    """Does jobs; says what became of each as it comes, in any order.

    Attributes
    ----------
    name : what it is, in words
    machines : about how many times as fast as this machine it is: local processes share its cores
    """

    name: str
    machines: int

    def outcomes(self, jobs: Iterable[Job]) -> Outcomes: ...


@contextmanager
def open_pool(workers: int | None = None, scheduler: str | None = None) -> Iterator[Pool]:
    """Those who do jobs: this process, ``workers`` processes, or the Dask cluster of a ``scheduler``.

    Raises
    ------
    InputError
        if the number is not allowed, both are given, Dask is not installed, or the scheduler does not answer.
    """
    if workers is not None and scheduler is not None:
        raise InputError(f"workers = {workers} and scheduler = {scheduler!r} exclude each other: give one of them.")
    if workers is not None and not 1 <= workers <= MOST_WORKERS:
        raise InputError(f"workers = {workers} is not allowed: a whole number from 1 to {MOST_WORKERS} is needed.")
    if scheduler is not None:
        with _cluster(scheduler) as cluster:
            yield cluster
    elif workers is not None:
        processes = _Processes(workers)
        try:
            yield processes
        finally:
            processes.stop()
    else:
        yield _Here()


class _Here:
    name = "this process"
    machines = 1

    def outcomes(self, jobs: Iterable[Job]) -> Outcomes:
        for job in jobs:
            yield job, run(job)


class _Processes:
    """Local processes; one that dies costs the jobs in flight a second try, and is replaced."""

    machines = 1

    def __init__(self, count: int) -> None:
        self.name = f"{count} {'process' if count == 1 else 'processes'}"
        self._count = count
        self._executor: ProcessPoolExecutor | None = None

    def outcomes(self, jobs: Iterable[Job]) -> Outcomes:
        waiting = iter(jobs)
        deaths: Counter[int] = Counter()
        running: dict[Future[Result | Failure], Job] = {}
        suspects: list[Job] = []
        while True:
            if suspects:  # one job at a time tells which of those in flight was deadly
                chosen = [] if running else [suspects.pop()]
            else:
                chosen = list(islice(waiting, 2 * self._count - len(running)))
            running.update({self._start().submit(run, job): job for job in chosen})
            if not running:
                return
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                job = running.pop(future)
                error = future.exception()
                if not isinstance(error, BrokenProcessPool):
                    yield job, future.result()
                    continue
                deaths[job.number] += 1
                if deaths[job.number] < MOST_DEATHS:
                    suspects.append(job)
                else:
                    yield job, Failure("the process that computed it died twice: fewer workers need less memory")
                if not running:
                    self.stop()

    def _start(self) -> ProcessPoolExecutor:
        if self._executor is None:
            context = multiprocessing.get_context("spawn")
            self._executor = ProcessPoolExecutor(self._count, context, _begin, (self._count,))
        return self._executor

    def stop(self) -> None:
        """End all processes, whatever they are at."""
        if self._executor is not None:
            for process in list((self._executor._processes or {}).values()):
                process.terminate()
            self._executor.shutdown(cancel_futures=True)
            self._executor = None


def _begin(workers: int) -> None:
    """Make a process a worker: it leaves interrupts to the process that it works for, and does not outlive that."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_follow, args=(multiprocessing.parent_process(),), daemon=True).start()
    _share_cores(workers)


def _follow(parent: BaseProcess) -> None:
    parent.join()
    os._exit(1)


def _share_cores(workers: int) -> None:
    """Give each of several processes its share of the cores for the light."""
    import drjit as dr

    # The mechanics keeps all of them: others wait meanwhile for the path that one solves.
    dr.set_thread_count(max(1, (os.cpu_count() or 1) // workers))


@contextmanager
def _cluster(address: str) -> Iterator[Pool]:
    try:
        from distributed import Client
    except ImportError as error:
        raise InputError("a scheduler needs Dask: install mitsuba_taxel[cluster].") from error
    try:
        client = Client(address, timeout="10s")
    except (OSError, ValueError) as error:
        raise InputError(f"scheduler = {address!r} is not allowed: no Dask scheduler answers there.") from error
    try:
        yield _Cluster(client, address)
    finally:
        client.close()


class _Cluster:
    """The workers of a Dask cluster; Dask gives the jobs of one that dies to others."""

    def __init__(self, client, address: str) -> None:
        self.name = f"scheduler {address}"
        self.machines = max(1, len(client.scheduler_info()["workers"]))
        self._client = client

    def outcomes(self, jobs: Iterable[Job]) -> Outcomes:
        from distributed import as_completed

        submit: Callable = self._client.submit
        given = {submit(run, job, pure=False, key=f"taxel-{id(self)}-{job.number}"): job for job in jobs}
        for future in as_completed(list(given)):
            job = given.pop(future)
            error = future.exception()
            yield job, future.result() if error is None else failure_of(error)
            future.release()
