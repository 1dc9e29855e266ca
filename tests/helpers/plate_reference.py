"""Power on a phototransistor beside an LED, by way of a plate above both: deterministic quadrature and images.

It shares no code with the program. Lengths are in mm, heights above the common plane of LED and phototransistor, powers
in W per W that the LED emits, evenly over a square with a square hole, after one of the program's laws.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np

LED, DETECTOR = (0.25, 0.25), (0.52, 0.3)  # mm
PANEL_NODES = 6


def image_power(
    z: float, law: str = "lambertian", cone_angle: float = 88.0, spacing: float = 0.7, hole: float = 0.0
) -> float:
    """By way of a large mirror: what comes straight from the LED to the phototransistor's image, twice as far."""
    whole, missing = (_to_image(z, law, math.radians(cone_angle), spacing, side) for side in (LED[0], hole))
    return (whole - missing) / (LED[0] ** 2 - hole**2)


def _to_image(z: float, law: str, cone: float, spacing: float, side: float) -> float:
    """Power from a square that emits 1 W/mm2."""
    reach = _reach(2 * z, law, cone)
    x_edges = [-spacing + end for end in _edges(side, reach)]
    x, weight_x = _graded(-0.5 * DETECTOR[0], 0.5 * DETECTOR[0], x_edges, min(2 * z, reach))
    y, weight_y = _graded(0, 0.5 * DETECTOR[1], _edges(side, reach), min(2 * z, reach))
    share = share_caught(law, cone, x[:, None] + spacing, y, 2 * z, (side, side))
    return float(2 * weight_x @ share @ weight_y)


@cache
def plate_power(
    z: float,
    law: str = "lambertian",
    scattering: str = "lambertian",
    cone_angle: float = 88.0,
    spacing: float = 0.7,
    offset: float = 0.0,
    side: float = 4.0,
    fineness: float = 0.7,
    nodes: int = 16,
) -> float:
    """After one reflection off a square plate of reflectance 1 at the height ``z``.

    The share of the light from a point of the plate that reaches the phototransistor, times the irradiance there,
    integrated over the plate by Gauss-Legendre quadrature on panels that become smaller towards the edges of LED and
    phototransistor.
    """
    cone = math.radians(cone_angle)
    reach = _reach(z, law, cone)
    scale = min(z, reach) * (0.05 if law == "uniform_polar_angle" else 1)  # whose irradiance has a kink at the edges
    x_edges = [-0.5 * spacing + end for end in _edges(LED[0], reach)]
    lit = min(x_edges), max(x_edges)
    x_edges += [0.5 * spacing + end for end in (-0.5 * DETECTOR[0], 0.5 * DETECTOR[0])]
    y_edges = [*_edges(LED[1], reach), 0.5 * DETECTOR[1]]
    x_ends, y_ends = (offset - 0.5 * side, offset + 0.5 * side), (0.0, 0.5 * side)
    if math.isfinite(reach):  # nothing arrives beyond
        x_ends = max(x_ends[0], lit[0]), min(x_ends[1], lit[1])
        y_ends = 0.0, min(y_ends[1], max(_edges(LED[1], reach)))
    x, weight_x = _graded(*x_ends, x_edges, scale, fineness)
    y, weight_y = _graded(*y_ends, y_edges, scale, fineness)
    onward = {"lambertian": lambertian_share, "isotropic": isotropic_share}[scattering]
    total = 0.0
    for part, weight in zip(np.array_split(x, 16), np.array_split(weight_x, 16), strict=True):
        part = part[:, None]
        arriving = share_caught(law, cone, part + 0.5 * spacing, y, z, LED, nodes) / np.prod(LED)
        total += weight @ (arriving * onward(part - 0.5 * spacing, y, z, DETECTOR)) @ weight_y
    return float(2 * total)


def lambertian_share(x, y, z: float, size: tuple[float, float]) -> np.ndarray:
    """As :func:`share_caught`, of a source after Lambert's law: a closed form.

    J. R. Howell, A Catalog of Radiation Configuration Factors, B-3, summed over the corners.
    """

    def corner(a, b):
        p, q = np.sqrt(1 + a**2), np.sqrt(1 + b**2)
        return a / p * np.arctan(b / p) + b / q * np.arctan(a / q)

    return _over_corners(corner, x, y, z, size)


def isotropic_share(x, y, z: float, size: tuple[float, float]) -> np.ndarray:
    """As :func:`share_caught`, of a source that is even over the half-space: the rectangle's solid angle over 2 pi."""
    return _over_corners(lambda a, b: np.arctan2(a * b, np.sqrt(1 + a**2 + b**2)), x, y, z, size)


