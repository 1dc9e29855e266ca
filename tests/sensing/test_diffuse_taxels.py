"""Packages that reflect: readings against random paths, derivatives against differences of the whole chain."""

from __future__ import annotations

import pytest
from diffuse_scene import LOW, STEPS, at, by, derivatives, pad_scene
from one_cell import one_cell

from mitsuba_taxel import Scene, measure
from mitsuba_taxel.sensing.diffuse.deterministic_light import deterministic_light
from mitsuba_taxel.sensing.diffuse.diffuse_taxels import NotDiffuse

WHITE = {"type": "wall", "scattering": "lambertian", "reflectance": 0.9}
PATCHED = {
    "type": "region",
    "body": {"type": "wall", "scattering": "mixed", "specular": 0.0, "lambertian": 1.0, "reflectance": 0.6},
    "led": {"type": "wall", "scattering": "lambertian", "reflectance": 0.3},
    "phototransistor": WHITE,
}


def with_package(walls, **pad):
    """Such a scene, with walls of the package."""
    scene = pad_scene(**pad)
    scene.source["package"]["bsdf"] = walls
    return scene


@pytest.mark.parametrize(
    ("walls", "pad"), [(WHITE, {}), (WHITE, LOW), (PATCHED, {"cell": "parallelepiped", "force": [0.2, 0.0, -1.0]})]
)
def test_readings_over_a_package_that_reflects_are_those_of_random_paths(walls, pad):
    """Within 4 standard errors, and 3e-4 for the facets of these large elements: by 2e-4 paths read more without a
    package that reflects, too."""
    live = with_package(walls, **pad).load()
    readings = measure(live, points=4096, mechanics_error=False)
    (found,), (black,) = (deterministic_light(each, False).power for each in (live, pad_scene(**pad).load()))
    assert found > 1.04 * black
    assert abs(found - readings.power[0]) < 4 * readings.standard_error[0] + 3e-4 * found


@pytest.mark.parametrize(
    ("name", "walls", "pad"),
    [("fz", WHITE, {}), ("fx", PATCHED, LOW), ("spacing", PATCHED, LOW)],
)
def test_derivatives_over_a_package_that_reflects_are_differences_of_the_whole_chain(name, walls, pad):
    step = STEPS[name]

    def changed(by):
        scene = at(name, by, **pad)
        scene.source["package"]["bsdf"] = walls
        return deterministic_light(scene.load(), False).power[0]

    found = by(derivatives(with_package(walls, **pad), name), name)[0]
    assert found == pytest.approx((changed(step) - changed(-step)) / (2 * step), rel=3e-3)


def over_package(folder, **parameters):
    """The scene of a cell that begins below the top of a package, whose height and reflectance are parameters."""
    file = folder / "cell.xml"
    package = """<vector name="body" value="1.46, 1.06, $high"/>
        <bsdf type="wall">
            <string name="scattering" value="lambertian"/> <float name="reflectance" value="$white"/>
        </bsdf>
        <emitter"""
    low = '<float name="cell_height" value="1.5"/> <float name="cell_size" value="2.5"/> <bsdf type="region">'
    scene = one_cell(cell="hemispheric", mesh_size=1.7, fz=-0.8, high=0.5, white=0.9)
    file.write_text(scene.replace("<emitter", package).replace('<bsdf type="region">', low))
    return Scene(file, parameters)


@pytest.mark.parametrize(("name", "value"), [("high", 0.5), ("white", 0.9)])
def test_derivatives_by_a_package_are_differences_of_the_whole_chain(tmp_path, name, value):
    """By its height, which moves its sides, its top and what lies in it, and what it blocks; and by its reflectance."""
    ends = [over_package(tmp_path, **{name: value + by}).load() for by in (1e-3, -1e-3)]
    ahead, behind = (deterministic_light(end, False).power[0] for end in ends)
    found = derivatives(over_package(tmp_path), name)
    assert by(found, name)[0] == pytest.approx((ahead - behind) / 2e-3, rel=3e-3)


def test_a_package_that_begins_to_reflect_needs_random_paths(tmp_path):
    with pytest.raises(NotDiffuse, match="begins to reflect light"):
        derivatives(over_package(tmp_path, white=0.0), "white")


def test_an_isotropic_package_needs_random_paths():
    with pytest.raises(NotDiffuse, match="step along the horizon of its faces"):
        derivatives(with_package({"type": "wall", "scattering": "isotropic"}), "fz")
