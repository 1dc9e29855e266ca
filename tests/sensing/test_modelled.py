"""Some hundred scenes that are not what they seem: each is read right, or refused with a reason; none is read wrongly.

Right is what quadrature says (`plate_power` and `image_power`), or Mitsuba's ``path``.
"""

from __future__ import annotations

import re
from functools import partial

import numpy as np
import pytest
from plate_reference import DETECTOR, image_power, plate_power
from plate_scenes import moved, rectangles

from mitsuba_taxel import ComputationError, InputError, Scene, measure

ABSORBING = {"type": "wall", "scattering": "absorbing"}
WHITE = {"type": "wall"}
ISOTROPIC = {"type": "wall", "scattering": "isotropic"}
OURS = ("taxel_tracer", "taxel_path", "analog_tracer")
MEDIUM = {"type": "homogeneous"}


def plate(integrator="taxel_tracer", *, z=0.7, at=(0, 0, 0), wall=None, led=None, sensor=None, more=None, **settings):
    """A plate over a photo-reflector, all of it moved to ``at``."""
    import mitsuba as mi

    transform = mi.ScalarTransform4f()
    place = transform.translate(list(at))
    return {
        "type": "scene",
        "integrator": {"type": integrator, **settings},
        "reflector": {
            "type": "photo_reflector",
            "spacing": 0.7,
            "to_world": place,
            "led": {"type": "annular_led", "law": "lambertian", "hole": 0.0, **(led or {})},
            "phototransistor": {"type": "phototransistor", **(sensor or {})},
        },
        "plate": {
            "type": "rectangle",
            "to_world": place @ transform.translate([0, 0, 0.5 + z]).rotate([1, 0, 0], 180).scale(2),
            "bsdf": wall or WHITE,
        },
        **(more or {}),
    }


def package(x: float, y: float = 0.0, z: float = 0.0) -> dict:
    import mitsuba as mi

    led, sensor = {"type": "annular_led", "power": 0.5}, {"type": "phototransistor", "quantum_efficiency": 0.5}
    place = mi.ScalarTransform4f().translate([x, y, z])
    return {"type": "photo_reflector", "to_world": place, "spacing": 0.7, "led": led, "sensor": sensor}


def shape(kind: str, at, size, **more) -> dict:
    import mitsuba as mi

    place = mi.ScalarTransform4f().translate(list(at)).scale(list(size))
    return {"type": kind, "to_world": place, "bsdf": WHITE, **more}


def lamp(kind: str) -> dict:
    import mitsuba as mi

    picture = mi.Bitmap(np.ones((8, 16, 3), dtype=np.float32))
    about = {"envmap": {"bitmap": picture}, "projector": {"irradiance": {"type": "bitmap", "bitmap": picture}}}
    return {"type": kind, **about.get(kind, {})}


def cavity(integrator: str, reflectance=1.0) -> dict:
    """A closed box round a package, all of which reflects."""
    wall = {"type": "wall", "reflectance": reflectance}
    scene = plate(integrator, more={"box": shape("cube", (0, 0, 0.9), (1.5, 1.5, 1), bsdf=wall)})
    del scene["plate"]
    scene["reflector"]["cover"] = {"type": "region", "body": wall, "led": wall, "phototransistor": wall}
    return scene


