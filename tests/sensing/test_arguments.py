"""What scenes and sensors may be described by, and threads that ask at the same time."""

from __future__ import annotations

import threading
from pathlib import Path

import numpy as np
import pytest

from mitsuba_taxel import InputError, PadSensor, Scene, Wall, crosstalk, measure, sweep
from mitsuba_taxel.backend import turns
from mitsuba_taxel.sensing import find_scene, measurement

Z = {"z": 0.6, "scattering": "lambertian"}


def test_scenes_by_name_by_path_and_as_dictionaries_are_the_same(llvm_mono):
    mi = llvm_mono
    reference = measure(Scene.from_file("plate.xml", **Z), points=64).replicates
    for scene in (Scene("plate.xml", Z), Scene(Path("plate.xml"), Z), Scene(find_scene("plate.xml"), Z)):
        np.testing.assert_array_equal(measure(scene, points=64).replicates, reference)
    wall = {"type": "wall", "scattering": "lambertian"}
    described = {
        "type": "scene",
        "integrator": {"type": "taxel_tracer"},
        "plate": {
            "type": "rectangle",
            "to_world": mi.ScalarTransform4f().translate([0, 0, 1.1]).rotate([1, 0, 0], 180).scale(2),
            "bsdf": wall,
        },
        "reflector": {"type": "photo_reflector", "led": {"type": "annular_led"}, "sensor": {"type": "phototransistor"}},
    }
    np.testing.assert_array_equal(measure(described, points=64).power, measure(Scene(described), points=64).power)
    assert crosstalk(described, points=64).power.shape == (1, 1)


def test_one_value_may_be_varied_by_itself():
    study = sweep("plate.xml", {"z": 1}, points=16)
    assert study.sizes["z"] == 1 and float(study.z[0]) == 1


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: measure(None), "scene = None is not allowed: a Scene, a path, a name"),
        (lambda: measure(PadSensor()), "scene = PadSensor"),
        (lambda: measure({}), "the scene holds 0 LEDs"),
        (lambda: measure({"a": 1}), "scene"),
        (lambda: Scene({"type": "scene", "pad": {"type": "deformable_pad", "force": None}}), "pad: force = None"),
        (lambda: PadSensor(pad=3), "pad = 3 is not allowed: a Pad is needed"),
        (lambda: PadSensor(roof="mirror"), "roof = 'mirror' is not allowed: a Wall is needed"),
        (lambda: PadSensor(history=3), "history = 3 is not allowed: pairs of a time and a value"),
        (lambda: PadSensor(force=3), "force = 3 is not allowed: a row of finite numbers is needed"),
        (lambda: Wall(reflectance="much"), "reflectance = 'much' is not allowed: a finite number from 0 to 1"),
        (lambda: Scene("plate.xml", 3), "parameters = 3 is not allowed: a mapping"),
        (lambda: Scene("plate.xml", mesh_size="fine"), "mesh_size = 'fine' is not allowed"),
    ],
)
def test_what_is_no_scene_or_part_is_refused_by_name(call, said):
    with pytest.raises(InputError, match=f"^{said}"):
        call()


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
