"""Scenes end with what refers to them."""

from __future__ import annotations

import gc
import weakref

import pytest
from one_cell import one_cell

from mitsuba_taxel import ComputationError, InputError, Scene


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


def test_a_path_that_ends_beside_mitsubas_own_shapes_is_told(llvm_mono, tmp_path):
    """The search for a package that was touched asks the pad alone, also where no shape has a name."""
    file = tmp_path / "scene.xml"
    board = '<shape type="rectangle"> <transform name="to_world"> <translate z="-1"/> </transform> </shape> </scene>'
    file.write_text(one_cell(fz=-200).replace("</scene>", board))
    with pytest.raises(ComputationError, match="cannot be loaded further .* ends at force"):
        Scene(file).load()
