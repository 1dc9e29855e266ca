"""Light that an LED sends onto patches, or a phototransistor accepts from them, by integrals along their outlines.

The power of a point source within an outline is the integral of F(theta) dphi along the outline, divided by 2 pi. F is
the fraction of the power up to the polar angle theta, and phi is the azimuth (Green's theorem on the sphere of
directions). This integral needs no pieces and no quadrature rules of patches. It is therefore an independent check of
the integrals over patches.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mitsuba_taxel.geometry.unique_rows import unique_rows
from mitsuba_taxel.transport.rules import gauss

POINTS = 6
"""Points of Gauss' rule on an interval of a side, and on each of its halves."""
TOLERANCE = 1e-6
"""Largest difference between the rule on an interval and on its two halves, as fraction of the source's power."""
MOST_CUTS = 24
"""Largest number of times that an interval is halved."""
GRAIN = 1e-7
"""Largest difference between the points of two sides that count as the same side, relative to the largest
coordinate."""
_SIDES = np.array([[0, 1, 2, 3, 4], [4, 8, 11, 13, 14], [14, 12, 9, 5, 0]])
"""Numbers (3, 5) of a patch's points (see `LATTICE`) along its sides, counterclockwise in (s, t)."""
_POWERS = np.arange(5)
_POLYNOMIAL = np.linalg.inv(np.vander(_POWERS / 4, increasing=True))
"""Matrix (5, 5) from five points of a side to the coefficients of the polynomial through them."""

_FIRST = (0.0, 1.0), (0.0, 0.5), (0.5, 0.5)
"""Start and width of the intervals of a side and of its two halves."""

Cumulative = Callable[[np.ndarray], np.ndarray]
"""Function of the cosines of polar angles that returns the fraction of the power within these angles."""


def power_within(points: np.ndarray, normal: np.ndarray, within: Cumulative, positions: np.ndarray) -> np.ndarray:
    """Fraction of the power of each point source within the outline of each patch.

    Parameters
    ----------
    points : (L, 3) ndarray
        Positions of the L sources, in mm.
    normal : (3,) ndarray
        Unit vector along the axis of their light.
    within : Cumulative
        Angular law of the sources.
    positions : (F, 15, 3) ndarray
        Positions of the F patches, in mm; they face the sources.

    Returns
    -------
    (L, F) ndarray
        Fractions; negative for a patch whose back faces the source.
    """
    # The polar axis is the third axis of a right-handed frame.
    across = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    across /= np.linalg.norm(across)
    frame = np.stack([across, np.cross(normal, across), normal])
    sides, sign, side_of = _distinct((positions[:, _SIDES] @ frame.T).reshape(-1, 5, 3))
    sources, coefficients = points @ frame.T, _POLYNOMIAL @ sides

    # All sources see the same points of entire sides and of their halves.
    rules = [_points(coefficients, *(np.full(len(sides), value) for value in interval)) for interval in _FIRST]
    entire, *first = (_integrals(at[:, None] - sources[:, None], rate[:, None], within) for at, rate in rules)
    integrals = first[0] + first[1]
    side, source = np.nonzero(np.abs(integrals - entire) > TOLERANCE)
    integrals[side, source] = 0

    # Intervals that do not agree with the sum of their halves are halved again, for the sources concerned.
    halves = np.stack([half[side, source] for half in first], axis=1).ravel()
    start = np.tile([0.0, 0.5], len(side))
    side, source, width = np.repeat(side, 2), np.repeat(source, 2), np.full(len(start), 0.5)
    for _ in range(MOST_CUTS):
        if not len(side):
            break
        entire = halves
        side, source, width = np.repeat(side, 2), np.repeat(source, 2), np.repeat(width / 2, 2)
        start = np.repeat(start, 2)
        start[1::2] += width[1::2]
        at, rate = _points(coefficients[side], start, width)
        halves = _integrals(at - sources[source][:, None], rate, within)
        both = halves[::2] + halves[1::2]
        agree = np.abs(both - entire) <= TOLERANCE
        np.add.at(integrals, (side[::2][agree], source[::2][agree]), both[agree])
        unresolved = np.repeat(~agree, 2)
        side, source, start, width, halves = (
            side[unresolved],
            source[unresolved],
            start[unresolved],
            width[unresolved],
            halves[unresolved],
        )
    np.add.at(integrals, (side, source), halves)
    return (sign[:, None] * integrals[side_of]).reshape(len(positions), 3, -1).sum(axis=1).T


def _points(coefficients: np.ndarray, start: np.ndarray, width: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Quadrature points (N, P, 3) on N intervals of the sides of patches, P on each, and their derivatives (N, P, 3)
    along the interval. Sides are polynomials with coefficients (N, 5, 3)."""
    along = start[:, None] + width[:, None] * gauss(POINTS)[0]
    powers = along[..., None] ** _POWERS
    rates = np.zeros_like(powers)
    rates[..., 1:] = width[:, None, None] * _POWERS[1:] * powers[..., :-1]
    return powers @ coefficients, rates @ coefficients


def _integrals(away: np.ndarray, rate: np.ndarray, within: Cumulative) -> np.ndarray:
    """Integrals (...) of F dphi / (2 pi) along intervals of sides, whose P points are at ``away`` (..., P, 3) from the
    sources.

    They are positive where the side runs clockwise as seen from above.
    """
    x, y, z, dx, dy = away[..., 0], away[..., 1], away[..., 2], rate[..., 0], rate[..., 1]
    across = np.maximum(x**2 + y**2, np.finfo(float).tiny)
    turn = (y * dx - x * dy) / across
    return (within(z / np.sqrt(across + z**2)) * turn) @ gauss(POINTS)[1] / (2 * np.pi)


def _distinct(sides: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The distinct sides (E, 5, 3) among sides (S, 5, 3): adjacent patches share a side, in opposite directions.

    Also returned are, for each side, the sign (S,) of its direction and its number (S,) among the distinct sides.
    """
    grain = GRAIN * np.abs(sides).max()
    ends = np.round(sides[:, [0, -1]] / grain).astype(np.int64)
    backwards = (ends[:, 0] * [4, 2, 1]).sum(axis=1) > (ends[:, 1] * [4, 2, 1]).sum(axis=1)
    forward = np.where(backwards[:, None, None], sides[:, ::-1], sides)
    keys = np.round(forward[:, [0, 2, -1]].reshape(-1, 9) / grain).astype(np.int64)
    first, number = unique_rows(keys)
    return forward[first], np.where(backwards, -1.0, 1.0), number
