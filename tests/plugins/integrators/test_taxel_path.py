"""Closed forms: light straight across, by configuration factors, and in an integrating sphere, by its balance."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mitsuba_taxel import Scene, measure

TRACERS = ["taxel_tracer", "taxel_path"]
ABSORBING = {"type": "wall", "scattering": "absorbing"}


def part(to_world, half, **nested):
    """An absorbing rectangle of half-sides ``half`` that looks along +z before ``to_world``."""
    return {"type": "rectangle", "to_world": to_world.scale([*half, 1]), "bsdf": ABSORBING, **nested}


def led(**parameters):
    return {"type": "annular_led", "law": "lambertian", "hole": 0.0, **parameters}


def face_to_face(mi, source, width, depth, offset, distance):
    """An LED that looks up from the origin, and a phototransistor that looks down on it."""
    transform = mi.ScalarTransform4f
    above = transform().translate([*offset, distance]).rotate([1, 0, 0], 180)
    half = 0.5 * source["size"]
    return {
        "lower": part(transform(), (half, half), led=led(**source)),
        "upper": part(
            above, (width / 2, depth / 2), sensor={"type": "phototransistor", "width": width, "depth": depth}
        ),
    }


def read(shapes, integrator, points, seed=1):
    return measure(Scene({"type": "scene", "integrator": {"type": integrator}, **shapes}), points=points, seed=seed)


def opposed_squares(side, distance):
    """Between aligned equal squares (J. R. Howell, A Catalog of Radiation Configuration Factors, C-11)."""
    x = side / distance
    root = math.sqrt(1 + x**2)
    inner = math.log(root**2 / math.sqrt(1 + 2 * x**2)) + 2 * x * root * math.atan(x / root) - 2 * x * math.atan(x)
    return 2 / (math.pi * x**2) * inner


def parallel_rectangles(source, target, distance):
    """From one rectangle ((x0, x1), (y0, y1)) to a parallel one (Howell's catalog, C-13): signed sum over corners."""

    def corner(dx, dy):
        p, q = math.hypot(dx, distance), math.hypot(dy, distance)
        angles = dy * p * math.atan(dy / p) + dx * q * math.atan(dx / q)
        return (angles - 0.5 * distance**2 * math.log(dx**2 + dy**2 + distance**2)) / (2 * math.pi)

    total = 0.0
    for i, j, k, m in np.ndindex(2, 2, 2, 2):
        total += (-1) ** (i + j + k + m) * corner(source[0][i] - target[0][k], source[1][j] - target[1][m])
    (x0, x1), (y0, y1) = source
    return total / ((x1 - x0) * (y1 - y0))


def element_to_disc(aside, radius, distance):
    """From an element to a parallel disc whose axis is ``aside`` from it (Howell's catalog, B-13)."""
    near, far = aside**2 + distance**2 - radius**2, aside**2 + distance**2 + radius**2
    return 0.5 * (1 - near / np.sqrt(far**2 - 4 * aside**2 * radius**2))


def gauss(half, count=16):
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return half * nodes, half * weights


def test_the_closed_forms_agree_with_each_other():
    """Aligned squares are parallel rectangles; on the axis of a disc the factor is r**2 / (r**2 + h**2)."""
    for distance in (0.1, 0.5, 3.0):
        square = ((-0.15, 0.15), (-0.15, 0.15))
        assert parallel_rectangles(square, square, distance) == pytest.approx(opposed_squares(0.3, distance), rel=1e-9)
        on_axis = 0.2**2 / (0.2**2 + distance**2)
        assert element_to_disc(0.0, 0.2, distance) == pytest.approx(on_axis, rel=1e-12)


@pytest.mark.parametrize("integrator", TRACERS)
@pytest.mark.parametrize("distance", [0.1, 0.3, 1.2])
def test_opposed_squares(llvm_mono, agree, integrator, distance):
    """A Lambertian LED before a phototransistor of its size: the share of its light that arrives is the factor."""
    shapes = face_to_face(llvm_mono, {"size": 0.3}, 0.3, 0.3, (0, 0), distance)
    reading = read(shapes, integrator, 4096)
    assert reading.relative_error < 0.003
    agree(reading.power, reading.standard_error, opposed_squares(0.3, distance))


@pytest.mark.parametrize("integrator", TRACERS)
@pytest.mark.parametrize("offset", [(0.3, 0.1), (-1.0, 0.5)])
def test_shifted_rectangles(llvm_mono, agree, integrator, offset):
    shapes = face_to_face(llvm_mono, {"size": 0.25}, 0.52, 0.3, offset, 0.4)
    reading = read(shapes, integrator, 4096)
    target = tuple((middle - side / 2, middle + side / 2) for middle, side in zip(offset, (0.52, 0.3), strict=True))
    expected = parallel_rectangles(((-0.125, 0.125), (-0.125, 0.125)), target, 0.4)
    assert reading.relative_error < 0.003
    agree(reading.power, reading.standard_error, expected)


@pytest.mark.parametrize("integrator", TRACERS)
@pytest.mark.parametrize("hole, distance", [(0.0, 0.15), (0.0, 0.6), (0.3, 0.2)])
def test_round_led_before_a_small_phototransistor(llvm_mono, agree, integrator, hole, distance):
    """By reciprocity: the irradiance at a point is what the point sends to the disc, less what it sends to the hole."""
    diameter, side = 0.4, 0.1
    source = {"shape": "circular", "size": diameter, "hole": hole}
    reading = read(face_to_face(llvm_mono, source, side, side, (0, 0), distance), integrator, 4096)
    x, w = gauss(side / 2)
    aside = np.hypot(x[:, None], x)
    seen = element_to_disc(aside, diameter / 2, distance) - element_to_disc(aside, hole / 2, distance)
    expected = (w @ seen @ w) / (math.pi / 4 * (diameter**2 - hole**2))
    assert reading.relative_error < 0.003
    agree(reading.power, reading.standard_error, expected)


@pytest.mark.parametrize("reflectance", [0.5, 0.98, 1.0])
@pytest.mark.parametrize("integrator", TRACERS)
def test_integrating_sphere(llvm_mono, agree, integrator, reflectance):
    """Irradiance on the wall of a sphere with ports against P / (4 pi R**2) / (1 - rho (1 - f)).

    A point of a sphere that sends light out after the cosine law lights all of the sphere evenly. So the LED, which
    lies on the wall, lights it with P / (4 pi R**2), and of whatever arrives on the whole sphere the share 1 - f falls
    on the wall and comes back reduced by rho: a geometric series, with what goes straight across as its first term.
    The ports are the LED, the phototransistor, and a disk that cuts off a cap: light crosses the disk if, and only if,
    it would have reached the cap. LED and phototransistor are chords, 0.0003 mm and 0.001 mm deep, which changes the
    reading by a ten-thousandth at most.
    """
    mi = llvm_mono
    radius, led_half, detector_half = 10.0, 0.05, 0.1
    port_radius, port_distance = 6.0, 8.0
    transform = mi.ScalarTransform4f

    def on_the_wall(direction, half, **nested):
        direction = np.array(direction) / np.linalg.norm(direction)
        place = direction * math.sqrt(radius**2 - 2 * half**2)
        to_world = transform().look_at(origin=list(place), target=[0, 0, 0], up=[0.1, 0.2, 1])
        return part(to_world, (half, half), **nested)

    detector = {"type": "phototransistor", "width": 2 * detector_half, "depth": 2 * detector_half}
    shapes = {
        "sphere": {"type": "sphere", "radius": radius, "bsdf": {"type": "wall", "reflectance": reflectance}},
        "led": on_the_wall((-1, 0.2, 0.3), led_half, led=led(size=2 * led_half)),
        "phototransistor": on_the_wall((0.8, 0.6, 0.1), detector_half, sensor=detector),
        "port": {
            "type": "disk",
            "to_world": transform().translate([0, 0, -port_distance]).scale(port_radius),
            "bsdf": ABSORBING,
        },
    }
    reading = read(shapes, integrator, 2048)
    sphere_area = 4 * math.pi * radius**2
    port_area = 2 * math.pi * radius * (radius - port_distance) + 4 * led_half**2 + 4 * detector_half**2
    irradiance = 1 / sphere_area / (1 - reflectance * (1 - port_area / sphere_area))
    assert reading.relative_error < 0.01
    agree(reading.power, reading.standard_error, irradiance * 4 * detector_half**2)
