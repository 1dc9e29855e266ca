"""Scenes end with what refers to them."""

from __future__ import annotations

import gc
import weakref

import pytest

from mitsuba_taxel import InputError, Scene


@pytest.fixture
def no_collector():
    gc.collect()
    gc.disable()
    yield
    gc.enable()


@pytest.mark.usefixtures("llvm_mono", "no_collector")
def test_a_scene_in_a_cycle_is_freed_before_the_next_is_built():
    ring = [Scene.from_file("plate.xml").load()]
    emitter = weakref.ref(ring[0].emitters()[0])
    ring.append(ring)
    del ring
    assert emitter() is not None
    used = Scene.from_file("plate.xml").load()
    assert emitter() is None
    emitter = weakref.ref(used.emitters()[0])
    Scene.from_file("plate.xml").load()
    assert emitter() is used.emitters()[0]


@pytest.mark.usefixtures("llvm_mono", "no_collector")
def test_a_scene_without_cycles_needs_no_collection(monkeypatch):
    Scene.from_file("plate.xml").load()
    monkeypatch.setattr(gc, "collect", lambda: pytest.fail("collected"))
    Scene.from_file("pad.xml", fz=-1).load()
    with pytest.raises(InputError):
        Scene.from_file("pad.xml", spacing=30).load()
    Scene.from_file("plate.xml").load()
