"""Readings of diffuse cells without random numbers: right within what they state, and taken where they are."""

from __future__ import annotations

import numpy as np
import pytest
from diffuse_scene import pad_scene
from one_cell import one_cell

from mitsuba_taxel import Pad, PadSensor, Scene, measure, sweep
from mitsuba_taxel.evidence.domes.domes import dome_scene
from mitsuba_taxel.evidence.domes.sphere_light import DOMES
from mitsuba_taxel.pads.parametric.drawings import write_drawings
from mitsuba_taxel.sensing.derivatives.diffuse_derivatives import derivatives_by
from mitsuba_taxel.sensing.derivatives.scene_rates import rates
from mitsuba_taxel.sensing.diffuse import diffuse_cells
from mitsuba_taxel.sensing.diffuse.deterministic_light import COARSE, deterministic_light
from mitsuba_taxel.sensing.reading.readings import light_error_line
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads
from mitsuba_taxel.sensing.targets import CLEAR
from mitsuba_taxel.transport import emission, reception
from mitsuba_taxel.transport.laws.ends import End

CONE, POLAR = "uniform_solid_angle", "uniform_polar_angle"


@pytest.mark.parametrize("law", ["lambertian", "isotropic"])
@pytest.mark.parametrize("cell", ["hemispheric", "spherical"])
def test_domes_read_as_the_sphere_within_the_stated_error(llvm_mono, cell, law):
    readings = measure(dome_scene(cell, {"scattering": law}, 1))
    truth = DOMES[cell].diffuse_power(law, 18)
    assert readings.points == 0 and not readings.standard_error.any()
    assert abs(readings.power[0] - truth) < min(2 * readings.total_error[0], 1e-4 * truth)


@pytest.mark.parametrize(
    ("cell", "roof", "side", "reflectance", "edged"),
    [
        ("parallelepiped", "isotropic", "isotropic", 0.9, True),
        ("cylindrical", "lambertian", "isotropic", 0.9, True),
        ("spherical", "lambertian", "lambertian", 0.5, True),
        ("hemispheric", "isotropic", "lambertian", 0.9, False),
    ],
)
def test_walls_that_meet_at_edges_read_as_random_paths_within_the_stated_error(cell, roof, side, reflectance, edged):
    """Patches that cross the plane of the phototransistor, and strips of walls hidden by a bent roof, were off by up to
    8e-3."""
    source = pad_scene(cell=cell, wall={"scattering": roof}, mesh_size=1.25).source
    source["pad"]["bsdf"]["side"] = {"type": "wall", "scattering": side, "reflectance": reflectance}
    live = Scene(source).load()
    assert diffuse_cells.DiffuseCells(live).cells[0].has_edges == edged
    found = deterministic_light(live, False)
    readings = measure(live, points=8192, mechanics_error=False)
    assert abs(found.power - readings.power) < 2 * np.hypot(found.error, readings.standard_error)
    assert found.error < 1e-3 * found.power


def test_kinks_of_a_response_and_edges_between_walls_multiply_errors(llvm_mono, tmp_path):
    """The reading is off by 0.4 %, which is 3 times what the root of the sum of the squares of both factors states,
    and 1.2 times what their product states."""
    table = tmp_path / "response.csv"
    table.write_text("0,1\n15.4,0.674\n18.5,0.388\n37.8,0\n", encoding="utf-8")
    sensor = {"width": 0.146, "depth": 0.035, "response": "tabulated", "file": str(table)}
    sizes = {"cell": "parallelepiped", "cell_size": 2.95, "pitch": 3.95, "cell_height": 1.3, "force": None}
    source = pad_scene({"reflectance": 1.0}, {"law": "lambertian"}, sensor, mesh_size=None, **sizes).source
    source["package"]["spacing"] = 0.89
    source["pad"]["bsdf"]["side"] = {"type": "wall", "scattering": "lambertian", "reflectance": 0.87}
    live = Scene(source).load()
    found = deterministic_light(live, False)
    readings = measure(live, points=8192, mechanics_error=False)
    assert abs(found.power - readings.power) < 2 * np.hypot(found.error, readings.standard_error)
    assert found.error < 5e-3 * found.power


