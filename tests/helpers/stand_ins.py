"""What worker processes do in place of jobs: each imports this file, which imports next to nothing."""

from __future__ import annotations

import os
import signal
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mitsuba_taxel.studies.plan.job import Job


def mortal(job: Job, threads: int) -> int:
    """Job 2 kills its process, and job 4 the first that is at it; a job's folder knows."""
    before = job.file / str(job.number)
    if job.number == 2 or (job.number == 4 and not before.exists()):
        before.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return os.getpid()


def take_threads(count: int) -> None:
    """As many threads as there are workers, in place of a share of the cores."""
    import drjit as dr

    os.environ["RAYON_NUM_THREADS"] = str(count)
    dr.set_thread_count(count)
