"""Scenes end with what refers to them."""

from __future__ import annotations

import copy
import gc
import subprocess
import sys
import weakref
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from one_cell import one_cell

from mitsuba_taxel import ComputationError, InputError, PadSensor, Scene, Wall, crosstalk, measure
from mitsuba_taxel.base.errors import UnusedDefault
from mitsuba_taxel.mechanics.meshes import pad_mesh
from mitsuba_taxel.sensing import find_scene
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads
from mitsuba_taxel.studies.plan.batch import make_batch


@pytest.fixture
def no_collector():
    gc.collect()
    gc.disable()
    yield
    gc.enable()


READ_MANY_SCENES = """
import ctypes, os
from pathlib import Path
from mitsuba_taxel import Scene, measure

def resident():  # in kB, without what is freed and kept for later
    ctypes.CDLL(None).malloc_trim(0)
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") // 1024

def read(numbers):
    for number in numbers:
        measure(Scene.from_file("plate.xml", z=0.3 + 1e-3 * number), points=1)
    return resident()

print(-read(range(120)) + read(range(120, 180)))
"""


def test_readings_of_many_scenes_take_no_memory():
    """Caches are full after some hundred; what each scene left behind was 20 to 30 kB.

    The process is a new one: in a test worker, memory is taken and returned by what other tests have left there.
    """
    done = subprocess.run([sys.executable, "-c", READ_MANY_SCENES], capture_output=True, text=True, check=True)
    assert int(done.stdout) / 60 < 8


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


def with_size(cell_size=2.5):
    return one_cell(fz=0, size=cell_size).replace("<vector", '<float name="cell_size" value="$size"/> <vector', 1)


@pytest.mark.usefixtures("llvm_mono")
def test_meshes_of_other_values_are_moved(tmp_path):
    """Elements are those of the scene with the other values; the scene that is written says so."""
    file, written = tmp_path / "scene.xml", tmp_path / "written.xml"
    file.write_text(with_size())
    first, moved, own = (
        Scene(file, given) for given in ({}, {"size": 2.6, "meshed_as": "size=2.5"}, {"size": 2.6, "meshed_as": "none"})
    )
    moved.write_xml(written)
    (of_first,), (of_moved,), (of_own,), (again,) = (
        deformed_pads(scene.load()) for scene in (first, moved, own, Scene(written))
    )
    meshes = [pad_mesh(each.pad, each.mesh_size) for each in (of_first, of_moved, of_own)]
    assert of_moved.pad.origin == of_first.pad and again.pad == of_moved.pad and of_own.pad.origin is None
    np.testing.assert_array_equal(meshes[1].tets, meshes[0].tets)
    assert np.abs(meshes[1].points - meshes[0].points).max() == pytest.approx(0.05)


@pytest.mark.parametrize(
    ("scene", "text", "said"),
    [
        ("cell.xml", "size", "'name=value'"),
        ("cell.xml", "sise=2.5", "meshed_as = 'sise=2.5' is not allowed: sise is not a parameter"),
        ("cell.xml", "size=x", "meshed_as = 'size=x' is not allowed: "),
        ("cell.xml", "size=-1", "cell_size = -1"),
        ("plate.xml", "spacing=0.8", "no pad"),
        ("hexagonal.xml", "fz=-1", "no pad"),
    ],
)
def test_meshes_of_no_such_scene_are_refused(tmp_path, scene, text, said):
    (tmp_path / "cell.xml").write_text(with_size())
    file = tmp_path / scene if scene == "cell.xml" else scene
    with pytest.raises(InputError, match=said):
        Scene(file, {"meshed_as": text}).load()


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
        (lambda: PadSensor(force=3), "force = 3 is not allowed: a list of finite numbers is needed"),
        (lambda: Wall(reflectance="much"), "reflectance = 'much' is not allowed: a finite number from 0 to 1"),
        (lambda: Scene("plate.xml", 3), "parameters = 3 is not allowed: a dictionary"),
        (lambda: Scene("plate.xml", mesh_size="fine"), "mesh_size = 'fine' is not allowed"),
    ],
)
def test_what_is_no_scene_or_part_is_refused_by_name(call, said):
    with pytest.raises(InputError, match=f"^{said}"):
        call()


UNUSED = '<default name="spp" value="16"/> <default name="mesh" value="2"/> <default'