def _refused():
    """Name, how to make the scene, and what is said of it."""
    for name in (*OURS, "path", "ptracer"):
        inside = {"more": {"fog": lambda: shape("cube", (0, 0, 0.8), (2, 2, 0.1), interior=MEDIUM)}}
        yield f"fog in a cube, {name}", name, inside, "participating medium"
        yield (
            f"fog round a ball, {name}",
            name,
            {"more": {"ball": lambda: shape("sphere", (0, 0, 5), (1, 1, 1), exterior=MEDIUM)}},
            "participating medium",
        )
    for name in ("depth", "direct", "direct_projective", "prb", "prb_basic", "prb_projective", "prbvolpath"):
        yield f"integrator {name}", name, {}, "integrator .* does not estimate the entire power"
    yield "integrator aov", "aov", {"aovs": "dd:depth", "nested": {"type": "path"}}, "integrator aov does not"
    yield "integrator moment", "moment", {"nested": {"type": "path"}}, "integrator moment does not"
    for name in ("path", "volpath", "volpathmis"):
        yield f"hidden emitters, {name}", name, {"hide_emitters": True}, "hide_emitters = true is not allowed"
    mirror, mixed = {"type": "wall", "scattering": "mirror"}, {"specular": 0.5, "lambertian": 0.5}
    yield "a mirror, ptracer", "ptracer", {"wall": mirror}, "sees no light via mirrors"
    yield "half a mirror, ptracer", "ptracer", {"wall": {**mirror, "scattering": "mixed", **mixed}}, "via mirrors"
    yield "a pane, ptracer", "ptracer", {"wall": {"type": "thindielectric"}}, "via mirrors"
    for name in ("independent", "stratified", "multijitter", "orthogonal", "ldsampler"):
        yield (
            f"sampler {name}",
            OURS[len(name) % 3],
            {"sensor": {"sampler": {"type": name}}},
            "its sampler must be owen",
        )
    parts = {
        "package on package": lambda: package(0),
        "package over package": lambda: package(0.3),
        "package beside, but for a hair": lambda: package(1.0, 0.1),
        "cube up to the LED's plane": lambda: shape("cube", (-0.35, 0, 0.4), (0.1, 0.1, 0.1)),
        "cube up to the phototransistor's": lambda: shape("cube", (0.35, 0, 0.4), (0.05, 0.05, 0.1)),
        "disk on the LED": lambda: shape("disk", (-0.35, 0, 0.5), (0.05, 0.05, 1)),
        "disk on the phototransistor": lambda: shape("disk", (0.55, 0, 0.5), (0.1, 0.1, 1)),
        "rectangle on both": lambda: shape("rectangle", (0, 0, 0.5), (0.5, 0.5, 1)),
    }
    for what, make in parts.items():
        for name in ("taxel_tracer", "path"):
            yield f"{what}, {name}", name, {"more": {"other": make}}, "lies in its plane and overlaps it"
    for distance in (400, 1e3, 1e5, 1e8):
        for name in OURS:
            yield f"{distance:g} mm away, {name}", name, {"at": (0, -0.6 * distance, 0.8 * distance)}, "from the origin"
    yield "1e9 mm away", "taxel_tracer", {"at": (1e9, 0, 0)}, "numbers of at most 1e.08 are needed"
    for name in ("path", "volpath", "ptracer"):
        yield f"40 mm away, {name}", name, {"at": (40, 0, 0)}, "from the origin, where Mitsuba's own"
    for law, z in (("lambertian", 0.02), ("lambertian", 0.05), ("uniform_solid_angle", 0.02)):
        yield f"gap of {z} mm, {law}", "taxel_path", {"z": z, "led": {"law": law}}, "hardly any path finds the light"
    yield "isotropic from the detector", "taxel_path", {"wall": ISOTROPIC}, "detector are unbounded"
    half = {"type": "wall", "scattering": "mixed", "isotropic": 0.5, "specular": 0.5}
    yield "half isotropic from the detector", "taxel_path", {"wall": half}, "detector are unbounded"
    polar = {"led": {"law": "uniform_polar_angle"}}
    yield "no bound on the axis", "taxel_path", polar, "unbounded on the axis"
    for kind in ("constant", "point", "spot"):
        yield (
            f"emitter {kind}",
            "taxel_tracer",
            {"more": {"lamp": {"type": kind}}},
            "every emitter must be an annular_led",
        )
    for name in ("path", "volpath", "volpathmis", "ptracer"):
        for kind in ("point", "spot", "directional", "projector", "constant", "envmap"):
            if name == "ptracer" or kind not in ("constant", "envmap"):
                said = "from a point or in one direction" if kind not in ("constant", "envmap") else "use path"
                yield f"emitter {kind}, {name}", name, {"more": {"lamp": partial(lamp, kind)}}, f"{kind} .*{said}"
        beam = {"more": {"beam": lambda: shape("rectangle", (0, 0, 9), (1, 1, 1), emitter={"type": "directionalarea"})}}
        yield f"emitter directionalarea, {name}", name, beam, "from a point or in one direction"
    for name in ("taxel_tracer", "path"):
        for kind in ("annular_led", "area", "directionalarea"):
            yield f"loose {kind}, {name}", name, {"more": {"lamp": {"type": kind}}}, f"{kind}: it must be nested in a"
    meter = {"more": {"meter": lambda: shape("sphere", (0, 0, 9), (1, 1, 1), sensor={"type": "irradiancemeter"})}}
    for name in ("taxel_tracer", "path"):
        yield f"another sensor, {name}", name, meter, "every sensor must be a phototransistor"
    film = {"type": "hdrfilm", "width": 4, "height": 4, "crop_width": 2, "crop_height": 2, "rfilter": {"type": "box"}}
    film |= {"crop_offset_x": 0, "crop_offset_y": 0}
    for name in ("taxel_tracer", "path"):
        yield f"a part of the film, {name}", name, {"sensor": {"film": film}}, "a crop is not allowed"
    sieve = {"type": "mask", "opacity": 0.3, "nested": WHITE}
    yield (
        "a white sieve, path",
        "path",
        {"wall": sieve},
        "path loses light that passes through a partly transparent mask",
    )
    for name in ("taxel_tracer", "path"):
        for kind, share, value in (("diffuse", "reflectance", 1.5), ("conductor", "specular_reflectance", -0.1)):
            wall = {"type": kind, share: value}
            yield f"{kind} of {value}, {name}", name, {"wall": wall}, f"{share} = {value} is not allowed"
        bumpy = {"type": "bumpmap", "bumps": {"type": "checkerboard"}, "nested": {"type": "diffuse"}}
        yield f"bumps without slopes, {name}", name, {"wall": bumpy}, "bumpmap: .* not implemented"
    for name in ("taxel_tracer", "path"):
        line = partial(shape, "rectangle", (0, 0, 3), (0, 1, 1))
        yield f"a plate of no width, {name}", name, {"more": {"other": line}}, "rectangle has no area: its to_world"
    labels = {
        "label on the plate": lambda: shape("rectangle", (1.8, 0, 1.2), (0.5, 0.5, 1), bsdf=ABSORBING),
        "disk turned to it": lambda: shape("disk", (0, 2.3, 1.2), (0.5, 0.5, -1), bsdf=ABSORBING),
    }
    for what, make in labels.items():
        yield f"{what}, taxel_tracer", "taxel_tracer", {"more": {"other": make}}, "overlap in one plane"


