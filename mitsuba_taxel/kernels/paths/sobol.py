"""Sobol' points as integers: S. Joe and F. Y. Kuo, SIAM J. Sci. Comput. 30 (2008) 2635, set new-joe-kuo-6."""

from __future__ import annotations

import numpy as np

# Per dimension after the first: primitive polynomial as a bit mask, and the initial odd direction numbers.
_JOE_KUO = (
    (3, (1,)),
    (7, (1, 3)),
    (11, (1, 3, 1)),
    (13, (1, 1, 1)),
    (19, (1, 1, 3, 3)),
    (25, (1, 3, 5, 13)),
    (37, (1, 1, 5, 5, 17)),
    (41, (1, 1, 5, 5, 5)),
    (47, (1, 1, 7, 11, 19)),
    (55, (1, 1, 5, 1, 1)),
    (59, (1, 1, 1, 3, 11)),
    (61, (1, 3, 5, 5, 31)),
    (67, (1, 3, 3, 9, 7, 49)),
    (91, (1, 1, 1, 15, 21, 21)),
    (97, (1, 3, 1, 13, 27, 49)),
    (103, (1, 1, 1, 15, 7, 5)),
    (109, (1, 3, 1, 15, 13, 25)),
    (115, (1, 1, 5, 5, 19, 61)),
    (131, (1, 3, 7, 11, 23, 15, 103)),
    (137, (1, 3, 7, 13, 13, 15, 69)),
    (143, (1, 1, 3, 13, 7, 35, 63)),
    (145, (1, 3, 5, 9, 1, 25, 53)),
    (157, (1, 3, 1, 13, 9, 35, 107)),
)
DIMENSIONS = len(_JOE_KUO) + 1


def sobol_points(count: int) -> np.ndarray:
    """The first Sobol' points.

    Parameters
    ----------
    count : int
        Number of points, a power of two.

    Returns
    -------
    (DIMENSIONS, count) ndarray of uint32
        Coordinate d of point i is ``points[d, i] / 2**32``.
    """
    points = np.zeros((DIMENSIONS, count), dtype=np.uint32)
    for d in range(DIMENSIONS):
        directions = _direction_numbers(d)
        for bit in range(count.bit_length() - 1):
            half = 1 << bit
            np.bitwise_xor(points[d, :half], directions[bit], out=points[d, half : 2 * half])
    return points


def _direction_numbers(dimension: int) -> np.ndarray:
    """The 32 direction numbers of a dimension, left-aligned in 32 bits."""
    if dimension == 0:
        return np.array([1 << (31 - bit) for bit in range(32)], dtype=np.uint32)
    polynomial, initial = _JOE_KUO[dimension - 1]
    degree = len(initial)
    numbers = [m << (31 - bit) for bit, m in enumerate(initial)]
    for bit in range(degree, 32):
        value = numbers[bit - degree] ^ (numbers[bit - degree] >> degree)
        for k in range(1, degree):
            if polynomial >> (degree - k) & 1:
                value ^= numbers[bit - k]
        numbers.append(value)
    return np.array(numbers, dtype=np.uint32)
