"""Scenes at the ends of what the program is for: a right reading with its error, or a message that says what to change.

References are :func:`plate_power` and :func:`image_power`, deterministic quadratures that share no code with the
program, closed forms, and `analog_tracer`, which only releases rays and counts them.
"""

from __future__ import annotations

import numpy as np
import pytest
from plate_reference import DETECTOR, image_power, plate_power

from mitsuba_taxel import ComputationError, InputError, Pad, PadSensor, Scene, Wall, measure

BODY_TOP = 0.5  # mm
ABSORBING = {"type": "wall", "scattering": "absorbing"}
WHITE = {"type": "wall"}


# Narrow gaps


@pytest.mark.parametrize("scattering", ["lambertian", "isotropic"])
@pytest.mark.parametrize("law", ["lambertian", "uniform_solid_angle"])
def test_narrow_gaps_match_quadrature(llvm_mono, agree, law, scattering):
    """Plates 0.1 and 0.02 mm above the LED's plane."""
    heights = (0.1, 0.02)
    readings = [measure(plate(z=z, law=law, scattering=scattering), points=1 << 15, seed=1) for z in heights]
    reference = [plate_power(z, law, scattering) for z in heights]
    assert max(r.relative_error for r in readings) < 2e-3
    agree(*column(readings), reference)


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


@pytest.mark.parametrize("scattering", ["lambertian", "isotropic", "mirror"])
def test_a_plate_that_touches_lets_nothing_across(llvm_mono, scattering):
    touching = measure(plate(z=0.0, scattering=scattering), points=1 << 12, seed=2)
    assert np.array_equal(touching.replicates, np.zeros((32, 1)))
    assert "no light found on taxel 1" in touching.notes


@pytest.mark.parametrize("scattering, order", [("lambertian", 2), ("isotropic", 1)])
def test_a_plate_that_all_but_touches_lets_little_across(llvm_mono, scattering, order):
    """A gap of 1e-5 mm: to a percent what quadrature says of 1e-3 mm, as light in a narrow gap goes with z**order."""
    reading = measure(plate(z=1e-5, scattering=scattering), points=1 << 12, seed=2)
    limit = plate_power(1e-3, "uniform_solid_angle", scattering) * 1e-2**order
    assert limit < 2e-6 and reading.power[0] == pytest.approx(limit, rel=0.01)
    assert reading.relative_error < 1e-2
    mirrored = measure(plate(z=1e-5, scattering="mirror"), points=1 << 12, seed=2)
    assert mirrored.power[0] == 0 and "no light found on taxel 1" in mirrored.notes


# Where LED and phototransistor lie


def test_led_and_phototransistor_that_overlap_in_a_package_are_refused(llvm_mono):
    with pytest.raises(InputError, match=r"spacing = 0.3 is not allowed: from 0.385 \(LED and phototransistor touch"):
        plate(spacing=0.3).load()


@pytest.mark.parametrize(
    "change, refused",
    [
        ({"x": 0.38}, "annular_led: the rectangle 'detector' lies in its plane"),
        ({"x": 0.4, "turn": 30}, "annular_led: the rectangle 'detector' lies in its plane"),
        ({"board": 0.0}, "annular_led: the rectangle 'board' lies in its plane"),
        ({"board": 1e-6}, "annular_led: the rectangle 'board' lies in its plane"),
        ({"led_half": 1.0}, "phototransistor: the rectangle 'led' lies in its plane"),
    ],
)
def test_rectangles_that_overlap_in_one_plane_are_refused(llvm_mono, change, refused):
    """A ray hits either of them, as it happens, and readings would be wrong without a word."""
    with pytest.raises(InputError, match=refused + " and overlaps it.*: move or shrink one of them"):
        measure(rectangles(**change), points=256)


@pytest.mark.parametrize("change", [{"x": 0.385 + 1e-5}, {"x": 0.276, "turn": 90}, {"board": -0.01}, {"plate": 0.0}])
def test_rectangles_that_only_touch_are_read(llvm_mono, agree, change):
    """Side by side, one after a quarter turn, on a board beneath, or with the plate on them: as hits alone see it."""
    ours = measure(rectangles(**change), points=1 << 13, seed=1)
    theirs = measure(rectangles(**change, strategy="unidirectional_hits"), points=1 << 14, seed=2)
    if change == {"plate": 0.0}:
        assert ours.power[0] == theirs.power[0] == 0
        assert "no light found on taxel 1" in ours.notes
    else:
        agree(ours.power, ours.standard_error, theirs.power, theirs.standard_error)


