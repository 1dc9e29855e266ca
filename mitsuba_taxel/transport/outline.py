"""What an LED sends onto patches, or a phototransistor accepts from them, by integrals along their outlines.

The power of a point source within an outline is the integral of F(theta) dphi along it / (2 pi), where F is the share
of its power up to the polar angle theta, and phi the azimuth: Green's theorem on the sphere of directions. It needs
neither the pieces nor the rules of the integrals over patches, and checks these.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mitsuba_taxel.geometry.unique_rows import unique_rows
from mitsuba_taxel.transport.rules import gauss

POINTS = 6
"""Points of Gauss' rule on a part of a side, and on each of its halves."""
TOLERANCE = 1e-6
"""Largest difference, as share of the source's power, of the rule on a part of a side and on its halves."""
MOST_CUTS = 24
GRAIN = 1e-7
"""Relative to the largest coordinate: sides whose points differ by less are the same."""
_SIDES = np.array([[0, 1, 2, 3, 4], [4, 8, 11, 13, 14], [14, 12, 9, 5, 0]])
"""(3, 5) numbers of a patch's points (see `LATTICE`) along its sides, counterclockwise in (s, t)."""
_POWERS = np.arange(5)
_POLYNOMIAL = np.linalg.inv(np.vander(_POWERS / 4, increasing=True))
"""(5, 5) from five points of a side to the coefficients of the polynomial through them."""

_FIRST = (0.0, 1.0), (0.0, 0.5), (0.5, 0.5)
"""Start and width of a side and its halves."""

Cumulative = Callable[[np.ndarray], np.ndarray]
"""Takes cosines of polar angles, and returns the share of the power at smaller angles."""


def power_within(points: np.ndarray, normal: np.ndarray, within: Cumulative, places: np.ndarray) -> np.ndarray:
    """Share of the power of each point source within the outline of each patch.

    Parameters
    ----------
    points : (L, 3) ndarray
        The sources, in mm.
    normal : (3,) ndarray
        Unit vector along the axis of their light.
    within : Cumulative
    places : (F, 15, 3) ndarray
        Of the patches, in mm; they face the sources.

    Returns
    -------
    (L, F) ndarray
        Negative for a patch that turns its back on the source.
    """
    frame = _frame(normal)
    side, sign, own = _shared((places[:, _SIDES] @ frame.T).reshape(-1, 5, 3))
    source, coefficients = points @ frame.T, _POLYNOMIAL @ side

    # All sources see the same points of whole sides and of their halves.
    parts = [_points(coefficients, *(np.full(len(side), value) for value in part)) for part in _FIRST]
    whole, *first = (_integrals(at[:, None] - source[:, None], rate[:, None], within) for at, rate in parts)
    amounts = first[0] + first[1]
    number, of = np.nonzero(np.abs(amounts - whole) > TOLERANCE)
    amounts[number, of] = 0

    # The parts that do not agree with the sum of their halves are halved again, for their sources alone.
    halves = np.stack([each[number, of] for each in first], axis=1).ravel()
    start = np.tile([0.0, 0.5], len(number))
    number, of, width = np.repeat(number, 2), np.repeat(of, 2), np.full(len(start), 0.5)
    for _ in range(MOST_CUTS):
        if not len(number):
            break
        whole = halves
        number, of, width = np.repeat(number, 2), np.repeat(of, 2), np.repeat(width / 2, 2)
        start = np.repeat(start, 2)
        start[1::2] += width[1::2]
        at, rate = _points(coefficients[number], start, width)
        halves = _integrals(at - source[of][:, None], rate, within)
        both = halves[::2] + halves[1::2]
        agree = np.abs(both - whole) <= TOLERANCE
        np.add.at(amounts, (number[::2][agree], of[::2][agree]), both[agree])
        left = np.repeat(~agree, 2)
        number, of, start, width, halves = number[left], of[left], start[left], width[left], halves[left]
    np.add.at(amounts, (number, of), halves)
    return (sign[:, None] * amounts[own]).reshape(len(places), 3, -1).sum(axis=1).T


def _points(coefficients: np.ndarray, start: np.ndarray, width: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N, P, 3) points of the rule on parts of sides with coefficients (N, 5, 3), and their rates along the part."""
    along = start[:, None] + width[:, None] * gauss(POINTS)[0]
    powers = along[..., None] ** _POWERS
    rates = np.zeros_like(powers)
    rates[..., 1:] = width[:, None, None] * _POWERS[1:] * powers[..., :-1]
    return powers @ coefficients, rates @ coefficients


def _integrals(away: np.ndarray, rate: np.ndarray, within: Cumulative) -> np.ndarray:
    """(...) integrals of F dphi / (2 pi) along parts of sides at ``away`` (..., P, 3), clockwise seen from above."""
    (x, y, z), (dx, dy) = np.moveaxis(away, -1, 0), np.moveaxis(rate[..., :2], -1, 0)
    across = np.maximum(x**2 + y**2, np.finfo(float).tiny)
    turn = (y * dx - x * dy) / across
    return (within(z / np.sqrt(across + z**2)) * turn) @ gauss(POINTS)[1] / (2 * np.pi)


def _shared(sides: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Different sides (E, 5, 3), and of each side (S, 5, 3) the sign of its direction in them and its number there."""
    grain = GRAIN * np.abs(sides).max()
    ends = np.round(sides[:, [0, -1]] / grain).astype(np.int64)
    backwards = (ends[:, 0] * [4, 2, 1]).sum(axis=1) > (ends[:, 1] * [4, 2, 1]).sum(axis=1)
    forward = np.where(backwards[:, None, None], sides[:, ::-1], sides)
    keys = np.round(forward[:, [0, 2, -1]].reshape(-1, 9) / grain).astype(np.int64)
    first, own = unique_rows(keys)
    return forward[first], np.where(backwards, -1.0, 1.0), own


def _frame(normal: np.ndarray) -> np.ndarray:
    """(3, 3) rows: two directions across a unit vector, and itself, right-handed."""
    first = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(normal, first), normal])
