"""A job leaves nothing behind but its result."""

from __future__ import annotations

import gc
import threading
import weakref

import pytest

from mitsuba_taxel.sensing import find_scene
from mitsuba_taxel.studies.run import job
from mitsuba_taxel.studies.run.job import Failure, Job, Result


def one_of(name, **parameters):
    values = {key: str(value) for key, value in parameters.items()}
    return Job(0, find_scene(name), values, values, 64, 0, None, False, False, False)


@pytest.mark.parametrize("parameters, kind", [({"fz": -1}, Result), ({"spacing": 30}, Failure)])
def test_no_scene_lives_on(llvm_mono, monkeypatch, parameters, kind):
    def plugins():
        return sum(isinstance(thing, llvm_mono.Object) for thing in gc.get_objects())

    def read(*arguments):
        ready = prepare(*arguments)
        seen.append(plugins())
        ring = [ready]
        ring.append(ring)  # only the collector ends it
        return ready

    prepare, seen = job.prepare, []
    monkeypatch.setattr(job, "prepare", read)
    gc.collect()
    before = plugins()
    for _ in range(3):
        assert isinstance(job.run(one_of("pad.xml", **parameters)), kind)
        assert plugins() == before
    assert kind is Failure or (len(seen) == 3 and min(seen) > before)
    assert gc.get_freeze_count() == 0


class Cycle:
    """What only the garbage collector ends."""

    def __init__(self):
        self.itself = self


def test_jobs_of_several_threads_end_what_is_theirs(monkeypatch):
    """Each begins before the one before it has ended, so that there is no moment without any."""
    ends = [threading.Event() for _ in range(4)]
    began, made = [threading.Event() for _ in range(4)], {}

    def read(number):
        made[number] = weakref.ref(Cycle())
        began[number].set()
        ends[number].wait(10)

    monkeypatch.setattr(job, "_read", read)
    threads = [threading.Thread(target=job.run, args=(number,)) for number in range(4)]
    for number, thread in enumerate(threads):
        thread.start()
        assert began[number].wait(10)
        if number:
            ends[number - 1].set()
            threads[number - 1].join()
            assert made[number - 1]() is None
    ends[-1].set()
    threads[-1].join()
    assert made[3]() is None and gc.get_freeze_count() == 0