def with_law(scene, law):
    return scene.replace('"annular_led">', f'"annular_led"> <string name="law" value="{law}"/>')


@pytest.mark.parametrize(
    ("cell", "scattering", "law"),
    [
        ("cylindrical", "isotropic", CONE),
        ("hemispheric", "isotropic", CONE),
        ("spherical", "lambertian", CONE),
        ("parallelepiped", "isotropic", POLAR),
    ],
)
def test_smaller_patches_of_a_pressed_cell_read_the_same_within_the_stated_error(
    llvm_mono, monkeypatch, tmp_path, cell, scattering, law
):
    """Patches of 0.7 of the size, on the same finite elements; domes of both laws are compared with spheres above."""
    file = tmp_path / "cell.xml"
    scene = one_cell(cell=cell, mesh_size=1.25, scattering=scattering, fx=0.1, fz=-1)
    file.write_text(with_law(scene, law))
    live = Scene(file).load()
    found = deterministic_light(live, False)
    pad = deformed_pads(live)[0].pad
    monkeypatch.setattr(diffuse_cells, "MOST_FACES", 1000)
    smaller = deterministic_light(live, False, 0.7 * pad.default_mesh_size)
    assert 0 < abs(smaller.power - found.power) < 2 * found.error


@pytest.fixture
def cell(tmp_path):
    """A function that gives the name of a scene of one cell."""

    def write(**words):
        file = tmp_path / "cell.xml"
        file.write_text(one_cell(**words))
        return file

    return write


def test_kept_solutions_are_those_of_equal_cells(llvm_mono, cell):
    def powers(forget):
        for scattering in ("lambertian", "isotropic", "lambertian"):
            forget()
            yield measure(cell(scattering=scattering)).power[0]

    diffuse_cells.kept_cell.cache_clear()
    kept, hits = list(powers(lambda: None)), diffuse_cells.kept_cell.cache_info().hits
    assert kept == list(powers(diffuse_cells.kept_cell.cache_clear)) and kept[0] == kept[2] != kept[1] and hits


def test_random_paths_where_they_are_asked_for(llvm_mono, cell):
    file = cell(fz=-1)
    quiet = measure(file, seed=1, mechanics_error=False)
    assert quiet.points == 0 and "without random numbers" in light_error_line(quiet)
    for asked in ({"points": 64}, {"irradiance": True}, {"time_budget": 0.1}):
        assert measure(file, **asked, mechanics_error=False).points > 0
    assert measure(file, target_error=0.05, irradiance=True).points > 0
    assert np.array_equal(measure(file, target_error=0.05).power, quiet.power)


@pytest.mark.parametrize(
    "integrator",
    [
        '<integrator type="taxel_path"/>',
        '<integrator type="taxel_tracer"> <integer name="max_depth" value="3"/> </integrator>',
        '<integrator type="taxel_tracer"> <string name="strategy" value="connections"/> </integrator>',
    ],
)
def test_random_paths_where_the_integrator_says_so(llvm_mono, cell, integrator):
    file = cell()
    file.write_text(file.read_text().replace("<shape", integrator + "<shape", 1))
    assert measure(file, mechanics_error=False).points > 0


def test_random_paths_where_a_wall_is_a_mirror(llvm_mono, cell):
    readings = measure(cell(scattering="mirror"), mechanics_error=False)
    assert readings.points > 0 and readings.standard_error.any()


@pytest.mark.parametrize(("shape", "scattering"), [("parallelepiped", "isotropic"), ("hemispheric", "lambertian")])
def test_light_uniform_in_the_polar_angle_is_that_of_random_paths(llvm_mono, cell, shape, scattering):
    scene = cell(cell=shape, scattering=scattering, fz=-0.5)
    scene.write_text(with_law(scene.read_text(), POLAR))
    quiet, random = (measure(scene, points=points, mechanics_error=False) for points in (None, 2048))
    assert quiet.points == 0
    assert abs(quiet.power[0] - random.power[0]) < 4 * random.standard_error[0] + 2 * np.hypot(
        quiet.geometry_error[0], random.geometry_error[0]
    )
    assert random.standard_error[0] < 1e-3 * random.power[0]


