"""Derivatives of readings, against differences of the whole chain, and their readings against random paths."""

from __future__ import annotations

import numpy as np
import pytest
from diffuse_scene import LOW, STEPS, at, by, derivatives, pad_scene

from mitsuba_taxel import InputError, Scene, measure
from mitsuba_taxel.base.caches import clear_caches
from mitsuba_taxel.mechanics.errors.second_meshes import SecondMeshes
from mitsuba_taxel.mechanics.meshes import pad_mesh
from mitsuba_taxel.mechanics.results.largest_strain import LargestStrain
from mitsuba_taxel.sensing.derivatives.diffuse_derivatives import derivatives_by
from mitsuba_taxel.sensing.derivatives.scene_rates import rates
from mitsuba_taxel.sensing.diffuse import diffuse_cells
from mitsuba_taxel.sensing.diffuse.deterministic_light import deterministic_light
from mitsuba_taxel.sensing.diffuse.diffuse_cells import DiffuseCells, NotFollowed
from mitsuba_taxel.sensing.diffuse.diffuse_taxels import NotDiffuse
from mitsuba_taxel.sensing.reading.derivative_values import BY_PATHS
from mitsuba_taxel.transport import emission
from mitsuba_taxel.transport.cell import Cell


@pytest.mark.parametrize(
    ("cell", "scattering"),
    [
        ("hemispheric", "isotropic"),
        ("cylindrical", "isotropic"),
        *((cell, "lambertian") for cell in ("hemispheric", "spherical", "parallelepiped")),
    ],
)
def test_readings_without_random_numbers_are_those_of_random_paths(cell, scattering):
    """Within 4 standard errors, and 1e-4 for the patches: a false alarm in 2000 runs."""
    scene = pad_scene({"scattering": scattering}, cell=cell)
    live = scene.load()
    readings = measure(live, points=1024, mechanics_error=False)
    (found,) = deterministic_light(live, False).power
    assert abs(found - readings.power[0]) < 4 * readings.standard_error[0] + 1e-4 * found


def test_readings_past_a_package_are_those_of_random_paths():
    live = pad_scene(**LOW).load()
    readings = measure(live, points=4096, mechanics_error=False)
    (found,) = deterministic_light(live, False).power
    assert abs(found - readings.power[0]) < 4 * readings.standard_error[0] + 1e-4 * found


@pytest.mark.parametrize("name", ["fx", "spacing"])
def test_derivatives_past_a_package_are_differences_of_the_whole_chain(name):
    scene, step = pad_scene(**LOW), STEPS[name]
    ahead, behind = (deterministic_light(at(name, sign * step, **LOW).load(), False).power[0] for sign in (1, -1))
    found = derivatives(scene, name)
    assert by(found, name)[0] == pytest.approx((ahead - behind) / (2 * step), rel=3e-3)


def test_the_horizon_of_bent_roofs_shows_in_random_paths():
    """The mean slope along a tangential force, by differences of readings of random paths that share their numbers."""
    forces, plain, without, traced = (0.9, 1.2, 1.5), [], [], []
    for force in forces:
        scene = pad_scene(cell="parallelepiped", force=[force, 0, -1.0])
        live, changes = scene.load(), [rates(scene, "fx")]
        plain.append(derivatives_by(changes, live, with_errors=False).values[0, 0])
        without.append(derivatives_by(changes, live, with_errors=False, wider=1e-9).values[0, 0])
        if force != forces[1]:
            traced.append(measure(live, points=65536, seed=3, mechanics_error=False).replicates[:, 0])
    slopes = (traced[1] - traced[0]) / (forces[2] - forces[0])
    error = slopes.std(ddof=1) / np.sqrt(len(slopes))
    mean, missing = (np.array(each) @ (1, 4, 1) / 6 for each in (plain, without))
    assert abs(mean - slopes.mean()) < 3 * error
    assert abs(missing - slopes.mean()) > 4 * error


