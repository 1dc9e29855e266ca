"""LEDs and phototransistors of diffuse cells, with their packages, for light without random numbers."""

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
"""Number of quadrature points along a side of a quarter of the LED, and along a side of the phototransistor. More
points change readings by less than 1e-6."""
SINGLE = 1e-7
"""Relative rounding error of single precision."""
STEEPEST = 20.0
"""Largest ratio of spread to width of a tabulated law. The number of patches in its light grows with the square of this
ratio."""
KINKED = 4.0
"""Factor of the error of the light if a law has kinks, at which polynomials converge more slowly. It was found by
comparison with patches of 0.6 of the size, for tables of five rows."""
HORIZON, NEARLY_DARK = 1e-4, 1e-3
"""A tabulated response ends with a step if its last cosine, and its last value relative to the maximum, exceed these
limits."""
IntoPad = Callable[..., np.ndarray]
"""Transforms points, or directions if ``is_direction``, from world coordinates to the frame of the pad."""


class NotDiffuse(InputError):
    """The light of the scene cannot be computed without random paths."""


@dataclass(frozen=True, eq=False)
class Taxel:
    """One LED and its phototransistor.

    Attributes
    ----------
    power : float
        Power of the LED, in W.
    led, phototransistor : End
        LED and phototransistor in the frame of the pad.
    body : Box or None
        Their package, in the frame of the pad.
    package : PackageFaces or None
        The faces of the package that scatter light.
    """

    power: float
    led: End
    phototransistor: End
    body: Box | None
    package: PackageFaces | None

    @property
    def error_factor(self) -> float:
        """Factor by which angular laws of LED and phototransistor increase the error of the light; see
        :meth:`DiffuseCells.error_factor`.
        """
        return KINKED if self.led.law.has_kinks or self.phototransistor.law.has_kinks else 1.0

    @property
    def middle(self) -> np.ndarray:
        """Point (2,) in mm, along x and y, midway between LED and phototransistor."""
        return (self.led.points.mean(axis=0) + self.phototransistor.points.mean(axis=0))[:2] / 2


