"""Derivatives by differences of random paths: against exact spheres, quadrature, the deterministic light, and whole
chains.

Z-tests at 4 standard errors: of the 23 comparisons of this file, one fails by chance in 700 runs.
"""

from __future__ import annotations

import gc
from dataclasses import replace

import numpy as np
import pytest
from plate_reference import image_power, plate_power
from scipy.stats import qmc

from mitsuba_taxel import InputError, Scene, measure
from mitsuba_taxel.base.differences import BEHIND, STENCILS
from mitsuba_taxel.evidence.domes.domes import dome_scene
from mitsuba_taxel.evidence.domes.sphere_light import SPACING, Dome
from mitsuba_taxel.kernels.paths import emission_guiding
from mitsuba_taxel.kernels.surfaces.mesh_adapter import places_of
from mitsuba_taxel.sensing.derivatives import path_derivatives
from mitsuba_taxel.sensing.derivatives.diffuse_derivatives import derivatives_by
from mitsuba_taxel.sensing.derivatives.moved_scene import MovedScene
from mitsuba_taxel.sensing.derivatives.path_derivatives import derivatives_of_paths
from mitsuba_taxel.sensing.derivatives.scene_rates import rates
from mitsuba_taxel.sensing.reading.derivative_values import BY_PATHS, DETERMINISTIC
from mitsuba_taxel.sensing.reading.runs import prepare
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads

MIRROR = {"scattering": "mirror"}
ROUGH = {"scattering": "rough_mirror", "rms_slope": 2.0}
POINTS = 1024


def pressed(roof, cell="hemispheric", force=(0.05, 0.0, -0.8), **pad):
    return dome_scene(cell, roof, force=list(force), mesh_size=1.7, **pad)


def by_paths(scene, *names, points=POINTS, seed=1):
    ready = prepare(scene)
    changes = [rates(scene, name) for name in names]
    return derivatives_of_paths(changes, ready, np.ones((32, 1)), seed, points, fixed=True)


@pytest.fixture
def _light_alone(monkeypatch):
    """For comparisons on the same elements."""
    monkeypatch.setattr("mitsuba_taxel.mechanics.second_state", lambda *_, **__: None)
    monkeypatch.setattr(path_derivatives._AlongWithPad, "_mechanics_error", lambda *_: 0.0)


@pytest.fixture
def _short_pilots(monkeypatch):
    """For tests that ask for no figure that light over mirrors decides: rays go where the law sends them."""
    monkeypatch.setattr(emission_guiding, "_PILOT", 1 << 9)
    monkeypatch.setattr(emission_guiding, "_MOST", 1)


def on_spheres(fields, rms_slope):
    """Derivatives by ray tracing on spheres, extrapolated from two steps, and their noise."""
    dome, found = Dome(1.275, 0.05, SPACING), []
    for run in range(16):
        u = qmc.Sobol(24, rng=run).random(1 << 14)

        def difference(field, h, u=u):
            ends = (replace(dome, **{field: getattr(dome, field) + sign * h}) for sign in (1, -1))
            return np.subtract(*(end._rays(rms_slope, u) for end in ends)) / (2 * h)

        found.append([(4 * difference(field, 0.01) - difference(field, 0.02)) / 3 for field in fields])
    return np.mean(found, axis=0), np.std(found, axis=0, ddof=1) / 4


@pytest.mark.parametrize("roof", [MIRROR, ROUGH], ids=["mirror", "rough"])
def test_mirrors_of_spheres_are_those_of_rays_on_spheres(roof):
    """A dome that begins a little above the LED; its height moves the mirror, the spacing LED and phototransistor."""
    found = by_paths(dome_scene("hemispheric", roof, cell_height=1.825), "spacing", "cell_height")
    expected, noise = on_spheres(("spacing", "rim"), roof.get("rms_slope", 0.0))
    error = np.hypot(found.standard_errors[0], noise)
    assert np.all(error < 0.08 * np.abs(expected))
    assert np.all(np.abs(found.values[0] - expected) < 4 * error)


@pytest.mark.usefixtures("_light_alone")
@pytest.mark.parametrize(
    ("cell", "names"), [("hemispheric", ("fz", "spacing")), ("parallelepiped", ("cell_size", "fx", "reflectance"))]
)
def test_diffuse_cells_have_the_derivatives_without_random_numbers(cell, names):
    """Within 0.5 % for the horizon and the patches, in addition to the noise; the reflectance is 1, and can only
    fall."""
    scene = pressed({"scattering": "lambertian"}, cell)
    expected = derivatives_by([rates(scene, name) for name in names], scene.load(), False)
    found = by_paths(scene, *names)
    assert (expected.method, found.method) == (DETERMINISTIC, BY_PATHS)
    off = np.abs(found.values - expected.values) - 5e-3 * np.abs(expected.values)
    assert np.all(off < 4 * found.standard_errors)
    assert found.strain_rates == pytest.approx(expected.strain_rates)
    assert found.units == expected.units


