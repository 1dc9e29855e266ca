"""LEDs and phototransistors of diffuse cells, with their packages, as ends of light that needs no random numbers."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import mitsuba as mi
import numpy as np

from mitsuba_taxel.backend.plugin_objects import kind_of
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.kernels.protocols import LedEmitter, PhototransistorSensor, is_package, is_wall
from mitsuba_taxel.kernels.taxel_pair import TaxelPair
from mitsuba_taxel.kernels.taxels.faces import FaceGrid
from mitsuba_taxel.kernels.walls import walls_by_region
from mitsuba_taxel.transport.box import Box
from mitsuba_taxel.transport.box_faces import BoxFaces, faces_of
from mitsuba_taxel.transport.laws.ends import AngularLaw, CosineFactor, End, uniform_cone
from mitsuba_taxel.transport.laws.polar_cone import PolarCone
from mitsuba_taxel.transport.laws.tabulated_law import TabulatedLaw
from mitsuba_taxel.transport.rules import disc_annulus_rule, rectangle_rule, square_annulus_rule

LED_POINTS, PHOTOTRANSISTOR_POINTS = 2, 8
"""Points along a side of a quarter of the LED, and of the phototransistor: more change readings by less than 1e-6."""
SINGLE = 1e-7
"""Relative rounding error of single precision."""
STEEPEST = 20.0
"""Largest spread of a law, relative to its width: the pieces of walls in its light increase with the square."""
KINKED = 4.0
"""How much larger errors of light are relative to the difference of two solutions if a law has kinks, as polynomials
follow these more slowly: compared with patches of 0.6 of the size, by tables of five rows."""
HORIZON, NEARLY_DARK = 1e-4, 1e-3
"""Cosine, and relative response, at the end of a table that is a step if both are larger."""
IntoPad = Callable[..., np.ndarray]
"""Takes points, or directions if ``is_direction``, from the scene to the pad."""


class NotDiffuse(InputError):
    """The scene needs random paths."""


@dataclass(frozen=True, eq=False)
class Taxel:
    """One LED and its phototransistor.

    Attributes
    ----------
    power : float
        Of the LED, in W.
    led, phototransistor : End
        In the frame of the pad.
    body : Box or None
        Their package, in that frame.
    package : PackageFaces or None
        Those of its faces that scatter light.
    """

    power: float
    led: End
    phototransistor: End
    body: Box | None
    package: PackageFaces | None

    @property
    def light_share(self) -> float:
        """Factor of the errors of its light by its laws; see :meth:`DiffuseCells.light_share`."""
        return KINKED if self.led.law.has_kinks or self.phototransistor.law.has_kinks else 1.0

    @property
    def middle(self) -> np.ndarray:
        """(2,) mm, between LED and phototransistor."""
        return (self.led.points.mean(axis=0) + self.phototransistor.points.mean(axis=0))[:2] / 2


@dataclass(frozen=True, eq=False)
class PackageFaces:
    """Faces of a package that scatter light by Lambert's law.

    Attributes
    ----------
    faces : BoxFaces
        R of them.
    shares : (R,) ndarray
        Share of the incident light that each scatters.
    """

    faces: BoxFaces
    shares: np.ndarray

    def cut(self, cuts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Patches (G, 15, 3) for numbers of parts (R, 2), see :meth:`BoxFaces.cuts`, and the share (G,) of each."""
        return self.faces.positions(cuts), np.repeat(self.shares, 2 * cuts.prod(axis=1))


def scattered_shares(wall: mi.BSDF) -> tuple[float, float]:
    """Shares of the light that a wall scatters isotropically and by Lambert's law; it reflects nothing else."""
    if not is_wall(wall):
        raise NotDiffuse(f"a surface is a {kind_of(wall)}, not a wall")
    if wall.scattering == "absorbing":
        return 0.0, 0.0
    if wall.reflectance is None:
        raise NotDiffuse("a wall's reflectance is a table")
    reflectance, scattering, stated = float(wall.reflectance[0]), wall.scattering, wall.specification
    if reflectance == 0:
        return 0.0, 0.0
    if scattering == "mixed" and not stated.specular:
        return reflectance * (stated.isotropic or 0.0), reflectance * (stated.lambertian or 0.0)
    if scattering not in ("isotropic", "lambertian"):
        raise NotDiffuse(f"a wall is a mirror in part: scattering = {scattering!r}")
    return (reflectance, 0.0) if scattering == "isotropic" else (0.0, reflectance)


