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
from mitsuba_taxel.base.processes.threads import set_thread_count
from mitsuba_taxel.studies.plan.job import Failure, Job, JobResult
from mitsuba_taxel.studies.run import processes
from mitsuba_taxel.studies.run.job import failure_of, run

MOST_WORKERS = 120
"""Largest number of worker processes: each needs eight of the 1024 open files that a process is commonly allowed."""

Curve = Sequence[Job]
"""Jobs that may share a load path."""
Outcomes = Generator[tuple[Job, "JobResult | Failure"], None, None]


class Pool(Protocol):
    """Executes jobs, and yields their outcomes as they arrive, in any order.

    Attributes
    ----------
    name : str
        Description, for messages and records.
    machines : int
        Approximate speed relative to this machine; 1 for local processes, which share its cores.
    processes : int
        Number of jobs that are computed at the same time.
    """

    name: str
    machines: int
    processes: int

    def outcomes(self, curves: Iterable[Curve]) -> Outcomes: ...


@contextmanager
def open_pool(workers: int | None = None, scheduler: str | None = None) -> Iterator[Pool]:
    """Open a pool that executes jobs: local processes, a Dask cluster or, by default, this process.

    Parameters
    ----------
    workers : int, optional
        Number of local processes.
    scheduler : str, optional
        Address of the scheduler of a Dask cluster.

    Yields
    ------
    Pool
        Its processes or connections end with the context.

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
        require("scheduler", scheduler, str, "an address, such as tcp://host:8786,")
        with _cluster(scheduler) as cluster:
            yield cluster
    elif workers is not None:
        pool = _ProcessPool(workers)
        try:
            yield pool
        finally:
            pool.stop()
    else:
        yield _SerialPool()


class _SerialPool:
    """This process, which computes jobs in their order."""

    name = "this process"
    machines = 1
    processes = 1

    def outcomes(self, curves: Iterable[Curve]) -> Outcomes:
        for job in chain.from_iterable(curves):
            yield job, run(job)


class _ProcessPool:
    """Local processes.

    Each process works on a curve that no other process works on, as long as there are enough curves: jobs of a curve
    share a load path, which one process solves while the others wait. A process that dies is replaced. Its job is
    repeated alone at the end, as the cause may have been lack of memory.
    """

    machines = 1

    def __init__(self, count: int) -> None:
        self.name = f"{count} {'process' if count == 1 else 'processes'}"
        self._count = self.processes = count
        self._executors: dict[int, ProcessPoolExecutor] = {}  # each of one process, so that jobs can be assigned to it

    def outcomes(self, curves: Iterable[Curve]) -> Outcomes:
        interrupted = []
        try:
            for job, outcome in self._spread([curve for curve in curves if curve], self._count):
                if outcome is None:
                    interrupted.append(job)
                else:
                    yield job, outcome
        except GeneratorExit:  # the caller needs no further outcomes
            self.stop()
            raise
        if interrupted:
            self.stop()  # idle processes hold memory as well
        for job, outcome in self._spread([interrupted], 1):
            yield job, outcome or Failure("the process that computed it died twice: fewer workers need less memory")

    def _spread(self, curves: Sequence[Curve], count: int) -> Iterator[tuple[Job, JobResult | Failure | None]]:
        """Distribute jobs to ``count`` processes, and yield their outcomes as they arrive; None for a job whose process
        died.

        Each process works along a curve, then along the next unassigned curve. When none is unassigned, it takes jobs
        of the curve with most remaining jobs.
        """
        threads = processes.share_of_cores(min(count, max(len(curves), 1)))
        unassigned = deque(map(deque, curves))
        queues: list[deque[Job]] = [deque()] * count
        running: dict[Future[JobResult | Failure], tuple[int, Job]] = {}
        arrived: list[tuple[Job, JobResult | Failure | None]] = []
        idle = list(range(count))
        while True:
            # Idle processes get their next job.
            for process in idle:
                queues[process] = queues[process] or (unassigned.popleft() if unassigned else max(queues, key=len))
                if queues[process]:
                    job = queues[process].popleft()
                    running[self._submit(process, job, threads)] = process, job

            # The caller receives the last outcomes while all processes work.
            yield from arrived
            if not running:
                return

            # Wait for the next outcomes; the executor of a process that died is removed.
            idle, arrived = [], []
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                process, job = running.pop(future)
                idle.append(process)
                died = isinstance(future.exception(), BrokenProcessPool)
                if died:
                    processes.end(self._executors.pop(process))
                arrived.append((job, None if died else future.result()))

    def _submit(self, process: int, job: Job, threads: int) -> Future[JobResult | Failure]:
        """Submit a job to a process, which is started if it does not run."""
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
    """Execute a job of a study in the current worker process. The finite elements use ``threads`` threads; see `run`.
    """
    set_thread_count(threads)
    return run(job)


@contextmanager
def _cluster(address: str) -> Iterator[Pool]:
    try:
        from distributed import Client
    except ImportError as error:
        raise InputError("a scheduler needs Dask: pip install distributed.") from error
    try:
        # As this process's default client, xarray would use it too, even if it does not answer.
        client = Client(address, timeout="10s", set_as_default=False)
    except (OSError, ValueError) as error:
        raise InputError(
            f"scheduler = {address!r} is not allowed: no Dask scheduler answers at this address; start "
            f"one, or correct the address."
        ) from error
    log = logging.getLogger("distributed.client")
    before = log.level
    log.setLevel(logging.CRITICAL)  # it writes pages when a scheduler is lost
    try:
        yield _ClusterPool(client, address)
    finally:
        client.close()
        log.setLevel(before)


class _ClusterPool:
    """The workers of a Dask cluster; Dask reassigns the jobs of a worker that dies."""

    def __init__(self, client, address: str) -> None:
        self.name = f"scheduler {address}"
        self.machines = self.processes = max(1, len(client.scheduler_info()["workers"]))
        self._client, self._address = client, address

    def outcomes(self, curves: Iterable[Curve]) -> Outcomes:
        from distributed import CancelledError, as_completed
        from distributed.comm import CommClosedError

        submit: Callable = self._client.submit
        jobs = chain.from_iterable(curves)
        submitted = {submit(run, job, pure=False, key=f"taxel-{id(self)}-{job.number}"): job for job in jobs}
        for future in as_completed(list(submitted), loop=self._client.loop):
            job = submitted.pop(future)
            try:
                error = future.exception()
                outcome = future.result() if error is None else failure_of(error)
            except (CancelledError, CommClosedError) as error:  # immediately, or while the result is transferred
                raise ComputationError(
                    f"the Dask scheduler at {self._address} is gone: finished jobs are kept, and the same call resumes."
                ) from error
            yield job, outcome
            future.release()
