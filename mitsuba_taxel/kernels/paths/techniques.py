"""Three techniques to read the light that leaves a vertex of a path, and their weights (multiple importance sampling).

A path of n reflections has the vertices LED, x1 .. xn and a point y of the phototransistor. It can be sampled as

* a *detector connection*: x1 .. xn by scattering, y uniform on the phototransistor;
* a *sensor-subpath connection*: x1 .. x(n-1) by scattering, y uniform, and xn by a ray from y, distributed as the
  response;
* a *unidirectional hit*: x1 .. xn and y by scattering.

The three densities share the factor of x1 .. x(n-1), so their ratios, and with them the weights of the power heuristic,
depend on xn alone (E. Veach, Robust Monte Carlo Methods for Light Transport Simulation, 1997, chapters 9 and 10).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from mitsuba_taxel.kernels.paths.guide import Guide
from mitsuba_taxel.kernels.paths.ray_offsets import between, release
from mitsuba_taxel.kernels.taxels.windows import Sight, straight

Scattering = Callable[[mi.Vector3f], tuple[mi.Float, mi.Float]]
"""World direction -> scattered share per solid angle [1/sr, cosine included], and its density [1/sr]."""


@dataclass
class Vertex:
    """A vertex of a path, with its throughput."""

    p: mi.Point3f
    n: mi.Normal3f
    throughput: mi.Float  # W
    guided: mi.Float  # probability that the guide samples the next direction
    place: mi.Point2f  # of the vertex on the guide's unit square
    inverse: mi.Float  # mm²: one over the area density of this vertex; 0 if no sensor subpath could have sampled it


@dataclass
class View:
    """A point of the phototransistor and what it sees along one ray."""

    y: mi.Point3f
    offset: mi.Point2f  # of y from the centre of the phototransistor
    si: mi.SurfaceInteraction3f  # at the point z that it sees
    bsdf: mi.BSDFPtr
    valid: mi.Bool
    weight: mi.Float  # sr: response times cosine over the density of the direction
    to_y: mi.Vector3f  # direction from z to y, in the frame of z
    cosine: mi.Float  # at z
    density: mi.Float  # 1/mm²: of z
    solid_angle: mi.Float  # of the phototransistor, seen from z
    member: mi.Bool  # whether the guide could have sampled z
    guided: mi.Float  # probability that the guide samples the direction that leaves z
    place: mi.Point2f  # of z on the guide's unit square


class Techniques:
    """The techniques on one scene, for the phototransistors of ``index``.

    Parameters
    ----------
    strategy : str
        ``all``, or a single technique: ``connections``, ``sensor_subpath_connections`` or ``unidirectional_hits``.
    clearance : mi.Float
        See :func:`mitsuba_taxel.kernels.paths.ray_offsets.leave`.
    """

    def __init__(
        self,
        strategy: str,
        scene: mi.Scene,
        sensor: mi.Sensor,
        index: mi.UInt32,
        guide: Guide | None,
        clearance: mi.Float,
    ) -> None:
        names = ("connections", "sensor_subpath_connections", "unidirectional_hits")
        self.connections, self.sensor_subpaths, self.unidirectional = (strategy in ("all", name) for name in names)
        self.scene, self.sensor, self.index, self.guide, self.clearance = scene, sensor, index, guide, clearance
        self.area = sensor.faces.area
        self.detector = mi.ShapePtr(sensor.get_shape())
        dr.make_opaque(self.detector)  # another phototransistor needs no new kernel
        self.context = mi.BSDFContext(mi.TransportMode.Importance)

    def look(self, position: mi.Point2f, direction: mi.Point2f) -> View:
        """What one point of each phototransistor sees along a direction that is distributed as its response."""
        y, offset = self.sensor.sample_point(self.index, position)
        local, of_direction = self.sensor.sample_view(direction)
        d = self.sensor.faces.frame.to_world(local)
        if not self.sensor_subpaths:
            nothing = dr.zeros(mi.SurfaceInteraction3f)
            return View(y, offset, nothing, nothing.bsdf(), mi.Bool(False), *[None] * 8)
        place, is_open = self.sensor.window.leave(self.index, y, d)
        ray = release(place, mi.Normal3f(self.sensor.normal), d, self.clearance)
        si = self.scene.ray_intersect(ray)
        valid = si.is_valid() & (local.z > 0) & (of_direction > 0) & is_open
        distance_squared = self.sensor.window.apparent(dr.squared_norm(si.p - place), local.z)
        cosine = dr.abs(dr.dot(si.n, d))
        member, guided, place = self.guidance(si, valid)
        return View(
            y,
            offset,
            si,
            si.bsdf(mi.RayDifferential3f(ray)),
            valid & (cosine > 0),
            self.sensor.response(local.z) * local.z / of_direction,
            si.to_local(-d),
            cosine,
            of_direction * cosine / distance_squared,
            self.area * local.z / distance_squared,
            member,
            guided,
            place,
        )

    def connect(self, view: View, here: Vertex, scatter: Scattering, active: mi.Bool) -> mi.Float:
        """Power [W] of a connection from ``here`` to the point of ``view``."""
        if not self.connections:
            return mi.Float(0)
        sight = self.sensor.window.sight(self.index, here.p, view.y)
        wo, distance_squared = sight.direction, sight.squared_distance
        cosine = -dr.dot(wo, self.sensor.normal)
        active = active & (cosine > 0) & (distance_squared > 0) & sight.is_open
        value, density = scatter(wo)
        active &= value > 0
        ray = between(here.p, here.n, wo, self.clearance, sight.place, self.sensor.normal)
        active &= ~self.scene.ray_test(ray, active)
        solid_angle = self.area * cosine / distance_squared
        hit = (1 - here.guided) * density * solid_angle
        subpath = self.sensor.density_of_view(-wo) * dr.abs(dr.dot(here.n, wo)) / distance_squared * here.inverse
        weight = self._weight((self.unidirectional, hit), (self.sensor_subpaths, subpath))
        value *= here.throughput * solid_angle * self.sensor.response(cosine) * weight
        return dr.select(active, value, 0)

    def connect_subpath(
        self, view: View, here: Vertex, scatter: Scattering, active: mi.Bool, sight: Sight | None = None
    ) -> mi.Float:
        """Power [W] of a connection from ``here`` to the point that ``view`` sees, and on to the phototransistor.

        ``sight`` is how ``here`` appears from that point, by default straight.
        """
        if not self.sensor_subpaths:
            return mi.Float(0)
        sight = sight or straight(view.si.p, here.p)
        wo, distance_squared = -sight.direction, sight.squared_distance
        active = active & view.valid & (distance_squared > 0) & sight.is_open
        value, density = scatter(wo)
        active &= value > 0
        cosine = dr.abs(dr.dot(view.si.n, wo))
        si = mi.SurfaceInteraction3f(view.si)
        si.wi = si.to_local(-wo)
        passed_on, onward = view.bsdf.eval_pdf(self.context, si, view.to_y, active)
        active &= (passed_on[0] > 0) & (cosine > 0)
        ray = between(sight.place, here.n, wo, self.clearance, view.si.p, view.si.n)
        active &= ~self.scene.ray_test(ray, active)

        drawn = self.drawn(density, here, view.member, view.place, distance_squared / cosine)
        connection = drawn * cosine / (distance_squared * view.density)
        hit = connection * (1 - view.guided) * onward * view.solid_angle
        weight = self._weight((self.connections, connection), (self.unidirectional, hit))
        value *= here.throughput * passed_on[0] * cosine / (distance_squared * view.cosine)
        return dr.select(active, value * self.area * view.weight * weight, 0)

    def hit(
        self, si: mi.SurfaceInteraction3f, d: mi.Vector3f, before: Vertex, density: mi.Float, specular: mi.Bool
    ) -> tuple[mi.Float, mi.Point2f]:
        """Power [W] of rays that arrive at ``si`` in direction ``d``, and their offset on the phototransistor.

        Parameters
        ----------
        before : Vertex
            The previous vertex, with the present throughput of the ray.
        density : mi.Float
            Of the direction ``d`` [1/sr]; unused where ``specular``.
        """
        inside, offset = self.sensor.contains(self.index, si.p, d)
        if not self.unidirectional:
            return mi.Float(0), offset
        cosine = -dr.dot(d, self.sensor.normal)
        here = si.is_valid() & (si.shape == self.detector) & inside & (cosine > 0)
        distance_squared = self.sensor.window.apparent(dr.squared_norm(si.p - before.p), cosine)
        connection = distance_squared / (density * self.area * cosine)
        subpath = connection * before.inverse * self.sensor.density_of_view(-d)
        subpath *= dr.abs(dr.dot(before.n, d)) / distance_squared
        weight = dr.select(specular, 1, self._weight((self.connections, connection), (self.sensor_subpaths, subpath)))
        return dr.select(here, before.throughput * self.sensor.response(cosine) * weight, 0), offset

    def guidance(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> tuple[mi.Bool, mi.Float, mi.Point2f]:
        """Whether the guide could have sampled ``si``, the probability that it samples the next direction, and its
        place."""
        if self.guide is None:
            return mi.Bool(False), mi.Float(0), mi.Point2f(0)
        member = self.guide.contains(self.index, si, active)
        return member, dr.select(member, self.guide.share, 0), self.guide.place(si, member)

    def draw(self, here: Vertex, sample: mi.Point2f, nearness: mi.Float) -> tuple[mi.Point3f, mi.UInt32]:
        """A point sampled by the guide, and its triangle."""
        assert self.guide is not None
        return self.guide.sample(self.index, here.place, sample, nearness)

    def drawn(
        self, density: mi.Float, before: Vertex, member: mi.Bool, place: mi.Point2f, area_per_angle: mi.Float
    ) -> mi.Float:
        """Density [1/sr] of a ray from ``before``, sampled by scattering with ``density`` or by the guide.

        Parameters
        ----------
        member, place : mi.Bool and mi.Point2f
            Of the point that the ray meets.
        area_per_angle : mi.Float
            Distance squared over cosine there, mm².
        """
        total = (1 - before.guided) * density
        if self.guide is not None:
            guide_density = self.guide.density(self.index, before.place, place) * area_per_angle
            total += dr.select(member, before.guided * guide_density, 0)
        return total

    @staticmethod
    def _weight(*others: tuple[bool, mi.Float]) -> mi.Float:
        """Weight of a technique, from the densities of the others in use, relative to its own."""
        total = mi.Float(1)
        for in_use, ratio in others:
            if in_use:
                total += dr.square(ratio)
        return dr.rcp(total)
