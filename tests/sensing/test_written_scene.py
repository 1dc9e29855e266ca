"""Scenes written as XML: their parameters are there, and all values give the readings of the same sensor."""

from __future__ import annotations

import numpy as np
import pytest
from one_cell import one_cell

from mitsuba_taxel import AnnularLed, Pad, PadSensor, PhotoReflector, Phototransistor, Scene, Wall, measure

pytestmark = pytest.mark.usefixtures("llvm_mono")


def sensor(height=4.0, width=0.52, fz=-0.25, reflectance=0.9):
    """Sides of pad, phototransistor and pitch that are equal are other parameters nevertheless."""
    return PadSensor(
        pad=Pad("parallelepiped", rows=1, columns=1, pitch=4.0, height=height),
        photo_reflector=PhotoReflector(led=AnnularLed(hole=0.0), phototransistor=Phototransistor(width=width)),
        force=(0.1, 0, fz),
        roof=Wall("lambertian", reflectance=reflectance),
        side=Wall("lambertian", reflectance=0.5),
    )


def power(scene):
    return measure(scene.with_mesh_size(2.0), points=64, mechanics_error=False).replicates


def test_a_sensor_made_in_python_has_its_parameters(tmp_path):
    """Changed one by one in the file, they are the sensor with those values, to the bit."""
    sensor().scene().write_xml(tmp_path / "sensor.xml")
    written = Scene(tmp_path / "sensor.xml")
    expected = {"fx": "0.1", "fz": "-0.25", "height": "4", "pitch": "4", "width": "0.52", "rows": "1"}
    expected |= {"roof_reflectance": "0.9", "side_reflectance": "0.5", "cell": "parallelepiped", "spacing": "0.9"}
    assert expected.items() <= written.parameters.items()
    assert not {"resx", "resy", "meshed_as"} & written.parameters.keys()
    np.testing.assert_array_equal(power(written), power(sensor().scene()))
    for name, value in {"height": 4.3, "width": 0.4, "fz": -0.1, "reflectance": 0.6}.items():
        own = Scene(tmp_path / "sensor.xml", {f"{'roof_' if name == 'reflectance' else ''}{name}": value})
        np.testing.assert_array_equal(power(own), power(sensor(**{name: value}).scene()))


def test_a_scene_from_a_file_keeps_its_parameters(tmp_path):
    """With the values that it has been given, uses of all kinds, and those of a file that it includes."""
    (tmp_path / "plate.xml").write_text(
        '<scene version="3.9.0"> <default name="z" value="6"/> <default name="w" value="2"/>'
        '<default name="wall" value="diffuse"/>'
        '<shape type="rectangle"> <transform name="to_world"><scale x="$w"/><translate z="$z"/></transform>'
        '<bsdf type="$wall"/> </shape> </scene>'
    )
    text = one_cell(cell="parallelepiped", mesh_size=2.0, fz=0)
    (tmp_path / "all.xml").write_text(text.replace("</scene>", '<include filename="plate.xml"/></scene>'))
    scene = Scene(tmp_path / "all.xml", {"fz": -0.25, "w": "3"})
    (tmp_path / "elsewhere").mkdir()
    scene.write_xml(tmp_path / "elsewhere" / "written.xml")
    written = Scene(tmp_path / "elsewhere" / "written.xml")
    assert written.parameters == scene.parameters and written.parameters["w"] == "3"
    for values in ({}, {"fz": "-0.5", "w": "1", "z": "8", "wall": "null"}):
        of_file, of_written = (Scene(each.source, {**each.parameters, **values}) for each in (scene, written))
        assert of_written.as_xml(tmp_path) == of_file.as_xml(tmp_path)
    np.testing.assert_array_equal(power(written), power(scene))


def test_files_are_found_from_where_a_scene_is_written(tmp_path):
    """By their full paths, unless they lie beside it too."""
    scene = Scene("hexagonal.xml")
    folder = scene.source.parent
    assert f'name="filename" value="{folder / "hexagonal.stl"}"' in scene.as_xml(tmp_path)
    assert 'name="filename" value="hexagonal.stl"' in scene.as_xml(folder)


def test_parts_of_equal_names_have_longer_ones(tmp_path):
    """Those of the dictionary around them, as long as they tell the parts apart."""
    balls = {name: {"type": "sphere", "radius": 0.1, "center": [0, number, 9.0]} for number, name in enumerate("ab")}
    scene = Scene({"type": "scene", **balls, "one": {"type": "rectangle", "wall": Wall("mirror", 0.5).to_dict()}})
    scene.write_xml(tmp_path / "balls.xml")
    written = Scene(tmp_path / "balls.xml")
    assert written.parameters == {
        "a_radius": "0.1", "a_center_x": "0", "a_center_y": "0", "a_center_z": "9",
        "b_radius": "0.1", "b_center_x": "0", "b_center_y": "1", "b_center_z": "9",
        "wall_scattering": "mirror", "wall_reflectance": "0.5",
    }  # fmt: skip
    assert len(Scene(tmp_path / "balls.xml", {"b_radius": 2}).load().shapes()) == 3
