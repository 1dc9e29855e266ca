"""Quadrature rules on triangles and rectangles, and the polynomials through their points.

Points of triangles are (s, t): the corners are (0, 0), (1, 0) and (0, 1); weights add up to the area of 1/2.
"""

from __future__ import annotations

import math

import numpy as np

from mitsuba_taxel.base.caches import kept

Rule = tuple[np.ndarray, np.ndarray]
"""Points (Q, 2) and weights (Q,)."""

_ORBITS = {
    1: ((1 / 6, 1 / 3),),
    2: ((0.445948490915965, 0.223381589678011), (0.091576213509771, 0.109951743655322)),
}


@kept(128)
def triangle_rule(degree: int) -> Rule:
    """The symmetric quadrature rule on the triangle with as many points as a polynomial of the given degree has
    coefficients.

    Source: D. A. Dunavant, High degree efficient symmetrical Gaussian quadrature rules for the triangle, International
    Journal for Numerical Methods in Engineering 21, 1985.

    Parameters
    ----------
    degree : int
        1 or 2; the rule is exact for polynomials of twice this degree.

    Returns
    -------
    points : (Q, 2) ndarray
        Points: 3 for degree 1, 6 for degree 2.
    weights : (Q,) ndarray
        Weights, whose sum is 1/2.
    """
    points = [point for a, _ in _ORBITS[degree] for point in ((a, a), (a, 1 - 2 * a), (1 - 2 * a, a))]
    weights = [weight / 2 for _, weight in _ORBITS[degree] for _ in range(3)]
    return np.array(points), np.array(weights)


def monomials(points: np.ndarray, degree: int) -> np.ndarray:
    """All monomials s^i t^j up to a degree.

    Parameters
    ----------
    points : (Q, 2) ndarray
        Coordinates (s, t).
    degree : int
        Largest i + j.

    Returns
    -------
    (Q, C) ndarray
        Values of the C monomials; each column is contiguous in memory.
    """
    table = np.empty((len(_exponents(degree)), len(points)))
    table[0] = 1
    numbers = {exponents: number for number, exponents in enumerate(_exponents(degree))}
    s, t = np.ascontiguousarray(points.T)
    for (i, j), number in numbers.items():
        if i:
            np.multiply(table[numbers[i - 1, j]], s, out=table[number])
        elif j:
            np.multiply(table[numbers[i, j - 1]], t, out=table[number])
    return table.T


@kept(128)
def differentiated(degree: int) -> np.ndarray:
    """Three matrices (3, C, C) that act on the C coefficients of a polynomial: the identity, and the derivatives with
    respect to s and t.
    """
    numbers = {exponents: number for number, exponents in enumerate(_exponents(degree))}
    result = np.stack([np.eye(len(numbers)), *np.zeros((2, len(numbers), len(numbers)))])
    for (i, j), number in numbers.items():
        if i:
            result[1, numbers[i - 1, j], number] = i
        if j:
            result[2, numbers[i, j - 1], number] = j
    return result


@kept(128)
def _exponents(degree: int) -> list[tuple[int, int]]:
    return [(i, total - i) for total in range(degree + 1) for i in range(total + 1)]


@kept(128)
def coefficients(degree: int) -> np.ndarray:
    """Matrix (C, Q) that computes the coefficients of the interpolating polynomial from values at the points of
    :func:`triangle_rule`.
    """
    return np.linalg.inv(monomials(triangle_rule(degree)[0], degree))


