"""A job leaves nothing behind but its result."""

from __future__ import annotations

import gc

import pytest

from mitsuba_taxel.sensing import find_scene
from mitsuba_taxel.studies.plan.job import Failure, Job, JobResult, describe
from mitsuba_taxel.studies.run import job


def one_of(name, **parameters):
    values = {key: str(value) for key, value in parameters.items()}
    return Job(0, find_scene(name), values, 64, 0, None, False, False, False)


@pytest.mark.parametrize("parameters, kind", [({"fz": -1}, JobResult), ({"spacing": 30}, Failure)])
def test_no_scene_lives_on(llvm_mono, monkeypatch, parameters, kind):
    def plugins():
        return sum(isinstance(thing, llvm_mono.Object) for thing in gc.get_objects())

    def read(*arguments):
        ready = prepare(*arguments)
        seen.append(plugins())
        return ready

    prepare, seen = job.prepare, []
    monkeypatch.setattr(job, "prepare", read)
    gc.collect()
    before = plugins()
    for _ in range(3):
        assert isinstance(job.run(one_of("pad.xml", **parameters)), kind)
        assert plugins() == before
    assert kind is Failure or (len(seen) == 3 and min(seen) > before)


def test_values_in_words_leave_out_the_way_to_contact_unless_it_is_all_there_is():
    assert describe({"fz": "-3", "to_contact": "fz=-40"}) == "fz=-3"
    assert describe({"to_contact": "fz=-40"}) == "to_contact=fz=-40" and describe({}) == ""


def test_values_in_words_leave_out_the_history_whatever_it_is_called():
    assert describe({"fz": "-3", "history": "0 0"}) == "fz=-3"
    roles = {"past": ("history", 1), "f": ("fz", 1)}
    assert describe({"f": "-3", "past": "0 0; 1 -2", "history": "7"}, roles) == "f=-3, history=7"
