"""Walls that are black on the side that faces the LED: `measure` and `taxel check` say so, and where."""

from __future__ import annotations

import pytest
from plate_scenes import ABSORBING

from mitsuba_taxel import Scene, check_scene, measure

BACK = "its back faces the LED, where {} is black: turn it round, or use wall or twosided"
ONE_SIDED = {
    "diffuse": {"type": "diffuse"},
    "conductor": {"type": "conductor"},
    "roughconductor": {"type": "roughconductor", "alpha": 0.3},
    "plastic": {"type": "plastic"},
    "roughplastic": {"type": "roughplastic"},
}
TWO_SIDED = {
    "wall": {"type": "wall"},
    "twosided": {"type": "twosided", "bsdf": {"type": "diffuse"}},
    "thindielectric": {"type": "thindielectric"},
    "black": {"type": "diffuse", "reflectance": 0.0},
}


def plate(bsdf, turned=False, shape="rectangle", **more):
    """A photo-reflector under a plate 0.7 mm above it, whose front is above unless it is turned."""
    import mitsuba as mi

    place = mi.ScalarTransform4f().translate([0, 0, 1.2]).rotate([1, 0, 0], 180 if turned else 0).scale(2)
    body = {"type": "photo_reflector", "led": {"type": "annular_led"}, "sensor": {"type": "phototransistor"}}
    hidden = {
        "type": "rectangle",
        "to_world": mi.ScalarTransform4f().translate([0, 0, -9]),
        "bsdf": {"type": "diffuse"},
    }
    roof = {"type": shape, "to_world": place, "bsdf": bsdf, **more}
    return {"type": "scene", "integrator": {"type": "taxel_tracer"}, "body": body, "hidden": hidden, "roof": roof}


def notes_of(source):
    return [note for note in measure(Scene(source), points=64).notes if "back" in note]


@pytest.mark.parametrize("name", ONE_SIDED)
def test_a_back_that_faces_the_led_is_named(llvm_mono, name):
    assert notes_of(plate(ONE_SIDED[name])) == [f"rectangle 'roof': {BACK.format(name)}"]
    assert notes_of(plate(ONE_SIDED[name], turned=True)) == []
    assert notes_of(plate(ONE_SIDED[name], flip_normals=True)) == []


@pytest.mark.parametrize("integrator", ["taxel_path", "analog_tracer", "path"])
def test_whatever_reads_the_scene(llvm_mono, integrator):
    source = plate(ONE_SIDED["diffuse"]) | {"integrator": {"type": integrator}}
    assert notes_of(source) == [f"rectangle 'roof': {BACK.format('diffuse')}"]


@pytest.mark.parametrize("name", TWO_SIDED)
def test_what_is_alike_on_both_sides_is_not(llvm_mono, name):
    assert notes_of(plate(TWO_SIDED[name])) == []


def test_the_inside_of_a_ball_is_its_back(llvm_mono):
    """The classic: a dome of Mitsuba's `sphere`, seen from within."""
    assert notes_of(plate({"type": "diffuse"}, shape="sphere")) == [f"sphere 'roof': {BACK.format('diffuse')}"]
    assert notes_of(plate({"type": "diffuse"}, shape="sphere", flip_normals=True)) == []


def test_a_back_that_hardly_any_light_meets_is_not_named(llvm_mono):
    """A cone of 10 degrees past the edge of a plate, and onto it."""
    mi = llvm_mono
    for x, count in ((2.2, 0), (1.5, 1)):
        source = plate({"type": "diffuse"})
        source["body"]["led"] = {"type": "annular_led", "cone_angle": 10.0}
        source["roof"]["to_world"] = mi.ScalarTransform4f().translate([x, 0, 1.2]).scale(2)
        assert len(notes_of(source)) == count


@pytest.mark.parametrize("name", ["diffuse", "twosided"])
def test_check_says_so_at_the_shape(llvm_mono, tmp_path, name):
    bsdf = '<bsdf type="diffuse"/>' if name == "diffuse" else '<bsdf type="twosided"> <bsdf type="diffuse"/> </bsdf>'
    (tmp_path / "scene.xml").write_text(f"""<scene version="3.9.0">
<shape type="photo_reflector"> <emitter type="annular_led"/> <sensor type="phototransistor"/> </shape>
<shape type="cube"> <transform name="to_world"> <translate z="-9"/> </transform> <bsdf type="wall"/> </shape>
<shape type="rectangle">
  <transform name="to_world"> <scale value="2"/> <translate z="1.2"/> </transform> {bsdf}
</shape>
<integrator type="taxel_tracer"/>
</scene>""")
    said = [(finding.severity, finding.line, finding.message) for finding in check_scene(tmp_path / "scene.xml")]
    assert said == ([("warning", 4, f"rectangle: {BACK.format('diffuse')}.")] if name == "diffuse" else [])


def test_a_scene_of_walls_traces_no_rays_for_it(llvm_mono, monkeypatch):
    monkeypatch.setattr("mitsuba_taxel.sensing.validity.dark_backs._hits", None)
    source = plate({"type": "wall"})
    source["hidden"]["bsdf"] = ABSORBING
    assert notes_of(source) == []
