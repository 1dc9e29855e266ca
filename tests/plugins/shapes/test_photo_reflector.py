"""The package of a photo-reflector: a closed surface whose LED and phototransistor do not reflect with it; bodies and
dies of parts."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from kernel_arrays import floats

from mitsuba_taxel import InputError, measure
from mitsuba_taxel.kernels.surfaces.regions import ALL_REGIONS, BODY_REGIONS
from mitsuba_taxel.pads import REGIONS
from mitsuba_taxel.parts import read_part
from mitsuba_taxel.sensing import Scene
from mitsuba_taxel.specification.annular_led import AnnularLed
from mitsuba_taxel.specification.photo_reflector import PhotoReflector

BODY = (1.46, 1.06, 0.5)
WHITE = {"type": "wall", "reflectance": 0.9}


def reflector(mi, *, led=None, sensor=None, **parameters):
    return mi.load_dict(
        {
            "type": "photo_reflector",
            "led": {"type": "annular_led", **(led or {})},
            "sensor": {"type": "phototransistor", **(sensor or {})},
            **parameters,
        }
    )


def triangles_of(mesh):
    """Corners (T, 3, 3) of a mesh's triangles, and the codes (T,) of their regions."""
    import mitsuba as mi

    parameters = mi.traverse(mesh)
    vertices = parameters["vertex_positions"].numpy().astype(float).reshape(-1, 3)
    return vertices[parameters["faces"].numpy().reshape(-1, 3)], parameters["face_region"].numpy()


def test_codes_are_disjoint():
    assert not set(REGIONS) & set(BODY_REGIONS)
    assert len(set(ALL_REGIONS.values())) == len(REGIONS) + len(BODY_REGIONS)


LAYOUTS = {
    "default": {},
    "touching": {"spacing": 0.385},
    "at the edge": {"spacing": 0.94},
    "array": {"rows": 2, "columns": 3},
    "packed array": {"rows": 2, "columns": 2, "pitch": 1.46},
    "as deep as the body": {"sensor": {"width": 0.2, "depth": 1.06}, "spacing": 0.6},
    "deeper LED": {"led": {"size": 0.5}, "sensor": {"width": 0.3, "depth": 0.2}, "spacing": 0.8},
    "equal": {"led": {"size": 0.3}, "sensor": {"width": 0.3, "depth": 0.3}, "spacing": 0.3},
}


@pytest.mark.parametrize("scale", [1.0, 2.5])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_regions_have_their_areas_and_form_a_closed_surface(llvm_mono, layout, scale):
    mi = llvm_mono
    parameters = LAYOUTS[layout]
    to_world = mi.ScalarTransform4f().translate([1, 2, 3]).rotate([0.6, 0.8, 0], 30).scale(scale)
    corners, region = triangles_of(reflector(mi, to_world=to_world, **parameters))
    normal = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(normal, axis=1)

    side = parameters.get("led", {}).get("size", 0.25)
    sensor = {"width": 0.52, "depth": 0.3, **parameters.get("sensor", {})}
    faces = {"led": side**2, "phototransistor": sensor["width"] * sensor["depth"]}
    box = 2 * (BODY[0] * BODY[1] + BODY[0] * BODY[2] + BODY[1] * BODY[2])
    expected = {"body": box - sum(faces.values()), **faces}
    bodies = parameters.get("rows", 1) * parameters.get("columns", 1)
    assert set(region) == set(BODY_REGIONS.values())
    for name, code in BODY_REGIONS.items():
        assert area[region == code].sum() == pytest.approx(bodies * scale**2 * expected[name], rel=1e-4), name

    assert_closed(corners, bodies)
    up = np.array(to_world.matrix, dtype=float)[:3, 2] / scale
    assert np.allclose(normal[region != BODY_REGIONS["body"]] @ up, area[region != BODY_REGIONS["body"]], rtol=1e-4)
    # Divergence theorem: the surface encloses the bodies' volume.
    assert np.sum(corners[:, 0] * normal) / 3 == pytest.approx(bodies * scale**3 * np.prod(BODY), rel=1e-4)


def assert_closed(corners, bodies):
    """Each edge of each body is run along once either way."""
    for body in np.split(corners, bodies):
        _, number = np.unique(np.round(body.reshape(-1, 3), 4), axis=0, return_inverse=True)
        edges = Counter()
        for a, b, c in number.reshape(-1, 3):
            edges.update([(a, b), (b, c), (c, a)])
        assert all(count == 1 and edges[b, a] == 1 for (a, b), count in edges.items())


