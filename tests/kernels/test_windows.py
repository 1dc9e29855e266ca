"""Dies below windows in scenes, against refraction ray by ray, mirrors in closed form, and bare dies."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
from refraction import escaping, plate_power

from mitsuba_taxel import InputError, Scene, crosstalk, measure
from mitsuba_taxel.check import check_scene
from mitsuba_taxel.parts import edge_positions, leaving_share, mirror_curve, read_part
from mitsuba_taxel.sensing import energy_audit, sample_paths
from mitsuba_taxel.sensing.reading.derivative_values import BY_PATHS
from mitsuba_taxel.specification.photo_reflector import PhotoReflector

VCNT = read_part("vcnt2020")
TRACERS = ("taxel_tracer", "taxel_path")
DEEP = replace(
    VCNT,
    emitter=replace(VCNT.emitter, die_depth=0.3, y=-0.1, window_width=0.5, window_length=0.9),
    detector=replace(VCNT.detector, die_depth=0.05, y=0.2, window_shape="rectangle", window_width=0.45),
)
"""Windows cut light, and dies lie at different depths beside the middle line."""


def written(part, folder) -> str:
    """The file of a part."""
    lines = [f"{name} = {value!r}" for name, value in asdict(part).items() if name in ("title", "source")]
    lines += [f"body = {list(part.body)}", f"wavelength = {part.wavelength}", f"resin_index = {part.resin_index}"]
    for name in ("emitter", "detector"):
        given = {key: value for key, value in asdict(getattr(part, name)).items() if value is not None}
        lines += [f"[{name}]", *(f"{key} = {value!r}" for key, value in given.items())]
    (folder / "mine.toml").write_text("\n".join(lines))
    return str(folder / "mine.toml")


def plate(part, height, scattering="lambertian", *, half=2.0, centre=(0.0, 0.0), motion=None, method=None, **reflector):
    """A square plate at a height above the windows of a part, all of it moved."""
    import mitsuba as mi

    motion = motion or mi.ScalarTransform4f()
    place = mi.ScalarTransform4f().translate([*centre, 0.8 + height]).rotate([1, 0, 0], 180).scale(half)
    wall = {"type": "wall", "scattering": scattering}
    return Scene(
        {
            "type": "scene",
            "integrator": {"type": "taxel_tracer"} if method is None else method,
            "reflector": {"type": "photo_reflector", "part": part, "to_world": motion, **reflector},
            "plate": {"type": "rectangle", "to_world": motion @ place, "bsdf": wall},
        }
    )


def test_the_curve_of_the_vcnt2020_under_a_mirror(agree, llvm_mono):
    heights = np.array(VCNT.distance_curve)[:, 0]
    curve = mirror_curve(VCNT, heights)
    found = [measure(plate("vcnt2020", height, "mirror", half=60), points=1024, seed=3) for height in heights]
    power, error = (np.array([getattr(each, name)[0] for each in found]) for name in ("power", "standard_error"))
    agree(power, error, curve, 2e-3 * curve)


@pytest.mark.parametrize(("emitted", "response"), [(3.0, 1.0), (1.5, 4.0)])
def test_dies_in_their_windows_may_have_other_laws(agree, llvm_mono, tmp_path, emitted, response):
    bare = {"die_depth": 0.0, "law": "cosine_power"}
    sides = {"emitter": replace(VCNT.emitter, exponent=emitted, **bare)}
    sides["detector"] = replace(VCNT.detector, exponent=response, **bare)
    part = replace(VCNT, resin_index=1.0, **sides)
    found = measure(plate(written(part, tmp_path), 1.0, "mirror", half=60), points=1024, seed=3)
    right = mirror_curve(part, 1.0)
    agree(found.power, found.standard_error, right, 2e-3 * right)
    assert leaving_share(part) == pytest.approx(1, abs=5e-3)


def test_the_edge_of_a_mirror(agree, llvm_mono):
    (edge,) = edge_positions(VCNT, 1.0, 1, 0.3)
    found = measure(plate("vcnt2020", 1.0, "mirror", half=60, centre=(0, edge - 60)), points=2048, seed=4)
    agree(found.power, found.standard_error, 0.3 * mirror_curve(VCNT, 1.0), 3e-3 * found.power)


@pytest.mark.parametrize("shift", [(0.1, -0.05, 0.0), (-0.05, 0.0, -0.1)])
def test_a_die_off_its_place_below_the_same_window(agree, llvm_mono, shift):
    """Both dies; the window stays, and bounds what the LED may move."""
    part = replace(VCNT, emitter=VCNT.emitter.moved(shift), detector=VCNT.detector.moved(shift[::-1]))
    moved = PhotoReflector(part="vcnt2020", led_shift=shift, phototransistor_shift=shift[::-1]).package
    assert (moved.emitter, moved.detector) == (part.emitter, part.detector)
    assert moved.openings == PhotoReflector(part="vcnt2020").package.openings
    shifts = {"led_shift": list(shift), "phototransistor_shift": list(shift[::-1])}
    found = measure(plate("vcnt2020", 1.0, "mirror", half=60, **shifts), points=1024, seed=5)
    right = mirror_curve(part, 1.0)
    agree(found.power, found.standard_error, right, 2e-3 * right)


@pytest.mark.parametrize(
    ("given", "complaint"),
    [
        ({"led_shift": (0.1, 0, 0)}, "led_shift is not allowed without part"),
        (
            {"part": "vcnt2020", "led_shift": (0, 0, 0.2)},
            "led_shift = 0, 0, 0.2 is not allowed: die_depth = -0.1 is not",
        ),
        ({"part": "vcnt2020", "led_shift": (-0.6, 0, 0)}, "its die extends beyond the edge of the body along x"),
        (
            {"part": "vcnt2020", "phototransistor_shift": (0, 0, -1)},
            "phototransistor_shift = 0, 0, -1 .* 0.8, is needed",
        ),
    ],
)
def test_a_die_stays_in_its_body(given, complaint):
    with pytest.raises(InputError, match=complaint):
        PhotoReflector(**given)


@pytest.mark.parametrize(
    ("part", "height", "centre"),
    [
        (VCNT, 0.4, (0.0, 0.0)),
        (VCNT, 1.5, (0.7, -0.4)),
        (replace(VCNT, resin_index=1.0), 1.0, (0.0, 0.0)),
        (DEEP, 0.5, (0.0, 0.0)),
        (replace(DEEP, resin_index=3.5), 1.0, (0.3, 0.2)),
    ],
)
def test_a_lambertian_plate_is_as_by_refraction_ray_by_ray(agree, llvm_mono, tmp_path, part, height, centre):
    power, error = plate_power(part, height, half=2.0, centre=centre)
    file = written(part, tmp_path)
    found = [measure(plate(file, height, centre=centre, method={"type": name}), points=1024) for name in TRACERS]
    agree([each.power[0] for each in found], [each.standard_error[0] for each in found], power, error, 16)


@pytest.mark.parametrize(
    "method",
    [
        {"type": "taxel_tracer", "strategy": "connections"},
        {"type": "taxel_tracer", "strategy": "sensor_subpath_connections"},
        {"type": "taxel_tracer", "strategy": "unidirectional_hits"},
        {"type": "analog_tracer"},
        {"type": "path"},
        {"type": "ptracer"},
    ],
    ids=lambda method: " ".join(method.values()),
)
def test_each_technique_and_integrator_finds_the_same(agree, llvm_mono, tmp_path, method):
    power, error = plate_power(DEEP, 0.8)
    found = measure(plate(written(DEEP, tmp_path), 0.8, method=method), points=2048, seed=5)
    agree(found.power, found.standard_error, power, error, 16)


def test_several_reflections(agree, llvm_mono):
    """Between a plate and a body that reflects, among mirrors and diffuse walls, from both ends."""
    wall = {"type": "wall", "scattering": "mixed", "specular": 0.4, "lambertian": 0.6}
    scenes = [plate("vcnt2020", 0.6, "lambertian", bsdf=wall, method={"type": name}) for name in TRACERS]
    one, other = (measure(scene, points=4096, seed=6) for scene in scenes)
    alone = measure(plate("vcnt2020", 0.6), points=1024, seed=6)
    agree(one.power, one.standard_error, other.power, other.standard_error)
    assert one.power > 1.05 * alone.power


@pytest.mark.parametrize("scattering", ["lambertian", "mirror"])
def test_little_depth_without_resin_is_a_bare_die(llvm_mono, tmp_path, scattering):
    sides = {"emitter": VCNT.emitter, "detector": VCNT.detector}
    powers = []
    for depth in (0.0, 1e-6):
        part = replace(VCNT, resin_index=1.0, **{name: replace(side, die_depth=depth) for name, side in sides.items()})
        powers.append(measure(plate(written(part, tmp_path), 0.7, scattering), points=256, seed=7).power[0])
    assert powers[0] == pytest.approx(powers[1], rel=2e-5)


def test_energy(agree, llvm_mono):
    scene = plate("vcnt2020", 1.0)
    audit, found = energy_audit(scene), measure(scene, points=1024, seed=8)
    shares = dict(zip(audit.places, zip(audit.share, audit.standard_error, strict=True), strict=True))
    inside, detected = shares["inside packages"], shares["detected"]
    out, error = escaping(VCNT.emitter, VCNT.resin_index)
    assert audit.total == pytest.approx(1, abs=1e-9) and shares["reflector phototransistor"][0] > 0
    agree(1 - inside[0], inside[1], out, error, 16)
    assert [leaving_share(part) for part in (VCNT, DEEP)] == pytest.approx(
        [escaping(part.emitter, part.resin_index)[0] for part in (VCNT, DEEP)], rel=2e-3
    )
    agree(*detected, found.power, found.standard_error)


def test_crosstalk_and_maps(agree, llvm_mono):
    scene = plate("vcnt2020", 1.0, half=4.0, columns=2, pitch=2.6)
    found = crosstalk(scene, points=2048, seed=9)
    ways = [(1.3, 0.0), (1.3, 2.6), (-1.3, -2.6), (-1.3, 0.0)]
    reference = [plate_power(VCNT, 1.0, half=4.0, centre=(middle, 0), apart=(apart, 0)) for middle, apart in ways]
    agree(found.power.ravel(), found.standard_error.ravel(), *np.transpose(reference), 16)
    one = measure(plate("vcnt2020", 1.0), points=256, irradiance=True)
    assert one.irradiance.mean() * 0.16 == pytest.approx(one.power[0], rel=1e-4)


def test_it_turns_moves_and_scales(llvm_mono):
    motion = llvm_mono.ScalarTransform4f().translate([3, -2, 40]).rotate([0, 1, 0], 70).scale(50)
    one, other = (measure(plate("vcnt2020", 0.5, motion=each), points=256, seed=10) for each in (None, motion))
    assert one.power[0] == pytest.approx(other.power[0], rel=1e-4)


def test_light_and_derivatives_of_a_pad_are_by_paths(llvm_mono):
    pad = {"type": "deformable_pad", "rows": 1, "columns": 1, "cell_size": 4.0, "pitch": 5.0, "height": 3.0}
    roof = {"type": "region", "roof": {"type": "wall", "scattering": "lambertian"}}
    cell = {"cell": "cylindrical", "cell_height": 1.6, "bsdf": roof}
    scene = Scene({"type": "scene", "pad": {**pad, **cell}, "parts": {"type": "photo_reflector", "part": "vcnt2020"}})
    assert measure(scene, points=16, derivatives=["cell_height"]).derivatives.method == BY_PATHS
    found, (power, _) = measure(scene, target_error=0.05), plate_power(VCNT, 0.8)
    assert found.points and "dies lie below windows: light is computed by random paths" in found.remarks
    assert 0.8 * power < found.power[0] < 1.2 * power  # the roof is round, and as large


def test_paths_leave_the_window(llvm_mono):
    paths = sample_paths(plate("vcnt2020", 0.5).load(), 1, count=40)
    starts = np.array([path[0] for path in paths.vertices])
    assert paths.reached.sum() == 20 and np.all([len(path) > 1 for path in paths.vertices])
    assert starts[:, 2] == pytest.approx(0.8) and np.abs(starts[:, :2] - (-0.595, -0.3)).max() < 0.175 + 0.0895


def test_the_mesh(llvm_mono):
    """It is closed, and its regions are the windows, of round ends by chords."""
    import trimesh

    reflector = plate("vcnt2020", 1.0).load().shapes()[0]
    if not reflector.has_attribute("face_region")[0]:
        reflector = plate("vcnt2020", 1.0).load().shapes()[1]
    given = llvm_mono.traverse(reflector)
    vertices, faces = np.array(given["vertex_positions"]).reshape(-1, 3), np.array(given["faces"]).reshape(-1, 3)
    mesh, codes = trimesh.Trimesh(vertices, faces, process=False), np.array(given["face_region"]).astype(int)
    areas = np.bincount(codes, mesh.area_faces)
    windows = [0.83 * 0.82 + np.pi * 0.83**2 / 4, 0.92 * 0.73 + np.pi * 0.92**2 / 4]
    assert mesh.is_watertight and mesh.volume == pytest.approx(np.prod(VCNT.body), rel=1e-6)
    assert sorted(areas[areas > 0])[:2] == pytest.approx(windows, rel=2e-3)


@pytest.mark.parametrize("distance", [0.0, 0.3, 4.0])
@pytest.mark.parametrize(("height", "depth", "index"), [(0.7, 0.1, 1.5), (0.01, 0.4, 1.3), (2.0, 0.5, 4.0), (1, 1, 1)])
def test_a_point_below_a_window_is_seen_where_snells_law_says(llvm_mono, distance, height, depth, index):
    from mitsuba_taxel.kernels.taxels.faces import FaceGrid
    from mitsuba_taxel.kernels.taxels.windows import ResinWindow

    mi = llvm_mono
    here = mi.ScalarTransform4f()
    dies, faces = FaceGrid(here, (0, 0, -depth), (1, 1)), FaceGrid(here, (0, 0, 0), (99, 99))
    window = ResinWindow(dies, faces, depth, index, False)

    def angle(across):
        sight = window.sight(mi.UInt32(0), mi.Point3f(0.6 * across, 0.8 * across, height), mi.Point3f(0, 0, -depth))
        d, place = np.array(sight.direction).ravel(), np.array(sight.crossing).ravel()
        assert sight.is_open[0] and place[2] == pytest.approx(0, abs=1e-6)
        return np.arctan2(np.hypot(*d[:2]), -d[2]), float(np.hypot(*place[:2])), sight.squared_distance[0]

    t, at_window, squared = angle(distance)
    beneath = np.arcsin(np.sin(t) / index)
    assert at_window == pytest.approx(depth * np.tan(beneath), abs=3e-5 * (1 + at_window))
    assert distance - at_window == pytest.approx(height * np.tan(t), rel=1e-4, abs=1e-5)
    step = 1e-2
    low, high = (np.cos(angle(max(distance, step) + sign * step / 2)[0]) for sign in (-1, 1))
    solid_angle, area = low - high, step * max(distance, step)  # both over 2 pi
    assert np.cos(t) / squared == pytest.approx(solid_angle / area, rel=0.02, abs=1e-4)


def test_an_led_is_read_in_its_own_package(llvm_mono):
    """In the order of the scene, that LED would be read against the phototransistor of a rectangle."""
    face = {"type": "rectangle", "bsdf": {"type": "wall"}}
    beside = {"type": "rectangle", "to_world": llvm_mono.ScalarTransform4f().translate([9, 0, 0])}
    parts = {name: part for name, part in plate("vcnt2020", 1.0).source.items() if name != "type"}
    alone = {"a": {**face, "sensor": {"type": "phototransistor"}}, "z": {**beside, "led": {"type": "annular_led"}}}
    scene = {"type": "scene", "a": alone["a"], **parts, "z": alone["z"]}
    with pytest.raises(InputError, match="LED below a window") as refused:
        measure(Scene(scene), points=16)
    assert "\n" not in str(refused.value)


def test_a_part_beside_the_scene_whatever_the_folder(llvm_mono, tmp_path, monkeypatch):
    from mitsuba_taxel.sensing.scene.parsed_parts import refusal_of

    written(VCNT, tmp_path)
    part = '<shape type="photo_reflector"> <string name="part" value="mine.toml"/> </shape>'
    (tmp_path / "scene.xml").write_text(f'<scene version="3.9.0"> {part} </scene>')
    monkeypatch.chdir("/")
    assert refusal_of(Scene(tmp_path / "scene.xml")) is None


def test_the_scene_of_the_documentation(agree, llvm_mono, tmp_path):
    page = (Path(__file__).parents[2] / "docs" / "theory" / "parts.md").read_text()
    (tmp_path / "scene.xml").write_text(page.split("```xml\n")[1].split("```")[0])
    (power, error), found = plate_power(VCNT, 1.0, half=5.0), measure(tmp_path / "scene.xml", points=256)
    agree(found.power, found.standard_error, power, error, 16)
    assert check_scene(tmp_path / "scene.xml") == []
