"""Faces of a box as patches that scatter light. The top is cut along the edges of openings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mitsuba_taxel.transport.box import Box
from mitsuba_taxel.transport.patches import LATTICE

THIN = 1e-6
"""Width, relative to the box, up to which a strip is omitted."""

Rectangle = tuple[float, float, float, float]
"""(x_min, x_max, y_min, y_max) in mm, in the frame of the top."""


@dataclass(frozen=True, eq=False)
class BoxFaces:
    """R rectangles on the faces of a box.

    Attributes
    ----------
    corner : (R, 3) ndarray
        Corner from which both sides start, in mm.
    sides : (R, 2, 3) ndarray
        Two sides, such that their cross product points outwards.
    kind : (R,) ndarray
        Number of the opening in which the rectangle lies, -1 outside of openings.
    """

    corner: np.ndarray
    sides: np.ndarray
    kind: np.ndarray

    def among(self, kept: np.ndarray) -> BoxFaces:
        """The rectangles that a mask (R,) selects."""
        return BoxFaces(self.corner[kept], self.sides[kept], self.kind[kept])

    def cuts(self, longest: float) -> np.ndarray:
        """Numbers (R, 2) of equal parts into which both sides are divided, so that parts are at most ``longest`` mm.

        Patches may be slender, because the box is convex: no wall that they see is close to them.
        """
        return np.ceil(np.linalg.norm(self.sides, axis=2) / longest * (1 - THIN)).astype(int)

    def positions(self, cuts: np.ndarray) -> np.ndarray:
        """Positions (G, 15, 3) in mm of the points of G patches, two triangles for each part of a rectangle."""
        patches = [np.empty((0, len(LATTICE), 3))]
        for corner, sides, (across, along) in zip(self.corner, self.sides, cuts, strict=True):
            u, v = sides / ((across,), (along,))
            steps = np.arange(across)[:, None, None] * u + np.arange(along)[:, None] * v
            starts = corner + steps.reshape(-1, 3)
            half = LATTICE @ np.stack([u, v])
            patches += [starts[:, None] + half, starts[:, None] + u + v - half]
        return np.concatenate(patches)


def faces_of(box: Box, openings: Sequence[Rectangle]) -> BoxFaces:
    """Rectangles that cover the sides and the top of a box, without the bottom. The top is divided so that each
    rectangle lies within one opening, or outside all openings.

    Parameters
    ----------
    box : Box
        The box, in mm.
    openings : sequence of Rectangle
        Openings in the top of the box.

    Returns
    -------
    BoxFaces
        Rectangles, and the opening of each.
    """
    (x, y, z), (a, b, c) = box.half, box.half[:, None] * box.axes
    top = [(rectangle, -1) for rectangle in around((-x, x, -y, y), openings)]
    top += [(_clipped(opening, (-x, x, -y, y)), number) for number, opening in enumerate(openings)]
    corners = [np.array([x_min, y_min, z]) @ box.axes for (x_min, _, y_min, _), _ in top]
    sides = [
        np.array([[x_max - x_min, 0, 0], [0, y_max - y_min, 0]]) @ box.axes for (x_min, x_max, y_min, y_max), _ in top
    ]
    # The four sides, from a vertical edge of each.
    corners += [-a - b - c, a - b - c, a + b - c, -a + b - c]
    sides += [np.stack([2 * along, 2 * c]) for along in (a, b, -a, -b)]
    kind = [number for _, number in top] + [-1] * 4
    return BoxFaces(np.array(corners) + box.centre, np.array(sides), np.array(kind))


def around(face: Rectangle, openings: Sequence[Rectangle]) -> list[Rectangle]:
    """Rectangles that cover a face except its openings.

    Parameters
    ----------
    face : Rectangle
        Face that is covered.
    openings : sequence of Rectangle
        Openings, which may overlap and extend beyond the face.

    Returns
    -------
    list of Rectangle
        Rectangles that do not overlap; strips thinner than `THIN` are left out.
    """
    inner = [_clipped(opening, face) for opening in openings]
    thin = THIN * max(face[1] - face[0], face[3] - face[2])
    edges = sorted({*face[:2], *(x for opening in inner for x in opening[:2])})
    rectangles = []
    # Between two adjacent edges in x, each opening covers a range of y or nothing: the ranges between are kept.
    for x_min, x_max in zip(edges, edges[1:], strict=False):
        middle, y = (x_min + x_max) / 2, face[2]
        if x_max - x_min <= thin:
            continue
        open_ranges = sorted(opening[2:] for opening in inner if opening[0] < middle < opening[1])
        for y_min, y_max in [*open_ranges, (face[3], face[3])]:
            if y_min - y > thin:
                rectangles.append((x_min, x_max, y, y_min))
            y = max(y, y_max)
    return rectangles


def _clipped(rectangle: Rectangle, face: Rectangle) -> Rectangle:
    """The intersection of a rectangle with a face."""
    limits = np.repeat(face[::2], 2), np.repeat(face[1::2], 2)
    x_min, x_max, y_min, y_max = (float(edge) for edge in np.clip(rectangle, *limits))
    return x_min, x_max, y_min, y_max