def _over_corners(corner, x, y, z: float, size: tuple[float, float]) -> np.ndarray:
    (left, right), (front, back) = (
        ((-0.5 * length - place) / z, (0.5 * length - place) / z) for place, length in ((x, size[0]), (y, size[1]))
    )
    return (corner(right, back) - corner(left, back) - corner(right, front) + corner(left, front)) / (2 * np.pi)


def share_caught(law: str, cone: float, x, y, z: float, size: tuple[float, float], nodes: int = 16) -> np.ndarray:
    """Share of what a point source at (x, y, z) sends down that falls on a rectangle about the origin.

    It is the integral of W(r) / (2 pi) over the polar angle about the source's foot, along the outline, where W(r) is
    the share that falls within the distance r of that foot. Along a side at distance a, the variable is u in
    r = a cosh(u). The irradiance of the point by a rectangle that emits by that law is the same integral, divided by
    the rectangle's area.
    """
    reach = _reach(z, law, cone)
    points, weights = np.polynomial.legendre.leggauss(nodes)
    half_x, half_y = 0.5 * size[0], 0.5 * size[1]
    sides = ((half_x - x, y, half_y), (half_x + x, -y, half_y), (half_y - y, -x, half_x), (half_y + y, x, half_x))
    total = np.zeros(np.broadcast(x, y).shape)
    for a, foot, half in sides:
        a, start, end = np.broadcast_arrays(a, -half - foot, half - foot)
        distance = np.abs(a)
        chord = np.sqrt(np.maximum(reach**2 - a**2, 0))
        first, last = np.clip(-chord, start, end), np.clip(chord, start, end)
        middle = np.clip(0, first, last)
        # Beyond the reach of the cone everything has fallen nearer.
        angle = sum(np.arctan2(q, distance) - np.arctan2(p, distance) for p, q in ((start, first), (last, end)))
        for p, q in ((first, middle), (middle, last)):
            u0, u1 = np.arcsinh(p / distance), np.arcsinh(q / distance)
            u = 0.5 * (u0 + u1)[..., None] + 0.5 * (u1 - u0)[..., None] * points
            within = _share_within(law, cone, distance[..., None] * np.cosh(u) / z)
            angle += 0.5 * (u1 - u0) * ((within / np.cosh(u)) @ weights)
        total += np.sign(a) * angle
    return total / (2 * np.pi)


def _share_within(law: str, cone: float, tangent: np.ndarray) -> np.ndarray:
    """Share of the power that leaves at angles against the normal with up to this tangent."""
    if law == "lambertian":
        return tangent**2 / (1 + tangent**2)
    if law == "uniform_polar_angle":
        return np.minimum(np.arctan(tangent), cone) / cone
    return np.minimum(0.5 - 0.5 / np.sqrt(1 + tangent**2), math.sin(0.5 * cone) ** 2) / math.sin(0.5 * cone) ** 2


def _reach(z: float, law: str, cone: float) -> float:
    """How far from its foot a source at height ``z`` lights."""
    return math.inf if law == "lambertian" or cone >= 0.5 * math.pi else z * math.tan(cone)


def _edges(size: float, reach: float) -> list[float]:
    """Where the light of an LED on a plate begins to fall off, on either side, and where it ends."""
    beyond = (0.0,) if math.isinf(reach) else (-reach, 0.0, reach)
    return [sign * 0.5 * size + shift for sign in (-1, 1) for shift in beyond]


def _graded(low: float, high: float, edges, scale: float, fineness: float = 0.7) -> tuple[np.ndarray, np.ndarray]:
    """Gauss-Legendre nodes and weights on panels no longer than ``scale`` and the distance from ``edges``."""
    nodes, weights = np.polynomial.legendre.leggauss(PANEL_NODES)
    cuts = np.unique(np.clip([low, *edges, high], low, high))
    todo = list(zip(cuts[:-1], cuts[1:], strict=True))
    panels = []
    while todo:
        a, b = todo.pop()
        distance = min(min(abs(a - edge), abs(b - edge)) for edge in edges)
        longest = min(scale + distance, max(0.2, 0.2 * distance)) / fineness
        if b - a > longest:
            todo += [(a, 0.5 * (a + b)), (0.5 * (a + b), b)]
        else:
            panels.append((a, b))
    start, end = np.array(panels).T
    middle, half = 0.5 * (start + end), 0.5 * (end - start)
    return (middle[:, None] + half[:, None] * nodes).ravel(), (half[:, None] * weights).ravel()
