"""`plate.xml` against deterministic quadrature, images, and Mitsuba's own integrators."""

from __future__ import annotations

import numpy as np
import pytest
from plain_meshes import plate_mesh
from plate_reference import image_power, plate_power
from plate_scenes import WHITE, column, plate

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
    from mitsuba_taxel.sensing.reading import runs

    for module in (runs, targets):
        monkeypatch.setattr(module, "MOST_POINTS", 256)
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


@pytest.mark.parametrize("scattering", ["lambertian", "isotropic"])
@pytest.mark.parametrize("law", ["lambertian", "uniform_solid_angle"])
def test_narrow_gaps_match_quadrature(llvm_mono, agree, law, scattering):
    """Plates 0.1 and 0.02 mm above the LED's plane."""
    heights = (0.1, 0.02)
    readings = [measure(plate(z=z, law=law, scattering=scattering), points=1 << 15, seed=1) for z in heights]
    reference = [plate_power(z, law, scattering) for z in heights]
    assert max(r.relative_error for r in readings) < 2e-3
    agree(*column(readings), reference)


@pytest.mark.parametrize("scattering", ["lambertian", "isotropic", "mirror"])
def test_a_plate_that_touches_lets_nothing_across(llvm_mono, scattering):
    touching = measure(plate(z=0.0, scattering=scattering), points=1 << 12, seed=2)
    assert np.array_equal(touching.replicates, np.zeros((32, 1)))
    assert touching.notes[-1].startswith("no light found on taxel 1: it may receive ")


@pytest.mark.parametrize("scattering, order", [("lambertian", 2), ("isotropic", 1)])
def test_a_plate_that_all_but_touches_lets_little_across(llvm_mono, scattering, order):
    """A gap of 1e-5 mm: to a percent what quadrature says of 1e-3 mm, as light in a narrow gap goes with z**order."""
    reading = measure(plate(z=1e-5, scattering=scattering), points=1 << 12, seed=2)
    limit = plate_power(1e-3, "uniform_solid_angle", scattering) * 1e-2**order
    assert limit < 2e-6 and reading.power[0] == pytest.approx(limit, rel=0.01)
    assert reading.relative_error < 1e-2
    mirrored = measure(plate(z=1e-5, scattering="mirror"), points=1 << 12, seed=2)
    assert mirrored.power[0] == 0 and 0 < mirrored.standard_error[0] < 1e-4


@pytest.mark.parametrize(
    "law, z, cone_angle",
    [
        ("lambertian", 0.02, 88.0),
        ("uniform_solid_angle", 0.02, 88.0),
        ("uniform_solid_angle", 0.7, 1.0),
        ("uniform_polar_angle", 0.3, 88.0),
        ("uniform_polar_angle", 0.7, 1.0),
    ],
)
def test_the_quadrature_has_converged(law, z, cone_angle):
    """Finer panels, with half as many nodes again in each integral, change less than any reading here could show."""
    for scattering in ("lambertian", "isotropic"):
        finer = plate_power(z, law, scattering, cone_angle, fineness=1.0, nodes=24)
        assert plate_power(z, law, scattering, cone_angle) == pytest.approx(finer, rel=1e-6)


def test_the_quadrature_gives_known_powers():
    """Eight digits that were computed otherwise, with 88-degree cone and with Lambert's law."""
    assert plate_power(0.7, "lambertian", "lambertian") == pytest.approx(0.019702463, rel=1e-7)
    assert plate_power(0.7, "lambertian", "isotropic") == pytest.approx(0.013124617, rel=1e-7)
    assert plate_power(2.0, "uniform_solid_angle", "lambertian") == pytest.approx(0.0020717984, rel=1e-7)
    assert plate_power(1.05, "uniform_solid_angle", "isotropic") == pytest.approx(0.0047395992, rel=1e-7)


@pytest.mark.parametrize("scattering", ["lambertian", "isotropic"])
@pytest.mark.parametrize("law", ["lambertian", "uniform_solid_angle", "uniform_polar_angle"])
def test_grazing_light_matches_quadrature(llvm_mono, agree, law, scattering):
    """A plate 0.3 mm high, 2.5 to 6.5 mm aside: light comes to it at 83 to 88 degrees, and leaves it at 80 to 88."""
    reading = measure(plate(z=0.3, law=law, scattering=scattering, offset=4.5), points=1 << 17, seed=3)
    assert reading.relative_error < 5e-3
    agree(reading.power, reading.standard_error, plate_power(0.3, law, scattering, offset=4.5))