@pytest.mark.parametrize("where", ["facing away", "behind the body"])
def test_a_phototransistor_that_sees_nothing_reads_nothing_and_says_so(llvm_mono, where):
    """With its back to the plate, or inside an absorbing block."""
    change = {"facing": -1} if where == "facing away" else {"block": True}
    reading = measure(rectangles(**change), points=1 << 12)
    assert np.array_equal(reading.replicates, np.zeros((32, 1)))
    assert "no light found on taxel 1" in reading.notes
    assert measure(rectangles(), points=256).power[0] > 0.01


# Grazing light, narrow and wide cones, little light


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


# Closed cells that reflect everything


def test_a_closed_white_cell_agrees_with_counted_rays(llvm_mono, agree):
    """All light ends on the absorbing package; how much of it on the phototransistor, counting rays tells as well."""
    ours = measure(closed_cell(body=ABSORBING), points=1 << 13, seed=1)
    theirs = measure(closed_cell(body=ABSORBING, integrator="analog_tracer"), points=1 << 15, seed=2)
    assert max(ours.relative_error, theirs.relative_error) < 4e-3
    agree(ours.power, ours.standard_error, theirs.power, theirs.standard_error)


def test_a_cell_that_only_led_and_phototransistor_absorb_in_agrees_with_counted_rays(llvm_mono, agree):
    """Some hundred reflections on a path."""
    cover = {"type": "region", "body": WHITE}
    ours = measure(closed_cell(body=cover), points=1 << 8, seed=3)
    theirs = measure(closed_cell(body=cover, integrator="analog_tracer"), points=1 << 10, seed=4)
    assert max(ours.relative_error, theirs.relative_error) < 1e-2
    agree(ours.power, ours.standard_error, theirs.power, theirs.standard_error)


@pytest.mark.parametrize("strategy", ["all", "unidirectional_hits"])
def test_all_light_ends_on_the_phototransistor_if_nothing_else_absorbs(llvm_mono, agree, strategy):
    """1 W: nothing is lost in the corners and edges of the cell in hundreds of reflections."""
    cover = {"type": "region", "body": WHITE, "led": WHITE}
    reading = measure(closed_cell(body=cover, strategy=strategy), points=1 << 10, seed=5)
    assert reading.power[0] == pytest.approx(1, abs=1e-4 + 4 * reading.standard_error[0])
    assert reading.relative_error < 1e-2


# Meshes


def test_a_plate_of_a_million_triangles_reads_as_a_rectangle(llvm_mono, agree, tmp_path):
    mi = llvm_mono
    grid = plate_mesh(mi, cells=708)
    assert len(mi.traverse(grid)["faces"]) // 3 == 1_002_528
    grid.write_ply(str(tmp_path / "plate.ply"))
    ply = {"type": "ply", "filename": str(tmp_path / "plate.ply"), "face_normals": True, "bsdf": WHITE}
    coarse, fine = (
        measure(plate(z=0.3, scattering="lambertian", plate=shape), points=1 << 13, seed=6) for shape in (None, ply)
    )
    assert sum(fine.seconds.values()) < 30
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


def test_a_guide_takes_degenerate_triangles(llvm_mono, agree):
    """A dome over the photo-reflector, with the attributes of a pad and thousands of triangles without area."""
    readings, guides = [], []
    for degenerate in (False, True):
        live = domed_cell(llvm_mono, degenerate).load()
        readings.append(measure(live, points=1 << 12, seed=8 + degenerate))
        guides.append(live.sensors()[0].guide[1])
    clean, dirty = readings
    assert guides[1] is not None and guides[1].area[0] == pytest.approx(guides[0].area[0], rel=1e-6)
    assert np.all(np.isfinite(dirty.replicates)) and dirty.relative_error < 5e-3
    agree(dirty.power, dirty.standard_error, clean.power, clean.standard_error)


def test_a_cell_without_area_has_no_guide(llvm_mono):
    """A mesh with the attributes of a pad, all of whose triangles are points: it reads what is there without it."""
    mi = llvm_mono
    points = np.repeat(np.array([[0.0, 0, 1], [0.2, 0, 1], [0, 0.2, 1]]), 3, axis=0)
    mesh = mesh_of(mi, points, np.arange(9).reshape(3, 3), region=1, cell=1)
    scene = plate(z=0.7, scattering="lambertian").source
    without = measure(Scene(scene), points=512)
    reading = measure(Scene({**scene, "mesh": mesh}), points=512)
    assert reading.power == pytest.approx(without.power, rel=1e-5)


