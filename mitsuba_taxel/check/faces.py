"""Positions of the LEDs and phototransistors of a scene, and the boxes that may hide them."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

import mitsuba as mi
import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.check.finding import Finding
from mitsuba_taxel.check.parts import SceneObject, SceneObjects

CORNERS = np.array(list(product((-1, 1), repeat=3)), dtype=float)
"""Corners (8, 3) of a cube."""


@dataclass
class Faces:
    """The N LEDs or N phototransistors of one plugin object, or the windows above them.

    Attributes
    ----------
    obj, carrier : SceneObject
        The LED or phototransistor, and the shape in which it is nested.
    centres : (N, 3) ndarray
        Centres in mm, in world coordinates.
    normal : (3,) ndarray
        Unit normal, the direction of emission or detection.
    side : float
        Shorter side in mm.
    """

    obj: SceneObject
    carrier: SceneObject
    centres: np.ndarray
    normal: np.ndarray
    side: float


def faces_of(objects: SceneObjects) -> tuple[list[Faces], list[Finding]]:
    """All LEDs and phototransistors of a scene, and a finding for each one that has no valid position."""
    faces, findings = [], []
    for carrier in objects.shapes():
        for obj in carrier.children.values():
            if obj.plugin not in ("annular_led", "phototransistor"):
                continue
            try:
                grid = obj.instance.window.faces
            except InputError as error:
                findings.append(obj.finding("error", f"{error}"))
                continue
            normal = np.array(grid.frame.n, dtype=float).ravel()
            side = float(np.array(grid.size, dtype=float).min())
            faces.append(Faces(obj, carrier, np.array(grid.centres, dtype=float).T, normal, side))
    return faces, findings


@dataclass
class Boxes:
    """N equal boxes on a grid: the bodies of a `photo_reflector`, or a single `cube`.

    Attributes
    ----------
    obj : SceneObject
        The shape.
    to_world : (4, 4) ndarray
        Transformation of the grid to world coordinates, mm.
    centre, half : (3,) ndarray
        Centre of the grid, and half sides of a box, in mm before ``to_world``.
    rows, columns, pitch : int and float
        Size of the grid, and distance of neighbouring boxes in mm.
    """

    obj: SceneObject
    to_world: np.ndarray
    centre: np.ndarray
    half: np.ndarray
    rows: int = 1
    columns: int = 1
    pitch: float = 0.0

    def centres(self) -> np.ndarray:
        """Centres (N, 3) of the boxes in mm, in the coordinates of the grid, before the transformation ``to_world``."""
        column, row = np.meshgrid(np.arange(self.columns), np.arange(self.rows))
        shift = np.zeros((self.rows * self.columns, 3))
        shift[:, 0] = (column.ravel() - (self.columns - 1) / 2) * self.pitch
        shift[:, 1] = ((self.rows - 1) / 2 - row.ravel()) * self.pitch
        return self.centre + shift

    def corners(self) -> np.ndarray:
        """Corners (N, 8, 3) of the boxes in mm, in world coordinates."""
        return apply(self.to_world, self.centres()[:, None] + CORNERS * self.half)

    def relative(self, points: np.ndarray) -> np.ndarray:
        """Coordinates (N, 3) of points in the nearest box, scaled so that the faces of the box are at -1 and 1."""
        local = apply(np.linalg.inv(self.to_world), points) - self.centre
        for axis, count in ((0, self.columns), (1, self.rows)):
            if count > 1:
                middle = (count - 1) / 2
                local[:, axis] -= (np.clip(np.round(local[:, axis] / self.pitch + middle), 0, count - 1) - middle) * (
                    self.pitch
                )
        return local / self.half


def boxes_of(objects: SceneObjects) -> list[Boxes]:
    """Collect all boxes of a scene: the bodies of photo-reflectors, and Mitsuba's cubes."""
    boxes = []
    for obj in objects.shapes():
        instance = obj.instance
        if obj.plugin == "photo_reflector":
            half = 0.5 * instance.body
            centre = np.array([0.0, 0.0, half[2]])
            boxes.append(Boxes(obj, to_world(obj), centre, half, instance.rows, instance.columns, instance.pitch))
        elif obj.plugin == "cube" and abs(np.linalg.det(to_world(obj))) > 0:
            boxes.append(Boxes(obj, to_world(obj), np.zeros(3), np.ones(3)))
    return boxes


def to_world(obj: SceneObject) -> np.ndarray:
    """The matrix (4, 4) that transforms a shape's own coordinates to world coordinates."""
    transform: Any = obj.props.get("to_world", mi.ScalarTransform4f())
    return np.array(transform.matrix, dtype=float)


def apply(matrix: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Transform points by an affine matrix.

    Parameters
    ----------
    matrix : (4, 4) ndarray
        The transformation.
    points : (..., 3) ndarray
        Points in mm.
    """
    return points @ matrix[:3, :3].T + matrix[:3, 3]