@kept(128)
def gauss(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points (count,) and weights (count,) of Gauss' rule on [0, 1]."""
    points, weights = np.polynomial.legendre.leggauss(count)
    return (points + 1) / 2, weights / 2


def rectangle_rule(width: float, depth: float, columns: int, rows: int) -> Rule:
    """Gauss rule on a rectangle around (0, 0).

    Parameters
    ----------
    width, depth : float
        Width and depth along x and y, mm.
    columns, rows : int
        Numbers of points along x and y.

    Returns
    -------
    points : (n, 2) ndarray
        Positions in mm.
    weights : (n,) ndarray
        Weights, which add up to the area, mm².
    """
    (x, of_x), (y, of_y) = gauss(columns), gauss(rows)
    points = np.stack(np.meshgrid((x - 0.5) * width, (y - 0.5) * depth, indexing="ij"), axis=-1).reshape(-1, 2)
    return points, (np.outer(of_x, of_y) * width * depth).ravel()


def square_annulus_rule(outer: float, inner: float, along: int, across: int) -> Rule:
    """Quadrature rule on a square with a square hole: four rectangles around the hole.

    Parameters
    ----------
    outer, inner : float
        Widths of square and hole, mm.
    along, across : int
        Numbers of points along and across each rectangle.

    Returns
    -------
    points : (n, 2) ndarray
        Positions in mm.
    weights : (n,) ndarray
        Weights, which add up to the area, mm².
    """
    if inner == 0:
        return rectangle_rule(outer, outer, along, along)
    width, depth = (outer + inner) / 2, (outer - inner) / 2
    points, weights = rectangle_rule(width, depth, along, across)
    points = points + ((width - outer) / 2, (depth - outer) / 2)
    turned = [points]
    for _ in range(3):
        turned.append(np.stack([-turned[-1][:, 1], turned[-1][:, 0]], axis=1))
    return np.concatenate(turned), np.tile(weights, 4)


def disc_annulus_rule(outer: float, inner: float, rings: int, spokes: int) -> Rule:
    """Quadrature rule on a disc with a round hole: Gauss' rule in r^2, equally spaced in the angle.

    Parameters
    ----------
    outer, inner : float
        Diameters of disc and hole, mm.
    rings, spokes : int
        Numbers of points along the radius and the angle.

    Returns
    -------
    points : (n, 2) ndarray
        Positions in mm.
    weights : (n,) ndarray
        Weights, which add up to the area, mm².
    """
    nodes, weights = gauss(rings)
    radius = 0.5 * np.sqrt(inner**2 + nodes * (outer**2 - inner**2))
    angle = 2 * math.pi * (np.arange(spokes) + 0.5) / spokes
    points = np.stack([np.outer(radius, np.cos(angle)), np.outer(radius, np.sin(angle))], axis=-1).reshape(-1, 2)
    return points, np.repeat(weights, spokes) / spokes * math.pi / 4 * (outer**2 - inner**2)


def polar_rule(target: np.ndarray, count: int) -> Rule:
    """Quadrature rule on the triangle for functions that grow as 1 / distance from a target.

    The target and each side form a triangle, with Gauss' rule along rays from the target. Directions of the rays are
    spaced by a hyperbolic sine, as the target may lie close to a side, in the plane where the triangle is equilateral.
    Source: B. M. Johnston, P. R. Johnston, D. Elliott, A sinh transformation for evaluating two-dimensional nearly
    singular boundary element integrals, International Journal for Numerical Methods in Engineering 69, 2007.

    Parameters
    ----------
    target : (2,) ndarray
        Coordinates (s, t) in the triangle.
    count : int
        Number of points along a ray, and of rays in each of the three triangles.

    Returns
    -------
    points : (3 count², 2) ndarray
        Coordinates (s, t).
    weights : (3 count²,) ndarray
        Weights, whose sum is 1/2.
    """
    equilateral = np.array([[1.0, 0.0], [0.5, math.sqrt(3) / 2]])
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    (along, of_along), (across, of_across) = gauss(count), gauss(count)
    points, weights = [], []
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        side, to_start = (end - start) @ equilateral, (start - target) @ equilateral
        length = np.linalg.norm(side)
        first = to_start @ side / length
        height = math.sqrt(to_start @ to_start - first**2)
        # Position along the side, from the foot of the target, and its derivative with respect to the variable of
        # Gauss' rule.
        low, high = math.asinh(first / height), math.asinh((first + length) / height)
        position = height * np.sinh(low + across * (high - low))
        rate = np.sqrt(height**2 + position**2) * (high - low) / length
        rim = start + ((position - first) / length)[:, None] * (end - start)
        twice_area = abs((start - target)[0] * (end - target)[1] - (start - target)[1] * (end - target)[0])
        points.append((target + along[:, None, None] * (rim - target)).reshape(-1, 2))
        weights.append((np.outer(of_along * along, of_across * rate) * twice_area).ravel())
    return np.concatenate(points), np.concatenate(weights)
