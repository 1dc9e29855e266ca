"""Loads of a pad.

A load has a ``value``, which a load path varies: three components of a force [N] or displacement [mm], or a pressure
[MPa].
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from mitsuba_taxel.base.arguments import require
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.geometry.quadratic_shapes import shape_functions
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.contact.indenter import Indenter
from mitsuba_taxel.pads.pad import REGIONS


@dataclass(frozen=True)
class _Loading:
    """Quantity that a path varies, and whether a rigid plate is bonded to the top; a path may go on where the pad
    touches itself, the board or other bodies."""

    quantity: ClassVar[str] = "force"
    unit: ClassVar[str] = "N"
    components: ClassVar[int] = 3
    bonded_plate: ClassVar[bool] = False

    self_contact: bool = field(default=False, kw_only=True)

    def __post_init__(self) -> None:
        require("self_contact", self.self_contact, bool, "True or False")

    @property
    def gives_displacement(self) -> bool:
        """Whether displacements are prescribed, and forces follow."""
        return self.unit == "mm"

    @property
    def goes_on(self) -> bool:
        """Whether a path goes on where the pad touches itself, the board or bodies."""
        return self.self_contact


@dataclass(frozen=True)
class SpreadForce(_Loading):
    """A total force, spread evenly over the undeformed top; it keeps its direction (a dead load).

    Parameters
    ----------
    self_contact : bool
        Whether paths go on where the pad touches itself, the board or obstacles, by contact without friction.
    """

    def nodal(self, mesh: VolumeMesh) -> np.ndarray:
        """(N,) loaded area in mm² of each node.

        The consistent load of a flat six-node triangle lies on its mid-edge nodes, a third of the area each.
        """
        top = mesh.faces[mesh.face_region == REGIONS["top"]]
        third = _areas(mesh, top) / 3
        return np.bincount(top[:, 3:].ravel(), weights=np.repeat(third, 3), minlength=len(mesh.points))


@dataclass(frozen=True)
class PatchForce(_Loading):
    """A total force, spread evenly over a rectangle of the undeformed top; a dead load.

    Parameters
    ----------
    centre : tuple[float, float]
        (x, y) in mm.
    size : tuple[float, float]
        Of the rectangle along x and y, in mm; parts outside the top carry no force.
    self_contact : bool
        As of a `SpreadForce`; so it is for other loads.
    """

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
        """(N,) loaded area in mm² of each node, by exact integration over clipped triangles."""
        top = mesh.faces[mesh.face_region == REGIONS["top"]]
        flat = mesh.points[top[:, :3], :2]
        middle, half = np.array(self.centre), 0.5 * np.array(self.size)
        near = np.all((flat.min(axis=1) < middle + half) & (flat.max(axis=1) > middle - half), axis=1)
        nodal = np.zeros(len(mesh.points))
        for nodes, corners in zip(top[near], flat[near], strict=True):
            np.add.at(nodal, nodes, _clipped_moments(corners, middle - half, middle + half))
        return nodal


@dataclass(frozen=True)
class PlateForce(_Loading):
    """A force on a rigid plate bonded to the top, which moves but does not rotate, like the flange of a robot."""

    bonded_plate: ClassVar[bool] = True


@dataclass(frozen=True)
class PlateDisplacement(_Loading):
    """A displacement of a rigid plate bonded to the top, which does not rotate."""

    quantity: ClassVar[str] = "displacement"
    unit: ClassVar[str] = "mm"
    bonded_plate: ClassVar[bool] = True


@dataclass(frozen=True)
class Pressure(_Loading):
    """A hydrostatic pressure on top and outside, normal to the deformed surface. The cells are vented."""

    quantity: ClassVar[str] = "pressure"
    unit: ClassVar[str] = "MPa"
    components: ClassVar[int] = 1


@dataclass(frozen=True)
class IndenterDisplacement(_Loading):
    """A displacement of a rigid indenter, which does not rotate."""

    indenter: Indenter

    quantity: ClassVar[str] = "displacement"
    unit: ClassVar[str] = "mm"

    def __post_init__(self) -> None:
        super().__post_init__()
        require("indenter", self.indenter, Indenter, "an Indenter")


@dataclass(frozen=True)
class IndenterForce(_Loading):
    """A force on a rigid indenter, which does not rotate; its displacement follows.

    It moves along z, and along sideways parts of the force, which need friction; else it is guided.
    """

    indenter: Indenter

    def __post_init__(self) -> None:
        super().__post_init__()
        require("indenter", self.indenter, Indenter, "an Indenter")

    @property
    def driven(self) -> IndenterDisplacement:
        """The displacement of the indenter that follows."""
        return IndenterDisplacement(self.indenter, self_contact=self.self_contact)

    def check(self, value: Sequence[float] | np.ndarray) -> None:
        """Refuse forces that contact cannot transmit; raises `InputError`."""
        x, y, z = value
        shown, friction = ", ".join(f"{component:g}" for component in value), self.indenter.friction
        if z > 0 or (not friction and (x or y)):
            without = "" if friction else "without friction "
            raise InputError(f"force = ({shown}) is not allowed: {without}an indenter only pushes, along -z.")
        if math.hypot(x, y) > -friction * z:
            raise InputError(
                f"force = ({shown}) is not allowed: with friction = {friction:g} the indenter slips sideways beyond "
                f"{-friction * z:g} N."
            )


SPREAD_FORCE = SpreadForce()

Load = SpreadForce | PatchForce | PlateForce | PlateDisplacement | Pressure | IndenterDisplacement | IndenterForce


def loaded_area(mesh: VolumeMesh, load: Load) -> float:
    """Undeformed area in mm² that a load acts on.

    Raises
    ------
    InputError
        if a patch lies outside the top.
    """
    if isinstance(load, PatchForce):
        area = float(load.nodal(mesh).sum())
        if not area > 0:
            raise InputError(
                f"patch centre = {load.centre}, size = {load.size} is not allowed: it lies outside the top."
            )
        return area
    return float(_areas(mesh, mesh.faces[mesh.face_region == REGIONS["top"]]).sum())


def keeps(load: Load, mesh: VolumeMesh, mirror: Mirror, image: np.ndarray) -> bool:
    """Whether the distribution of a load is symmetric in a mirror, which maps nodes to their ``image`` (N,)."""
    if isinstance(load, IndenterDisplacement | IndenterForce):
        return load.indenter.body.keeps(mirror)
    if not isinstance(load, PatchForce):
        return True  # it covers a region of the surface, symmetric like the mesh
    nodal = load.nodal(mesh)
    return bool(np.allclose(nodal[image], nodal, rtol=0, atol=1e-12 * nodal.max(initial=0.0)))


def _areas(mesh: VolumeMesh, faces: np.ndarray) -> np.ndarray:
    a, b, c = (mesh.points[faces[:, k]] for k in range(3))
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


def _clipped_moments(corners: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """(6,) integrals of a triangle's quadratic shape functions over the part between ``low`` and ``high`` (x, y)."""
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
    """The part of a convex polygon (n, 2) where ``inside`` (n,), linear along its edges, is not negative."""
    kept = []
    for k in range(len(polygon)):
        here, there = inside[k - 1], inside[k]
        if here * there < 0:
            kept.append(polygon[k - 1] + here / (here - there) * (polygon[k] - polygon[k - 1]))
        if there >= 0:
            kept.append(polygon[k])
    return np.array(kept).reshape(-1, 2)
