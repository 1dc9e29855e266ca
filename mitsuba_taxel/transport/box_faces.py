"""Faces of a box as patches that scatter light, its top cut along the edges of openings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mitsuba_taxel.transport.box import Box
from mitsuba_taxel.transport.patches import LATTICE

THIN = 1e-6
"""Width of strips that are left out, relative to the box."""

Rectangle = tuple[float, float, float, float]
"""From x to x, and from y to y, in the frame of the top."""


@dataclass(frozen=True, eq=False)
class BoxFaces:
    """Rectangles on the faces of a box.

    Attributes
    ----------
    corner : (R, 3) ndarray
        In mm.
    sides : (R, 2, 3) ndarray
        Two sides, such that their cross product points outwards.
    kind : (R,) ndarray
        Number of the opening in which each lies, -1 on the box itself.
    """

    corner: np.ndarray
    sides: np.ndarray
    kind: np.ndarray

    def among(self, kept: np.ndarray) -> BoxFaces:
        """Those of a mask (R,)."""
        return BoxFaces(self.corner[kept], self.sides[kept], self.kind[kept])

    def cuts(self, longest: float) -> np.ndarray:
        """(R, 2) numbers of equal parts of both sides, such that these are at most ``longest`` mm. They may be slender:
        nothing that they see is near, as the box is convex."""
        return np.ceil(np.linalg.norm(self.sides, axis=2) / longest * (1 - THIN)).astype(int)

    def places(self, cuts: np.ndarray) -> np.ndarray:
        """(G, 15, 3) positions of patches, two for each part of a rectangle."""
        found = [np.empty((0, len(LATTICE), 3))]
        for corner, sides, (across, along) in zip(self.corner, self.sides, cuts, strict=True):
            one, other = sides / ((across,), (along,))
            steps = np.arange(across)[:, None, None] * one + np.arange(along)[:, None] * other
            starts = corner + steps.reshape(-1, 3)
            half = LATTICE @ np.stack([one, other])
            found += [starts[:, None] + half, starts[:, None] + one + other - half]
        return np.concatenate(found)


def faces_of(box: Box, openings: Sequence[Rectangle]) -> BoxFaces:
    """The sides of a box and its top, around ``openings`` and in these; its bottom is left out.

    Parameters
    ----------
    box : Box
        In mm.
    openings : sequence of Rectangle
        In its top.

    Returns
    -------
    BoxFaces
        Rectangles, and the opening of each.
    """
    (x, y, z), (a, b, c) = box.half, box.half[:, None] * box.axes
    top = [(each, -1) for each in around((-x, x, -y, y), openings)]
    top += [(_within(each, (-x, x, -y, y)), number) for number, each in enumerate(openings)]
    corners = [np.array([left, near, z]) @ box.axes for (left, _, near, _), _ in top]
    sides = [np.array([[right - left, 0, 0], [0, far - near, 0]]) @ box.axes for (left, right, near, far), _ in top]
    corners += [-a - b - c, a - b - c, a + b - c, -a + b - c]
    sides += [np.stack([2 * along, 2 * c]) for along in (a, b, -a, -b)]
    kind = [number for _, number in top] + [-1] * 4
    return BoxFaces(np.array(corners) + box.centre, np.array(sides), np.array(kind))


def around(whole: Rectangle, openings: Sequence[Rectangle]) -> list[Rectangle]:
    """Rectangles that cover a whole one but for openings, which may overlap and reach beyond it."""
    inner = [_within(opening, whole) for opening in openings]
    thin = THIN * max(whole[1] - whole[0], whole[3] - whole[2])
    edges = sorted({*whole[:2], *(x for each in inner for x in each[:2])})
    found = []
    for left, right in zip(edges, edges[1:], strict=False):
        middle, at = (left + right) / 2, whole[2]
        if right - left <= thin:
            continue
        here = sorted(each[2:] for each in inner if each[0] < middle < each[1])
        for near, far in [*here, (whole[3], whole[3])]:
            if near - at > thin:
                found.append((left, right, at, near))
            at = max(at, far)
    return found


def _within(one: Rectangle, whole: Rectangle) -> Rectangle:
    left, right, near, far = (float(each) for each in np.clip(one, np.repeat(whole[::2], 2), np.repeat(whole[1::2], 2)))
    return left, right, near, far
