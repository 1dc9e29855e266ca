"""`plate.xml` against deterministic quadrature, images, and Mitsuba's own integrators."""

from __future__ import annotations

import numpy as np
import pytest
from plate_reference import image_power

from mitsuba_taxel import Scene, measure

# One bounce, LED 0.25 x 0.25 mm, phototransistor 0.52 x 0.3 mm, spacing 0.7, plate 4 x 4 mm of reflectance 1.
# Deterministic quadrature, eight digits.
REFERENCE = {
    ("lambertian", "lambertian"): (0.019702463, 0.011441221, 0.0034533907),
    ("lambertian", "isotropic"): (0.013124617, 0.0071676537, 0.0019999896),
    ("uniform_solid_angle", "lambertian"): (0.013598936, 0.0074263126, 0.0020717984),
    ("uniform_solid_angle", "isotropic"): (0.0092022309, 0.0047395992, 0.0012102686),
}
HEIGHTS = (0.7, 1.05, 2.0)


@pytest.mark.parametrize("law, scattering", REFERENCE)
def test_plate_matches_quadrature(llvm_mono, agree, law, scattering):
    readings = [
        measure(
            Scene.from_file("plate.xml", z=z, law=law, scattering=scattering, hole=0, spacing=0.7),
            points=1 << 15,
            seed=11,
        )
        for z in HEIGHTS
    ]
    power = np.array([r.power[0] for r in readings])
    error = np.array([r.standard_error[0] for r in readings])
    reference = np.array(REFERENCE[law, scattering])
    assert np.all(error < 1e-4 * reference)  # so that 0.05 % is five standard errors
    assert np.all(np.abs(power / reference - 1) < 5e-4)
    agree(power, error, reference)


@pytest.mark.parametrize("z", [0.3, 0.7, 1.5])
@pytest.mark.parametrize("law", ["lambertian", "uniform_solid_angle"])
def test_mirror_matches_method_of_images(llvm_mono, agree, law, z):
    reading = measure(Scene.from_file("plate.xml", z=z, law=law, hole=0.1, spacing=0.7), points=1 << 16)
    agree(reading.power, reading.standard_error, image_power(z, law, hole=0.1))


@pytest.mark.parametrize(
    "scattering, parts",
    [
        ("lambertian", ("connections", "sensor_subpath_connections", "unidirectional_hits")),
        ("isotropic", ("connections", "unidirectional_hits")),
    ],
)
@pytest.mark.parametrize("z", [0.1, 0.7])
def test_each_technique_alone_agrees_with_all(llvm_mono, agree, tmp_path, scattering, parts, z):
    """Sensor-subpath connections alone have a weight without bound at an isotropic wall: not compared."""
    readings = {}
    for strategy in (*parts, "all"):
        scene = with_integrator(
            tmp_path,
            f'<integrator type="taxel_tracer"><string name="strategy" value="{strategy}"/></integrator>',
        )
        readings[strategy] = measure(
            Scene.from_file(scene, z=z, scattering=scattering, law="lambertian", spacing=0.7),
            points=1 << 15,
            seed=3,
        )
    for strategy in parts:
        mine, other = readings[strategy], readings["all"]
        agree(mine.power, mine.standard_error, other.power, other.standard_error)


@pytest.mark.parametrize(
    "integrator, scattering, law, variant",
    [
        ("path", "lambertian", "uniform_solid_angle", "llvm_ad_mono"),
        ("path", "lambertian", "uniform_polar_angle", "llvm_ad_mono"),
        ("path", "isotropic", "lambertian", "llvm_ad_mono"),
        ("ptracer", "lambertian", "uniform_solid_angle", "llvm_ad_mono"),
        ("ptracer", "isotropic", "uniform_polar_angle", "llvm_ad_mono"),
        ("path", "isotropic", "uniform_solid_angle", "llvm_ad_rgb"),
    ],
)
def test_stock_integrators_agree(llvm_mono, agree, tmp_path, integrator, scattering, law, variant):
    llvm_mono.set_variant(variant)
    stock = with_integrator(tmp_path, f'<integrator type="{integrator}"/>')
    values = dict(z=0.9, scattering=scattering, law=law, spacing=0.7, hole=0.1)
    theirs = measure(Scene.from_file(stock, **values), points=2048, seed=5)
    ours = measure(Scene.from_file("plate.xml", **values), points=1 << 13, seed=6)
    agree(theirs.power, theirs.standard_error, ours.power, ours.standard_error)


@pytest.mark.parametrize("seed", [0, 4294967295])
def test_a_target_error_works_under_stock_integrators_too(llvm_mono, tmp_path, seed):
    path = with_integrator(tmp_path, '<integrator type="path"/>')
    reading = measure(Scene.from_file(path, scattering="lambertian"), target_error=0.02, seed=seed)
    assert 0 < reading.relative_error < 0.03


