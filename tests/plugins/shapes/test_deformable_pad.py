"""What a scene may say of its pad: silicone, load, mesh, cells that are read, a file; packages in the way."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.optimize import brentq

from mitsuba_taxel import ComputationError, InputError, Pad, PadSensor, Scene, measure
from mitsuba_taxel.kernels.surfaces.mesh_adapter import places_of
from mitsuba_taxel.mechanics import (
    Indenter,
    IndenterDisplacement,
    IndenterForce,
    MooneyRivlin,
    NeoHookean,
    PatchForce,
    PlateDisplacement,
    PlateForce,
    Pressure,
    SpreadForce,
    Yeoh,
    from_shore_a,
    load_path,
    silicone,
    tessellate,
)
from mitsuba_taxel.mechanics.errors import second_ends
from mitsuba_taxel.pads import REGIONS
from mitsuba_taxel.sensing.scene.clearance import packages
from mitsuba_taxel.sensing.scene.description import Scene as OpticsScene
from mitsuba_taxel.sensing.scene.taxels import taxels_of
from mitsuba_taxel.studies import deform

pytestmark = pytest.mark.usefixtures("mechanics_error_unknown")

PAD = Pad("parallelepiped", rows=1, columns=1)
SIZE = 2.0
SCENE = """<scene version="3.9.0">
    <integrator type="taxel_tracer"/>
    <shape type="deformable_pad"> <integer name="rows" value="1"/> <integer name="columns" value="1"/>
        <float name="mesh_size" value="2.0"/> {} </shape>
    <shape type="photo_reflector"> <emitter type="annular_led"/> <sensor type="phototransistor"/> {} </shape>
