"""Mirrors: a curved one against a quadrature of its own, rough ones in the two limits where optics is simple, against
formulas of Beckmann and Smith, and against Mitsuba's own rough conductor."""

from __future__ import annotations

import math

import numpy as np
import pytest
from chi_square import SIGNIFICANCE
from kernel_arrays import vectors
from wall_laws import as_array, direction, directions, draw, evaluate, wall

from mitsuba_taxel import Scene, measure

SPACING, LED_SIDE, WIDTH, DEPTH = 0.7, 0.25, 0.52, 0.3


def reflector():
    return {
        "type": "photo_reflector",
        "spacing": SPACING,
        "led": {"type": "annular_led", "law": "lambertian", "hole": 0.0},
        "detector": {"type": "phototransistor"},
    }


def read(shapes, points, seed=1, **integrator):
    integrator = {"type": "taxel_tracer", **integrator}
    return measure(Scene({"type": "scene", "integrator": integrator, **shapes}), points=points, seed=seed)


def landing(start, slope, height, radius):
    """Where rays come back to z = 0 after one reflection in a sphere.

    Parameters
    ----------
    start : (n, 2) points of z = 0; slope : (n, 2) directions as dx/dz, dy/dz
    height : of the sphere's highest point above z = 0; its centre is ``radius`` below that, on the axis

    Returns
    -------
    (n, 2) points of z = 0
    """
    origin = np.column_stack([start, np.zeros(len(start))]) - (0, 0, height - radius)
    d = np.column_stack([slope, np.ones(len(slope))])
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    along = (origin * d).sum(axis=1)
    t = np.sqrt(along**2 + radius**2 - (origin**2).sum(axis=1)) - along
    hit = origin + t[:, None] * d
    d -= 2 * (d * hit).sum(axis=1, keepdims=True) / radius**2 * hit
    down = -(hit[:, 2] + height - radius) / d[:, 2]
    return (hit + down[:, None] * d)[:, :2]


def slopes_between(start, end, height, radius):
    """(n, 2) slopes with which rays from ``start`` come back at ``end``, and (n,) areas per area of slopes there."""
    slope = (end - start) / (2 * height)
    steps = 1e-6 * np.eye(2)

    def jacobian():
        columns = [landing(start, slope + e, height, radius) - landing(start, slope - e, height, radius) for e in steps]
        return np.stack(columns, axis=2) / 2e-6

    for _ in range(30):
        miss = landing(start, slope, height, radius) - end
        slope = slope - np.linalg.solve(jacobian(), miss[:, :, None])[:, :, 0]
    assert np.abs(landing(start, slope, height, radius) - end).max() < 1e-9
    return slope, np.linalg.det(jacobian())


def sphere_power(height, radius, count):
    """Power in W per W of a Lambertian LED that one reflection in a sphere brings to the phototransistor.

    Gauss-Legendre quadrature with ``count`` nodes a side over LED and phototransistor: for each pair of points the ray
    between them is found by Newton's method, and its share of the power by how directions map to landing points.
    """
    nodes, weights = np.polynomial.legendre.leggauss(count)

    def rectangle(side_x, side_y, middle):
        x, y = np.meshgrid(middle + 0.5 * side_x * nodes, 0.5 * side_y * nodes)
        return np.column_stack([x.ravel(), y.ravel()]), np.outer(weights, weights).ravel() * 0.25 * side_x * side_y

    led, led_weight = rectangle(LED_SIDE, LED_SIDE, -SPACING / 2)
    detector, detector_weight = rectangle(WIDTH, DEPTH, SPACING / 2)
    start, end = np.repeat(led, len(detector), axis=0), np.tile(detector, (len(led), 1))
    slope, area = slopes_between(start, end, height, radius)
    assert area.min() > 0  # one ray for each pair: no caustic within the phototransistor
    density = 1 / (math.pi * (1 + (slope**2).sum(axis=1)) ** 2 * area)
    return led_weight @ density.reshape(len(led), -1) @ detector_weight / LED_SIDE**2


@pytest.mark.parametrize(("radius", "height"), [(3.0, 0.6), (3.0, 1.1), (8.0, 0.6)])
def test_concave_mirror_matches_quadrature(llvm_mono, agree, height, radius):
    """The quadrature has converged to a millionth; only hits see the light, all of it after one reflection."""
    expected = sphere_power(height, radius, 8)
    assert sphere_power(height, radius, 5) == pytest.approx(expected, rel=1e-6)
    centre = [0, 0, 0.5 + height - radius]
    mirror = {"type": "wall", "scattering": "mirror"}
    shapes = {
        "reflector": reflector(),
        "mirror": {"type": "sphere", "center": centre, "radius": radius, "bsdf": mirror},
    }
    reading = read(shapes, 1 << 16, max_depth=1)
    assert reading.relative_error < 0.002
    agree(reading.power, reading.standard_error, expected)