def narrow(**led):
    """A cell whose flat roof has a spot of light."""
    return pad_scene(cell="parallelepiped", wall={"scattering": "lambertian"}, led=led, force=None)


NARROW = {
    "cone of 0.1 degrees": {"law": CONE, "cone_angle": 0.1},
    "cone of 5 degrees": {"law": CONE, "cone_angle": 5.0},
    "polar cone of 0.5 degrees": {"law": POLAR, "cone_angle": 0.5},
    "power of 5000": {"law": "cosine_power", "exponent": 5000.0},
    "power of 1e6": {"law": "cosine_power", "exponent": 1e6},
}


@pytest.mark.parametrize("name", NARROW)
def test_narrow_beams_read_as_random_paths(llvm_mono, name):
    scene = narrow(**NARROW[name])
    quiet, random = measure(scene), measure(scene, points=1024)
    assert quiet.points == 0 and quiet.error_budget["geometry"] < 2e-4
    off = abs(quiet.power[0] - random.power[0])
    assert off < 2 * quiet.total_error[0] + 4 * random.standard_error[0]
    assert random.standard_error[0] < 2e-4 * random.power[0]


def test_derivatives_of_a_narrow_beam_are_those_of_differences_of_random_paths(llvm_mono):
    step = 0.025
    ends = [
        measure(pad_scene(cell="parallelepiped", wall={"scattering": "lambertian"}, led=NARROW["cone of 0.1 degrees"],
                          force=None, cell_height=1.55 + sign * step), points=1024)
        for sign in (1, -1)
    ]  # fmt: skip
    expected = (ends[0].power[0] - ends[1].power[0]) / (2 * step)
    scene = narrow(**NARROW["cone of 0.1 degrees"])
    found = derivatives_by([rates(scene, "cell_height")], scene.load())
    assert found.values[0, 0] == pytest.approx(expected, rel=1e-2)
    assert found.standard_errors[0, 0] < 5e-3 * abs(expected)


def test_a_spot_that_the_pieces_of_walls_miss_is_read_by_random_paths(llvm_mono, monkeypatch):
    scene = narrow(**NARROW["cone of 0.1 degrees"])
    truth = measure(scene).power[0]
    monkeypatch.setattr(emission, "MOST_CUTS", 0)
    monkeypatch.setattr(emission, "MOST_EDGE_CUTS", 0)
    diffuse_cells.kept_cell.cache_clear()
    readings = measure(scene)
    diffuse_cells.kept_cell.cache_clear()
    assert readings.points > 0 and readings.power[0] == pytest.approx(truth, rel=0.01)


def test_a_narrow_response_is_read_without_random_numbers_unless_pieces_of_walls_are_too_large(llvm_mono, monkeypatch):
    """Against random paths: within 4 standard errors, and twice what is stated."""
    scene = pad_scene(cell="parallelepiped", sensor={"response": "cosine_power", "exponent": 300.0}, force=None)
    quiet = measure(scene)
    assert quiet.points == 0 and quiet.total_error[0] < 2e-4 * quiet.power[0]
    monkeypatch.setattr(End, "resolved", lambda self, middle, size: np.full(len(middle), np.inf))
    diffuse_cells.kept_cell.cache_clear()
    coarse, random = deterministic_light(scene.load(), False), measure(scene)
    diffuse_cells.kept_cell.cache_clear()
    assert coarse.error[0] > 0.01 * coarse.power[0] and random.points > 0
    for power, error in ((coarse.power[0], coarse.error[0]), (quiet.power[0], quiet.total_error[0])):
        assert abs(power - random.power[0]) < 2 * error + 4 * random.standard_error[0]