def test_a_time_budget_ends_stock_integrators_too(llvm_mono, agree, tmp_path):
    """Alone it asks for as many points as there is time for, in steps that may be added up."""
    path = with_integrator(tmp_path, '<integrator type="path"/>')
    scene = Scene.from_file(path, scattering="lambertian")
    reading = measure(scene, time_budget=0.3)
    assert 256 <= reading.points < 1 << 20
    ours = measure(Scene.from_file("plate.xml", scattering="lambertian"), points=1 << 12)
    agree(reading.power, reading.standard_error, ours.power, ours.standard_error)
    longer = measure(scene, points=2048, continued=measure(scene, points=1024))
    assert longer.points == 2048
    agree(longer.power, longer.standard_error, ours.power, ours.standard_error)


def test_points_are_found_that_reach_the_target(llvm_mono, agree):
    """The pilots' random numbers do not enter the result: it is that of as many points asked for by number."""
    scene = Scene.from_file("plate.xml", scattering="lambertian")
    found = measure(scene, target_error=5e-4, seed=9)
    assert found.relative_error < 1.5 * 5e-4
    assert np.array_equal(found.replicates, measure(scene, points=found.points, seed=9).replicates)


def test_what_a_reading_did_not_reach_is_said(llvm_mono, monkeypatch):
    """Also where the target is the default one: a mirror has too few hits for half a percent from 256 points."""
    from mitsuba_taxel.sensing import targets

    monkeypatch.setattr(targets, "MOST_POINTS", 256)
    reading = measure(Scene.from_file("plate.xml", z=0.3), seed=1)
    assert reading.points == 256 and reading.relative_error > 0.005
    assert any(note.startswith("target error 0.005 not reached") for note in reading.notes)
    dark = measure(Scene.from_file("plate.xml", offset_x=10))
    assert dark.power[0] == 0 and dark.notes == ["no light found on taxel 1: it may receive 1.1e-03 W (1 sigma)"]


@pytest.mark.parametrize(
    "request_, message",
    [
        ({"target_error": 0.0}, "target_error = 0.0"),
        ({"target_error": float("nan")}, "target_error = nan"),
        ({"points": 0}, "points = 0"),
        ({"points": 2.5}, "points = 2.5"),
        ({"points": 1 << 21}, "points = 2097152"),
        ({"points": 16, "target_error": 0.1}, "exclude each other"),
        ({"time_budget": 0}, "time_budget = 0"),
        ({"time_budget": float("inf")}, "time_budget = inf"),
        ({"seed": -1}, "seed = -1"),
        ({"seed": 1 << 32}, "seed = 4294967296"),
    ],
)
def test_requests_that_cannot_be_met_are_refused(request_, message):
    from mitsuba_taxel import InputError

    with pytest.raises(InputError, match=message):
        measure("plate.xml", **request_)


def with_integrator(folder, xml: str):
    """`plate.xml` with another integrator."""
    from mitsuba_taxel.sensing import find_scene

    path = folder / "plate.xml"
    path.write_text(find_scene("plate.xml").read_text().replace('<integrator type="taxel_tracer"/>', xml))
    return path


def test_hits_agree_near_contact(llvm_mono, agree, tmp_path):
    """Where the plate all but touches, connections alone have too heavy a tail to tell their own error."""
    hits = with_integrator(
        tmp_path, '<integrator type="taxel_tracer"><string name="strategy" value="unidirectional_hits"/></integrator>'
    )
    values = dict(z=0.05, scattering="lambertian", law="lambertian", spacing=0.7, hole=0)
    theirs = measure(Scene.from_file(hits, **values), points=1 << 16, seed=3)
    ours = measure(Scene.from_file("plate.xml", **values), points=1 << 16, seed=4)
    agree(ours.power, ours.standard_error, theirs.power, theirs.standard_error)


def test_irradiance_map_integrates_to_reading(llvm_mono, tmp_path):
    from mitsuba_taxel.sensing import find_scene

    film = """<sensor type="phototransistor"><film type="hdrfilm">
        <integer name="width" value="26"/> <integer name="height" value="15"/> <rfilter type="box"/>
    </film></sensor>"""
    path = tmp_path / "map.xml"
    path.write_text(find_scene("plate.xml").read_text().replace('<sensor type="phototransistor"/>', film))
    reading = measure(Scene.from_file(path, scattering="lambertian"), points=4096, irradiance=True)
    assert reading.irradiance.shape == (15, 26)
    assert reading.irradiance.mean() * 0.52 * 0.3 == pytest.approx(reading.power[0], rel=1e-5)
    # The LED is at -x: the half of the phototransistor that is nearer to it gets more light.
    assert reading.irradiance[:, :13].sum() > reading.irradiance[:, 13:].sum()