def test_readings_under_other_laws_of_the_ends():
    mixed = {"scattering": "mixed", "specular": 0.0, "lambertian": 0.3, "isotropic": 0.7}
    lobe, narrow = (
        {"law": "cosine_power", "exponent": 8.0, "shape": "circular"},
        {"response": "cosine_power", "exponent": 3.0},
    )
    live = pad_scene(mixed, lobe, narrow, cell="spherical").load()
    readings = measure(live, points=1024, mechanics_error=False)
    (found,) = deterministic_light(live, False).power
    assert abs(found - readings.power[0]) < 4 * readings.standard_error[0] + 1e-4 * found


@pytest.fixture(scope="module")
def found():
    scene = pad_scene()
    names = (*STEPS, "annular_led.power", "cell_size")
    return derivatives(scene, *names, with_errors=True)


@pytest.mark.parametrize("cell", ["hemispheric", "spherical"])
def test_slopes_of_domes_at_rest_are_those_of_a_small_load(cell):
    """On the default elements, which are larger in domes at rest: there, slopes are off by a percent."""
    at_rest, loaded = (pad_scene(cell=cell, mesh_size=None, force=[0, 0, fz]) for fz in (0.0, -1e-3))
    found, expected = (derivatives(scene, "fz", "fx", with_errors=True) for scene in (at_rest, loaded))
    np.testing.assert_allclose(found.values[:, 0], expected.values[:, 0], rtol=1e-3)
    np.testing.assert_allclose(found.values[:, 1], expected.values[:, 1], atol=1e-3 * abs(expected.values).max())
    np.testing.assert_allclose(found.standard_errors, expected.standard_errors, rtol=0.02)


def flat_at(*force, scattering="isotropic", cell="parallelepiped"):
    """A cell with a flat roof, on the elements of loaded ones."""
    return pad_scene({"scattering": scattering}, cell=cell, force=[float(each) for each in force])


@pytest.mark.parametrize("cell", ["parallelepiped", "cylindrical"])
def test_the_slope_of_a_flat_isotropic_roof_at_rest_is_that_of_pressing_it(cell):
    """Points of a plane see each other once it is bent; pulled, the roof has another slope."""
    at_rest = derivatives(flat_at(0, 0, 0, cell=cell), "fz")
    read = {fz: deterministic_light(flat_at(0, 0, fz, cell=cell).load(), False).power[0] for fz in (-2e-3, -1e-3, 2e-3)}
    pressing = (4 * (read[-1e-3] - at_rest.power[0]) - (read[-2e-3] - at_rest.power[0])) / -2e-3
    pulling = (read[2e-3] - at_rest.power[0]) / 2e-3
    assert at_rest.values[0, 0] == pytest.approx(pressing, rel=1e-4)
    assert abs(pulling - pressing) > 0.02 * abs(pressing)
    loaded = derivatives(flat_at(0, 0, -1e-3, cell=cell), "fz")
    assert at_rest.values[0, 0] == pytest.approx(loaded.values[0, 0], rel=1e-3)


def test_a_derivative_between_two_sides_has_their_distance_as_error():
    """Of a sideways force on a flat roof at rest; of Lambertian roofs both sides agree."""
    found, ends = derivatives(flat_at(0, 0, 0), "fx", with_errors=True), (1e-3, -1e-3)
    read = [deterministic_light(flat_at(fx, 0, 0).load(), False).power[0] for fx in ends]
    slopes = (np.array(read) - found.power[0]) / ends
    assert found.values[0, 0] == pytest.approx(np.mean(slopes), abs=1e-3 * np.ptp(slopes))
    assert found.standard_errors[0, 0] > 0.49 * np.ptp(slopes) > 0.1 * abs(np.mean(slopes))
    smooth = derivatives(flat_at(0, 0, 0, scattering="lambertian"), "fx", with_errors=True)
    assert smooth.standard_errors[0, 0] < 0.2 * found.standard_errors[0, 0]