# A cell that nearly closes

SOFT_PAD = Pad("cylindrical", rows=1, columns=1, height=3.0, cell_height=0.85)


@pytest.mark.parametrize("roof", ["isotropic", "lambertian"])
def test_a_cell_that_nearly_closes_agrees_with_hits_and_counted_rays(llvm_mono, agree, own_solutions, roof):
    """Pressed until its roof comes down to less than 0.1 mm above the LED's plane."""
    scene = soft_sensor(force=-1.3, roof=Wall(roof, 0.9)).scene()
    live = scene.load()
    pad = next(shape for shape in live.shapes() if hasattr(shape, "pad"))
    parameters = llvm_mono.traverse(pad)
    corners = np.array(parameters["vertex_positions"]).reshape(-1, 3)[np.array(parameters["faces"])]
    lowest = corners[np.repeat(np.array(parameters["face_region"]) == 1, 3), 2].min()
    assert BODY_TOP < lowest < BODY_TOP + 0.1

    ours = measure(scene, points=1 << 13, seed=1, mechanics_error=False)
    assert np.all(np.isfinite(ours.replicates)) and ours.relative_error < 5e-3
    assert pad.state.error is not None
    for integrator in ({"type": "taxel_tracer", "strategy": "unidirectional_hits"}, {"type": "analog_tracer"}):
        other = Scene({**scene.source, "integrator": integrator})
        theirs = measure(other, points=1 << 14, seed=2, mechanics_error=False)
        agree(ours.power, ours.standard_error, theirs.power, theirs.standard_error)


def test_a_force_that_the_pad_cannot_bear_is_refused(llvm_mono, own_solutions):
    """By what comes first: the touch of a package, or what the pad itself can bear."""
    end = r": the load path ends at force = \(0, 0, -\d.*\) N"
    parts = soft_sensor(force=-10.0).scene().source
    with pytest.raises(ComputationError, match="touches a package .*" + end):
        Scene(parts).load()
    with pytest.raises(ComputationError, match=r"cannot be loaded further \(.*\)" + end):
        Scene({name: part for name, part in parts.items() if name != "photo_reflector"}).load()


# Size and place


@pytest.mark.parametrize("z", [0.1, 0.7])
@pytest.mark.parametrize("scattering", ["isotropic", "mirror"])
def test_size_and_place_of_a_plate_do_not_matter(llvm_mono, agree, scattering, z):
    """100 times larger and smaller, in metres, and 200 mm away: as in place, and as quadrature says."""
    mi = llvm_mono
    transform = mi.ScalarTransform4f()
    motions = [transform.scale(scale) for scale in (1, 100, 0.01, 0.001)] + [transform.translate([200, -150, 120])]
    points = 1 << (14 if scattering == "mirror" else 12)
    readings = [measure(plate(z=z, scattering=scattering, motion=motion), points=points, seed=9) for motion in motions]
    power, error = column(readings)
    law = "uniform_solid_angle"
    reference = image_power(z, law) if scattering == "mirror" else plate_power(z, law, scattering)
    assert np.all(error < 2e-3 * power)
    assert np.all(np.abs(power / power[0] - 1) < 1e-3)  # the same random numbers
    agree(power, error, np.full(len(motions), reference))


def test_size_and_place_of_a_pad_do_not_matter(llvm_mono, agree, own_solutions):
    """A pad under a force with all that stands in it, in metres, 100 times larger, and 200 mm away."""
    transform = llvm_mono.ScalarTransform4f()
    motions = [transform, transform.scale(1e-3), transform.scale(100), transform.translate([200, -150, 120])]
    scene = soft_sensor(force=-1.0, roof=Wall("lambertian", 0.9), side=Wall("lambertian", 0.5)).scene().source
    readings = [measure(moved(scene, motion), points=1 << 12, seed=10, mechanics_error=False) for motion in motions]
    power, error = column(readings)
    assert np.all(error < 2e-3 * power)
    agree(power[1:], error[1:], np.full(3, power[0]), error[0])
    assert np.all(np.abs(power / power[0] - 1) < 2e-3)  # the same random numbers