REFUSED = {name: rest for name, *rest in _refused()}


@pytest.mark.parametrize("integrator, change, message", REFUSED.values(), ids=REFUSED.keys())
def test_what_is_not_modelled_is_refused(llvm_mono, integrator, change, message):
    more = {name: part() if callable(part) else part for name, part in change.get("more", {}).items()}
    scene = Scene(plate(integrator, **{**change, "more": more}))
    with pytest.raises((InputError, ComputationError)) as caught:
        measure(scene, points=16)
    assert re.search(message, str(caught.value)) and "\n" not in str(caught.value)


@pytest.mark.parametrize("integrator", [*OURS, "path", "volpath"])
def test_light_that_never_ends_is_refused(llvm_mono, integrator):
    with pytest.raises(ComputationError, match="light in a closed cavity is not absorbed anywhere"):
        measure(Scene(cavity(integrator)), points=16)


@pytest.mark.parametrize(
    "scene, message",
    [
        (lambda: cavity("taxel_tracer"), "light in a closed cavity is not absorbed anywhere"),
        (lambda: plate("taxel_path", z=0.02), "hardly any path finds the light"),
    ],
)
def test_an_image_by_our_integrators_refuses_as_readings_do(llvm_mono, scene, message):
    with pytest.raises(RuntimeError) as caught:  # Dr.Jit puts its own words round it
        llvm_mono.render(llvm_mono.load_dict(scene()), sensor=0, spp=16)
    assert isinstance(caught.value.__cause__, ComputationError) and message in str(caught.value.__cause__)


