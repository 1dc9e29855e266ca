"""Windows above the dies of LEDs and phototransistors, and how light crosses them.

A window is the flat surface of a clear resin of index n. A ray crosses it at the angles t in air and t' in the resin,
sin t = n sin t'; its radiance is T(t) L / n^2 in air for L in the resin, with Fresnel's transmittance T of unpolarised
light, and vice versa. A point at the height a above the window sees one of a die at the depth b, a lateral distance R
away, in the direction with

    R = a tan t + b tan t',

and an area of the die there in a solid angle of

    dw / dA = sin t / (R dR/dt) = cos t / r^2,    r^2 = (a + b cos t / q) (a / cos^2 t + b n^2 cos t / q^3),

with q^2 = n^2 - sin^2 t. A bare die in the same direction, at the distance r, has the same dw / dA, and densities of
points and directions are related as there. So integrators treat both alike: a die below a window is one at an *apparent
distance* r, whose light crosses the window elsewhere than straight ahead. Light that a window reflects is not followed.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import drjit as dr
import mitsuba as mi

from mitsuba_taxel.kernels.taxels.faces import FaceGrid

NEWTON_STEPS = 7
"""They leave an error of 5e-5 degrees for dies that are a thousand times as deep as the point is high."""


class Sight(NamedTuple):
    """A point of a die as seen from a point outside."""

    direction: mi.Vector3f  # in which it appears
    squared_distance: mi.Float  # mm²: apparent distance, squared
    place: mi.Point3f  # where the line of sight crosses the window
    is_open: mi.Bool  # whether the window is open there


class Window(Protocol):
    """The windows of an array of dies, at the positions ``faces``."""

    faces: FaceGrid

    def sight(self, number: mi.UInt32, p: mi.Point3f, y: mi.Point3f) -> Sight:
        """The point ``y`` of die ``number``, seen from ``p``."""

    def leave(self, number: mi.UInt32, y: mi.Point3f, d: mi.Vector3f) -> tuple[mi.Point3f, mi.Bool]:
        """Where a ray from the point ``y`` of die ``number`` with the direction ``d`` in air leaves, and whether the
        window is open there."""

    def enter(self, number: mi.UInt32, p: mi.Point3f, d: mi.Vector3f) -> tuple[mi.Point2f, mi.Bool]:
        """Offset from the centre of die ``number`` at which a ray that arrives at ``p`` in direction ``d`` meets its
        plane, and whether ``p`` lies in its open window."""

    def apparent(self, squared_distance: mi.Float, cosine: mi.Float) -> mi.Float:
        """Apparent distance, squared, of the point of a die at which a ray arrives that has covered a distance to the
        window at an angle of that cosine."""


class NoWindow:
    """Of dies in the surface."""

    def __init__(self, faces: FaceGrid) -> None:
        self.faces = faces

    def sight(self, number: mi.UInt32, p: mi.Point3f, y: mi.Point3f) -> Sight:
        return straight(p, y)

    def leave(self, number: mi.UInt32, y: mi.Point3f, d: mi.Vector3f) -> tuple[mi.Point3f, mi.Bool]:
        return y, mi.Bool(True)

    def enter(self, number: mi.UInt32, p: mi.Point3f, d: mi.Vector3f) -> tuple[mi.Point2f, mi.Bool]:
        nearest, offset = self.faces.locate(p)
        return offset, self.faces.is_at_height(p) & (nearest == number)

    def apparent(self, squared_distance: mi.Float, cosine: mi.Float) -> mi.Float:
        return squared_distance


class ResinWindow:
    """Of dies at a depth below windows of clear resin.

    Parameters
    ----------
    dies, faces : FaceGrid
        Positions of the dies, and of the windows.
    depth : float
        Of the dies, in world lengths.
    index : float
        Of the resin.
    is_obround : bool
        Whether windows end in half circles, else they are rectangles.
    """

    def __init__(self, dies: FaceGrid, faces: FaceGrid, depth: float, index: float, is_obround: bool) -> None:
        self.dies, self.faces, self.is_obround = dies, faces, is_obround
        self.depth, self.index = dr.opaque(mi.Float, depth), dr.opaque(mi.Float, index)

    def sight(self, number: mi.UInt32, p: mi.Point3f, y: mi.Point3f) -> Sight:
        away = self.faces.frame.to_local(p - y)
        height, across = away.z - self.depth, mi.Point2f(-away.x, -away.y)
        tangent = across * self._tangent_per_distance(height, dr.squared_norm(across))
        cosine = dr.rsqrt(1 + dr.squared_norm(tangent))
        step = mi.Vector3f(tangent.x, tangent.y, -1)
        place = mi.Point3f(p + self.faces.frame.to_world(height * step))
        return Sight(
            self.faces.frame.to_world(cosine * step),
            self._apparent(height, cosine),
            place,
            self._is_open(self.faces.offset(number, place)) & (height > 0),
        )

    def leave(self, number: mi.UInt32, y: mi.Point3f, d: mi.Vector3f) -> tuple[mi.Point3f, mi.Bool]:
        local = self.faces.frame.to_local(d)
        aside = self._aside(local)
        place = mi.Point3f(y + self.faces.frame.to_world(mi.Vector3f(aside.x, aside.y, self.depth)))
        return place, self._is_open(self.faces.offset(number, place)) & (local.z > 0)

    def enter(self, number: mi.UInt32, p: mi.Point3f, d: mi.Vector3f) -> tuple[mi.Point2f, mi.Bool]:
        local = self.faces.frame.to_local(d)
        is_open = self._is_open(self.faces.offset(number, p)) & self.faces.is_at_height(p)
        return self.dies.offset(number, p) + self._aside(local), is_open & (local.z < 0)

    def apparent(self, squared_distance: mi.Float, cosine: mi.Float) -> mi.Float:
        return self._apparent(dr.sqrt(squared_distance) * cosine, cosine)

    def _aside(self, local: mi.Vector3f) -> mi.Point2f:
        """Lateral way in the resin of light with a direction in air."""
        across = mi.Point2f(local.x, local.y)
        return across * (self.depth * dr.rsqrt(dr.square(self.index) - dr.squared_norm(across)))

    def _tangent_per_distance(self, height: mi.Float, squared_distance: mi.Float) -> mi.Float:
        """tan t / R, by Newton's method.

        R is concave in tan t, and R / (a + b / n) at most its tangent: steps from there approach the solution from one
        side.
        """
        square = dr.square(self.index)
        result = dr.rcp(height + self.depth / self.index)
        for _ in range(NEWTON_STEPS):
            inverse = dr.rsqrt(square + (square - 1) * dr.square(result) * squared_distance)
            excess = result * (height + self.depth * inverse) - 1
            result -= excess / (height + self.depth * square * inverse * dr.square(inverse))
        return result

    def _apparent(self, height: mi.Float, cosine: mi.Float) -> mi.Float:
        inverse = dr.rsqrt(dr.square(self.index) - 1 + dr.square(cosine))
        bent = self.depth * cosine * inverse
        return (height + bent) * (height / dr.square(cosine) + bent * dr.square(self.index * inverse))

    def _is_open(self, offset: mi.Point2f) -> mi.Bool:
        across, half = dr.abs(offset), 0.5 * self.faces.size
        if not self.is_obround:
            return dr.all(across <= half)
        return dr.norm(mi.Point2f(across.x, dr.maximum(across.y - (half.y - half.x), 0))) <= half.x


def transmittance(index: mi.Float, cosine: mi.Float) -> mi.Float:
    """Fresnel's transmittance of the surface of a resin for unpolarised light.

    Parameters
    ----------
    index : mi.Float
        Of refraction.
    cosine : mi.Float
        Of the angle in air.

    Returns
    -------
    mi.Float
        From 0 to 1.
    """
    return 1 - mi.fresnel(dr.maximum(cosine, 0), index)[0]


def straight(p: mi.Point3f, y: mi.Point3f) -> Sight:
    """A point ``y`` seen from ``p`` with nothing in between."""
    to_y = y - p
    squared_distance = dr.squared_norm(to_y)
    return Sight(to_y * dr.rsqrt(squared_distance), squared_distance, y, mi.Bool(True))
