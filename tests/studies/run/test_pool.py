"""Who does the jobs must not matter: one process, several, a cluster; and workers may die."""

from __future__ import annotations

import os
import signal
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from own_wall import PLATE_OF_ONES_OWN, darkened_wall
from stand_ins import mortal, take_threads

from mitsuba_taxel import Pad, PadSensor, PhotoReflector, Scene, load_plugins, measure, sweep, write_xml
from mitsuba_taxel.backend import own_plugins
from mitsuba_taxel.studies.plan.job import Failure, Job
from mitsuba_taxel.studies.run import pool, processes
from mitsuba_taxel.studies.run.pool import open_pool

VARY = {"z": "0.6,0.7", "law": "lambertian,uniform_solid_angle"}
RUN = {"points": 256, "seed": 7}


@pytest.fixture(scope="module")
def alone():
    return sweep("plate.xml", VARY, **RUN)


def test_processes_give_the_same_to_the_bit(alone):
    shared = sweep("plate.xml", VARY, workers=2, **RUN)
    np.testing.assert_array_equal(shared.replicate_power, alone.replicate_power)


@pytest.fixture
def own_walls(tmp_path, monkeypatch, llvm_mono):
    """Sweep of a plate with a wall of one's own that is forgotten after the test: ``own_walls(its name, ...)``."""
    monkeypatch.setattr(own_plugins, "_LOADED", {})

    def study(name: str, **how):
        file = darkened_wall(tmp_path / f"{name}.py")
        load_plugins(file)
        (tmp_path / "own.xml").write_text(PLATE_OF_ONES_OWN.format(name))
        return sweep(tmp_path / "own.xml", {"share": "0.5,1"}, points=64, **how)

    return study


def test_a_cluster_gives_the_same_to_the_bit(alone, tmp_path, own_walls):
    distributed = pytest.importorskip("distributed")
    settings = {"n_workers": 2, "threads_per_worker": 1, "processes": True, "dashboard_address": "127.0.0.1:0"}
    with distributed.LocalCluster(
        host="127.0.0.1", local_directory=str(tmp_path), silence_logs=50, **settings
    ) as cluster:
        spread = sweep("plate.xml", VARY, scheduler=cluster.scheduler_address, output=tmp_path / "out", **RUN)
        own = own_walls("darkened_on_a_cluster", scheduler=cluster.scheduler_address)
    np.testing.assert_array_equal(spread.replicate_power, alone.replicate_power)
    assert len(list((tmp_path / "out" / "jobs").iterdir())) == 4
    np.testing.assert_array_equal(own.replicate_power, own_walls("darkened_on_a_cluster").replicate_power)


def test_processes_know_the_plugins_that_the_user_has_loaded(own_walls):
    """And only such files: a scene that needs one fails without."""
    shared = own_walls("darkened", workers=1)
    np.testing.assert_array_equal(shared.replicate_power, own_walls("darkened").replicate_power)
    np.testing.assert_allclose(shared.power.sel(share="0.5"), 0.5 * shared.power.sel(share="1"), rtol=1e-5)


def job_of(file, points, seed):
    return Job(0, file, {}, points, seed, mesh_size=None, mechanics_error=False, meshes=False, maps=False)


def test_pads_read_the_same_with_any_number_of_threads(tmp_path, monkeypatch):
    """Meshing, solving and tracing, each time from nothing: by one thread, by two, and by as many as there are."""
    reflectors = PhotoReflector(rows=1, columns=1)
    sensor = PadSensor(pad=Pad("parallelepiped", 1, 1), photo_reflector=reflectors, force=(0.1, 0.2, -0.5))
    write_xml(sensor.scene().with_mesh_size(2.0), tmp_path / "pad.xml")
    job = job_of(tmp_path / "pad.xml", points=64, seed=1)
    monkeypatch.setattr(processes, "_begin", take_threads)
    readings = []
    for threads in (1, 2):
        monkeypatch.setenv("MITSUBA_TAXEL_CACHE", str(tmp_path / str(threads)))
        monkeypatch.setattr(processes, "share_of_cores", lambda _, share=threads: share)
        with open_pool(workers=threads) as workers:
            ((_, result),) = workers.outcomes([[job]])
        readings.append(result.readings.replicates)
    monkeypatch.setenv("MITSUBA_TAXEL_CACHE", str(tmp_path / "here"))
    readings.append(measure(Scene(job.file), points=64, seed=1, mechanics_error=False).replicates)
    np.testing.assert_array_equal(readings[0], readings[1])
    np.testing.assert_array_equal(readings[0], readings[2])