def test_what_is_asked_for_again_is_not_computed_again(monkeypatch):
    """As studies do, of a state in which they looked for steps and meshes; strain and clearance are left out there."""
    scene, solved = flat_at(0, 0, -0.7), []
    own = Cell.gradient

    def gradient(cell, wider=1.0):
        if wider not in cell._gradients:
            solved.append(wider)
        return own(cell, wider)

    monkeypatch.setattr(Cell, "gradient", gradient)
    first = derivatives_by([rates(scene, "fz")], scene.load(), of_light_alone=True)
    assert sorted(solved) == [1, 1, 1, 2]  # finer, coarser and on the second mesh, and with the wider horizon
    again = derivatives_by([rates(scene, "fz")], scene.load())
    assert len(solved) == 4
    np.testing.assert_array_equal(again.values, first.values)
    np.testing.assert_array_equal(again.standard_errors, first.standard_errors)
    assert np.isnan([first.strain, *first.strain_rates, first.clearance, *first.clearance_rates]).all()
    assert again.strain > 0 and again.clearance > 0


def strain_rate(derivatives, name):
    return derivatives.strain_rates[derivatives.parameters.index(name)]


@pytest.mark.parametrize("name", STEPS)
def test_derivatives_are_differences_of_the_whole_chain(name, found):
    step = STEPS[name]
    ends = [at(name, sign * step).load() for sign in (1, -1)]
    ahead, behind = (deterministic_light(end, False).power[0] for end in ends)
    assert by(found, name)[0] == pytest.approx((ahead - behind) / (2 * step), rel=3e-3)
    ahead, behind = (LargestStrain(DiffuseCells(end).pad.state).value for end in ends)
    assert strain_rate(found, name) == pytest.approx((ahead - behind) / (2 * step), rel=3e-3, abs=1e-9)


BEAM, STEP_AT_THE_END = "0,1\n20,0.9\n30,0.6\n50,0.1\n90,0\n", "0,1\n30,0.9\n60,0.7\n"
LEDS_AND_RESPONSES = [(BEAM, None), (STEP_AT_THE_END, None), (None, BEAM), ("0,0.2\n40,1\n70,0\n80,0.1\n", BEAM)]


def of_tables(folder, led, response):
    """Parameters of the parts by such tables."""

    def stated(name, kind, table):
        if table is None:
            return {}
        (file := folder / f"{name}.csv").write_text(table)
        return {kind: "tabulated", "file": str(file)}

    return {"led": stated("led", "law", led), "sensor": stated("sensor", "response", response)}


@pytest.mark.parametrize(
    ("cell", "led", "response"),
    [(cell, *tables) for cell, tables in zip(("parallelepiped", "hemispheric") * 2, LEDS_AND_RESPONSES, strict=True)],
)
def test_readings_by_tables_are_those_of_random_paths(tmp_path, cell, led, response):
    """Tables of few rows, whose kinks patches do not follow. Within 4 standard deviations of both."""
    live = pad_scene(cell=cell, **of_tables(tmp_path, led, response)).load()
    readings, found = measure(live, points=2048, mechanics_error=False), deterministic_light(live, False)
    assert abs(found.power - readings.power) < 4 * np.hypot(readings.standard_error, found.error)
    assert found.error < 2e-3 * found.power


@pytest.mark.parametrize(
    ("pad", "led", "response"),
    [({}, STEP_AT_THE_END, None), ({"cell": "cylindrical", "mesh_size": 2.5}, None, BEAM)],
    ids=["LED that ends at a step, dome", "response, cylinder"],
)
def test_derivatives_by_tables_are_differences_of_the_whole_chain(tmp_path, monkeypatch, pad, led, response):
    """Differences need more rays at the edge of the light to be as good: four times as many, and twice those to it.

    That matters under a dome that is lit up to a step; responses have no edge, and are judged in a cylinder: a tenth
    of the time of a dome.
    """
    parts = pad | of_tables(tmp_path, led, response)
    found = derivatives(pad_scene(**parts), "fz", "spacing")
    monkeypatch.setattr(emission, "RIM_POINTS", 2 * emission.RIM_POINTS)
    monkeypatch.setattr(emission, "EDGE_POINTS", 4 * emission.EDGE_POINTS)
    clear_caches(diffuse_cells.kept_cell)
    finer = derivatives(pad_scene(**parts), "fz", "spacing")
    for name in found.parameters:
        step = 3 * STEPS[name]
        ahead, behind = (deterministic_light(at(name, by, **parts).load(), False).power[0] for by in (step, -step))
        assert by(finer, name)[0] == pytest.approx((ahead - behind) / (2 * step), rel=3e-3)
        assert by(found, name)[0] == pytest.approx(by(finer, name)[0], rel=5e-3)
    clear_caches(diffuse_cells.kept_cell)