</scene>"""


@pytest.fixture
def loaded(llvm_mono, tmp_path):
    """A function that loads a scene with some words for its pad, and gives the pad."""

    def load(words, reflector=""):
        file = tmp_path / "scene.xml"
        file.write_text(SCENE.format(words, reflector))
        scene = OpticsScene.from_file(file).load()
        return next(shape for shape in scene.shapes() if hasattr(shape, "state")), scene

    return load


def string(name, value):
    return f'<string name="{name}" value="{value}"/>'


def numbers(**values):
    return "".join(f'<float name="{name}" value="{value}"/>' for name, value in values.items())


@pytest.mark.parametrize(
    "words, material",
    [
        ("", NeoHookean()),
        (numbers(youngs_modulus=1.0, poisson_ratio=0.45), NeoHookean(1.0, 0.45)),
        (numbers(shore_a=40), from_shore_a(40)),
        (string("material", "mooney_rivlin") + numbers(c10=0.5, c01=0.2), MooneyRivlin(0.5, 0.2)),
        (string("material", "yeoh") + numbers(c10=0.5, c20=0.1, poisson_ratio=0.5), Yeoh(0.5, 0.1, 0.0, 0.5)),
        (string("material", "dragon_skin_30"), silicone("dragon_skin_30")),
        (
            string("material", "dragon_skin_30") + numbers(poisson_ratio=0.5),
            silicone("dragon_skin_30").changed(poisson_ratio=0.5),
        ),
    ],
)
def test_silicones(loaded, words, material):
    pad, _ = loaded(words)
    assert type(pad.material) is type(material)
    for name in material.parameters:
        assert getattr(pad.material, name) == pytest.approx(getattr(material, name), rel=1e-6)


@pytest.mark.parametrize(
    "words, load, value",
    [
        ('<vector name="force" value="0, 0, -2"/>', SpreadForce(), (0, 0, -2)),
        (
            string("load", "patch_force")
            + numbers(patch_width=1, patch_depth=2, patch_x=0.5)
            + '<vector name="force" value="0, 0, -0.5"/>',
            PatchForce((0.5, 0), (1, 2)),
            (0, 0, -0.5),
        ),
        (string("load", "plate_force") + '<vector name="force" value="0, 0, -2"/>', PlateForce(), (0, 0, -2)),
        (
            string("load", "plate_displacement") + '<vector name="displacement" value="0.125, 0, -0.25"/>',
            PlateDisplacement(),
            (0.125, 0, -0.25),
        ),
        (string("load", "pressure") + numbers(pressure=0.125), Pressure(), (0.125,)),
        (
            string("load", "indenter_displacement")
            + string("indenter", "sphere")
            + numbers(indenter_radius=20, indenter_x=0.25, indenter_y=0.5, friction=0.25)
            + '<vector name="displacement" value="0.0625, 0, -0.0625"/>',
            IndenterDisplacement(Indenter("sphere", radius=20, at=(0.25, 0.5), friction=0.25)),
            (0.0625, 0, -0.0625),
        ),
        (
            string("load", "indenter_displacement")
            + string("indenter", "plane")
            + numbers(indenter_angle=30, indenter_tilt=-2)
            + '<vector name="displacement" value="0, 0, -0.0625"/>',
            IndenterDisplacement(Indenter("plane", angle=30, tilt=-2)),
            (0, 0, -0.0625),
        ),
    ],
)
def test_loads_deform_the_pad_as_load_path_does(loaded, words, load, value):
    pad, _ = loaded(words)
    assert pad.load == load
    assert pad.value == pytest.approx(value)
    (state,) = load_path(PAD, NeoHookean(), [value], load=load, mesh_size=SIZE)
    np.testing.assert_allclose(pad.state.displacement, state.displacement, atol=1e-12)


@pytest.mark.parametrize(
    "words, message",
    [
        (string("material", "rubber"), "material = 'rubber' is not allowed: one of neo_hookean"),
        (string("material", "yeoh"), "c10 is missing"),
        (numbers(c10=1.0), "c10 is not allowed for material = 'neo_hookean', only for 'mooney_rivlin', 'yeoh'"),
        (numbers(shore_a=40, youngs_modulus=2), "youngs_modulus and shore_a exclude each other"),
        (numbers(shore_a=99), "shore_a = 99 is not allowed: a finite number from 20 to 80"),
        (string("load", "indenter_displacement") + numbers(friction=-0.25), "friction = -0.25 is not allowed"),
        (string("load", "wind"), "load = 'wind' is not allowed: one of spread_force"),
        (numbers(pressure=1.0), "pressure is not allowed for load = 'spread_force', only for 'pressure'"),
        (numbers(patch_width=1.0), "patch_width is not allowed for load = 'spread_force', only for 'patch_force'"),
        (string("load", "patch_force"), "patch_width is missing"),
        (
            string("load", "patch_force")
            + numbers(patch_width=1, patch_depth=1, patch_x=50)
            + '<vector name="force" value="0, 0, -1"/>',
            "it lies outside the top",
        ),
        (numbers(mesh_tolerance=0.1), "mesh_size and mesh_tolerance exclude each other"),
        (string("read_cells", "one"), "read_cells = 'one' is not allowed"),
        (string("read_cells", "2"), "read_cells = 2 is not allowed: the pad's cells have numbers from 1 to 1"),
        (string("regions", "a.toml"), "regions is not allowed without filename"),
        (string("filename", "a.stl"), "rows and filename exclude each other"),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_line(loaded, words, message):
    with pytest.raises(InputError, match=message) as caught:
        loaded(words)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "sensor",
    [
        PadSensor(PAD, MooneyRivlin(0.5, 0.2), (0, 0, -1.0)),
        PadSensor(PAD, NeoHookean(2.0), (0, 0, -0.25), PlateDisplacement()),
        PadSensor(PAD, NeoHookean(2.0), (0.125,), Pressure()),
        PadSensor(PAD, NeoHookean(2.0), (0, 0, -0.0625), IndenterDisplacement(Indenter("plane"))),
        PadSensor(PAD, NeoHookean(2.0), (0, 0, -0.5), IndenterForce(Indenter("sphere", radius=20.0, at=(0.5, 0)))),
        PadSensor(PAD, NeoHookean(2.0), (0, 0, -0.25), PatchForce((0.5, 0.25), (1.0, 1.5))),
    ],
)
def test_python_objects_make_the_same_pad(llvm_mono, sensor):
    scene = sensor.scene().with_mesh_size(SIZE).load()
    pad = next(shape for shape in scene.shapes() if hasattr(shape, "state"))
    assert (pad.load, pad.material) == (sensor.load, sensor.material)
    assert pad.value == pytest.approx(tuple(sensor.force))


def wall(scattering, name="walls"):
    return f'<bsdf type="wall" name="{name}"> <string name="scattering" value="{scattering}"/> </bsdf>'


@pytest.mark.parametrize(
    ("words", "mirrors"),
    [
        ("", []),
        (wall("lambertian"), []),
        (wall("mirror"), [1, 2, 3, 4, 5]),
        ('<bsdf type="region">' + wall("mirror", "roof") + wall("isotropic", "side") + "</bsdf>", [1]),
        ('<bsdf type="roughconductor"/>', [1, 2, 3, 4, 5]),
    ],
)
def test_mirrors_have_the_normals_of_the_curved_walls_and_other_walls_are_flat(loaded, words, mirrors):
    """Where normals are interpolated, diffuse walls would lose light."""
    pad, _ = loaded('<string name="cell" value="hemispheric"/>' + words)
    places, surface = places_of(pad), pad.surface
    assert (places.normals is not None) == bool(mirrors)
    if mirrors:
        a, b, c = places.vertices.reshape(-1, 3, 3).transpose(1, 0, 2)
        facet = np.cross(b - a, c - a)
        facet /= np.linalg.norm(facet, axis=1, keepdims=True)
        turned = np.abs(places.normals.reshape(-1, 3, 3) - facet[:, None]).max(axis=(1, 2))
        assert turned[~np.isin(surface.region, mirrors)].max(initial=0) < 1e-4
        roof = surface.region == 1
        outward = (places.vertices.reshape(-1, 3, 3)[roof] - (0, 0, 0.5)) / 1.275
        np.testing.assert_allclose(places.normals.reshape(-1, 3, 3)[roof], -outward, atol=4e-3)


def test_only_cells_that_are_read_are_cut_finely(llvm_mono):
    (state,) = load_path(Pad(rows=1, columns=2), NeoHookean(), [(0, 0, -1)], mesh_size=SIZE)
    whole, part = tessellate(state), tessellate(state, cells=(2,))
    assert np.count_nonzero(part.cell == 2) == np.count_nonzero(whole.cell == 2)
    assert np.count_nonzero(part.cell == 1) == 4 * np.count_nonzero(state.mesh.face_cell == 1)  # as mid-edge nodes need
    edges = np.sort(np.stack([part.triangles, np.roll(part.triangles, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    assert np.all(np.unique(edges, axis=0, return_counts=True)[1] == 2)  # closed


TALL = '<vector name="body" value="1.46, 1.06, 1.5"/>'
FORCE = '<vector name="force" value="{}"/>'


@cache
def lowest_over_the_package(force):
    """mm: least height of the roof over the package, by points of the deformed surface."""
    (state,) = load_path(PAD, NeoHookean(), [force], mesh_size=SIZE)
    surface = tessellate(state, 24)
    corners = surface.vertices[surface.triangles[surface.region == REGIONS["roof"]]].reshape(-1, 3)
    return corners[np.all(np.abs(corners[:, :2]) < (0.73, 0.53), axis=1), 2].min()


@cache
def force_at_touch():
    """N, at which the roof comes down to the package."""
    return brentq(lambda force: lowest_over_the_package((0, 0, force)) - 1.5, -1.5, -1.1, xtol=1e-4)


@pytest.mark.parametrize("asked", ["0, 0, -1.35", "0, 0, -6", "0, 0, -200", "-40, 2, -1.35"])
def test_a_roof_pressed_onto_the_package_is_refused_at_the_load_where_it_happens(loaded, asked):
    """The same whatever is asked for, also beyond where the silicone itself gives way.

    The roof is 1.05 mm above the package; 0.05 mm above a taller one it touches early.
    """
    _, scene = loaded(FORCE.format("0, 0, -1.25"), TALL)
    assert len(taxels_of(scene)) == 1
    with pytest.raises(ComputationError, match="touches a package near .* ends at force") as caught:
        loaded(FORCE.format(asked), TALL)
    limit = [float(word) for word in str(caught.value).split("(")[-1].split(")")[0].split(",")]
    assert limit == [0, 0, pytest.approx(force_at_touch(), rel=3e-3)]


def test_a_roof_pushed_onto_the_package_is_refused_on_its_way_aside(loaded):
    """The package touches where the roof comes down, on the side that it is pushed to."""
    for aside in (2.0, -2.0):
        with pytest.raises(ComputationError, match="touches a package near") as caught:
            loaded(FORCE.format(f"{aside}, 0, -1.25"), TALL)
        message = str(caught.value)
        pushed, _, pressed = (float(word) for word in message.split("(")[-1].split(")")[0].split(","))
        assert pressed == -1.25 and 0 < pushed / aside < 1
        assert lowest_over_the_package((pushed, 0, -1.25)) == pytest.approx(1.5, abs=2e-4)
        assert lowest_over_the_package((pushed + 0.1 * np.sign(aside), 0, -1.25)) < 1.5


def test_what_touches_a_package_is_not_read_by_mitsuba_s_own_integrators_or_written(tmp_path, llvm_mono):
    file = tmp_path / "scene.xml"
    words = SCENE.replace("taxel_tracer", "path").format(FORCE.format("0, 0, -2"), TALL)
    file.write_text(words)
    with pytest.raises(ComputationError, match="touches a package"):
        measure(OpticsScene.from_file(file))
    with pytest.raises(ComputationError, match="touches a package"):
        deform(file, {}, tmp_path / "meshes")


def test_packages_are_tested_again_only_where_they_were_moved(loaded, monkeypatch):
    """One that is raised by 0.02 mm, more than it was below the roof, touches the pad."""
    pad, scene = loaded(FORCE.format("0, 0, -1.25"), TALL)
    tested, state_under = [], type(pad).state_under
    monkeypatch.setattr(type(pad), "state_under", lambda *all: tested.append(1) or state_under(*all))
    (package,) = packages(scene)
    assert not pad.heed(package) and not tested
    assert not pad.heed(package - (0, 0, 0.1)) and len(tested) == 1
    with pytest.raises(ComputationError, match="touches a package"):
        pad.heed(package + (0, 0, 0.02))
    assert len(tested) == 2
    pad.take(load_path(PAD, NeoHookean(), [(0.0, 0.0, -1.0)], mesh_size=SIZE)[0])
    assert not pad.heed(package) and len(tested) == 3


def test_a_package_in_the_silicone_is_refused_at_rest(loaded):
    with pytest.raises(InputError, match="the undeformed pad touches a package"):
        loaded("", '<vector name="body" value="1.46, 1.06, 3"/>')


def test_the_hexagonal_pad_reads_alike_in_its_outer_cells(llvm_mono, agree):
    """Six cells round the middle, each with its reflector along x: those mirrored in the planes x = 0, y = 0 agree."""
    readings = measure(Scene.from_file("hexagonal.xml"), points=1 << 10, seed=3)
    assert len(readings.power) == 7
    agree(readings.power, readings.standard_error, np.full(7, readings.power.mean()))


def test_an_interrupt_while_the_end_of_a_path_is_compared_is_not_swallowed(loaded, monkeypatch):
    """The message of the end is composed when it is read, for which a path on other elements is solved."""

    def interrupted(path):
        raise KeyboardInterrupt

    monkeypatch.setattr(second_ends, "second_meshes", interrupted)
    with pytest.raises(KeyboardInterrupt):
        loaded('<vector name="force" value="8, 0, -0.9"/>')