def diffuse_taxels(pair: TaxelPair, into_pad: IntoPad, scale: float, points: int) -> list[Taxel]:
    """The taxels of a pair, in the frame of a pad.

    Parameters
    ----------
    pair : TaxelPair
    into_pad : IntoPad
    scale : float
        Of the pad in the scene.
    points : int
        Along a side of each phototransistor.

    Raises
    ------
    NotDiffuse
        with the reason, if one of their laws, or what their package scatters, needs random paths.
    """
    if pair.is_below_windows:
        raise NotDiffuse("LED and phototransistor lie below windows, where light is bent")
    stated = pair.led.specification
    size, hole = (pair.led.faces.scale * side for side in (stated.size, stated.hole))
    if stated.shape == "square":
        emitting = square_annulus_rule(size, hole, LED_POINTS, LED_POINTS)
    else:
        emitting = disc_annulus_rule(size, hole, LED_POINTS, 4 * LED_POINTS)
    width, depth = (float(side) for side in np.array(pair.sensor.faces.size, dtype=float).ravel())
    sensitive = rectangle_rule(width, depth, points, points)
    bodies = _bodies(pair, into_pad, scale)
    packages = [_scattering_faces(pair, body) for body in bodies]
    live = float(pair.led.power[0])  # in single precision, and perhaps changed in the loaded scene
    power = stated.power if math.isclose(live, stated.power, rel_tol=SINGLE) else live
    laws = _law_of_led(pair.led), _law_of_phototransistor(pair.sensor)
    leds = _ends(pair.led.faces, emitting, laws[0], into_pad)
    sensors = _ends(pair.sensor.faces, sensitive, laws[1], into_pad)
    return [
        Taxel(
            power,
            replace(led, weights=led.weights / led.weights.sum()),
            replace(sensor, weights=sensor.weights / scale**2),
            body,
            package,
        )
        for led, sensor, body, package in zip(leds, sensors, bodies, packages, strict=True)
    ]


def _bodies(pair: TaxelPair, into_pad: IntoPad, scale: float) -> list[Box | None]:
    """Boxes of the packages with the LEDs of a pair at their tops."""
    package, faces = pair.led.get_shape(), pair.led.faces
    centres = np.array(faces.centres, dtype=float).T
    if not is_package(package):
        return [None] * len(centres)
    axes = np.stack([np.array(axis, dtype=float).ravel() for axis in (faces.frame.s, faces.frame.t, faces.frame.n)])
    half = 0.5 * faces.scale * package.body
    side = package.sides["led"]
    inwards = -faces.scale * (side.x * axes[0] + side.y * axes[1]) - half[2] * axes[2]
    turned = into_pad(axes, is_direction=True)
    return [Box(into_pad(centre + inwards), turned, half / scale) for centre in centres]


def _scattering_faces(pair: TaxelPair, body: Box | None) -> PackageFaces | None:
    """The faces of a package with LED and phototransistor that scatter light; None if there are none."""
    package = pair.led.get_shape()
    walls = walls_by_region(package.bsdf())
    if not (body is not None and pair.coplanar and is_package(package)):
        return None
    each = [scattered_shares(walls[name]) if name in walls else (0.0, 0.0) for name in (*package.sides, "body")]
    if any(isotropic for isotropic, _ in each):
        raise NotDiffuse(
            "a package scatters light isotropically, which ends with a step along the horizon of its faces"
        )
    shares = np.array([lambertian for _, lambertian in each])
    scale = 2 * body.half[:2] / package.body[:2]
    dies = [np.array([[s.x, s.y], [s.die_width, s.die_length]]) * scale for s in package.sides.values()]
    openings = [(x - a / 2, x + a / 2, y - b / 2, y + b / 2) for (x, y), (a, b) in (die.tolist() for die in dies)]
    found = faces_of(body, openings)
    kept = shares[found.kind] > 0
    return PackageFaces(found.among(kept), shares[found.kind[kept]]) if kept.any() else None


def _ends(faces: FaceGrid, rule: tuple[np.ndarray, np.ndarray], law: AngularLaw, into_pad: IntoPad) -> list[End]:
    axes = np.stack([np.array(axis, dtype=float).ravel() for axis in (faces.frame.s, faces.frame.t, faces.frame.n)])
    offsets, weights = rule
    around = offsets @ axes[:2]
    normal = into_pad(axes[2], is_direction=True)
    centres = np.array(faces.centres, dtype=float).T
    return [End(into_pad(centre + around), weights, normal, law) for centre in centres]


def _law_of_led(led: LedEmitter) -> AngularLaw:
    stated = led.specification
    if led.table is not None:
        return _tabulated(led.table, "the LED's law")
    if stated.law == "uniform_solid_angle":
        assert stated.cone_angle is not None  # set with this law
        return uniform_cone(np.cos(np.radians(stated.cone_angle)))
    if stated.law == "uniform_polar_angle":
        assert stated.cone_angle is not None  # set with this law
        return PolarCone(math.radians(stated.cone_angle))
    if stated.law == "lambertian":
        return CosineFactor(1 / np.pi, 1.0)
    if stated.law == "cosine_power":
        assert stated.exponent is not None  # this law needs it
        return CosineFactor((stated.exponent + 1) / (2 * np.pi), stated.exponent)
    raise NotDiffuse(f"the LED's law is {stated.law}")


def _law_of_phototransistor(sensor: PhototransistorSensor) -> AngularLaw:
    stated = sensor.specification
    if sensor.table is not None:
        cosines, values = sensor.table
        if cosines[0] > HORIZON and values[0] > NEARLY_DARK * values.max():
            raise NotDiffuse("the phototransistor's response ends with a step")
        return _tabulated((cosines, values), "the phototransistor's response")
    if stated.response == "ideal":
        return CosineFactor(1.0, 0.0)
    if stated.response == "cosine_power":
        assert stated.exponent is not None  # this response needs it
        return CosineFactor(1.0, stated.exponent - 1)
    raise NotDiffuse(f"the phototransistor's response is {stated.response}")


def _tabulated(table: tuple[np.ndarray, np.ndarray], what: str) -> AngularLaw:
    law = TabulatedLaw(*table)
    if law.spread > STEEPEST * law.width(np.ones(1)):
        raise NotDiffuse(f"{what} falls within a small part of its {np.degrees(law.spread):.2g} degrees")
    return law
