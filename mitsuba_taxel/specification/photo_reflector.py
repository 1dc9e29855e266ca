"""Parameters of photo-reflectors."""

from __future__ import annotations

from dataclasses import dataclass
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.parameters import nested, number, text, transform, vector, whole
from mitsuba_taxel.parameters.similarity import similarity_scale
from mitsuba_taxel.parts import Side, read_part
from mitsuba_taxel.specification.annular_led import AnnularLed
from mitsuba_taxel.specification.phototransistor import Phototransistor
from mitsuba_taxel.specification.specification import Specification
from mitsuba_taxel.specification.wall import ABSORBING, Wall

MOST_TAXELS = 100_000
SHORTEST, LONGEST = 1e-8, 1e8
"""Allowed sides of a package in mm: outside, areas or products of areas exceed single precision."""
_ROUNDING = 1e-6
"""Relative error of lengths that Mitsuba stores in single precision, such as components of vectors."""


Shift = tuple[float, float, float]


class Opening(NamedTuple):
    """A rectangle in the top of a package, in mm: the surface of a die, or the window above a die."""

    centre: tuple[float, float]
    extent: tuple[float, float]
    is_obround: bool = False


class Package(NamedTuple):
    """The body of a photo-reflector, its LED and phototransistor, and their dies and windows.

    ``body`` is the extent along x, y and z in mm. ``resin_index`` is the refractive index of the resin above the dies;
    None for dies in the top of the body.
    """

    body: tuple[float, float, float]
    led: AnnularLed
    phototransistor: Phototransistor
    emitter: Side
    detector: Side
    resin_index: float | None = None

    @property
    def extent(self) -> str:
        """Extent of the body, as text."""
        return ", ".join(f"{side:g}" for side in self.body)

    @property
    def sides(self) -> dict[str, Side]:
        """Dies and windows by the name of their region."""
        return {"led": self.emitter, "phototransistor": self.detector}

    @property
    def openings(self) -> dict[str, Opening]:
        """Openings in the top of the body, by the name of their region: windows, or dies if these are in the top."""
        if self.resin_index is None:
            return {n: Opening((s.x, s.y), (s.die_width, s.die_length)) for n, s in self.sides.items()}
        return {
            name: Opening(side.window_centre, (side.window_width, side.window_length), side.window_shape == "obround")
            for name, side in self.sides.items()
        }


def _bare(x: float, width: float, length: float) -> Side:
    """Die in the top of a body, centred at y = 0, without a separate window."""
    return Side(x=x, window_width=width, window_length=length, die_width=width, die_length=length)


def _package_of(name: str, led_shift: Shift | None, phototransistor_shift: Shift | None) -> Package:
    """The package of a part with shifted dies; raises `InputError` if a package cannot represent it."""
    part = read_part(name)
    emitter = _shifted("led_shift", part.emitter, led_shift, part.body)
    detector = _shifted("phototransistor_shift", part.detector, phototransistor_shift, part.body)
    if emitter.die_width != emitter.die_length:
        raise InputError(f"part = {name!r} is not allowed here: the emitter's die must be a square.")
    size, light = emitter.die_width, part.wavelength
    led = AnnularLed(size=size, hole=0.0, law=emitter.law, exponent=emitter.exponent, wavelength=light)
    response = "ideal" if detector.law == "lambertian" else detector.law
    width, depth = detector.die_width, detector.die_length
    phototransistor = Phototransistor(width=width, depth=depth, response=response, exponent=detector.exponent)
    is_deep = max(emitter.die_depth, detector.die_depth) > 0
    package = Package(part.body, led, phototransistor, emitter, detector, part.resin_index if is_deep else None)
    _check_openings(name, package)
    return package


def _shifted(name: str, side: Side, shift: Shift | None, body: tuple[float, float, float]) -> Side:
    """Copy of a die with its window, shifted by the parameter ``name``; raises `InputError` if it leaves the body."""
    if shift is None:
        return side
    try:
        shifted = side.moved(shift)
        shifted.check_in(body)
    except InputError as error:
        words = ", ".join(f"{component:g}" for component in shift)
        raise InputError(f"{name} = {words} is not allowed: {error}") from error
    return shifted


def _check_openings(name: str, package: Package) -> None:
    """Raise `InputError` for a part whose top cannot be divided along the edges of its openings."""
    first, second = package.openings.values()
    if abs(first.centre[0] - second.centre[0]) < 0.5 * (first.extent[0] + second.extent[0]) * (1 - _ROUNDING):
        kind = "dies" if package.resin_index is None else "windows"
        raise InputError(f"part = {name!r} is not allowed here: its {kind} must lie side by side along x, not overlap.")
    for opening in (first, second):
        reach = abs(opening.centre[0]) + 0.5 * opening.extent[0]
        if opening.is_obround and reach > 0.5 * package.body[0] * (1 - 10 * _ROUNDING):
            raise InputError(
                f"part = {name!r} is not allowed here: its obround window reaches the edge of the body; a smaller "
                "window_width, or a window_x nearer to 0, is needed."
            )


