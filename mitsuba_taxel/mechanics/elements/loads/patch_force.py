"""Load by a force on a rectangle of the top."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.quadratic_shapes import shape_functions
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.elements.loads.load import DeadForce, top_faces


@dataclass(frozen=True)
class PatchForce(DeadForce, name="patch_force", rank=1):
    """A total force, spread evenly over a rectangle of the undeformed top; a dead load.

    Parameters
    ----------
    centre : tuple[float, float]
        Position (x, y) of the centre in mm.
    size : tuple[float, float]
        Size of the rectangle along x and y, in mm; parts outside the top carry no force.
    self_contact : bool
        See `SpreadForce`; the same for other loads.
    """

    meaning = "on a rectangle of it"
    uses = ("force", "patch_width", "patch_depth", "patch_x", "patch_y")
    loads_rim = False
    position = ("patch_x", "patch_y")

    centre: tuple[float, float]
    size: tuple[float, float]

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, allowed in (("centre", "two finite numbers are"), ("size", "two finite lengths above 0 mm are")):
            value = getattr(self, name)
            try:
                pair = tuple(float(component) for component in value)
            except (TypeError, ValueError, OverflowError):
                pair = ()
            good = len(pair) == 2 and all(map(math.isfinite, pair)) and (name == "centre" or min(pair) > 0)
            if not good:
                raise InputError(f"patch {name} = {value!r} is not allowed: {allowed} needed.")
            object.__setattr__(self, name, pair)

    def nodal(self, mesh: VolumeMesh) -> np.ndarray:
        """Loaded area (N,) in mm² of each node, by exact integration over clipped triangles."""
        top = top_faces(mesh)
        flat = mesh.points[top[:, :3], :2]
        middle, half = np.array(self.centre), 0.5 * np.array(self.size)
        overlapping = np.all((flat.min(axis=1) < middle + half) & (flat.max(axis=1) > middle - half), axis=1)
        nodal = np.zeros(len(mesh.points))
        for nodes, corners in zip(top[overlapping], flat[overlapping], strict=True):
            np.add.at(nodal, nodes, _clipped_moments(corners, middle - half, middle + half))
        return nodal

    @property
    def area(self) -> float:
        return self.size[0] * self.size[1]

    @property
    def where(self) -> str:
        return "a patch of {:g} x {:g} mm".format(*self.size)

    @classmethod
    def of_scene(cls, pad: Any, find: Any, **about: Any) -> PatchForce:
        return cls((pad.patch_x, pad.patch_y), (pad.patch_width, pad.patch_depth), **about)

    def scene_values(self) -> dict[str, Any]:
        (x, y), (width, depth) = self.centre, self.size
        return {"patch_x": x, "patch_y": y, "patch_width": width, "patch_depth": depth}


def _clipped_moments(corners: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Integrals (6,) of the six quadratic shape functions of a triangle over its part within a rectangle, whose corners
    are ``low`` and ``high`` (x, y)."""
    polygon = corners
    for axis in range(2):
        for limit, sign in ((low[axis], 1), (high[axis], -1)):
            polygon = _clipped(polygon, sign * (polygon[:, axis] - limit))
            if len(polygon) < 3:
                return np.zeros(6)
    edges = corners[1:] - corners[0]
    moments = np.zeros(6)
    for second, third in zip(polygon[1:-1], polygon[2:], strict=True):
        triangle = np.array([polygon[0], second, third])
        (ux, uy), (vx, vy) = triangle[1:] - triangle[0]
        middles = 0.5 * (triangle + np.roll(triangle, -1, axis=0))  # exact to degree two
        local = np.linalg.solve(edges.T, (middles - corners[0]).T)
        barycentric = np.stack([1 - local[0] - local[1], *local], axis=1)
        moments += abs(ux * vy - uy * vx) / 6 * shape_functions(barycentric).sum(axis=0)
    return moments


def _clipped(polygon: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Part of a convex polygon with vertices (n, 2) in which a linear function is not negative; ``inside`` (n,)
    contains its values at the vertices."""
    vertices = []
    for k in range(len(polygon)):
        before, after = inside[k - 1], inside[k]
        if before * after < 0:
            vertices.append(polygon[k - 1] + before / (before - after) * (polygon[k] - polygon[k - 1]))
        if after >= 0:
            vertices.append(polygon[k])
    return np.array(vertices).reshape(-1, 2)