def test_nine_hundred_taxels_read_alike(llvm_mono, agree):
    """An array 107 mm wide under one plate: as one alone, and as quadrature says for a plate of that extent."""
    array = plate(z=0.3, law="lambertian", scattering="lambertian", width=140.0, rows=30, columns=30)
    single = plate(z=0.3, law="lambertian", scattering="lambertian", width=140.0)
    readings, alone = measure(array, points=256, seed=11), measure(single, points=1 << 13, seed=12)
    assert readings.power.shape == (900,) and readings.relative_error < 1e-2
    reference = plate_power(0.3, "lambertian", "lambertian", side=140.0)
    agree(alone.power, alone.standard_error, reference)
    agree(readings.power, readings.standard_error, np.full(900, reference))


# Scenes


@pytest.fixture
def own_solutions(tmp_path_factory, monkeypatch):
    """Keep the solutions of these tests away from the user's."""
    monkeypatch.setenv("MITSUBA_TAXEL_CACHE", str(tmp_path_factory.getbasetemp() / "extremes"))


def plate(
    *,
    z: float = 0.7,
    law: str = "uniform_solid_angle",
    scattering: str = "lambertian",
    spacing: float = 0.7,
    offset: float = 0.0,
    width: float = 4.0,
    cone_angle: float | None = None,
    power: float = 1.0,
    motion=None,
    plate=None,
    integrator=None,
    **array,
) -> Scene:
    """What `plate.xml` holds, with a square plate at ``z`` above the LED's plane, all of it moved by ``motion``."""
    import mitsuba as mi

    motion = mi.ScalarTransform4f() if motion is None else motion
    flipped = mi.ScalarTransform4f().translate([offset, 0, BODY_TOP + z]).rotate([1, 0, 0], 180).scale(0.5 * width)
    led = {"type": "annular_led", "law": law, "hole": 0.0, "power": power}
    if cone_angle is not None:
        led["cone_angle"] = cone_angle
    rectangle = {"type": "rectangle", "to_world": motion @ flipped, "bsdf": {"type": "wall", "scattering": scattering}}
    return Scene(
        {
            "type": "scene",
            "integrator": integrator or {"type": "taxel_tracer"},
            "photo_reflector": {
                "type": "photo_reflector",
                "spacing": spacing,
                "to_world": motion,
                "led": led,
                "phototransistor": {"type": "phototransistor"},
                **array,
            },
            "plate": plate or rectangle,
        }
    )


def rectangles(
    *, x=0.7, turn=0.0, facing=1, led_half=0.125, board=None, block=False, plate=0.7, strategy="all"
) -> Scene:
    """LED and phototransistor on a rectangle each, in one plane under a Lambertian plate, and a board or a block."""
    import mitsuba as mi

    transform = mi.ScalarTransform4f()
    half = [0.5 * DETECTOR[0], 0.5 * DETECTOR[1], 1]
    detector = transform.translate([x, 0, 0]).rotate([0, 0, 1], turn).rotate([1, 0, 0], 90 - 90 * facing).scale(half)
    scene = {
        "type": "scene",
        "integrator": {"type": "taxel_tracer", "strategy": strategy},
        "led": {
            "type": "rectangle",
            "to_world": transform.scale(led_half),
            "bsdf": ABSORBING,
            "emitter": {"type": "annular_led", "hole": 0.0},
        },
        "detector": {
            "type": "rectangle",
            "to_world": detector,
            "bsdf": ABSORBING,
            "sensor": {"type": "phototransistor"},
        },
        "plate": {
            "type": "rectangle",
            "to_world": transform.translate([0, 0, plate]).rotate([1, 0, 0], 180).scale(2),
            "bsdf": WHITE,
        },
    }
    if board is not None:
        scene["board"] = {"type": "rectangle", "to_world": transform.translate([0, 0, board]), "bsdf": ABSORBING}
    if block:
        middle = transform.translate([x, 0, 0.1]).scale([0.5, 0.4, 0.2])
        scene["block"] = {"type": "cube", "to_world": middle, "bsdf": ABSORBING}
    return Scene(scene)


def closed_cell(*, body, integrator: str = "taxel_tracer", strategy: str = "all") -> Scene:
    """A photo-reflector in a closed box of reflectance 1, 2.4 x 2 x 1.3 mm, whose floor cuts through the package."""
    import mitsuba as mi

    box = mi.ScalarTransform4f().translate([0, 0, 0.8]).scale([1.2, 1.0, 0.65])
    scene = plate(law="lambertian").source
    method = {"type": integrator, "strategy": strategy} if integrator == "taxel_tracer" else {"type": integrator}
    package = {**scene["photo_reflector"], "bsdf": body}
    cell = {"type": "cube", "to_world": box, "bsdf": WHITE}
    return Scene({"type": "scene", "integrator": method, "photo_reflector": package, "plate": cell})