@dataclass(frozen=True, eq=False)
class PackageFaces:
    """Faces of a package that scatter light by Lambert's law.

    Attributes
    ----------
    faces : BoxFaces
        The R rectangles into which the package is divided.
    fractions : (R,) ndarray
        Fraction of the incident light that each rectangle scatters.
    """

    faces: BoxFaces
    fractions: np.ndarray

    def cut(self, cuts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Divide the faces into patches with 15 nodes each.

        Parameters
        ----------
        cuts : (R, 2) ndarray
            Numbers of parts along both sides of each of the R rectangles; see :meth:`BoxFaces.cuts`.

        Returns
        -------
        positions : (G, 15, 3) ndarray
            Positions of the nodes of G patches, in mm.
        fraction : (G,) ndarray
            Fraction of the incident light that each patch scatters.
        """
        return self.faces.positions(cuts), np.repeat(self.fractions, 2 * cuts.prod(axis=1))


def scattered_fractions(wall: mi.BSDF) -> tuple[float, float]:
    """Fractions of the incident light that a wall scatters isotropically and by Lambert's law.

    Parameters
    ----------
    wall : mi.BSDF
        BSDF of the wall.

    Returns
    -------
    isotropic, lambertian : float
        Fractions from 0 to 1; the rest is absorbed.

    Raises
    ------
    NotDiffuse
        if the wall scatters light by any other law.
    """
    if not is_wall(wall):
        raise NotDiffuse(f"a surface is a {kind_of(wall)}, not a wall")
    if wall.scattering == "absorbing":
        return 0.0, 0.0
    if wall.reflectance is None:
        raise NotDiffuse("a wall's reflectance is a table")
    reflectance, scattering, specification = float(wall.reflectance[0]), wall.scattering, wall.specification
    if reflectance == 0:
        return 0.0, 0.0
    if scattering == "mixed" and not specification.specular:
        return reflectance * (specification.isotropic or 0.0), reflectance * (specification.lambertian or 0.0)
    if scattering not in ("isotropic", "lambertian"):
        raise NotDiffuse(f"a wall is a mirror in part: scattering = {scattering!r}")
    return (reflectance, 0.0) if scattering == "isotropic" else (0.0, reflectance)


def diffuse_taxels(pair: TaxelPair, into_pad: IntoPad, scale: float, points: int) -> list[Taxel]:
    """Convert an array of LEDs and phototransistors to taxels in the frame of a pad.

    Parameters
    ----------
    pair : TaxelPair
        The array of LEDs and phototransistors.
    into_pad : IntoPad
        Transformation from world coordinates to the frame of the pad.
    scale : float
        Scale of the pad in the scene: length in the scene per length in the frame of the pad.
    points : int
        Points along a side of each phototransistor.

    Returns
    -------
    list[Taxel]
        Taxels in the order of the array.

    Raises
    ------
    NotDiffuse
        if an angular law, or the scattering of a package, needs random paths; the message has the reason.
    """
    if pair.is_below_windows:
        raise NotDiffuse("LED and phototransistor lie below windows, where light is bent")
    # Points and weights on the LED and on the phototransistor, as offsets from their centres.
    specification = pair.led.specification
    size, hole = (pair.led.faces.scale * side for side in (specification.size, specification.hole))
    if specification.shape == "square":
        emitting = square_annulus_rule(size, hole, LED_POINTS, LED_POINTS)
    else:
        emitting = disc_annulus_rule(size, hole, LED_POINTS, 4 * LED_POINTS)
    width, depth = (float(side) for side in np.array(pair.sensor.faces.size, dtype=float).ravel())
    sensitive = rectangle_rule(width, depth, points, points)
    bodies = _bodies(pair, into_pad, scale)
    packages = [_scattering_faces(pair, body) for body in bodies]
    # The power may have been changed in the loaded scene, where it is in single precision.
    loaded = float(pair.led.power[0])
    power = specification.power if math.isclose(loaded, specification.power, rel_tol=SINGLE) else loaded
    leds = _ends(pair.led.faces, emitting, _law_of_led(pair.led), into_pad)
    sensors = _ends(pair.sensor.faces, sensitive, _law_of_phototransistor(pair.sensor), into_pad)
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
    """For each LED, the package in whose top it lies, as a box in the frame of the pad; None without packages."""
    package, faces = pair.led.get_shape(), pair.led.faces
    centres = np.array(faces.centres, dtype=float).T
    if not is_package(package):
        return [None] * len(centres)
    axes = np.stack([np.array(axis, dtype=float).ravel() for axis in (faces.frame.s, faces.frame.t, faces.frame.n)])
    half = 0.5 * faces.scale * package.body
    side = package.sides["led"]
    inwards = -faces.scale * (side.x * axes[0] + side.y * axes[1]) - half[2] * axes[2]
    axes_in_pad = into_pad(axes, is_direction=True)
    return [Box(into_pad(centre + inwards), axes_in_pad, half / scale) for centre in centres]


def _scattering_faces(pair: TaxelPair, body: Box | None) -> PackageFaces | None:
    """The faces of a package with LED and phototransistor that scatter light; None if there are none."""
    package = pair.led.get_shape()
    walls = walls_by_region(package.bsdf())
    if not (body is not None and pair.coplanar and is_package(package)):
        return None
    scattered = [scattered_fractions(walls[name]) if name in walls else (0.0, 0.0) for name in (*package.sides, "body")]
    if any(isotropic for isotropic, _ in scattered):
        raise NotDiffuse(
            "a package scatters light isotropically, which ends with a step along the horizon of its faces"
        )
    # The dies are openings in the top of the body; the last fraction is that of the body.
    fractions = np.array([lambertian for _, lambertian in scattered])
    scale = 2 * body.half[:2] / package.body[:2]
    dies = [np.array([[s.x, s.y], [s.die_width, s.die_length]]) * scale for s in package.sides.values()]
    openings = [(x - a / 2, x + a / 2, y - b / 2, y + b / 2) for (x, y), (a, b) in (die.tolist() for die in dies)]
    faces = faces_of(body, openings)
    scatters = fractions[faces.kind] > 0
    return PackageFaces(faces.among(scatters), fractions[faces.kind[scatters]]) if scatters.any() else None


def _ends(faces: FaceGrid, rule: tuple[np.ndarray, np.ndarray], law: AngularLaw, into_pad: IntoPad) -> list[End]:
    """LEDs or phototransistors as quadrature points and weights: those of a rule, around the centre of each face."""
    axes = np.stack([np.array(axis, dtype=float).ravel() for axis in (faces.frame.s, faces.frame.t, faces.frame.n)])
    offsets, weights = rule
    around = offsets @ axes[:2]
    normal = into_pad(axes[2], is_direction=True)
    centres = np.array(faces.centres, dtype=float).T
    return [End(into_pad(centre + around), weights, normal, law) for centre in centres]


def _law_of_led(led: LedEmitter) -> AngularLaw:
    """Angular law of an LED: the fraction of its power per solid angle."""
    specification = led.specification
    if led.table is not None:
        return _tabulated(led.table, "the LED's law")
    if specification.law == "uniform_solid_angle":
        assert specification.cone_angle is not None  # set with this law
        return uniform_cone(np.cos(np.radians(specification.cone_angle)))
    if specification.law == "uniform_polar_angle":
        assert specification.cone_angle is not None  # set with this law
        return PolarCone(math.radians(specification.cone_angle))
    if specification.law == "lambertian":
        return CosineFactor(1 / np.pi, 1.0)
    if specification.law == "cosine_power":
        assert specification.exponent is not None  # this law needs it
        return CosineFactor((specification.exponent + 1) / (2 * np.pi), specification.exponent)
    raise NotDiffuse(f"the LED's law is {specification.law}")


def _law_of_phototransistor(sensor: PhototransistorSensor) -> AngularLaw:
    """Angular law of a phototransistor: its response relative to that of an ideal phototransistor."""
    specification = sensor.specification
    if sensor.table is not None:
        cosines, values = sensor.table
        if cosines[0] > HORIZON and values[0] > NEARLY_DARK * values.max():
            raise NotDiffuse("the phototransistor's response ends with a step")
        return _tabulated((cosines, values), "the phototransistor's response")
    if specification.response == "ideal":
        return CosineFactor(1.0, 0.0)
    if specification.response == "cosine_power":
        assert specification.exponent is not None  # this response needs it
        return CosineFactor(1.0, specification.exponent - 1)
    raise NotDiffuse(f"the phototransistor's response is {specification.response}")


def _tabulated(table: tuple[np.ndarray, np.ndarray], what: str) -> AngularLaw:
    """Angular law from a table of cosines and values; raises `NotDiffuse` if the law falls steeply relative to its
    spread."""
    law = TabulatedLaw(*table)
    if law.spread > STEEPEST * law.width(np.ones(1)):
        raise NotDiffuse(f"{what} falls within a small part of its {np.degrees(law.spread):.2g} degrees")
    return law