def test_a_flat_sphere_is_a_flat_mirror():
    """The quadrature itself, where the method of images knows the power: distance 1.2 mm, sphere of 20 m."""
    nodes, weights = np.polynomial.legendre.leggauss(16)
    across = (SPACING + 0.5 * WIDTH * nodes[:, None] - 0.5 * LED_SIDE * nodes) ** 2
    along = (0.5 * DEPTH * nodes[:, None] - 0.5 * LED_SIDE * nodes) ** 2
    kernel = 1.2**2 / (math.pi * (1.2**2 + across[:, :, None, None] + along) ** 2)
    expected = np.einsum("abcd,a,b,c,d", kernel, *[weights / 2] * 4) * WIDTH * DEPTH
    assert sphere_power(0.6, 2e4, 8) == pytest.approx(expected, rel=1e-4)


def plate(mi, z, wall):
    to_world = mi.ScalarTransform4f().translate([0, 0, 0.5 + z]).scale(2)
    return {
        "reflector": reflector(),
        "plate": {"type": "rectangle", "to_world": to_world, "bsdf": {"type": "wall", **wall}},
    }


@pytest.mark.parametrize(("z", "rms_slope"), [(0.4, 0.2), (1.0, 0.02)])
def test_a_rough_mirror_tends_to_the_mirror(llvm_mono, agree, rms_slope, z):
    """Its blur of at most 0.01 mm moves as much light over the phototransistor's edges outwards as inwards."""
    rough, smooth = (
        read(plate(llvm_mono, z, wall), 1 << 16, seed)
        for seed, wall in enumerate(
            ({"scattering": "rough_mirror", "rms_slope": rms_slope}, {"scattering": "mirror"}), start=1
        )
    )
    assert max(rough.relative_error, smooth.relative_error) < 0.003
    agree(rough.power, rough.standard_error, smooth.power, smooth.standard_error)


@pytest.mark.parametrize("reflectance", [1.0, 0.6])
@pytest.mark.parametrize("rms_slope", [1.0, 3.0, 8.0])
def test_backscatter_follows_geometrical_optics(llvm_mono, rms_slope, reflectance):
    """sigma0 = |R|**2 sec(theta)**4 exp(-tan(theta)**2 / (2 s**2)) / (2 s**2), where no facet hides another.

    Sources: D. E. Barrick, IEEE Trans. Antennas Propag. 16 (1968) 449; F. T. Ulaby, R. K. Moore, A. K. Fung, Microwave
    Remote Sensing, volume 2 (1982), chapter 12. s**2 is the mean square slope along one axis and sigma0 =
    4 pi cos(theta)**2 f, so that the wall's f cos(theta) is sigma0 / (4 pi cos(theta)).
    """
    import drjit as dr

    mi = llvm_mono
    wall = mi.load_dict(
        {"type": "wall", "scattering": "rough_mirror", "rms_slope": rms_slope, "reflectance": reflectance}
    )
    s = math.tan(math.radians(rms_slope))
    theta = np.linspace(0, math.atan(3 * s), 31)
    si = dr.zeros(mi.SurfaceInteraction3f, len(theta))
    si.wi = mi.Vector3f(mi.Float(np.sin(theta)), mi.Float(0), mi.Float(np.cos(theta)))
    for mode in (mi.TransportMode.Importance, mi.TransportMode.Radiance):
        value = wall.eval(mi.BSDFContext(mode), si, si.wi)[0].numpy()
        sigma0 = reflectance / np.cos(theta) ** 4 * np.exp(-(np.tan(theta) ** 2) / (2 * s**2)) / (2 * s**2)
        assert value == pytest.approx(sigma0 / (4 * math.pi * np.cos(theta)), rel=2e-3)


def test_another_place_of_a_mirror_compiles_nothing(llvm_mono):
    """Nor does it leave a kernel on disk."""
    import drjit as dr

    measure(Scene("plate.xml", {"z": 0.7, "scattering": "mirror"}), points=16)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        measure(Scene("plate.xml", {"z": 0.7231, "scattering": "mirror"}), points=16)
        kernels = [kernel for kernel in dr.kernel_history() if "cache_hit" in kernel]
    assert kernels and all(kernel["cache_hit"] and not kernel["cache_disk"] for kernel in kernels)


def beckmann(wi, wo, alpha):
    """f cos(theta_o) of a rough perfect conductor, in double precision: Walter et al. 2007, with Smith's G1 exactly."""
    from scipy.special import erf

    def visible(v):
        a = v[:, 2] / (alpha * np.maximum(np.hypot(v[:, 0], v[:, 1]), 1e-12))
        shadow = 0.5 * (np.exp(-(a**2)) / (a * np.sqrt(np.pi)) - (1 - erf(a)))
        return 1 / (1 + shadow)

    half = wi + wo
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    tan2 = (half[:, 0] ** 2 + half[:, 1] ** 2) / half[:, 2] ** 2
    facets = np.exp(-tan2 / alpha**2) / (np.pi * alpha**2 * half[:, 2] ** 4)
    return facets * visible(wi) * visible(wo) / (4 * wi[:, 2])