def test_the_derivative_by_a_lean_at_rest_is_the_difference_of_readings():
    """Of upright cells, by steps of which the error is of second order."""
    found = derivatives(pad_scene(force=[0.0, 0.0, 0.0]), "top_x").values[0, 0]
    errors = []
    for step in (0.1, 0.05):
        ends = [pad_scene(force=[0.0, 0.0, 0.0], top_x=sign * step).load() for sign in (1, -1)]
        ahead, behind = (deterministic_light(end, False).power[0] for end in ends)
        errors.append(abs((ahead - behind) / (2 * step) - found))
    assert errors[1] < 2e-3 * abs(found) and errors[1] < 0.5 * errors[0] + 1e-3 * abs(found)


def test_cells_that_lean_to_the_other_side_read_as_their_mirror_images():
    """The package is symmetric in y, and so is its image."""
    one, other = (
        deterministic_light(pad_scene(top_y=0.3 * sign, force=[0.05, 0.02 * sign, -0.8]).load(), False).power[0]
        for sign in (1, -1)
    )
    upright, stated = (
        deterministic_light(pad_scene(force=[0.05, 0.02, -0.8], **given).load(), False).power[0]
        for given in ({}, {"top_x": 0.0, "top_y": 0.0})
    )
    assert stated == upright
    assert one == pytest.approx(other, rel=1e-6) and abs(one / upright - 1) > 1e-3


PATCH = {"load": "patch_force", "patch_width": 1.0, "patch_depth": 0.8, "patch_y": 0.1}


def test_derivatives_by_the_place_of_a_patch_are_differences():

    def scene(x):
        found = pad_scene(**PATCH, patch_x=x)
        found.source["pad"]["force"] = [0.0, 0.05, -0.4]
        return found

    ahead, behind = (deterministic_light(scene(x).load(), False).power[0] for x in (0.31, 0.29))
    found = derivatives(scene(0.3), "patch_x")
    assert found.units == ("W/mm",)
    assert found.values[0, 0] == pytest.approx((ahead - behind) / 0.02, rel=3e-3)


def test_the_place_of_an_indenter_is_where_it_is_moved_to():
    ball = {"load": "indenter_displacement", "indenter": "sphere", "indenter_radius": 2.5, "indenter_x": 0.4}
    found = derivatives(pad_scene(**ball, displacement=[0.0, 0.0, -0.1], mesh_size=3.0), "indenter_x", "ux")
    assert abs(found.values[0, 0]) > 1e-6 and found.values[0, 0] == pytest.approx(found.values[0, 1], rel=1e-9)


def test_the_reading_is_proportional_to_the_power(found):
    value, _ = by(found, "annular_led.power")
    assert value == pytest.approx(found.power[0] / 0.5, rel=1e-9)


def test_every_derivative_has_an_error(found):
    assert np.all(found.standard_errors > 0)
    assert 0 < found.power_errors[0] < 5e-3 * found.power[0]
    assert by(found, "fx")[1] < 0.05 * abs(by(found, "fx")[0])  # of a coarse mesh
    assert by(found, "reflectance")[1] < 1e-3 * by(found, "reflectance")[0]
    table = found.to_xarray()
    assert table.value.sel(taxel=1, parameter="fz") == found.values[0, 0]
    assert dict(zip(found.parameters, found.units, strict=True))["fz"] == "W/N"