@pytest.mark.parametrize(
    ("roof", "force", "name", "stencils"),
    [
        ({"scattering": "isotropic"}, (0.0, 0.0, 0.0), "fz", (BEHIND,)),
        ({"scattering": "mixed", "specular": 0.6, "isotropic": 0.4}, (0.0, 0.0, 0.0), "fz", (BEHIND,)),
        ({"scattering": "isotropic"}, (0.0, 0.0, 0.0), "fx", STENCILS),
        ({"scattering": "isotropic"}, (0.0, 0.0, -0.1), "fz", STENCILS),
        (MIRROR, (0.0, 0.0, 0.0), "fz", STENCILS),
    ],
)
def test_flat_roofs_at_rest_are_pressed_where_that_matters(roof, force, name, stencils, monkeypatch):
    """Isotropic ones have another slope when they are pulled."""
    tried = []

    def estimate(along, _):
        tried.append(along._stencils)
        return np.zeros((2, 1))

    monkeypatch.setattr(path_derivatives._AlongWithPad, "estimate", estimate)
    by_paths(pressed(roof, "parallelepiped", force=force), name, points=16)
    assert tried == [stencils]


CHAIN = [
    (MIRROR, {"force": (0.05, 0.0, -0.8)}, "fz", 0.1),
    (ROUGH, {"force": (0.05, 0.0, -0.8)}, "fz", 0.1),
    (ROUGH, {"force": (0.0, 0.1, -1.2), "cell": "spherical"}, "youngs_modulus", 0.4),
    (ROUGH, {"force": (0.0, 0.0, -0.8)}, "cell_size", 0.08),
]


@pytest.mark.usefixtures("_light_alone")
@pytest.mark.parametrize(("roof", "pad", "name", "step"), CHAIN)
def test_derivatives_are_differences_of_whole_chains(roof, pad, name, step):
    """Each end solved and, for dimensions, meshed anew; its bias by the step is within 3 % of the derivative."""

    def at(change):
        given = dict(pad)
        if name == "fz":
            given["force"] = (*pad["force"][:2], pad["force"][2] + change)
        else:
            given[name] = {"youngs_modulus": 4.16, "cell_size": 2.55}[name] + change
        return measure(pressed(roof, **given), points=2 * POINTS, seed=5, mechanics_error=False).replicates

    ends = (at(step) - at(-step)) / (2 * step)
    expected, noise = ends.mean(), ends.mean(axis=1).std(ddof=1) / np.sqrt(len(ends))
    found = by_paths(pressed(roof, **pad), name)
    error = np.hypot(found.standard_errors[0, 0], noise)
    assert abs(found.values[0, 0] - expected) < 4 * error + 0.03 * abs(expected)


@pytest.mark.usefixtures("_short_pilots")
def test_every_law_has_derivatives_with_errors_that_name_the_method():
    scene = dict(pressed({"scattering": "mixed", "specular": 0.3, "isotropic": 0.7}, "parallelepiped").source)
    scene["packages"] = {**scene["packages"], "led": {"type": "annular_led", "law": "uniform_polar_angle"}}
    found = measure(Scene(scene), points=64, derivatives=["fz", "annular_led.power"]).derivatives
    assert np.all(np.isfinite(found.values)) and np.all(found.standard_errors > 0)
    assert found.to_xarray().attrs["method"] == BY_PATHS
    assert {row["method"] for row in found.rows()} == {BY_PATHS}
    assert found.values[0, 1] == pytest.approx(found.power[0], rel=1e-5)  # the power is proportional to it


@pytest.mark.usefixtures("_short_pilots")
def test_the_error_of_the_elements_is_part_of_the_stated_one(monkeypatch):
    scene = pressed(ROUGH, "parallelepiped")
    whole = by_paths(scene, "fz", points=64).standard_errors
    monkeypatch.setattr(path_derivatives._AlongWithPad, "_mechanics_error", lambda *_: 0.0)
    assert np.all(by_paths(scene, "fz", points=64).standard_errors < whole)
    monkeypatch.undo()
    monkeypatch.setattr("mitsuba_taxel.mechanics.second_state", lambda *_, **__: None)
    assert np.all(np.isnan(by_paths(scene, "fz", points=64).standard_errors))


@pytest.mark.usefixtures("_short_pilots")
def test_the_scene_is_as_it_was_afterwards():
    scene = pressed(MIRROR)
    ready = prepare(scene)
    (pad,) = deformed_pads(ready.scene)
    before = places_of(pad)
    derivatives_of_paths([rates(scene, "fz")], ready, np.ones((32, 1)), 1, 64, fixed=True)
    np.testing.assert_array_equal(places_of(pad).vertices, before.vertices)
    np.testing.assert_array_equal(places_of(pad).normals, before.normals)


