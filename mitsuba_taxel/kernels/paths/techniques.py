"""Techniques that estimate the light from a vertex of a path, and their weights (multiple importance sampling).

A path of n reflections has the vertices LED, x1 .. xn and a point y of the phototransistor. It can be sampled as

* a *detector connection*: x1 .. xn by scattering, y uniform on the phototransistor;
* a *sensor-subpath connection*: x1 .. x(n-1) by scattering, y uniform, and xn by a ray from y, distributed as the
  response;
* a *unidirectional hit*: x1 .. xn and y by scattering.

The factor of x1 .. x(n-1) is common to the three densities. Their ratios, and with them the weights of the power
heuristic, therefore depend on xn alone (E. Veach, Robust Monte Carlo Methods for Light Transport Simulation, 1997,
chapters 9 and 10).

If xn is on a mirror, only hits sample the path. Two more techniques then sample it as well:

* a *reflected sensor-subpath connection*: the ray from y is reflected by mirrors until it meets a wall that scatters,
  and the vertex there is connected, see `reflected_views`;
* an *image connection*, if the mirror is plane: x1 .. x(n-1) by scattering, y uniform, and xn where the straight line
  from the image of x(n-1) behind the mirror to y crosses the mirror.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

import drjit as dr
import mitsuba as mi

from mitsuba_taxel.kernels.paths.guide import Guide
from mitsuba_taxel.kernels.paths.plane_mirrors import PlaneMirrors
from mitsuba_taxel.kernels.paths.ray_offsets import between, leave, release
from mitsuba_taxel.kernels.paths.reflected_views import (
    MOST_MIRRORS,
    ViewRay,
    follows_mirrors,
    reflected,
    specular_probability,
    stretch_at,
)
from mitsuba_taxel.kernels.taxels.windows import Sight, straight

Scattering = Callable[[mi.Vector3f], tuple[mi.Float, mi.Float]]
"""Function of a world direction that returns the scattered fraction per solid angle [1/sr, with the cosine] and the
density of the direction [1/sr]."""


@dataclass
class Vertex:
    """A vertex of a light path: its power, and the densities that determine the weights of the techniques."""

    p: mi.Point3f
    n: mi.Normal3f
    throughput: mi.Float  # W
    guided: mi.Float  # probability that the guide samples the next direction
    uv: mi.Point2f  # position of the vertex on the guide's unit square
    inverse: mi.Float  # mm²: reciprocal area density of this vertex; 0 if no sensor subpath can sample it
    ends_views: mi.Float  # probability with which a reflected view ends at this wall


@dataclass
class Mirrored:
    """A ray after reflection by a mirror, with its densities and powers before the mirror."""

    # In 1/sr: density of the ray's direction before the mirror and of specular reflection; 0 if images have no part.
    density: mi.Float
    distance: mi.Float  # mm: from the vertex before the mirror
    # In mm² sr: ratio of reflected views to hits, without the factor of the phototransistor; 0 if impossible.
    odds: mi.Float
    specular: mi.Float  # probability of specular reflection by the mirror
    mirrors: mi.UInt32  # number of mirrors since the last wall that scattered

    @classmethod
    def nowhere(cls) -> Mirrored:
        """Default data for a ray that no mirror has reflected."""
        return cls(mi.Float(0), mi.Float(0), mi.Float(0), mi.Float(0), mi.UInt32(0))


@dataclass
class View:
    """A view of the phototransistor: a point y on it, and the first point z of the scene on a ray from y.

    In a reflected view the ray goes over mirrors. Area density and solid angle are then those for a plane mirror. Only
    their product has a meaning; it does not depend on the curvature.
    """

    y: mi.Point3f
    offset: mi.Point2f  # offset of y from the centre of the phototransistor
    si: mi.SurfaceInteraction3f  # at z
    bsdf: mi.BSDFPtr
    valid: mi.Bool
    weight: mi.Float  # sr: response times cosine over the density of the direction
    to_y: mi.Vector3f  # direction from z to y, in the frame of z
    cosine: mi.Float  # at z
    density: mi.Float  # 1/mm²: area density of z
    solid_angle: mi.Float  # sr: solid angle of the phototransistor, seen from z
    member: mi.Bool  # whether the guide can sample z
    guided: mi.Float  # probability that the guide samples the next direction at z
    uv: mi.Point2f  # position of z on the guide's unit square
    connectable: mi.Bool  # whether a connection samples the same path
    mirrors: mi.UInt32  # number of mirrors between y and z
    ray: ViewRay  # the ray as it left the phototransistor


class Techniques:
    """Ways to sample the light from a vertex of a path to the phototransistor, and their weights.

    Parameters
    ----------
    strategy : str
        ``all``, or a single technique: ``connections``, ``sensor_subpath_connections`` or ``unidirectional_hits``.
    scene : mi.Scene
        The scene.
    sensor : mi.Sensor
        The phototransistor array.
    index : mi.UInt32
        Number of the phototransistor of each path.
    guide : Guide or None
        Guide of the directions between walls.
    clearance : mi.Float
        Part of the offset from the surface in mm, by :func:`clearance_of`. See
        :func:`mitsuba_taxel.kernels.paths.ray_offsets.leave`.
    mirrors : PlaneMirrors or None
        Plane mirrors for image connections.
    """

    def __init__(
        self,
        strategy: str,
        scene: mi.Scene,
        sensor: mi.Sensor,
        index: mi.UInt32,
        guide: Guide | None,
        clearance: mi.Float,
        mirrors: PlaneMirrors | None = None,
    ) -> None:
        names = ("connections", "sensor_subpath_connections", "unidirectional_hits")
        self.connections, self.sensor_subpaths, self.unidirectional = (strategy in ("all", name) for name in names)
        self.scene, self.sensor, self.index, self.guide, self.clearance = scene, sensor, index, guide, clearance
        self.mirrors = mirrors if self.connections else None
        self.area = sensor.faces.area
        self.detector = mi.ShapePtr(sensor.get_shape())
        dr.make_opaque(self.detector)  # so that another phototransistor needs no new kernel
        self.context = mi.BSDFContext(mi.TransportMode.Importance)
        self.follows_mirrors, self.has_mixed_walls = follows_mirrors(scene) if self.sensor_subpaths else (False, False)

    def look(self, position: mi.Point2f, direction: mi.Point2f) -> View:
        """Sample a point of each phototransistor and a direction distributed as its response, and trace the ray from
        it.

        Parameters
        ----------
        position, direction : mi.Point2f
            Uniform random numbers.

        Returns
        -------
        View
            The point, and the first surface point on the ray.
        """
        y, offset = self.sensor.sample_point(self.index, position)
        local, of_direction = self.sensor.sample_view(direction)
        d = self.sensor.faces.frame.to_world(local)
        if not self.sensor_subpaths:
            nothing = dr.zeros(mi.SurfaceInteraction3f)
            values: dict[str, Any] = dict.fromkeys(field.name for field in fields(View))
            values |= {"y": y, "offset": offset, "si": nothing, "bsdf": nothing.bsdf(), "valid": mi.Bool(False)}
            return View(**values)
        exit_point, is_open = self.sensor.window.leave(self.index, y, d)
        ray = release(exit_point, mi.Normal3f(self.sensor.normal), d, self.clearance)
        si = self.scene.ray_intersect(ray)
        valid = si.is_valid() & (local.z > 0) & (of_direction > 0) & is_open
        distance_squared = self.sensor.window.apparent(dr.squared_norm(si.p - exit_point), local.z)
        cosine = dr.abs(dr.dot(si.n, d))
        member, guided, uv = self.guidance(si, valid)
        return View(
            y=y,
            offset=offset,
            si=si,
            bsdf=si.bsdf(mi.RayDifferential3f(ray)),
            valid=valid & (cosine > 0),
            weight=self.sensor.response(local.z) * local.z / of_direction,
            to_y=si.to_local(-d),
            cosine=cosine,
            density=of_direction * cosine / distance_squared,
            solid_angle=self.area * local.z / distance_squared,
            member=member,
            guided=guided,
            uv=uv,
            connectable=mi.Bool(self.connections),
            mirrors=mi.UInt32(0),
            ray=ViewRay(exit_point, d, local.z, of_direction),
        )

    def reflect(self, view: View, choice: mi.Float) -> View:
        """Continue a ray from the phototransistor beyond a mirror, to the next wall that scatters.

        Parameters
        ----------
        view : View
            The point of the phototransistor, and the first point on a ray from it.
        choice : mi.Float
            Uniform random numbers.

        Returns
        -------
        View
            View from the same point of the phototransistor; not valid where the first wall is no mirror.
        """
        end = reflected(self.scene, self.context, self.clearance, view.si, view.ray.direction, view.valid, choice)
        exit_distance = dr.norm(view.si.p - view.ray.exit_point)
        distance_squared = self.sensor.window.apparent(dr.square(exit_distance + end.distance), view.ray.cosine)
        cosine = dr.abs(dr.dot(end.si.n, end.direction))
        valid = end.valid & (cosine > 0)
        member, guided, uv = self.guidance(end.si, valid)
        plane = mi.Bool(False)
        if self.mirrors is not None:
            plane = (end.mirrors == 1) & self.mirrors.contains(self.index, view.si, valid)
        return View(
            y=view.y,
            offset=view.offset,
            si=end.si,
            bsdf=end.si.bsdf(),
            valid=valid,
            weight=view.weight * end.weight,
            to_y=end.si.to_local(-end.direction),
            cosine=cosine,
            density=view.ray.density * end.stretch * cosine * end.ends / distance_squared,
            solid_angle=self.area * view.ray.cosine * end.specular / distance_squared,
            member=member,
            guided=guided,
            uv=uv,
            connectable=plane,
            mirrors=end.mirrors,
            ray=view.ray,
        )

    def ends_views(self, si: mi.SurfaceInteraction3f, bsdf: mi.BSDFPtr, active: mi.Bool) -> mi.Float:
        """Probability with which a ray from the phototransistor, reflected by mirrors, ends at a wall that scatters."""
        if not (self.follows_mirrors and self.has_mixed_walls):
            return mi.Float(1)
        return 1 - specular_probability(self.context, si, bsdf, active)[0]

    def connect(self, view: View, vertex: Vertex, scatter: Scattering, active: mi.Bool) -> mi.Float:
        """Power [W] of a connection from a vertex to the point y of a view.

        Parameters
        ----------
        view : View
            The point of the phototransistor.
        vertex : Vertex
            The vertex.
        scatter : Scattering
            Scattering or emission at the vertex.
        active : mi.Bool
            Active lanes.
        """
        if not self.connections:
            return mi.Float(0)
        sight = self.sensor.window.sight(self.index, vertex.p, view.y)
        wo, distance_squared = sight.direction, sight.squared_distance
        cosine = -dr.dot(wo, self.sensor.normal)
        active = active & (cosine > 0) & (distance_squared > 0) & sight.is_open
        value, density = scatter(wo)
        active &= value > 0
        ray = between(vertex.p, vertex.n, wo, self.clearance, sight.crossing, self.sensor.normal)
        active &= ~self.scene.ray_test(ray, active)
        solid_angle = self.area * cosine / distance_squared
        hit = (1 - vertex.guided) * density * solid_angle
        subpath = self.sensor.density_of_view(-wo) * dr.abs(dr.dot(vertex.n, wo)) / distance_squared * vertex.inverse
        weight = self._weight((self.unidirectional, hit), (self.sensor_subpaths, subpath))
        value *= vertex.throughput * solid_angle * self.sensor.response(cosine) * weight
        return dr.select(active, value, 0)

    def connect_subpath(
        self, view: View, vertex: Vertex, scatter: Scattering, active: mi.Bool, sight: Sight | None = None
    ) -> mi.Float:
        """Power [W] of a connection from a vertex through the point z of a view to the phototransistor.

        Parameters
        ----------
        view : View
            The point z, and the ray from the phototransistor.
        vertex : Vertex
            The vertex.
        scatter : Scattering
            Scattering or emission at the vertex.
        active : mi.Bool
            Active lanes.
        sight : Sight, optional
            Line of sight from z to the vertex; by default a straight line.
        """
        if not self.sensor_subpaths:
            return mi.Float(0)
        sight = sight or straight(view.si.p, vertex.p)
        wo, distance_squared = -sight.direction, sight.squared_distance
        active = active & view.valid & (distance_squared > 0) & sight.is_open
        value, density = scatter(wo)
        active &= value > 0
        cosine = dr.abs(dr.dot(view.si.n, wo))
        si = mi.SurfaceInteraction3f(view.si)
        si.wi = si.to_local(-wo)
        passed_on, onward = view.bsdf.eval_pdf(self.context, si, view.to_y, active)
        active &= (passed_on[0] > 0) & (cosine > 0)
        ray = between(sight.crossing, vertex.n, wo, self.clearance, view.si.p, view.si.n)
        active &= ~self.scene.ray_test(ray, active)

        drawn = self.drawn(density, vertex, view.member, view.uv, distance_squared / cosine)
        connection = drawn * cosine / (distance_squared * view.density)
        hit = connection * (1 - view.guided) * onward * view.solid_angle
        of_connection = dr.select(view.connectable, connection, 0)
        weight = self._weight((self.connections, of_connection), (self.unidirectional, hit))
        value *= vertex.throughput * passed_on[0] * cosine / (distance_squared * view.cosine)
        return dr.select(active, value * self.area * view.weight * weight, 0)

    def connect_image(self, view: View, vertex: Vertex, scatter: Scattering, active: mi.Bool) -> mi.Float:
        """Power [W] of a connection from a vertex over the plane mirror to the point y of a view.

        Parameters
        ----------
        view : View
            The point of the phototransistor.
        vertex : Vertex
            The vertex.
        scatter : Scattering
            Scattering at the vertex.
        active : mi.Bool
            Active lanes.
        """
        if self.mirrors is None:
            return mi.Float(0)
        # The line from the image of the vertex to y, and its direction before the mirror.
        image, normal, exists = self.mirrors.image(self.index, vertex.p)
        sight = self.sensor.window.sight(self.index, image, view.y)
        onward, distance_squared = sight.direction, sight.squared_distance
        wo = onward - 2 * dr.dot(onward, normal) * normal
        cosine = -dr.dot(onward, self.sensor.normal)
        active = active & exists & (cosine > 0) & (distance_squared > 0) & sight.is_open
        value, density = scatter(wo)
        active &= value > 0

        # Both segments are visible, and meet on the mirror.
        si = self.scene.ray_intersect(leave(vertex.p, vertex.n, wo, self.clearance), active)
        active &= self.mirrors.contains(self.index, si, active & si.is_valid())
        ray = between(si.p, normal, onward, self.clearance, sight.crossing, self.sensor.normal)
        active &= ~self.scene.ray_test(ray, active)

        solid_angle = self.area * cosine / distance_squared
        hit = (1 - vertex.guided) * density * self.mirrors.specular * solid_angle
        subpath = self.sensor.density_of_view(-onward) * dr.abs(dr.dot(vertex.n, wo)) / distance_squared
        subpath *= vertex.inverse * vertex.ends_views
        value *= vertex.throughput * self.mirrors.reflected * solid_angle * self.sensor.response(cosine)
        return dr.select(active, value * self._weight((self.unidirectional, hit), (self.follows_mirrors, subpath)), 0)

    def mirrored(
        self,
        si: mi.SurfaceInteraction3f,
        active: mi.Bool,
        arrived: Mirrored,
        arrived_specular: mi.Bool,
        previous: Vertex,
        d: mi.Vector3f,
        density: mi.Float,
        specular: mi.Float,
        onward: mi.Vector3f,
        distance: mi.Float,
    ) -> Mirrored:
        """Data of rays that a mirror reflects at ``si``, for the weights of the sampling techniques.

        Parameters
        ----------
        si : mi.SurfaceInteraction3f
            Hits at which the rays are reflected.
        active : mi.Bool
            Whether the ray is reflected as by a mirror, and has been reflected by a wall before.
        arrived : Mirrored
            Properties of the ray at the previous mirror, if any.
        arrived_specular : mi.Bool
            Whether the ray comes from a mirror.
        previous : Vertex
            The previous vertex.
        d, onward : mi.Vector3f
            World directions before and after the mirror.
        density : mi.Float
            Density of ``d`` [1/sr].
        specular : mi.Float
            Probability of specular reflection.
        distance : mi.Float
            Distance from the previous vertex, mm.
        """
        from_wall = active & ~arrived_specular
        by_image = dr.zeros(mi.Float, dr.width(si))
        if self.mirrors is not None:
            by_image = dr.select(self.mirrors.contains(self.index, si, from_wall), density * specular, 0)
        first = previous.inverse * previous.ends_views * dr.abs(dr.dot(previous.n, d)) / density
        odds = dr.select(from_wall, first, arrived.odds) * stretch_at(si, onward)
        mirrors = dr.select(from_wall, 0, arrived.mirrors) + 1
        return Mirrored(
            by_image, mi.Float(distance), dr.select(active & (mirrors <= MOST_MIRRORS), odds, 0), specular, mirrors
        )

    def hit(
        self,
        si: mi.SurfaceInteraction3f,
        d: mi.Vector3f,
        previous: Vertex,
        density: mi.Float,
        specular: mi.Bool,
        mirrored: Mirrored,
    ) -> tuple[mi.Float, mi.Point2f]:
        """Power [W] of rays that hit a phototransistor at ``si`` in direction ``d``, and the offset of the hit from its
        centre.

        Parameters
        ----------
        si : mi.SurfaceInteraction3f
            Hit of the ray.
        d : mi.Vector3f
            World direction of the ray.
        previous : Vertex
            The previous vertex, with the current throughput of the ray.
        density : mi.Float
            Density of the direction ``d`` [1/sr]; not used where ``specular``.
        specular : mi.Bool
            Whether the direction was sampled by a mirror.
        mirrored : Mirrored
            Density and distance of the ray before the reflection by that mirror.
        """
        inside, offset = self.sensor.contains(self.index, si.p, d)
        if not self.unidirectional:
            return mi.Float(0), offset
        cosine = -dr.dot(d, self.sensor.normal)
        hits = si.is_valid() & (si.shape == self.detector) & inside & (cosine > 0)
        distance_squared = self.sensor.window.apparent(dr.squared_norm(si.p - previous.p), cosine)
        connection = distance_squared / (density * self.area * cosine)
        subpath = connection * previous.inverse * self.sensor.density_of_view(-d)
        subpath *= dr.abs(dr.dot(previous.n, d)) / distance_squared
        weight = self._weight((self.connections, connection), (self.sensor_subpaths, subpath))
        by_image, by_view = mi.Float(0), mi.Float(0)
        if self.mirrors is not None:
            from_image = dr.square(dr.norm(si.p - previous.p) + mirrored.distance)
            by_image = self.sensor.window.apparent(from_image, cosine) / (mirrored.density * self.area * cosine)
            by_image = dr.select(mirrored.density > 0, by_image, 0)
        if self.follows_mirrors:
            by_view = mirrored.odds * self.sensor.density_of_view(-d) / (mirrored.specular * self.area * cosine)
            by_view = dr.select(mirrored.odds > 0, by_view, 0)
        of_mirror = self._weight((True, by_image), (True, by_view))
        weight = dr.select(specular, of_mirror, weight)
        return dr.select(hits, previous.throughput * self.sensor.response(cosine) * weight, 0), offset

    def guidance(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> tuple[mi.Bool, mi.Float, mi.Point2f]:
        """Mask of the hits ``si`` at which the guide can sample directions, the probability that it is used there, and
        the position of ``si`` on the unit square of the guide."""
        if self.guide is None:
            return mi.Bool(False), mi.Float(0), mi.Point2f(0)
        member = self.guide.contains(self.index, si, active)
        return member, dr.select(member, self.guide.probability, 0), self.guide.uv(si, member)

    def draw(self, vertex: Vertex, sample: mi.Point2f, nearness: mi.Float) -> tuple[mi.Point3f, mi.UInt32]:
        """Sample the next vertex of a path on triangles of the taxel's own cell. Returns a point, and the number of its
        triangle.
        """
        assert self.guide is not None
        return self.guide.sample(self.index, vertex.uv, sample, nearness)

    def drawn(
        self, density: mi.Float, previous: Vertex, member: mi.Bool, uv: mi.Point2f, area_per_angle: mi.Float
    ) -> mi.Float:
        """Density [1/sr] of the direction of a ray from a vertex, which was sampled by scattering or by the guide.

        Parameters
        ----------
        density : mi.Float
            Density of scattering [1/sr].
        previous : Vertex
            The vertex.
        member, uv : mi.Bool and mi.Point2f
            Mask of the hits that the guide can sample, and their positions on the unit square.
        area_per_angle : mi.Float
            Distance squared over cosine at the hit, mm².
        """
        total = (1 - previous.guided) * density
        if self.guide is not None:
            guide_density = self.guide.density(self.index, previous.uv, uv) * area_per_angle
            total += dr.select(member, previous.guided * guide_density, 0)
        return total

    @staticmethod
    def _weight(*alternatives: tuple[bool, mi.Float]) -> mi.Float:
        """Weight of a technique by the power heuristic (multiple importance sampling). ``alternatives`` lists all other
        techniques: whether each is in use, and its density relative to that of this technique.
        """
        total = mi.Float(1)
        for in_use, ratio in alternatives:
            if in_use:
                total += dr.square(ratio)
        return dr.rcp(total)