def test_a_pad_at_rest_has_an_error_of_the_elements_only_where_a_load_comes(monkeypatch):
    scene = pad_scene(force=[0.0, 0.0, 0.0])
    asked = []
    comparisons = SecondMeshes.__iter__
    monkeypatch.setattr(SecondMeshes, "__iter__", lambda meshes: asked.append(meshes) or comparisons(meshes))
    still = derivatives(scene, "cell_size", "spacing", with_errors=True)
    assert not asked and np.all(still.standard_errors > 0)
    pressed = derivatives(scene, "cell_size", "fz", with_errors=True)
    assert asked and np.all(pressed.standard_errors > 0)
    np.testing.assert_array_equal(still.values[:, 0], pressed.values[:, 0])


@pytest.mark.parametrize("cell", ["hemispheric", "parallelepiped"])
def test_readings_and_slopes_do_not_depend_on_the_patches_of_the_light(cell, monkeypatch):
    scene = pad_scene(cell=cell)
    usual = derivatives(scene, "fx")
    share = 0.8 if cell == "hemispheric" else 0.6  # of which the domes have 0.8 * 0.8
    monkeypatch.setattr(diffuse_cells, "_mesh_of", lambda pad, size: pad_mesh(pad, share * size))
    finer = derivatives(scene, "fx")
    assert usual.power == pytest.approx(finer.power, rel=1e-4)
    assert usual.values == pytest.approx(finer.values, rel=3e-3)


@pytest.mark.parametrize(
    ("scene", "name", "words"),
    [
        (lambda: pad_scene(), "hight", "it is not a numeric parameter of the scene"),
        (lambda: pad_scene(), "rows", "it is not a numeric parameter of the scene"),
        (lambda: pad_scene(), "power.led", "it is not a numeric parameter of the scene"),
        (lambda: pad_scene(load="pressure", pressure=0.01), "fz", "it is not a numeric parameter of the scene"),
        (lambda: Scene.from_file("pad.xml"), "cell", "it is not a number"),
    ],
)
def test_what_has_no_derivative_is_refused(scene, name, words):
    with pytest.raises(InputError, match=words):
        measure(scene(), points=16, derivatives=[name])


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        (lambda: pad_scene({"scattering": "mirror"}), "a wall is a mirror"),
        (
            lambda: pad_scene(finish="grooves", groove_pitch=0.5, groove_depth=0.02, groove_direction=[0, 0, 1]),
            "finish",
        ),
        (lambda: pad_scene(sensor={"response": "tabulated", "file": "60.csv"}), "response ends with a step"),
        (
            lambda: pad_scene(led={"law": "tabulated", "file": "steep.csv"}),
            "falls within a small part of its 42 degrees",
        ),
        (lambda: pad_scene(board={"type": "rectangle", "bsdf": {"type": "wall"}}), "reflects light"),
    ],
)
def test_what_needs_random_paths_is_not_followed_without(tmp_path, monkeypatch, scene, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "60.csv").write_text(STEP_AT_THE_END)
    (tmp_path / "steep.csv").write_text("0,1\n40,1\n42,0\n90,0\n")
    with pytest.raises(NotDiffuse, match=words):
        derivatives(scene(), "fz")


def test_a_scene_that_is_loaded_has_no_parameters_left():
    with pytest.raises(InputError, match="derivatives need the description of a scene"):
        measure(pad_scene().load(), points=16, derivatives=["fz"])


def test_a_screen_over_the_led_needs_random_paths(llvm_mono):
    place = llvm_mono.ScalarTransform4f().translate([-0.45, 0, 0.7]).scale(0.2)
    screen = {"type": "rectangle", "to_world": place, "bsdf": {"type": "wall", "scattering": "absorbing"}}
    scene = pad_scene(cell="cylindrical", board=screen, force=[0.0, 0.0, 0.0])
    with pytest.raises(NotFollowed, match="walls occlude .*% of the light"):
        derivatives(scene, "spacing")
    assert measure(scene, points=16, derivatives=["spacing"]).derivatives.method == BY_PATHS