@pytest.mark.usefixtures("_short_pilots")
def test_one_moved_scene_is_alive_at_a_time(llvm_mono, monkeypatch):
    """Kernels contain the parts of all: of many, they would be large, and compiled anew for each."""
    read, alive = MovedScene.power, []

    def counted(self, *args):
        powers = read(self, *args)
        alive.append(sum(isinstance(thing, llvm_mono.Sensor) for thing in gc.get_objects()))
        return powers

    monkeypatch.setattr(MovedScene, "power", counted)
    gc.collect()
    gc.freeze()  # those of other tests
    by_paths(dome_scene("hemispheric", MIRROR, mesh_size=1.7), "spacing", "annular_led.power", points=64)
    assert len(alive) > 16 and max(alive) == 2


def test_walls_that_move_along_are_those_of_a_changed_pad():
    """Nodes of a pad at rest move with its dimensions to those of a pad with others."""
    scene = dome_scene("hemispheric", MIRROR, mesh_size=1.7)
    effort, change = path_derivatives._Effort(prepare(scene), 0, 64, True), rates(scene, "cell_size")
    (pad,) = deformed_pads(effort.ready.scene)
    linear = path_derivatives._PadAndSecond(pad, [change])
    along = path_derivatives._AlongWithPad(effort, linear, change, linear.linear.nodal(change))
    step, chords = 0.1, replace(along._walls, chords=True)
    vertices = MovedScene(effort.ready, change)._places(step, chords).vertices
    roof = vertices[np.repeat(pad.surface.region == 1, 3)]
    distance = np.linalg.norm(roof - [0, 0, 0.5], axis=1)  # the height of the cell follows its size
    assert distance == pytest.approx(0.5 * (2.55 + step), abs=1e-6)


@pytest.mark.usefixtures("_short_pilots")
def test_a_dimension_of_cells_with_a_finish_is_refused():
    layers = {"finish": "layer_steps", "layer_height": 0.2, "print_direction": [0, 0, 1]}
    scene = pressed(ROUGH, "parallelepiped", **layers)
    with pytest.raises(InputError, match="cell_size has no derivative: the pad's cells have a finish"):
        by_paths(scene, "cell_size", points=16)
    assert by_paths(scene, "fz", points=16).standard_errors[0, 0] > 0


def test_with_self_contact_nothing_that_a_pad_may_touch_moves():
    scene = pressed(MIRROR, self_contact=True)
    assert rates(scene, "cell_size").pad
    with pytest.raises(InputError, match="^spacing has no derivative with self_contact, as it moves an object that"):
        rates(scene, "spacing")


# Scenes without a pad: against quadrature of the plate


def of_quadrature(power, at: dict[str, float], name: str) -> float:
    """Derivative of a quadrature, by differences of fourth order."""
    step = 0.02

    def difference(h: float) -> float:
        return (power(**{**at, name: at[name] + h}) - power(**{**at, name: at[name] - h})) / (2 * h)

    return (4 * difference(step) - difference(2 * step)) / 3


@pytest.mark.parametrize(
    ("law", "scattering", "z", "offset", "names"),
    [
        ("uniform_solid_angle", "mirror", 0.7, 0.0, ("z", "spacing")),
        ("lambertian", "mirror", 0.45, 0.0, ("z", "spacing")),
        ("lambertian", "lambertian", 0.5, 0.0, ("z", "spacing")),
        ("uniform_solid_angle", "isotropic", 0.8, 0.0, ("z", "spacing")),
        ("lambertian", "isotropic", 0.6, 1.8, ("z", "offset_x")),
    ],
)
def test_a_plate_has_the_derivatives_of_its_quadrature(law, scattering, z, offset, names):
    at = {"z": z, "spacing": 0.7}
    if scattering == "mirror":
        power = lambda **where: image_power(law=law, **where)  # noqa: E731
    else:
        at["offset_x"] = offset
        power = lambda offset_x, **where: plate_power(law=law, scattering=scattering, offset=offset_x, **where)  # noqa: E731
    scene = Scene("plate.xml", {**at, "hole": 0, "law": law, "scattering": scattering})
    found = measure(scene, points=1024, seed=3, derivatives=names).derivatives
    truth = np.array([of_quadrature(power, at, name) for name in names])
    errors = found.standard_errors[0]
    assert np.all(errors < 0.08 * np.abs(truth))
    assert np.all(np.abs(found.values[0] - truth) < 4 * errors), (found.values[0], truth, errors)
    assert found.method == BY_PATHS and found.units == ("W/mm", "W/mm") and np.isnan(found.strain)


def test_what_changes_nothing_has_no_slope_and_what_is_no_number_none():
    scene = Scene("plate.xml", {"width": 50})
    found = measure(scene, points=64, derivatives=("width",)).derivatives
    assert max(abs(found.values[0, 0]), found.standard_errors[0, 0]) < 1e-15  # W/mm: rounding at most
    with pytest.raises(InputError, match=r"^law = 'uniform_solid_angle' has no derivative: it is not a number"):
        measure(scene, points=64, derivatives=("law",))
    with pytest.raises(InputError, match=r"^fz has no derivative: it is not a numeric parameter of the scene"):
        measure(scene, points=64, derivatives=("fz",))