def soft_sensor(force: float, roof=None, side=None) -> PadSensor:
    """A pad of one low cell, of a material ten times softer than the usual one."""
    from mitsuba_taxel.mechanics import NeoHookean

    walls = {name: wall for name, wall in (("roof", roof), ("side", side)) if wall is not None}
    return PadSensor(pad=SOFT_PAD, material=NeoHookean(youngs_modulus=0.416), force=(0, 0, force), **walls)


def moved(scene: dict, motion) -> Scene:
    """A scene whose shapes are moved and scaled."""
    import mitsuba as mi

    shapes = {name: part for name, part in scene.items() if isinstance(part, dict) and name != "integrator"}
    return Scene(
        {
            **scene,
            **{
                name: {**part, "to_world": motion @ part.get("to_world", mi.ScalarTransform4f())}
                for name, part in shapes.items()
            },
        }
    )


# Meshes to put into scenes


def mesh_of(mi, vertices, triangles, bsdf=WHITE, **attributes):
    """An ``mi.Mesh`` with flat normals; ``attributes`` are numbers of its faces."""
    props = mi.Properties()
    props["bsdf"] = mi.load_dict(bsdf)
    props["face_normals"] = True
    mesh = mi.Mesh("mesh", len(vertices), len(triangles), props=props)
    parameters = mi.traverse(mesh)
    parameters["faces"] = np.asarray(triangles, dtype=np.uint32).ravel()
    parameters["vertex_positions"] = np.asarray(vertices, dtype=np.float32).ravel()
    parameters.update()
    for name, values in attributes.items():
        values = np.broadcast_to(np.asarray(values, dtype=np.float32), len(triangles))
        mesh.add_attribute(f"face_{name}", 1, np.ascontiguousarray(values))
    return mesh


def grid_of(cells: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles of [-1, 1]² at z = 0, which face +z."""
    line = np.linspace(-1, 1, cells + 1)
    x, y = np.meshgrid(line, line)
    number = np.arange((cells + 1) ** 2).reshape(cells + 1, -1)
    a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]
    triangles = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    return np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1), triangles


def with_degenerate(vertices: np.ndarray, triangles: np.ndarray, before: float):
    """Also triangles of one vertex, of two, of three on a line, and the same moved by ``before`` along z."""
    first, second, third = triangles.T
    count = len(vertices)
    middle = 0.5 * (vertices[first] + vertices[second])
    third_on_line = count + np.arange(len(triangles))
    flat = np.concatenate(
        [
            np.stack([first, first, first], axis=1),
            np.stack([first, second, second], axis=1),
            np.stack([first, third, first], axis=1),
            np.stack([first, second, third_on_line], axis=1),
        ]
    )
    vertices = np.concatenate([vertices, middle])
    return (
        np.concatenate([vertices, vertices + [0, 0, before]]),
        np.concatenate([triangles, flat, flat + len(vertices)]),
    )


def plate_mesh(mi, cells: int, degenerate: bool = False, bsdf=WHITE):
    """A plate 4 mm wide, 0.3 mm above the LED's plane and facing down, in 2 cells² triangles."""
    vertices, triangles = grid_of(cells)
    if degenerate:
        vertices, triangles = with_degenerate(vertices, triangles, before=0.05)
    return mesh_of(mi, vertices * [2, -2, -1] + [0, 0, BODY_TOP + 0.3], triangles, bsdf)


def domed_cell(mi, degenerate: bool) -> Scene:
    """A photo-reflector under half a sphere of radius 1.3 mm, open below, that is a pad's mesh to the guide."""
    square, triangles = grid_of(16)
    polar = 0.5 * np.pi * np.abs(square[:, :2]).max(axis=1)
    azimuth = np.arctan2(square[:, 1], square[:, 0])
    dome = np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=1)
    if degenerate:
        dome, triangles = with_degenerate(dome, triangles, before=-0.1)
    cover = {"type": "region", "roof": {"type": "wall", "reflectance": 0.9}}
    mesh = mesh_of(mi, 1.3 * dome, triangles[:, ::-1], cover, region=1, cell=1)
    return Scene({**plate().source, "plate": mesh})


# Readings


def column(readings) -> tuple[np.ndarray, np.ndarray]:
    """Powers and standard errors of scenes with one taxel."""
    return np.array([r.power[0] for r in readings]), np.array([r.standard_error[0] for r in readings])
