"""Markers on the coat of a pad without cells: a regular grid of dark dots, which move with the silicone."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mitsuba_taxel.base.arguments import as_numbers
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.pads.block import Block

MOST_MARKERS = 10_000
"""Largest number of markers."""
PIXELS = 2048
"""Number of pixels of the map of the markers along the longer side of the block."""


class Markers(NamedTuple):
    """A grid of round markers, with one at the centre of the top.

    Attributes
    ----------
    spacing_x, spacing_y : float
        Distances of their centres along x and y, in mm.
    radius : float
        Radius on the unloaded top, in mm, seen along z.
    """

    spacing_x: float
    spacing_y: float
    radius: float

    def centres(self, block: Block) -> np.ndarray:
        """Centres of the markers that lie on a block as a whole.

        Parameters
        ----------
        block : Block
            The block.

        Returns
        -------
        (M, 2) ndarray
            x and y in mm of the unloaded markers, row by row: x rises first, then y.
        """
        sides = zip((block.width, block.depth), (self.spacing_x, self.spacing_y), strict=True)
        most = [math.floor((0.5 * side - self.radius) / spacing) for side, spacing in sides]
        along = [np.arange(-m, m + 1) * spacing for m, spacing in zip(most, self[:2], strict=True)]
        x, y = np.meshgrid(*along)
        return np.stack([x.ravel(), y.ravel()], axis=1)

    def map_on(self, block: Block) -> np.ndarray:
        """Image of the top of a block that shows where its markers are.

        Parameters
        ----------
        block : Block
            The block.

        Returns
        -------
        (H, W) ndarray of float32
            Part of each pixel that a marker covers, from 0 to 1; columns run along x and rows along y.
        """
        scale = PIXELS / max(block.width, block.depth)
        width, height = (max(1, round(side * scale)) for side in (block.width, block.depth))
        x = ((np.arange(width) + 0.5) / width - 0.5) * block.width
        y = ((np.arange(height) + 0.5) / height - 0.5) * block.depth
        counts = (np.abs(self.centres(block)) / self[:2]).max(axis=0)
        # Distance from the nearest centre; beyond the outermost centres there are no others.
        apart = []
        for places, spacing, count in zip((x, y), self[:2], counts, strict=True):
            apart.append(places - spacing * np.clip(np.round(places / spacing), -round(count), round(count)))
        distance = np.hypot(apart[0][None, :], apart[1][:, None])
        # Edges are blurred over a pixel, which adds pi / 12 pixels to the area: a smaller radius has the right area.
        radius = math.sqrt(self.radius**2 - 1 / (12 * scale**2))
        return np.clip(0.5 + (radius - distance) * scale, 0.0, 1.0).astype(np.float32)


def markers_of(words: str, block: Block) -> Markers | None:
    """Create markers from the three numbers of the parameter `markers`: distances along x and y, and radius.

    Parameters
    ----------
    words : str
        Distances along x and y, and radius, such as ``"2 2 0.25"`` in mm; blank for none.
    block : Block
        The block that has them.

    Returns
    -------
    Markers or None
        The markers.

    Raises
    ------
    InputError
        if the numbers are not allowed.
    """
    parts = words.replace(",", " ").split()
    if not parts:
        return None
    numbers = as_numbers(parts)
    if numbers is None or len(numbers) != 3 or min(numbers) <= 0:
        raise InputError(
            f"markers = {words!r} is not allowed: three numbers above 0 are needed, 'dx dy radius' in mm, such as "
            "'2 2 0.25'."
        )
    found = Markers(*numbers)
    if 2 * found.radius >= min(found.spacing_x, found.spacing_y):
        raise InputError(f"markers = {words!r} is not allowed: a radius below half of the distances is needed.")
    if 2 * found.radius > min(block.width, block.depth):
        raise InputError(f"markers = {words!r} is not allowed: not one of them fits onto the block.")
    if block.width / found.spacing_x * block.depth / found.spacing_y > MOST_MARKERS:
        raise InputError(f"markers = {words!r} is not allowed: at most {MOST_MARKERS} markers are possible.")
    if found.radius < (least := max(block.width, block.depth) / PIXELS):
        raise InputError(
            f"markers = {words!r} is not allowed: a radius of at least {least:.3g} mm is needed, a pixel of their map."
        )
    return found