def test_regions_lie_where_the_faces_are(llvm_mono):
    """Rays down on each region of each body of an array; the dark centre of the LED is the LED's."""
    mi = llvm_mono
    scene = mi.load_dict({"type": "scene", "p": reflector(mi, rows=2, columns=2)})
    centres = np.array([(x, y) for y in (1.775, -1.775) for x in (-1.775, 1.775)])
    spots = {(-0.45, 0): "led", (-0.33, 0.12): "led", (0.45, 0): "phototransistor", (0.2, 0.14): "phototransistor"}
    spots |= {(-0.31, 0): "body", (0.45, 0.16): "body", (0, 0): "body", (0.72, 0): "body"}
    for spot, name in spots.items():
        x, y = (centres + spot).T
        si = scene.ray_intersect(mi.Ray3f(mi.Point3f(floats(mi, x), floats(mi, y), 2), mi.Vector3f(0, 0, -1)))
        assert np.all(si.shape.eval_attribute_1("face_region", si).numpy() == BODY_REGIONS[name]), (spot, name)


def test_what_covers_the_package(llvm_mono):
    """Nothing, a wall, or a region that says more."""
    mi = llvm_mono
    assert reflector(mi).bsdf().scattering == "absorbing"
    wrapped = reflector(mi, bsdf=WHITE).bsdf()
    assert list(wrapped.walls) == ["body"] and wrapped.walls["body"].reflectance[0] == pytest.approx(0.9)
    stock = reflector(mi, bsdf={"type": "diffuse"}).bsdf()
    assert list(stock.walls) == ["body"] and stock.walls["body"].class_name() == "SmoothDiffuse"
    own = reflector(mi, bsdf={"type": "region", "phototransistor": WHITE}).bsdf()
    assert list(own.walls) == ["phototransistor"]


HEIGHT = 0.3


def scene_with(mi, cover):
    plate = mi.ScalarTransform4f().translate([0, 0, BODY[2] + HEIGHT]).scale(1)
    package = {
        "type": "photo_reflector",
        "led": {"type": "annular_led", "law": "lambertian", "hole": 0.0},
        "sensor": {"type": "phototransistor"},
    }
    if cover is not None:
        package["bsdf"] = cover
    return Scene(
        {
            "type": "scene",
            "integrator": {"type": "taxel_tracer"},
            "package": package,
            "plate": {"type": "rectangle", "to_world": plate, "bsdf": WHITE},
        }
    )


def stock_power(mi, detector_reflectance):
    """Power and its standard error by Mitsuba's own parts only: the package's top pieced together from rectangles."""

    def rectangle(x0, x1, y0, y1, z, reflectance, facing=1):
        middle = [0.5 * (x0 + x1), 0.5 * (y0 + y1), z]
        to_world = mi.ScalarTransform4f().translate(middle).scale([0.5 * (x1 - x0), 0.5 * (y1 - y0) * facing, facing])
        texture = {"type": "uniform", "value": reflectance}
        return {"type": "rectangle", "to_world": to_world, "bsdf": {"type": "diffuse", "reflectance": texture}}

    x, y, top = 0.5 * BODY[0], 0.5 * BODY[1], BODY[2]
    led = {
        **rectangle(-0.575, -0.325, -0.125, 0.125, top, 0.0),
        "emitter": {"type": "area", "radiance": {"type": "uniform", "value": 1 / (np.pi * 0.25**2)}},
    }
    film = {"type": "hdrfilm", "width": 1, "height": 1, "pixel_format": "luminance", "rfilter": {"type": "box"}}
    detector = {
        **rectangle(0.19, 0.71, -0.15, 0.15, top, detector_reflectance),
        "sensor": {"type": "irradiancemeter", "film": film},
    }
    around = [(-x, -0.575, -y, y), (-0.325, 0.19, -y, y), (0.71, x, -y, y)]
    around += [(-0.575, -0.325, -y, -0.125), (-0.575, -0.325, 0.125, y), (0.19, 0.71, -y, -0.15), (0.19, 0.71, 0.15, y)]
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": -1, "rr_depth": 1000},
            "led": led,
            "detector": detector,
            "plate": rectangle(-1, 1, -1, 1, top + HEIGHT, 0.9, facing=-1),
            **{f"piece{i}": rectangle(*extent, top, 0.9) for i, extent in enumerate(around)},
        },
        optimize=False,
    )
    values = np.array([mi.render(scene, spp=1 << 14, seed=seed).numpy().item() for seed in range(32)]) * 0.52 * 0.3
    return values.mean(), values.std(ddof=1) / np.sqrt(32)


