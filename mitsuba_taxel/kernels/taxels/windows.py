"""Windows above the dies of LEDs and phototransistors, and the refraction of light there.

A window is the flat surface of a clear resin of index n. A ray crosses it at the angles t in air and t' in the resin,
sin t = n sin t'. Its radiance is T(t) L / n^2 in air for L in the resin, with Fresnel's transmittance T for unpolarised
light, and vice versa. From a point at the height a above the window, a point of a die at the depth b and the lateral
distance R appears in the direction with

    R = a tan t + b tan t',

and an area of the die there subtends a solid angle of

    dw / dA = sin t / (R dR/dt) = cos t / r^2,    r^2 = (a + b cos t / q) (a / cos^2 t + b n^2 cos t / q^3),

with q^2 = n^2 - sin^2 t. A bare die in the same direction at the distance r has the same dw / dA, and the same relation
between densities of points and directions. Integrators therefore treat both cases alike: a die below a window is a die
at an *apparent distance* r, whose light crosses the window at a refracted position. Light that a window reflects is not
followed.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import drjit as dr
import mitsuba as mi

from mitsuba_taxel.kernels.taxels.faces import FaceGrid

NEWTON_STEPS = 7
"""Newton steps for the angle: the error is 5e-5 degrees for a depth of a thousand times the height of the point."""


class Sight(NamedTuple):
    """The line of sight from a point in air to a point of an LED or phototransistor die, refracted if there is a
    window.
    """

    direction: mi.Vector3f  # direction at the point in air
    squared_distance: mi.Float  # mm²: square of the apparent distance
    crossing: mi.Point3f  # crossing of the line of sight and the window
    is_open: mi.Bool  # whether the window is open there


class Window(Protocol):
    """The windows of an array of dies; ``faces`` are their positions."""

    faces: FaceGrid

    def sight(self, number: mi.UInt32, p: mi.Point3f, y: mi.Point3f) -> Sight:
        """Line of sight from ``p`` to the point ``y`` of die ``number``."""

    def leave(self, number: mi.UInt32, y: mi.Point3f, d: mi.Vector3f) -> tuple[mi.Point3f, mi.Bool]:
        """Point at which a ray from the point ``y`` of die ``number``, with the direction ``d`` in air, leaves the
        window, and whether the window is open there."""

    def enter(self, number: mi.UInt32, p: mi.Point3f, d: mi.Vector3f) -> tuple[mi.Point2f, mi.Bool]:
        """Offset from the centre of die ``number`` at which a ray through ``p`` in direction ``d`` meets the plane of
        the die, and whether ``p`` lies in the open window of that die."""

    def apparent(self, squared_distance: mi.Float, cosine: mi.Float) -> mi.Float:
        """Square of the apparent distance r (see the top of this module) to the point of a die that a ray hits, from
        the square of the distance to the window and the cosine of the angle in air.
        """


class NoWindow:
    """Replacement for `Window` where dies lie in the surface of the body, without a window."""

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
    """Windows of clear resin above dies at a depth.

    Parameters
    ----------
    dies, faces : FaceGrid
        Positions of the dies, and of the windows.
    depth : float
        Depth of the dies, in world lengths.
    index : float
        Refractive index of the resin.
    is_obround : bool
        Whether windows end in half circles; otherwise they are rectangles.
    """

    def __init__(self, dies: FaceGrid, faces: FaceGrid, depth: float, index: float, is_obround: bool) -> None:
        self.dies, self.faces, self.is_obround = dies, faces, is_obround
        self.depth, self.index = dr.opaque(mi.Float, depth), dr.opaque(mi.Float, index)

    def sight(self, number: mi.UInt32, p: mi.Point3f, y: mi.Point3f) -> Sight:
        local = self.faces.frame.to_local(p - y)
        height, lateral = local.z - self.depth, mi.Point2f(-local.x, -local.y)
        tangent = lateral * self._tangent_per_distance(height, dr.squared_norm(lateral))
        cosine = dr.rsqrt(1 + dr.squared_norm(tangent))
        step = mi.Vector3f(tangent.x, tangent.y, -1)
        crossing = mi.Point3f(p + self.faces.frame.to_world(height * step))
        return Sight(
            self.faces.frame.to_world(cosine * step),
            self._apparent(height, cosine),
            crossing,
            self._is_open(self.faces.offset(number, crossing)) & (height > 0),
        )

    def leave(self, number: mi.UInt32, y: mi.Point3f, d: mi.Vector3f) -> tuple[mi.Point3f, mi.Bool]:
        local = self.faces.frame.to_local(d)
        shift = self._lateral_shift(local)
        exit_point = mi.Point3f(y + self.faces.frame.to_world(mi.Vector3f(shift.x, shift.y, self.depth)))
        return exit_point, self._is_open(self.faces.offset(number, exit_point)) & (local.z > 0)

    def enter(self, number: mi.UInt32, p: mi.Point3f, d: mi.Vector3f) -> tuple[mi.Point2f, mi.Bool]:
        local = self.faces.frame.to_local(d)
        is_open = self._is_open(self.faces.offset(number, p)) & self.faces.is_at_height(p)
        return self.dies.offset(number, p) + self._lateral_shift(local), is_open & (local.z < 0)

    def apparent(self, squared_distance: mi.Float, cosine: mi.Float) -> mi.Float:
        return self._apparent(dr.sqrt(squared_distance) * cosine, cosine)

    def _lateral_shift(self, local: mi.Vector3f) -> mi.Point2f:
        """Lateral distance that light travels in the resin between die and window, for a direction in air."""
        lateral = mi.Point2f(local.x, local.y)
        return lateral * (self.depth * dr.rsqrt(dr.square(self.index) - dr.squared_norm(lateral)))

    def _tangent_per_distance(self, height: mi.Float, squared_distance: mi.Float) -> mi.Float:
        """Ratio tan t / R: the tangent of the angle in air, divided by the lateral distance R between point and die.

        It is found by Newton's method. R is a concave function of tan t, and the initial value R / (a + b / n) does not
        exceed the solution: the steps approach it from one side.
        """
        square = dr.square(self.index)
        result = dr.rcp(height + self.depth / self.index)
        for _ in range(NEWTON_STEPS):
            inverse = dr.rsqrt(square + (square - 1) * dr.square(result) * squared_distance)
            excess = result * (height + self.depth * inverse) - 1
            result -= excess / (height + self.depth * square * inverse * dr.square(inverse))
        return result

    def _apparent(self, height: mi.Float, cosine: mi.Float) -> mi.Float:
        """Square of the apparent distance r of a die below a window, from the height a of the point above the window
        and the cosine of the angle t in air."""
        inverse = dr.rsqrt(dr.square(self.index) - 1 + dr.square(cosine))
        bent = self.depth * cosine * inverse
        return (height + bent) * (height / dr.square(cosine) + bent * dr.square(self.index * inverse))

    def _is_open(self, offset: mi.Point2f) -> mi.Bool:
        """Whether an offset from the centre of a window lies in the window."""
        distance, half = dr.abs(offset), 0.5 * self.faces.size
        if not self.is_obround:
            return dr.all(distance <= half)
        return dr.norm(mi.Point2f(distance.x, dr.maximum(distance.y - (half.y - half.x), 0))) <= half.x


def transmittance(index: mi.Float, cosine: mi.Float) -> mi.Float:
    """Fresnel's transmittance of the surface of a resin for unpolarised light.

    Parameters
    ----------
    index : mi.Float
        Refractive index.
    cosine : mi.Float
        Cosine of the angle in air.

    Returns
    -------
    mi.Float
        Transmittance, from 0 to 1.
    """
    return 1 - mi.fresnel(dr.maximum(cosine, 0), index)[0]


def straight(p: mi.Point3f, y: mi.Point3f) -> Sight:
    """The straight line of sight from ``p`` to ``y``."""
    to_y = y - p
    squared_distance = dr.squared_norm(to_y)
    return Sight(to_y * dr.rsqrt(squared_distance), squared_distance, y, mi.Bool(True))