def test_defaults_that_nothing_uses_are_warned_of_and_change_nothing(tmp_path, llvm_mono):
    """Exporters write them, and mi.load_file takes them."""
    plain = find_scene("plate.xml").read_text()
    (tmp_path / "used.xml").write_text(plain)
    (tmp_path / "more.xml").write_text(plain.replace("<default", UNUSED, 1))
    with pytest.warns(UnusedDefault, match=r"more\.xml: nothing uses the <default> spp, mesh"):
        more = Scene.from_file(tmp_path / "more.xml", z="1.5")
    assert more.unused == ("spp", "mesh")
    one, other = (measure(scene, points=64) for scene in (Scene.from_file(tmp_path / "used.xml", z="1.5"), more))
    assert np.array_equal(one.power, other.power)
    more.write_xml(tmp_path / "written.xml")
    assert "spp" not in (tmp_path / "written.xml").read_text()
    with pytest.warns(UnusedDefault), pytest.raises(InputError, match="spp cannot be varied: nothing in more.xml uses"):
        make_batch(tmp_path / "more.xml", {"spp": "1,2"})


def test_a_scene_from_a_dictionary_can_be_copied(llvm_mono):
    """With Mitsuba's objects in it, too; the copy is a scene of its own."""
    mi = llvm_mono
    turned = {"type": "rectangle", "to_world": mi.ScalarTransform4f().scale(2)}
    scene = Scene({"type": "scene", "made": mi.load_dict({"type": "sphere"}), "turned": turned})
    copied = copy.deepcopy(scene)
    del copied.source["turned"]
    assert len(scene.load().shapes()) == 2 and len(copied.load().shapes()) == 1


@pytest.mark.parametrize(
    ("inside", "said"),
    [
        ('<string name="part" value="vcnt2020"/> <emitter type="annular_led"/>', "<emitter> .* and part exclude"),
        ('<emitter type="annular_led"> <float name="size" value="-1"/> </emitter>', "size = -1"),
    ],
)
def test_parts_are_refused_before_the_pad_is_solved(tmp_path, monkeypatch, llvm_mono, inside, said):
    """Also those that stand below the pad in the file."""
    (tmp_path / "scene.xml").write_text(
        f"""<scene version="3.9.0"> <integrator type="taxel_tracer"/>
        <shape type="deformable_pad"> <integer name="rows" value="1"/> <integer name="columns" value="1"/>
            <vector name="force" value="0, 0, -1"/> </shape>
        <shape type="photo_reflector"> {inside} </shape> </scene>"""
    )
    monkeypatch.setattr("mitsuba_taxel.mechanics.load_path", lambda *_, **__: pytest.fail("the pad was solved"))
    with pytest.raises(InputError, match=said):
        Scene.from_file(tmp_path / "scene.xml").load()


def test_a_decimal_comma_is_refused_with_the_parameter(tmp_path):
    """Of a parameter that is a number; vectors in words have commas."""
    with pytest.raises(InputError, match=r"fz = '-1,5' is not allowed: a decimal point is needed, as in -1\.5"):
        Scene.from_file("pad.xml", fz="-1,5")
    assert Scene.from_file("pad.xml", history="0 0 0 0; 1,5").parameters["history"] == "0 0 0 0; 1,5"


@pytest.mark.parametrize("packages", [True, False])
def test_a_pad_waits_for_its_packages_on_whatever_thread_it_is_built(llvm_mono, tmp_path, monkeypatch, packages):
    """It is solved once, against the packages if the scene has any, by a parser that builds parts on threads."""
    import mitsuba_taxel.mechanics as mechanics

    text = one_cell(fz=-0.1, mesh_size=1.0)
    text = text.replace('<vector name="force"', '<boolean name="self_contact" value="true"/> <vector name="force"')
    assert "self_contact" in text
    if not packages:
        text = text[: text.index('<shape type="photo_reflector">')] + "</scene>"
    (tmp_path / "cell.xml").write_text(text)
    instantiate, load_path, against = llvm_mono.parser.instantiate, mechanics.load_path, []

    def on_a_thread(*arguments):
        with ThreadPoolExecutor(1) as pool:
            return pool.submit(instantiate, *arguments).result()

    def noted(*arguments, **how):
        against.append(how.get("obstacles") is not None)
        return load_path(*arguments, **how)

    monkeypatch.setattr(llvm_mono.parser, "instantiate", on_a_thread)
    monkeypatch.setattr(mechanics, "load_path", noted)
    (pad,) = deformed_pads(Scene(tmp_path / "cell.xml").load())
    assert against == [packages]
    assert np.abs(pad.state.displacement).max() > 0


def test_a_scene_file_cannot_have_a_pad_wait(llvm_mono, tmp_path):
    flag = '<boolean name="awaited_package" value="true"/> <vector name="force"'
    text = one_cell(fz=-0.1).replace('<vector name="force"', flag)
    (tmp_path / "cell.xml").write_text(text)
    with pytest.raises(InputError, match="awaited_package is no parameter of deformable_pad"):
        Scene(tmp_path / "cell.xml").load()