def test_a_white_body_lights_the_phototransistor_more(llvm_mono, agree):
    """As much as Mitsuba's own parts say, with the LED and the phototransistor absorbing, or one of them white."""
    mi = llvm_mono
    dark, white, all_white = (
        measure(scene_with(mi, cover), points=1 << 15, seed=seed)
        for seed, cover in enumerate((None, WHITE, {"type": "region", "body": WHITE, "phototransistor": WHITE}), 1)
    )
    assert white.power[0] - dark.power[0] > 100 * white.standard_error[0]
    assert all_white.power[0] - white.power[0] > 10 * all_white.standard_error[0]
    agree(white.power, white.standard_error, *stock_power(mi, 0.0))
    agree(all_white.power, all_white.standard_error, *stock_power(mi, 0.9))


# Parts

PLATE = {
    "type": "scene",
    "integrator": {"type": "taxel_tracer"},
    "plate": {"type": "disk", "bsdf": {"type": "wall", "scattering": "lambertian"}},
}


def reading(**reflector):
    import mitsuba as mi

    turned = mi.ScalarTransform4f().translate([0, 0, 1.2]).rotate([1, 0, 0], 180).scale(3)
    plate = {**PLATE["plate"], "to_world": turned}
    return measure(Scene({**PLATE, "plate": plate, "parts": reflector}), points=256, seed=1).power[0]


def test_a_part_is_what_its_file_says(llvm_mono):
    mi, part = llvm_mono, read_part("njl5908ar")
    apart = part.detector.x - part.emitter.x
    middle = mi.ScalarTransform4f().translate([(part.detector.x + part.emitter.x) / 2, 0, 0])
    same = {
        "type": "photo_reflector",
        "spacing": apart,
        "to_world": middle,
        "led": {"type": "annular_led", "hole": 0.0, "law": "lambertian"},
        "phototransistor": {"type": "phototransistor"},
    }
    assert reading(type="photo_reflector", part="njl5908ar") == pytest.approx(reading(**same), rel=1e-5)


def test_a_file_of_ones_own(llvm_mono, tmp_path):
    from mitsuba_taxel.parts.part import _catalogue

    text = (_catalogue() / "njl5908ar.toml").read_text().replace("x = 0.25", "x = 0.3")
    (tmp_path / "mine.toml").write_text(text)
    package = PhotoReflector(part=str(tmp_path / "mine.toml")).package
    assert (package.emitter.x, package.detector.x) == (-0.45, 0.3)
    assert np.allclose(package.body, (1.46, 1.06, 0.5))


def test_dies_beside_the_middle_line(llvm_mono, tmp_path):
    """Under a plate that is large, a reading depends on where they lie relative to each other."""
    from mitsuba_taxel.parts.part import _catalogue

    text, powers = (_catalogue() / "njl5908ar.toml").read_text(), []
    for emitter, detector in ((0, 0), (0.2, 0.2), (-0.15, 0.15), (0, 0.3)):
        lines = text.replace("x = -0.45", f"x = -0.45\ny = {emitter}\nwindow_y = 0")
        (tmp_path / "mine.toml").write_text(lines.replace("x = 0.25", f"x = 0.25\ny = {detector}\nwindow_y = 0"))
        powers.append(reading(type="photo_reflector", part=str(tmp_path / "mine.toml")))
    assert powers[1] == pytest.approx(powers[0], rel=2e-3) and powers[3] == pytest.approx(powers[2], rel=2e-3)
    assert powers[2] < 0.95 * powers[0]


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("die_length = 0.35", "die_length = 0.3", "emitter's die must be a square"),
        ("x = -0.595", "x = -0.595\nwindow_x = -0.2", "windows must lie side by side along x"),
        ("x = -0.595", "x = -0.835\nwindow_x = -0.835", "obround window reaches the edge"),
    ],
)
def test_parts_that_are_no_packages(tmp_path, before, after, words):
    from mitsuba_taxel.parts.part import _catalogue

    (tmp_path / "mine.toml").write_text((_catalogue() / "vcnt2020.toml").read_text().replace(before, after, 1))
    with pytest.raises(InputError, match=words) as refused:
        PhotoReflector(part=str(tmp_path / "mine.toml"))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"part": "none"}, "is not known"),
        ({"part": "njl5908ar", "spacing": 0.8}, "spacing and part exclude each other"),
        ({"part": "njl5908ar", "led": AnnularLed()}, r"<emitter> \(led in Python\) and part exclude each other"),
    ],
)
def test_refusals(given, words):
    with pytest.raises(InputError, match=words):
        PhotoReflector(**given)