@pytest.mark.parametrize("scattering", ["lambertian", "isotropic"])
@pytest.mark.parametrize("law", ["uniform_solid_angle", "uniform_polar_angle"])
@pytest.mark.parametrize("cone_angle", [1.0, 90.0])
def test_narrow_and_wide_cones_match_quadrature(llvm_mono, agree, law, scattering, cone_angle):
    heights = (0.1, 0.7)
    scenes = [plate(z=z, law=law, scattering=scattering, cone_angle=cone_angle) for z in heights]
    readings = [measure(scene, points=1 << 13, seed=4) for scene in scenes]
    assert max(r.relative_error for r in readings) < 2e-3
    agree(*column(readings), [plate_power(z, law, scattering, cone_angle) for z in heights])


@pytest.mark.parametrize("law", ["uniform_solid_angle", "uniform_polar_angle"])
def test_narrow_cones_in_a_mirror_match_images(llvm_mono, agree, law):
    """A cone of 1 degree comes back beside the phototransistor, and on it once its place is 20 mm higher."""
    assert measure(plate(z=0.7, law=law, scattering="mirror", cone_angle=1.0), points=1 << 10).power[0] == 0
    reading = measure(plate(z=20.0, law=law, scattering="mirror", cone_angle=1.0), points=1 << 14, seed=5)
    agree(reading.power, reading.standard_error, image_power(20.0, law, cone_angle=1.0))


def test_little_light_has_the_same_relative_error(llvm_mono, agree):
    """1e-9 W and less: from an LED of that power the very same replicates, and from a plate 5 m away quadrature."""
    bright, dim = (measure(plate(scattering="lambertian", power=power), points=1024, seed=6) for power in (1.0, 1e-9))
    assert np.allclose(dim.replicates, 1e-9 * bright.replicates, rtol=1e-5)
    assert dim.relative_error == pytest.approx(bright.relative_error, rel=1e-3)
    far = measure(plate(z=5000.0, scattering="lambertian", width=4000.0), points=1024, seed=7)
    assert far.power[0] < 1e-8 and far.relative_error < 5e-3
    agree(far.power, far.standard_error, plate_power(5000.0, "uniform_solid_angle", "lambertian", side=4000.0))


def test_an_led_without_power_gives_nothing(llvm_mono):
    for integrator in ("taxel_tracer", "taxel_path", "analog_tracer"):
        reading = measure(plate(scattering="lambertian", power=0.0, integrator={"type": integrator}), points=256)
        assert np.array_equal(reading.replicates, np.zeros((32, 1)))
        assert "no light found on taxel 1" in reading.notes


def test_a_plate_of_a_million_triangles_reads_as_a_rectangle(llvm_mono, agree, tmp_path):
    mi = llvm_mono
    grid = plate_mesh(mi, cells=708)
    assert len(mi.traverse(grid)["faces"]) // 3 == 1_002_528
    grid.write_ply(str(tmp_path / "plate.ply"))
    ply = {"type": "ply", "filename": str(tmp_path / "plate.ply"), "face_normals": True, "bsdf": WHITE}
    coarse, fine = (
        measure(plate(z=0.3, scattering="lambertian", plate=shape), points=1 << 13, seed=6) for shape in (None, ply)
    )
    assert fine.power == pytest.approx(coarse.power, rel=1e-4)
    agree(fine.power, fine.standard_error, plate_power(0.3, "uniform_solid_angle", "lambertian"))


@pytest.mark.parametrize("scattering", ["lambertian", "isotropic", "mirror"])
def test_degenerate_triangles_change_nothing(llvm_mono, scattering):
    """Points and lines for triangles, in the plate and before it."""
    mi = llvm_mono
    bsdf = {"type": "wall", "scattering": scattering}
    clean, dirty = (
        measure(
            plate(z=0.3, scattering=scattering, plate=plate_mesh(mi, cells=4, degenerate=degenerate, bsdf=bsdf)),
            points=1 << 11,
            seed=7,
        )
        for degenerate in (False, True)
    )
    assert clean.power[0] > 0
    assert np.allclose(dirty.replicates, clean.replicates, rtol=1e-5)