def test_outlines_are_integrated_once_for_the_led_and_once_for_a_wide_response(llvm_mono, monkeypatch):
    """They check each reading at 2 to 3 % of its cost: it was three times as much when the coarser solution, which the
    reading is not, was checked as well, and the integrals of a phototransistor were computed twice."""
    sources = []
    for module in (emission, reception):

        def counted(points, *others, integrated=module.power_within):
            sources.append(len(points))
            return integrated(points, *others)

        monkeypatch.setattr(module, "power_within", counted)
    diffuse_cells.kept_cell.cache_clear()
    live = pad_scene(cell="cylindrical", force=None).load()
    (taxel,) = diffuse_cells.DiffuseCells(live).taxels
    deterministic_light(live, False)
    assert len(sources) == 2
    assert sum(sources) < 0.2 * (len(taxel.led.points) + len(taxel.phototransistor.points))


def test_what_patches_cannot_resolve_is_not_solved_on_finer_rules(llvm_mono, monkeypatch):
    """A dome that the phototransistor sees a spot of, in the light of all of the dome."""
    degrees, solved = [], diffuse_cells.DiffuseCells.solved

    def counted(cells, number, mesh, places):
        degrees.append(mesh.degree)
        return solved(cells, number, mesh, places)

    monkeypatch.setattr(diffuse_cells.DiffuseCells, "solved", counted)
    narrow = {"response": "cosine_power", "exponent": 1e4, "width": 0.02, "depth": 0.02}
    assert deterministic_light(pad_scene(sensor=narrow, force=None).load()) is None
    assert degrees == [COARSE]


def test_the_change_with_coarser_elements_is_that_of_random_paths(llvm_mono, cell):
    """To what random paths resolve of it."""
    scene = cell(mesh_size=1.5, fz=-1)
    quiet, random = measure(scene), measure(scene, points=1024)
    assert quiet.mechanics_error[0] == pytest.approx(random.mechanics_error[0], rel=CLEAR)
    assert abs(quiet.power[0] - random.power[0]) < 4 * random.standard_error[0] + 2 * np.hypot(
        quiet.geometry_error[0], random.geometry_error[0]
    )


def test_changed_power_and_reflectance_of_a_loaded_scene_are_seen(llvm_mono, cell):
    live = Scene(cell()).load()
    before = measure(live).power
    parameters = llvm_mono.traverse(live)
    (name,) = (key for key in parameters.keys() if key.endswith("power"))
    parameters[name] = 2 * parameters[name]
    parameters.update()
    assert measure(live).power == pytest.approx(2 * before, rel=1e-12)


def test_a_study_is_read_and_resumed_without_random_numbers(llvm_mono, cell, tmp_path):
    file, folder = cell(fz=0), tmp_path / "study"
    study = sweep(file, {"fz": "0:-1:-1"}, output=folder)
    assert study.attrs["points"] == 0 and not study.standard_error.values.any()
    expected = [measure(file.parent / file.name, mechanics_error=False).power[0]]
    assert study.power.sel(fz=0).values == pytest.approx(expected, rel=1e-12)
    longer = sweep(file, {"fz": "0:-2:-1"}, output=folder)
    assert longer.attrs["points"] == 0 and longer.power.sel(fz=-1).equals(study.power.sel(fz=-1))
    assert longer.parameter.values.tolist() == ["fz"] and np.isfinite(longer.derivative_error).all()
    np.testing.assert_allclose(longer.smooth_power, longer.power, rtol=1e-12)
    traced = sweep(file, {"fz": "0:-2:-1"}, output=folder, points=64)
    assert traced.attrs["points"] == 64 and traced.standard_error.values.all() and "derivative" not in traced
    aimed = sweep(file, {"fz": "0:-2:-1"}, output=folder, target_error=0.1)
    assert aimed.attrs["points"] == 0 and not aimed.standard_error.values.any() and aimed.power.equals(longer.power)


def reading_of_parts(force, **pad):
    roof = {"type": "region", "roof": {"type": "wall", "scattering": "isotropic"}}
    parts = {
        "pad": {"type": "deformable_pad", "mesh_size": 1.5, "force": force, "bsdf": roof, **pad},
        "package": {"type": "photo_reflector", "led": {"type": "annular_led"}, "sensor": {"type": "phototransistor"}},
    }
    return deterministic_light(Scene({"type": "scene", **parts}).load(), False).power[0]


