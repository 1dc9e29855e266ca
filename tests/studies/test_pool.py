"""Who does the jobs must not matter: one process, several, a cluster; and workers may die."""

from __future__ import annotations

import os
import signal
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mitsuba_taxel import Pad, PadSensor, PhotoReflector, Scene, measure, sweep, write_xml
from mitsuba_taxel.studies import pool
from mitsuba_taxel.studies.job import Failure, Job
from mitsuba_taxel.studies.pool import open_pool

VARY = {"z": "0.6,0.7", "law": "lambertian,uniform_solid_angle"}
RUN = {"points": 256, "seed": 7}


@pytest.fixture
def stand_ins(monkeypatch):
    """Worker processes find the functions of this file, which need not be on their path."""
    monkeypatch.setattr(sys, "path", [*sys.path, str(Path(__file__).parents[2])])


@pytest.fixture(scope="module")
def alone():
    return sweep("plate.xml", VARY, **RUN)


def test_processes_give_the_same_to_the_bit(alone):
    shared = sweep("plate.xml", VARY, workers=2, **RUN)
    np.testing.assert_array_equal(shared.replicate_power, alone.replicate_power)


def test_a_cluster_gives_the_same_to_the_bit(alone, tmp_path):
    distributed = pytest.importorskip("distributed")
    settings = {"n_workers": 2, "threads_per_worker": 1, "processes": True, "dashboard_address": None}
    with distributed.LocalCluster(
        host="127.0.0.1", local_directory=str(tmp_path), silence_logs=50, **settings
    ) as cluster:
        spread = sweep("plate.xml", VARY, scheduler=cluster.scheduler_address, output=tmp_path / "out", **RUN)
    np.testing.assert_array_equal(spread.replicate_power, alone.replicate_power)
    assert len(list((tmp_path / "out" / "jobs").iterdir())) == 4


def job_of(file, points, seed):
    return Job(0, file, {}, {}, points, seed, mesh_size=None, mechanics_error=False, meshes=False, maps=False)


@pytest.mark.usefixtures("stand_ins")
def test_pads_read_the_same_with_any_number_of_threads(tmp_path, monkeypatch):
    """Meshing, solving and tracing, each time from nothing: by one thread, by two, and by as many as there are."""
    reflectors = PhotoReflector(rows=1, columns=1)
    sensor = PadSensor(pad=Pad("cylindrical", 1, 1), photo_reflector=reflectors, force=(0.1, 0.2, -0.5))
    write_xml(sensor.scene(), tmp_path / "pad.xml")
    job = job_of(tmp_path / "pad.xml", points=64, seed=1)
    monkeypatch.setattr(pool, "_begin", _take_threads)
    readings = []
    for threads in (1, 2):
        monkeypatch.setenv("MITSUBA_TAXEL_CACHE", str(tmp_path / str(threads)))
        with open_pool(workers=threads) as processes:
            ((_, result),) = processes.outcomes([job])
        readings.append(result.readings.replicates)
    monkeypatch.setenv("MITSUBA_TAXEL_CACHE", str(tmp_path / "here"))
    readings.append(measure(Scene(job.file), points=64, seed=1).replicates)
    np.testing.assert_array_equal(readings[0], readings[1])
    np.testing.assert_array_equal(readings[0], readings[2])


def _take_threads(count: int) -> None:
    """Stand-in for the sharing of cores: as many threads as there are workers."""
    import drjit as dr

    os.environ["RAYON_NUM_THREADS"] = str(count)
    dr.set_thread_count(count)


def die(job: Job):
    """Stand-in for the work: one job kills its process, the others do not."""
    if job.number == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    return job.label


@pytest.mark.usefixtures("stand_ins")
def test_a_job_that_kills_its_process_does_not_stop_the_others(monkeypatch):
    monkeypatch.setattr(pool, "run", die)
    job = job_of(Path(), points=1, seed=0)
    jobs = [replace(job, number=number, varied={"n": str(number)}) for number in range(6)]
    with open_pool(workers=2) as processes:
        outcomes = {job.number: outcome for job, outcome in processes.outcomes(jobs)}
    assert outcomes.pop(2) == Failure("the process that computed it died twice: fewer workers need less memory")
    assert outcomes == {number: f"n={number}" for number in (0, 1, 3, 4, 5)}
