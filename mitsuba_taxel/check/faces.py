"""Positions of the LEDs and phototransistors of a scene, and the boxes that may hide them."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

import mitsuba as mi
import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.check.finding import Finding
from mitsuba_taxel.check.parts import Parts, ScenePart

CORNERS = np.array(list(product((-1, 1), repeat=3)), dtype=float)
"""(8, 3) corners of a cube."""


@dataclass
class Faces:
    """The LEDs or phototransistors of one plugin, or the windows above them.

    Attributes
    ----------
    part, carrier : ScenePart
        The plugin, and the shape that it is nested in.
    centres : (N, 3) ndarray
        In mm, in the world.
    normal : (3,) ndarray
        The direction that they face.
    side : float
        Shorter side, mm.
    """

    part: ScenePart
    carrier: ScenePart
    centres: np.ndarray
    normal: np.ndarray
    side: float


def faces_of(parts: Parts) -> tuple[list[Faces], list[Finding]]:
    """All LEDs and phototransistors, and findings on those without a valid position."""
    found, findings = [], []
    for carrier in parts.shapes():
        for part in carrier.children.values():
            if part.plugin not in ("annular_led", "phototransistor"):
                continue
            try:
                grid = part.made.window.faces
            except InputError as error:
                findings.append(part.finding("error", f"{error}"))
                continue
            normal = np.array(grid.frame.n, dtype=float).ravel()
            side = float(np.array(grid.size, dtype=float).min())
            found.append(Faces(part, carrier, np.array(grid.centres, dtype=float).T, normal, side))
    return found, findings


@dataclass
class Boxes:
    """Equal boxes on a grid: the bodies of a `photo_reflector`, or a `cube`.

    Attributes
    ----------
    part : ScenePart
        The shape.
    to_world : ndarray
        (4, 4).
    centre, half : (3,) ndarray
        Of the central box, or of its place if there is none, before ``to_world``.
    rows, columns, pitch : int and float
        The grid.
    """

    part: ScenePart
    to_world: np.ndarray
    centre: np.ndarray
    half: np.ndarray
    rows: int = 1
    columns: int = 1
    pitch: float = 0.0

    def centres(self) -> np.ndarray:
        """(N, 3) before ``to_world``."""
        column, row = np.meshgrid(np.arange(self.columns), np.arange(self.rows))
        shift = np.zeros((self.rows * self.columns, 3))
        shift[:, 0] = (column.ravel() - (self.columns - 1) / 2) * self.pitch
        shift[:, 1] = ((self.rows - 1) / 2 - row.ravel()) * self.pitch
        return self.centre + shift

    def corners(self) -> np.ndarray:
        """(N, 8, 3) corners of the boxes in the world."""
        return apply(self.to_world, self.centres()[:, None] + CORNERS * self.half)

    def relative(self, points: np.ndarray) -> np.ndarray:
        """(N, 3) positions of world points relative to the nearest box, whose faces are at -1 and 1."""
        local = apply(np.linalg.inv(self.to_world), points) - self.centre
        for axis, count in ((0, self.columns), (1, self.rows)):
            if count > 1:
                middle = (count - 1) / 2
                local[:, axis] -= (np.clip(np.round(local[:, axis] / self.pitch + middle), 0, count - 1) - middle) * (
                    self.pitch
                )
        return local / self.half


def boxes_of(parts: Parts) -> list[Boxes]:
    """The bodies of photo-reflectors, and Mitsuba's cubes."""
    boxes = []
    for part in parts.shapes():
        made = part.made
        if part.plugin == "photo_reflector":
            half = 0.5 * made.body
            centre = np.array([0.0, 0.0, half[2]])
            boxes.append(Boxes(part, to_world(part), centre, half, made.rows, made.columns, made.pitch))
        elif part.plugin == "cube" and abs(np.linalg.det(to_world(part))) > 0:
            boxes.append(Boxes(part, to_world(part), np.zeros(3), np.ones(3)))
    return boxes


def to_world(part: ScenePart) -> np.ndarray:
    """(4, 4) transformation of a shape."""
    transform: Any = part.props.get("to_world", mi.ScalarTransform4f())
    return np.array(transform.matrix, dtype=float)


def apply(matrix: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Points (..., 3) under an affine transformation (4, 4)."""
    return points @ matrix[:3, :3].T + matrix[:3, 3]