def curves_of(*sizes: int) -> list[list[Job]]:
    """Jobs numbered in a row, so many on each curve."""
    numbers = iter(range(sum(sizes)))
    job = job_of(Path(), points=1, seed=0)
    return [[replace(job, number=next(numbers)) for _ in range(size)] for size in sizes]


class TestDealing:
    """Which job goes to whom, with threads in place of processes, and stand-ins for the work."""

    @pytest.fixture(autouse=True)
    def _threads(self, monkeypatch):
        monkeypatch.setattr(processes, "start", lambda count, sharing: ThreadPoolExecutor(count))
        monkeypatch.setattr(processes, "end", lambda *executors: None)
        monkeypatch.setattr(os, "cpu_count", lambda: 8)

    @pytest.mark.parametrize(("workers", "sizes"), [(2, (4, 4)), (3, (3, 3, 3)), (2, (3, 3, 3, 3)), (1, (2, 3, 2))])
    def test_each_has_a_curve_of_its_own(self, workers, sizes, monkeypatch):
        together = threading.Barrier(workers)

        def work(job: Job, threads: int) -> int:
            together.wait(timeout=10)
            return threading.get_ident()

        monkeypatch.setattr(pool, "do", work)
        curves = curves_of(*sizes)
        with open_pool(workers=workers) as doers:
            done = {job.number: outcome for job, outcome in doers.outcomes(curves)}
        assert [len({done[job.number] for job in curve}) for curve in curves] == [1] * len(sizes)
        assert len(set(done.values())) == workers
        for curve in curves:
            numbers = [job.number for job in curve]
            assert [number for number in done if number in numbers] == numbers

    def test_one_without_a_curve_takes_the_next_and_then_helps(self, monkeypatch):
        """Who is at the first job goes on only when all others are done, all but one of them by the other."""
        others_done = threading.Event()

        def work(job: Job, threads: int) -> int:
            if job.number == 0:
                assert others_done.wait(timeout=10)
            return threading.get_ident()

        monkeypatch.setattr(pool, "do", work)
        done = {}
        with open_pool(workers=2) as doers:
            for job, outcome in doers.outcomes(curves_of(4, 1, 2)):
                done[job.number] = outcome
                if len(done) == 6:
                    others_done.set()
        assert list(done) == [4, 5, 6, 1, 2, 3, 0]
        assert len({done[number] for number in (1, 2, 3, 4, 5, 6)}) == 1
        assert done[0] != done[1]

    @pytest.mark.parametrize(
        ("workers", "sizes", "threads"), [(4, (2,), 8), (4, (1, 1), 4), (4, (1,) * 9, 2), (9, (1,) * 9, 1)]
    )
    def test_curves_share_the_cores(self, workers, sizes, threads, monkeypatch):
        monkeypatch.setattr(pool, "do", lambda job, threads: threads)
        with open_pool(workers=workers) as doers:
            assert [used for _, used in doers.outcomes(curves_of(*sizes))] == [threads] * sum(sizes)

    @pytest.mark.parametrize("workers", [None, 1, 2])
    def test_curves_without_jobs_are_passed_over(self, workers, monkeypatch):
        """As where an earlier run did them."""
        monkeypatch.setattr(pool, "do", lambda job, threads: threads)
        monkeypatch.setattr(pool, "run", lambda job: 8)
        with open_pool(workers=workers) as doers:
            assert [threads for _, threads in doers.outcomes([[], *curves_of(2), []])] == [8, 8]
            assert list(doers.outcomes([[], []])) == []


def test_a_job_that_kills_its_process_does_not_stop_the_others(monkeypatch, tmp_path):
    monkeypatch.setattr(pool, "do", mortal)
    curves = [[replace(job, file=tmp_path) for job in curve] for curve in curves_of(3, 3)]
    with open_pool(workers=2) as workers:
        done = {job.number: outcome for job, outcome in workers.outcomes(curves)}
    assert done.pop(2) == Failure("the process that computed it died twice: fewer workers need less memory")
    assert sorted(done) == [0, 1, 3, 4, 5]
    assert not any(isinstance(outcome, Failure) for outcome in done.values())


def test_a_process_that_dies_when_it_has_nothing_to_do_is_replaced(monkeypatch, tmp_path):
    monkeypatch.setattr(pool, "do", mortal)
    with open_pool(workers=1) as workers:
        ((_, first),) = workers.outcomes(curves_of(1))
        os.kill(first, signal.SIGKILL)
        ((_, second),) = workers.outcomes(curves_of(1))
    assert second != first