@dataclass(frozen=True)
class PhotoReflector(Specification):
    """An array of photo-reflectors; the defaults are those of the paper's sensor, the NJL5908AR."""

    plugin = "photo_reflector"

    rows: int = whole(1, 1, 1000, "Rows of the array, from +y to -y.")
    columns: int = whole(1, 1, 1000, "Columns of the array, along +x.")
    pitch: float = number(3.55, "mm", "Distance between neighbours.", above=0, common=(0.1, 200))
    part: str | None = text(
        None,
        "A part by its name in the catalogue, or from a TOML file. It determines body, windows, dies and their "
        "positions; LED and phototransistor are then not nested. The LED is Lambertian unless the file specifies "
        "another law. It emits 1 W: into air, or, from a die below a window, into the resin above it.",
        "the name of a part, or of a TOML file",
        default_words="the paper's sensor, with the defaults listed here",
    )
    led_shift: Shift | None = vector(
        (0.0, 0.0, 0.0),
        "mm",
        "Displacement of the LED's die from its position in the part, along x, y and z; its window stays in place.",
        needs="part",
    )
    phototransistor_shift: Shift | None = vector(
        (0.0, 0.0, 0.0),
        "mm",
        "Displacement of the phototransistor's die from its position in the part, along x, y and z.",
        needs="part",
    )
    body: tuple[float, float, float] | None = vector(
        (1.46, 1.06, 0.5), "mm", "Extent of the package along x, y and z.", above=0, common=(0.05, 100), without="part"
    )
    spacing: float | None = number(
        0.9,
        "mm",
        "Distance between the centres of LED (at -spacing/2) and phototransistor (at +spacing/2) along x.",
        minimum=0,
        common=(0.02, 100),
        without="part",
    )
    to_world: Any = transform(
        "Rigid motion, with at most a uniform scale. The body stands on z = 0, its centre on x = y = 0."
    )
    led: AnnularLed | None = nested(
        "emitter", AnnularLed, AnnularLed(), "The `annular_led` of each body.", without="part"
    )
    phototransistor: Phototransistor | None = nested(
        "sensor", Phototransistor, Phototransistor(), "The `phototransistor` of each body.", without="part"
    )
    wall: Wall = nested(
        "bsdf",
        Wall,
        ABSORBING,
        "BSDF of the package: a `region` with entries `body`, `led` and `phototransistor`, or any other BSDF, which "
        "then covers only the body.",
        default_words="absorbing",
    )

    def _check(self) -> None:
        if self.rows * self.columns > MOST_TAXELS:
            raise InputError(
                f"rows = {self.rows}, columns = {self.columns} are not allowed: at most {MOST_TAXELS} photo-reflectors "
                "are possible."
            )
        package = self.package
        scale = 1.0 if self.to_world is None else similarity_scale(np.array(self.to_world.matrix, dtype=float))
        if not all(SHORTEST <= scale * side <= LONGEST for side in package.body):
            raise InputError(
                f"body = {package.extent} is not allowed: with the scale of to_world, sides from {SHORTEST:g} to "
                f"{LONGEST:g} mm are needed."
            )
        self._check_layout(package)

    @property
    def package(self) -> Package:
        """The package of the catalogue's `part` if it is set, else of the given dimensions; raises `InputError`."""
        if self.part is not None:
            return _package_of(self.part, self.led_shift, self.phototransistor_shift)
        assert self.body is not None and self.spacing is not None and self.led and self.phototransistor
        led, sensor = self.led, self.phototransistor
        emitter = _bare(-0.5 * self.spacing, led.size, led.size)
        return Package(self.body, led, sensor, emitter, _bare(0.5 * self.spacing, sensor.width, sensor.depth))

    def _check_layout(self, package: Package) -> None:
        """Raise `InputError` if faces do not fit into the body side by side, or bodies overlap."""
        led, phototransistor = package.led, package.phototransistor
        length, width, _ = package.body
        closest = 0.5 * (led.size + phototransistor.width)
        furthest = length - max(led.size, phototransistor.width)
        slack = 1 + _ROUNDING
        if self.spacing is not None and closest > furthest * slack:
            sides = ("size", "LED", led.size), ("width", "phototransistor", phototransistor.width)
            name, face, side = max(sides, key=itemgetter(2))
            raise InputError(
                f"{name} = {side:g} of the {face} is not allowed: side by side, LED and phototransistor "
                f"need a body of x extent {closest + length - furthest:g}, and it has {length:g}."
            )
        if self.spacing is not None and not closest / slack <= self.spacing <= furthest * slack:
            raise InputError(
                f"spacing = {self.spacing:g} is not allowed: from {closest:g} (LED and phototransistor touch) "
                f"to {furthest:g} (the edge of the body) is needed."
            )
        widest = max(led.size, phototransistor.depth)
        if widest > width * slack:
            raise InputError(
                f"body = {package.extent} is not allowed: a y extent of at least {widest:g} mm is needed, that of the "
                f"larger of LED and phototransistor."
            )
        closest_pitch = max(length if self.columns > 1 else 0.0, width if self.rows > 1 else 0.0)
        if self.pitch < closest_pitch / slack:
            raise InputError(
                f"pitch = {self.pitch:g} is not allowed: at least {closest_pitch:g} is needed, or bodies overlap."
            )
