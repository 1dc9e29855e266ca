"""Execution of the jobs of a study: in this process, in local processes, or on a Dask cluster.

A result depends on its job alone, not on the kind or number of workers or the order of the jobs.
"""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from itertools import chain
from typing import Protocol

from mitsuba_taxel.base.arguments import check_whole, plain_number, require
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.base.threads import set_thread_count
from mitsuba_taxel.studies.plan.job import Failure, Job, JobResult
from mitsuba_taxel.studies.run import processes
from mitsuba_taxel.studies.run.job import failure_of, run

MOST_WORKERS = 120
"""Each uses eight of the 1024 open files that a process is commonly allowed."""

Curve = Sequence[Job]
"""Jobs that may share a load path."""
Outcomes = Generator[tuple[Job, "JobResult | Failure"], None, None]


class Pool(Protocol):
    """Executes jobs, and yields their outcomes as they arrive, in any order.

    Attributes
    ----------
    name : str
        Description.
    machines : int
        Approximate speed relative to this machine, whose cores local processes share.
    processes : int
        Jobs that are computed at once.
    """

    name: str
    machines: int
    processes: int

    def outcomes(self, curves: Iterable[Curve]) -> Outcomes: ...


@contextmanager
def open_pool(workers: int | None = None, scheduler: str | None = None) -> Iterator[Pool]:
    """The pool that executes jobs: this process, ``workers`` processes, or the Dask cluster of a ``scheduler``.

    Parameters
    ----------
    workers : int, optional
        Number of processes.
    scheduler : str, optional
        Address of a Dask scheduler.

    Yields
    ------
    Pool
        Whose processes end with the block.

    Raises
    ------
    InputError
        if the number is not allowed, both are given, Dask is not installed, or the scheduler does not answer.
    """
    if workers is not None and scheduler is not None:
        raise InputError(f"workers = {workers} and scheduler = {scheduler!r} exclude each other: give one of them.")
    if workers is not None:
        check_whole("workers", workers, 1, MOST_WORKERS)
        workers = plain_number(workers)
    if scheduler is not None:
        require("scheduler", scheduler, str, "an address, as tcp://host:8786,")
        with _cluster(scheduler) as cluster:
            yield cluster
    elif workers is not None:
        pool = _Processes(workers)
        try:
            yield pool
        finally:
            pool.stop()
    else:
        yield _Here()


class _Here:
    name = "this process"
    machines = 1
    processes = 1

    def outcomes(self, curves: Iterable[Curve]) -> Outcomes:
        for job in chain.from_iterable(curves):
            yield job, run(job)


class _Processes:
    """Local processes, each on a curve of its own while there are enough: on a shared curve, one solves and others
    wait.

    A process that dies is replaced. Its job is repeated alone at the end, as the cause may have been lack of memory.
    """

    machines = 1

    def __init__(self, count: int) -> None:
        self.name = f"{count} {'process' if count == 1 else 'processes'}"
        self._count = self.processes = count
        self._executors: dict[int, ProcessPoolExecutor] = {}  # one process each, so that a process can be chosen

    def outcomes(self, curves: Iterable[Curve]) -> Outcomes:
        deadly = []
        try:
            for job, outcome in self._spread([curve for curve in curves if curve], self._count):
                if outcome is None:
                    deadly.append(job)
                else:
                    yield job, outcome
        except GeneratorExit:  # no further outcome is wanted
            self.stop()
            raise
        if deadly:
            self.stop()  # idle processes hold memory as well
        for job, outcome in self._spread([deadly], 1):
            yield job, outcome or Failure("the process that computed it died twice: fewer workers need less memory")

    def _spread(self, curves: Sequence[Curve], count: int) -> Iterator[tuple[Job, JobResult | Failure | None]]:
        """The outcomes of jobs from so many processes, as they arrive; None if the process died.

        Each process works along a curve, then along the next unassigned one, then joins the one with most jobs left.
        """
        threads = processes.share_of_cores(min(count, max(len(curves), 1)))
        untouched = deque(map(deque, curves))
        ahead: list[deque[Job]] = [deque()] * count
        running: dict[Future[JobResult | Failure], tuple[int, Job]] = {}
        came: list[tuple[Job, JobResult | Failure | None]] = []
        idle = list(range(count))
        while True:
            for process in idle:
                ahead[process] = ahead[process] or (untouched.popleft() if untouched else max(ahead, key=len))
                if ahead[process]:
                    job = ahead[process].popleft()
                    running[self._submit(process, job, threads)] = process, job
            yield from came
            if not running:
                return
            idle, came = [], []
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                process, job = running.pop(future)
                idle.append(process)
                died = isinstance(future.exception(), BrokenProcessPool)
                if died:
                    processes.end(self._executors.pop(process))
                came.append((job, None if died else future.result()))

    def _submit(self, process: int, job: Job, threads: int) -> Future[JobResult | Failure]:
        if process not in self._executors:
            self._executors[process] = processes.start(1, sharing=self._count)
        try:
            return self._executors[process].submit(do, job, threads)
        except BrokenProcessPool:  # it died while idle
            processes.end(self._executors.pop(process))
            return self._submit(process, job, threads)

    def stop(self) -> None:
        """Terminate all processes at once."""
        processes.end(*self._executors.values())
        self._executors.clear()


def do(job: Job, threads: int) -> JobResult | Failure:
    """Execute a job in a worker process, with so many threads for the mechanics."""
    set_thread_count(threads)
    return run(job)


@contextmanager
def _cluster(address: str) -> Iterator[Pool]:
    try:
        from distributed import Client
    except ImportError as error:
        raise InputError("a scheduler needs Dask: install mitsuba_taxel[cluster].") from error
    try:
        # As this process's default client, xarray would use it too, even if it does not answer.
        client = Client(address, timeout="10s", set_as_default=False)
    except (OSError, ValueError) as error:
        raise InputError(f"scheduler = {address!r} is not allowed: no Dask scheduler answers there.") from error
    log = logging.getLogger("distributed.client")
    before = log.level
    log.setLevel(logging.CRITICAL)  # it writes pages when a scheduler is lost
    try:
        yield _Cluster(client, address)
    finally:
        client.close()
        log.setLevel(before)


class _Cluster:
    """The workers of a Dask cluster; Dask reassigns the jobs of one that dies."""

    def __init__(self, client, address: str) -> None:
        self.name = f"scheduler {address}"
        self.machines = self.processes = max(1, len(client.scheduler_info()["workers"]))
        self._client, self._address = client, address

    def outcomes(self, curves: Iterable[Curve]) -> Outcomes:
        from distributed import CancelledError, as_completed
        from distributed.comm import CommClosedError

        submit: Callable = self._client.submit
        jobs = chain.from_iterable(curves)
        given = {submit(run, job, pure=False, key=f"taxel-{id(self)}-{job.number}"): job for job in jobs}
        for future in as_completed(list(given), loop=self._client.loop):
            job = given.pop(future)
            try:
                error = future.exception()
                outcome = future.result() if error is None else failure_of(error)
            except (CancelledError, CommClosedError) as error:  # immediately, or while the result is transferred
                raise ComputationError(
                    f"the Dask scheduler at {self._address} is gone: finished jobs are kept, and the same call resumes."
                ) from error
            yield job, outcome
            future.release()