@pytest.mark.parametrize("integrator", ["taxel_path", "path"])
def test_instances_are_refused(llvm_mono, integrator):
    """An isotropic wall in one would give `taxel_path` weights without bound, and nobody could tell."""
    group = {"type": "shapegroup", "plate": shape("rectangle", (0, 0, 3), (1, 1, 1), bsdf=ISOTROPIC)}
    copy = {"type": "instance", "ref": {"type": "ref", "id": "group"}}
    source = plate(integrator, more={"group": group, "copy": copy})
    with pytest.raises(InputError, match="instance is not allowed"):
        measure(Scene(source), points=16)


def test_light_that_ends_after_long_is_read(llvm_mono, agree):
    """A hundred reflections: as Mitsuba counts them."""
    ours = measure(Scene(cavity("taxel_tracer", 0.99)), points=512, seed=1)
    theirs = measure(Scene(cavity("path", 0.99)), points=512, seed=2)
    agree(ours.power, ours.standard_error, theirs.power, theirs.standard_error)


@pytest.mark.parametrize("change", ["moved", "scaled", "turned inside out"])
def test_a_package_changed_in_a_loaded_scene_is_refused(llvm_mono, change):
    live = Scene(plate()).load()
    before = measure(live, points=16)
    parameters = llvm_mono.traverse(live)
    name = "reflector.faces" if change == "turned inside out" else "reflector.vertex_positions"
    value = np.array(parameters[name])
    parameters[name] = {"moved": value + 0.3, "scaled": value * 1.05}.get(change, value[::-1].copy())
    parameters.update()
    with pytest.raises(InputError, match="photo_reflector: its vertex_positions or faces were changed"):
        measure(live, points=16)
    parameters[name] = value
    parameters.update()
    assert np.allclose(measure(live, points=16).power, before.power)


def test_a_rectangle_moved_in_a_loaded_scene_takes_its_led_along(llvm_mono):
    mi = llvm_mono
    readings = []
    for x in (-0.35, -0.6):
        live = rectangles(x=0.35 - x).load()
        readings.append(measure(live, points=256, seed=1).power)
    live = rectangles(x=0.7).load()
    measure(live, points=256, seed=1)
    parameters = mi.traverse(live)
    half = [0.5 * DETECTOR[0], 0.5 * DETECTOR[1], 1]
    parameters["detector.to_world"] = mi.Transform4f().translate([0.95, 0, 0]).scale(half)
    parameters.update()
    assert np.allclose(measure(live, points=256, seed=1).power, readings[1], rtol=1e-5)
    assert not np.allclose(*readings, rtol=1e-2)


READ_BY = [
    *((name, law) for law in ("lambertian", "mirror") for name in OURS),
    *((name, "isotropic") for name in OURS if name != "taxel_path"),
]


@pytest.mark.parametrize("integrator, scattering", READ_BY)
@pytest.mark.parametrize("distance", [60, 200])
def test_away_from_the_origin_readings_are_right(llvm_mono, agree, scattering, distance, integrator):
    wall = {"type": "wall", "scattering": scattering}
    scene = plate(integrator, at=(0.6 * distance, -0.64 * distance, 0.48 * distance), wall=wall)
    reading = measure(Scene(scene), points=1 << (14 if scattering == "mirror" else 12), seed=3)
    truth = image_power(0.7) if scattering == "mirror" else plate_power(0.7, "lambertian", scattering)
    agree(reading.power, reading.standard_error, truth)