@pytest.mark.parametrize("slope", [0.1, 5.0, 20.0, 45.0])
def test_rough_mirror_is_beckmann_and_smith(llvm_mono, slope):
    """Against the formulas in double precision, and against Mitsuba's conductor, whose G1 is a fit to 0.35 %."""
    mi = llvm_mono
    alpha = math.sqrt(2) * math.tan(math.radians(slope))
    tilt = np.random.default_rng(9).normal(size=(5000, 2)) * alpha / math.sqrt(2)
    facet = np.concatenate([-tilt, np.ones((5000, 1))], axis=1)
    facet /= np.linalg.norm(facet, axis=1, keepdims=True)
    wi = directions(5000, 10)
    wo = 2 * np.sum(wi * facet, axis=1, keepdims=True) * facet - wi
    seen = (wo[:, 2] > 0.02) & (wi[:, 2] > 0.02)
    wi, wo = wi[seen], wo[seen]
    assert len(wi) > 1000
    ours = evaluate(mi, wall(mi, "rough", rms_slope=slope, reflectance=1.0), "Importance", wi, wo)[0]
    assert np.allclose(ours, beckmann(wi, wo, alpha), rtol=2e-2 if slope < 1 else 1e-3)
    conductor = {"type": "roughconductor", "material": "none", "distribution": "beckmann", "alpha": alpha}
    theirs = mi.load_dict(conductor)
    assert np.allclose(ours, evaluate(mi, theirs, "Importance", wi, wo)[0], rtol=8e-3)


@pytest.mark.parametrize("slope", [0.01, 1.0, 20.0, 45.0])
def test_facets_project_to_the_area_of_the_wall(llvm_mono, slope):
    """The integral of D cos over the hemisphere is 1; in slopes, over which it is smooth however small they are."""
    mi = llvm_mono
    normals = wall(mi, "rough", rms_slope=slope).law._normals()
    alpha = math.sqrt(2) * math.tan(math.radians(slope))
    nodes, weights = np.polynomial.legendre.leggauss(200)
    x, y = np.meshgrid(8 * alpha * nodes, 8 * alpha * nodes)
    normal = np.stack([-x.ravel(), -y.ravel(), np.ones(x.size)], axis=1)
    cosine = 1 / np.linalg.norm(normal, axis=1)
    d = normals.eval(vectors(mi, *(normal * cosine[:, None]).T)).numpy().astype(float)
    total = (np.outer(weights, weights).ravel() * (8 * alpha) ** 2) @ (d * cosine * cosine**3)
    assert total == pytest.approx(1, abs=1e-5)


@pytest.mark.parametrize("slope", [0.01, 0.1, 1.0, 5.0])
def test_slopes_of_the_facets_have_the_given_root_mean_square(llvm_mono, slope):
    """At normal incidence: along x and along y, the sum of squares follows the chi-square distribution."""
    from scipy import stats

    mi = llvm_mono
    count = 200_000
    bs, weight = draw(mi, wall(mi, "rough", rms_slope=slope), "Importance", np.array([0, 0, 1.0]), count)
    wo = as_array(bs.wo)
    assert np.all(weight > 0)
    slopes = wo[:, :2] / (1 + wo[:, 2:])
    for axis in (0, 1):
        total = np.sum((slopes[:, axis] / math.tan(math.radians(slope))) ** 2)
        assert SIGNIFICANCE / 2 < stats.chi2.cdf(total, count) < 1 - SIGNIFICANCE / 2


@pytest.mark.parametrize("angle", [0.0, 60.0, 89.0])
def test_the_smallest_slope_is_a_mirror_nearly(llvm_mono, angle):
    """In single precision too: the mean direction is the mirror's, all light comes back, also by the stated values."""
    mi = llvm_mono
    slope, wi = 0.01, direction(angle)
    bsdf = wall(mi, "rough", rms_slope=slope, reflectance=1.0)
    bs, weight = draw(mi, bsdf, "Importance", wi)
    wo = as_array(bs.wo)
    spread = 5 * 2 * math.tan(math.radians(slope))
    assert np.allclose(wo.mean(axis=0), wi * [-1, -1, 1], atol=spread / math.sqrt(len(wo)) + 1e-6)
    assert np.allclose(weight, 1, atol=1e-3)
    value, _ = evaluate(mi, bsdf, "Importance", np.tile(wi, (len(wo), 1)), wo)
    reference = beckmann(np.tile(wi, (len(wo), 1)), wo, math.sqrt(2) * math.tan(math.radians(slope)))
    assert np.mean(value / reference) == pytest.approx(1, abs=1e-3)


def test_the_smallest_slope_may_be_given_in_a_file(llvm_mono, tmp_path):
    path = tmp_path / "scene.xml"
    path.write_text(
        '<scene version="3.9.0"> <bsdf type="wall"> <string name="scattering" value="rough_mirror"/>'
        '<float name="rms_slope" value="0.01"/> </bsdf> </scene>'
    )
    Scene.from_file(path).load()
