"""Where time goes: what is inside a stage or a record, and what is not."""

from __future__ import annotations

import threading
import time

import pytest

from mitsuba_taxel.base.processes import stages

pytestmark = pytest.mark.quick


def test_nested_records_that_look_alike_stay_apart():
    with stages.record() as outer:
        with stages.record() as inner:
            with stages.stage("a"):
                pass
            assert inner == outer
        with stages.stage("b"):
            pass
    assert set(outer) == {"a", "b"} and set(inner) == {"a"}
    with stages.stage("c"):
        pass
    assert "c" not in outer


def test_a_stage_does_not_count_what_another_inside_it_takes():
    with stages.record() as seconds, stages.stage("load"):
        with stages.stage("mechanics"):
            time.sleep(0.05)
    assert seconds["mechanics"] >= 0.05
    assert 0 <= seconds["load"] < seconds["mechanics"]


def test_a_failed_stage_is_counted_and_left():
    with stages.record() as seconds:
        with pytest.raises(KeyError), stages.stage("load"):
            raise KeyError
        with stages.stage("optics"):
            pass
    assert set(seconds) == {"load", "optics"}


def test_threads_count_their_own_time_alone():
    def work(seconds, name):
        with stages.record() as record, stages.stage("all"):
            begun.wait()
            with stages.stage(name):
                time.sleep(seconds)
            ended.wait()
        records.append(record)

    records: list[dict[str, float]] = []
    begun, ended = threading.Barrier(2), threading.Barrier(2)
    threads = [threading.Thread(target=work, args=(0.01, name)) for name in ("one", "other")]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(sorted(record) for record in records) == [["all", "one"], ["all", "other"]]