def test_a_domed_cell_reads_the_same_where_it_is_allowed_to_be(llvm_mono, agree):
    """240 mm away: within 0.05 %, by the same random numbers, of what it reads at the origin."""
    from mitsuba_taxel import Pad, PadSensor, Wall

    source = PadSensor(pad=Pad("hemispheric", rows=1, columns=1), roof=Wall("lambertian", 0.5)).scene().source
    motion = llvm_mono.ScalarTransform4f().translate([-140, 150, 120])
    here, away = (measure(scene, points=1 << 12, seed=1) for scene in (Scene(source), moved(source, motion)))
    change = (away.replicates - here.replicates)[:, 0]
    error = change.std(ddof=1) / np.sqrt(len(change))
    assert abs(change.mean()) < 5e-4 * here.power[0] + 4 * error and error < 5e-4 * here.power[0]


FOREIGN = {
    "glass": {"pane": ("cube", (0, 0, 0.8), (2, 2, 0.1), {"type": "dielectric", "int_ior": 1.5})},
    "thin pane": {"pane": ("rectangle", (0, 0, 0.8), (2, 2, 1), {"type": "thindielectric"})},
    "hole": {"pane": ("rectangle", (0, 0, 0.8), (2, 2, 1), {"type": "null"})},
    "sieve": {"pane": ("rectangle", (0, 0, 0.8), (2, 2, 1), {"type": "mask", "opacity": 0.5, "nested": ABSORBING})},
    "frosted": {"pane": ("cube", (0, 0, 0.8), (2, 2, 0.1), {"type": "roughdielectric", "alpha": 0.2})},
    "ball": {"ball": ("sphere", (0, 0, 1.1), (0.4, 0.4, 0.4), WHITE)},
    "block behind": {"block": ("cube", (-1.5, 0, 0.6), (0.3, 0.3, 0.3), {"type": "plastic"})},
}


@pytest.mark.parametrize("parts", FOREIGN.values(), ids=FOREIGN.keys())
def test_what_mitsuba_has_besides_reads_as_mitsuba_does(llvm_mono, agree, parts):
    def read(integrator, seed):
        more = {name: shape(kind, at, size, bsdf=bsdf) for name, (kind, at, size, bsdf) in parts.items()}
        return measure(Scene(plate(integrator, more=more)), points=2048, seed=seed)

    theirs = read("path", 2)
    for integrator in ("taxel_tracer", "taxel_path"):
        ours = read(integrator, 1)
        agree(ours.power, ours.standard_error, theirs.power, theirs.standard_error)


@pytest.mark.parametrize("integrator", [*OURS, "volpath", "volpathmis"])
def test_a_white_sieve_returns_its_share(llvm_mono, agree, integrator):
    wall = {"type": "mask", "opacity": 0.3, "nested": WHITE}
    reading = measure(Scene(plate(integrator, wall=wall)), points=1024, seed=1)
    agree(reading.power, reading.standard_error, 0.3 * plate_power(0.7, "lambertian", "lambertian"))


def test_mitsubas_integrators_say_that_all_leds_are_lit(llvm_mono):
    """Of two packages that face each other, each phototransistor sees the other's LED, not its own."""
    import mitsuba as mi

    def facing(integrator):
        scene = plate(integrator)
        away = mi.ScalarTransform4f().translate([0, 0, 3]).rotate([1, 0, 0], 180)
        return Scene({**scene, "plate": {**scene["reflector"], "to_world": away}})

    ours, theirs = (measure(facing(name), points=64, seed=1) for name in ("taxel_tracer", "path"))
    assert np.all(ours.power == 0) and np.all(theirs.power > 5e-3)
    assert ours.notes == ["no light found on taxel 1, 2"] and "the light of all LEDs" in theirs.notes[0]


