"""Scenes that are read at once or one after the other, and those whose pads cannot bear their load."""

from __future__ import annotations

import threading
from dataclasses import replace

import numpy as np
import pytest
from plate_scenes import soft_sensor

from mitsuba_taxel import ComputationError, Scene, measure
from mitsuba_taxel.backend import turns
from mitsuba_taxel.sensing import measurement


def scene(shapes, integrator="taxel_tracer"):
    named = {} if integrator is None else {"integrator": {"type": integrator}}
    return Scene({"type": "scene", **named, **shapes})


def test_a_scene_that_was_read_is_gone_before_the_next_is_read(monkeypatch):
    """Else a kernel may be recorded of shapes that another thread is destroying."""

    class Live:
        def __del__(self):
            in_its_turn.append(turns._LOCK._is_owned())

    in_its_turn: list[bool] = []
    monkeypatch.setattr(measurement, "measured", lambda *arguments: ("readings", Live()))
    assert measure("plate.xml") == "readings" and in_its_turn == [True]
    assert not turns._LOCK._is_owned()


def test_threads_read_what_one_alone_reads():
    """Four at once, each other scenes, registering plugins and compiling kernels of their own."""
    kinds = ["lambertian", "mirror", "isotropic", "absorbing"]
    scenes = [{"z": f"{0.5 + 0.1 * n:g}", "scattering": kind} for n, kind in enumerate(kinds)]
    read: dict[int, np.ndarray] = {}

    def work(number):
        together.wait()
        read[number] = measure(Scene("plate.xml", scenes[number]), points=64, seed=2).replicates

    together = threading.Barrier(len(scenes))
    threads = [threading.Thread(target=work, args=(number,)) for number in range(len(scenes))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(read) == list(range(len(scenes)))
    for number, scene in enumerate(scenes):
        np.testing.assert_array_equal(read[number], measure(Scene("plate.xml", scene), points=64, seed=2).replicates)


def test_a_force_that_the_pad_cannot_bear_is_refused(llvm_mono, own_solutions):
    """Where its roof touches its wall, before it touches the package."""
    end = r"touches itself .*: the load path ends at force = \(0, 0, -1\.\d*\) N"
    parts = soft_sensor(force=-10.0).scene().source
    for scene in (parts, {name: part for name, part in parts.items() if name != "photo_reflector"}):
        with pytest.raises(ComputationError, match=end):
            Scene(scene).load()


def test_a_force_that_a_relaxing_pad_cannot_bear_is_refused(llvm_mono, own_solutions):
    """It was borne at first: the pad, asked where it touches the package, has that history too."""
    from mitsuba_taxel.mechanics import Viscoelastic

    sensor = soft_sensor(force=-0.5)
    relaxing = Viscoelastic(sensor.material, [(0.99, 1.0)])
    held = replace(sensor, material=relaxing, history=[(1e-3, sensor.force)], time=1e4)
    end = r"^the pad [^\n]*: the load path ends at force = \(0, 0, -0\.5\) N, [^\n]* s\.$"
    with pytest.raises(ComputationError, match=end):
        held.scene().load()