LEANING = {"cell": "cylindrical", "rows": 1, "columns": 1, "top_x": 0.4, "top_y": 0.2}


@pytest.fixture(scope="module")
def drawing(tmp_path_factory):
    folder = tmp_path_factory.mktemp("drawing")
    write_drawings(Pad(**LEANING), folder)
    return folder / "pad.step"


@pytest.mark.parametrize(("force", "error"), [([0.0, 0.0, 0.0], 5e-5), ([0.1, 0.05, -1.0], 1e-3)], ids=["rest", "load"])
def test_the_drawing_reads_the_same(force, error, drawing):
    """But for another mesh."""
    drawn = reading_of_parts(force, filename=str(drawing))
    assert drawn == pytest.approx(reading_of_parts(force, **LEANING), rel=error)


def test_upright_cells_read_more():
    rest, upright = [0.0, 0.0, 0.0], {**LEANING, "top_x": 0.0, "top_y": 0.0}
    assert reading_of_parts(rest, **upright) > 1.05 * reading_of_parts(rest, **LEANING)


MESH = 1e-3

"""Relative change of a reading by another mesh of the same size."""


def reading(pad, force):
    (power,) = deterministic_light(Scene(PadSensor(pad, force=force).scene().source, mesh_size=1.5).load(), False).power
    return power


@pytest.mark.parametrize(
    ("cell", "force", "error"),
    [
        ("cylindrical", (0.0, 0.0, 0.0), 2e-6),
        ("spherical", (0.2, 0.0, -1.0), MESH),
        ("hemispheric", (0.0, 0.0, 0.0), 2e-6),
        ("hemispheric", (0.2, 0.0, -1.0), MESH),
    ],
)
def test_readings_are_those_of_the_same_cell(cell, force, error):
    pad = Pad(cell, 1, 1)
    assert reading(pad.as_profile(), force) == pytest.approx(reading(pad, force), rel=error)


@pytest.mark.parametrize(("force", "error"), [((0.0, 0.0, 0.0), 1e-4), ((0.2, 0.0, -1.0), MESH)], ids=["rest", "load"])
def test_box_shaped_cells_are_profiles_of_a_square_section(force, error):
    """But for the patches of the light, which are others."""
    pad = Pad("parallelepiped", 1, 1)
    assert reading(pad.as_profile(), force) == pytest.approx(reading(pad, force), rel=error)


def test_light_in_a_pyramid_is_that_of_random_paths():
    """Within 4 standard errors: a false alarm in 16000 runs."""
    pad = Pad("profile", 1, 1, profile="1 0.6; 0.7 0.95; 0 1", section="square")
    live = Scene(PadSensor(pad).scene().source, mesh_size=1.5).load()
    (found,) = deterministic_light(live, False).power
    readings = measure(live, points=4096, mechanics_error=False)
    assert abs(readings.power[0] - found) < 4 * readings.standard_error[0] + 1e-4 * found
    assert readings.standard_error[0] < 3e-3 * found


def test_light_of_a_flat_isotropic_roof_has_a_kink():
    """Bent one way, its points see each other, in proportion to the bend: slopes are those of differences on either
    side, and differ. The derivative of the flat roof is between them."""
    step = 0.01
    places = 0.65 + step * np.arange(-2, 3)
    value, slope = [], []
    for place in places:
        pad = Pad("profile", 1, 1, cell_height=2.4, profile=f"1 0.65; 0.7 {place}; 0 0.65", section="square")
        moved = pad.moved_from(pad.changed(profile_z2=0.65))
        scene = Scene(PadSensor(moved).scene().source, mesh_size=1.6)
        found = derivatives_by([rates(scene, "profile_z2")], scene.load(), with_errors=False)
        value.append(found.power[0])
        slope.append(found.values[0, 0])
    for one, other in ((0, 1), (3, 4)):
        difference = (value[other] - value[one]) / step
        assert (slope[one] + slope[other]) / 2 == pytest.approx(difference, rel=0.01, abs=1e-5)
    below, above = np.diff(value)[[1, 2]] / step
    assert abs(below - above) > 0.5 * abs(below)
    assert min(below, above) < slope[2] < max(below, above)
