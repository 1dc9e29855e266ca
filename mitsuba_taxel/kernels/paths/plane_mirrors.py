"""Plane mirrors above taxels, and the images of scattering walls behind them.

From the image, a straight line leads through the mirror to the phototransistor: paths from the wall can be connected
over the mirror; without the connection, they would meet the phototransistor only by chance. Roofs of unloaded boxes,
cylinders and frusta are plane.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsuba_taxel.backend.packets import in_packets
from mitsuba_taxel.kernels.protocols import is_pad, is_phototransistor, is_wall
from mitsuba_taxel.kernels.surfaces.regions import ALL_REGIONS
from mitsuba_taxel.kernels.taxel_pair import TaxelPair
from mitsuba_taxel.kernels.walls import absorbs, wall_at, walls_of

_PLANE = 1e-6
"""Largest distance from a plane, relative to the largest coordinate: the precision of single-precision vertices."""

WITHOUT = np.empty(0), None
"""Value that is cached with a phototransistor while paths must not use images."""


class PlaneMirrors:
    """Plane mirrors: at most one for each taxel, on its roof.

    Parameters
    ----------
    mesh : mi.Mesh
        The mesh.
    owner : (N,) ndarray
        Taxel of each of N triangles if it belongs to a mirror; else -1.
    planes : (T, 4) ndarray
        Unit normal of the mirror of each of T taxels, and its distance from the origin along the normal, mm; 0 without
        a mirror.
    wall : mi.BSDF
        The `wall` of the mirrors.
    """

    def __init__(self, mesh: mi.Mesh, owner: np.ndarray, planes: np.ndarray, wall: Any) -> None:
        self.mesh = mi.ShapePtr(mesh)
        self.owner = mi.Int32(in_packets(owner, np.int32))
        self.planes = mi.Float(in_packets(planes.ravel(), np.float32))
        self.wall = wall

    @property
    def specular(self) -> mi.Float:
        """Probability with which the wall samples its specular component."""
        fractions = getattr(self.wall.law, "fractions", None)
        return mi.Float(1) if fractions is None else fractions[0]

    @property
    def reflected(self) -> mi.Float:
        """Fraction of the light that is reflected as by a mirror."""
        return self.wall.reflectance * self.specular

    def image(self, index: mi.UInt32, p: mi.Point3f) -> tuple[mi.Point3f, mi.Normal3f, mi.Bool]:
        """Mirror image of a point behind the plane mirror of a taxel.

        Parameters
        ----------
        index : mi.UInt32
            Number of the taxel.
        p : mi.Point3f
            The point.

        Returns
        -------
        image, normal : mi.Point3f and mi.Normal3f
            The image, and the normal of the mirror.
        exists : mi.Bool
            Whether the taxel has a mirror.
        """
        x, y, z, offset = (dr.gather(mi.Float, self.planes, 4 * index + k) for k in range(4))
        normal = mi.Normal3f(x, y, z)
        return p - 2 * (dr.dot(p, normal) - offset) * normal, normal, dr.squared_norm(normal) > 0

    def contains(self, index: mi.UInt32, si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.Bool:
        """Whether a hit ``si`` lies on the plane mirror above a taxel."""
        on_mesh = active & (si.shape == self.mesh)
        return on_mesh & (dr.gather(mi.Int32, self.owner, si.prim_index, on_mesh) == mi.Int32(index))


def plane_mirrors(scene: mi.Scene, pair: TaxelPair) -> PlaneMirrors | None:
    """The plane mirrors above the taxels of a pair; they are cached with the phototransistor.

    Parameters
    ----------
    scene : mi.Scene
        The scene.
    pair : TaxelPair
        LED and phototransistor.

    Returns
    -------
    PlaneMirrors or None
        The mirrors; None if no unloaded pad has plane roofs with a specular component, or no wall scatters.
    """
    scattering = mi.BSDFFlags.Diffuse | mi.BSDFFlags.Glossy
    if pair.sensor.plane_mirrors is WITHOUT or all(
        absorbs(wall) or not wall.flags() & scattering for wall in walls_of(scene)
    ):
        return None
    for mesh in scene.shapes():
        wall = wall_at(mesh.bsdf(), "roof") if is_pad(mesh) else None
        if wall is None or not is_wall(wall) or wall.scattering not in ("mirror", "mixed"):
            continue
        positions = np.array(mi.traverse(mesh)["vertex_positions"])
        if pair.sensor.plane_mirrors is None or not np.array_equal(pair.sensor.plane_mirrors[0], positions):
            pair.sensor.plane_mirrors = positions, _on(mesh, positions, pair, wall)
        mirrors: PlaneMirrors | None = pair.sensor.plane_mirrors[1]
        return mirrors
    return None


@contextmanager
def without_images(scene: mi.Scene) -> Iterator[None]:
    """Trace paths without image connections (connections over the mirror image of a point) within the block.

    Readings whose difference is computed must not use them: of a roof at rest and a bent roof, only the former has an
    image, so the noise of the two readings would not cancel.

    Parameters
    ----------
    scene : mi.Scene
        The scene.

    Yields
    ------
    None
        Within the block; afterwards image connections are used again.
    """
    sensors = [sensor for sensor in scene.sensors() if is_phototransistor(sensor)]
    for sensor in sensors:
        sensor.plane_mirrors = WITHOUT
    try:
        yield
    finally:
        for sensor in sensors:
            sensor.plane_mirrors = None


def _on(mesh: Any, positions: np.ndarray, pair: TaxelPair, wall: Any) -> PlaneMirrors | None:
    """Find the plane mirrors of a pad whose V vertices have the coordinates ``positions`` (3 V,)."""
    parameters = mi.traverse(mesh)
    corners = positions.reshape(-1, 3).astype(float)[np.array(parameters["faces"]).reshape(-1, 3)]
    region, cell = mesh.surface.region, mesh.surface.cell

    # A cell belongs to the taxel with the nearest LED; where a taxel has several cells, the first has its mirror.
    leds = np.array(pair.led.faces.centres).T
    owner, planes = np.full(len(corners), -1), np.zeros((pair.count, 4))
    tolerance = _PLANE * np.abs(positions).max()
    for number in np.unique(cell[cell > 0]):
        roof = np.flatnonzero((cell == number) & (region == ALL_REGIONS["roof"]))
        if not len(roof):
            continue
        points = corners[roof].reshape(-1, 3)
        middle = points.mean(axis=0)
        normal = np.linalg.eigh((points - middle).T @ (points - middle))[1][:, 0]  # of least extent
        taxel = int(np.argmin(np.linalg.norm(leds - middle, axis=1)))
        if np.abs((points - middle) @ normal).max() <= tolerance and not planes[taxel].any():
            owner[roof], planes[taxel] = taxel, [*normal, normal @ middle]
    return PlaneMirrors(mesh, owner, planes, wall) if planes.any() else None