@pytest.mark.parametrize(("x", "angle", "fits"), [(0, 0, False), (5.2, 0, True), (4.4, 45, False), (6.3, 45, True)])
def test_two_pads_in_one_place_are_refused(llvm_mono, x, angle, fits):
    """They are 4.55 mm wide, and 6.4 mm along the diagonal."""
    import mitsuba as mi

    def pad(to_world):
        walls = {"type": "region", "roof": WHITE}
        size = {"rows": 1, "columns": 1, "mesh_size": 2.5}
        return {"type": "deformable_pad", **size, "to_world": to_world, "walls": walls}

    place = mi.ScalarTransform4f()
    pads = {"plate": pad(place), "second": pad(place.translate([x, 0, 0]).rotate([0, 0, 1], angle))}
    scene = Scene({**plate(), **pads})
    if fits:
        assert measure(scene, points=16).power[0] > 0
    else:
        with pytest.raises(InputError, match="two deformable_pads overlap in space"):
            measure(scene, points=16)


@pytest.mark.parametrize("integrator", ["volpath", "volpathmis"])
def test_mitsubas_integrators_of_media_read_them(llvm_mono, agree, integrator):
    """Fog that absorbs everything in its way, and none."""
    fog = {"type": "homogeneous", "albedo": 0.0, "sigma_t": 1e-6}
    pane = {"fog": shape("cube", (0, 0, 0.8), (2, 2, 0.1), bsdf={"type": "null"}, interior=fog)}
    thin = measure(Scene(plate(integrator, more=pane)), points=1024, seed=1)
    agree(thin.power, thin.standard_error, plate_power(0.7, "lambertian", "lambertian"))
    fog = {**fog, "sigma_t": 1e3}
    pane = {"fog": shape("cube", (0, 0, 0.8), (2, 2, 0.1), bsdf={"type": "null"}, interior=fog)}
    assert measure(Scene(plate(integrator, more=pane)), points=256, seed=1).power[0] < 1e-9


@pytest.mark.parametrize("integrator", ["path", "volpath", "volpathmis"])
@pytest.mark.parametrize("kind", ["constant", "envmap"])
def test_light_from_all_around_reads_as_the_closed_form_says(llvm_mono, kind, integrator):
    """Radiance 1 over the hemisphere, onto an ideal phototransistor: pi times its area."""
    scene = rectangles().source | {"integrator": {"type": integrator}, "lamp": lamp(kind)}
    del scene["plate"], scene["led"]
    expected = np.pi * DETECTOR[0] * DETECTOR[1]
    assert measure(Scene(scene), points=64).power[0] == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("integrator", OURS)
@pytest.mark.parametrize("mode", ["forward", "backward"])
def test_derivatives_are_refused_by_name(llvm_mono, integrator, mode):
    import drjit as dr

    live = Scene(plate(integrator)).load()
    parameters = llvm_mono.traverse(live)
    dr.enable_grad(parameters["plate.bsdf.reflectance"])
    parameters.update()
    image = llvm_mono.render(live, parameters, sensor=0, spp=16)
    with pytest.raises(InputError, match="derivatives by dr.forward or dr.backward are not available"):
        dr.forward(parameters["plate.bsdf.reflectance"]) if mode == "forward" else dr.backward(dr.sum(image.array))


@pytest.mark.parametrize("rows", ["0,1\n0.5,1\n1.5708,0\n", "0,1\n1.0472,0.5\n"])
@pytest.mark.parametrize("part", ["led", "sensor"])
def test_a_table_in_radians_is_refused(llvm_mono, tmp_path, part, rows):
    (tmp_path / "table.csv").write_text(rows)
    table = {"law" if part == "led" else "response": "tabulated", "file": str(tmp_path / "table.csv")}
    with pytest.raises(InputError, match="look like radians: degrees are needed"):
        Scene(plate(**{part: table})).load()
