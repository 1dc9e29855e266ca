"""Parameters of the LED."""

from __future__ import annotations

from dataclasses import dataclass

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.parameters import REQUIRED, choice, number, text
from mitsuba_taxel.specification.specification import Specification

SHAPES = ("square", "circular")
LAWS = {
    "uniform_solid_angle": "a cone, uniform per solid angle",
    "uniform_polar_angle": "a cone, uniform in the polar angle",
    "lambertian": "",
    "cosine_power": "",
    "tabulated": "",
}
LARGEST_EXPONENT = 1e6
"""Largest exponent: a larger exponent gives a lobe below 0.1 degrees, which single precision does not resolve well."""


@dataclass(frozen=True)
class AnnularLed(Specification):
    """LED with an emitting annulus around a dark centre: its size, power, wavelength and emission law."""

    plugin = "annular_led"

    power: float = number(1.0, "W", "Power of each LED.", minimum=0)
    wavelength: float = number(
        925.0,
        "nm",
        "Wavelength of the light, which determines the `responsivity` of a phototransistor.",
        above=0,
        common=(200, 20_000),
    )
    shape: str = choice("square", SHAPES, "Outline of the emitting area and of its hole.")
    size: float = number(
        0.25, "mm", "Side of the emitting square or diameter of the disc.", above=0, common=(0.002, 50)
    )
    hole: float = number(
        0.1, "mm", "Side or diameter of the dark area at its centre, below `size`; 0 for none.", minimum=0
    )
    law: str = choice("uniform_solid_angle", LAWS, "Directional law.")
    cone_angle: float | None = number(
        88.0,
        "degrees",
        "Half-angle of the cone against the normal.",
        minimum=0.05,
        maximum=90,
        when=("law", "uniform_solid_angle", "uniform_polar_angle"),
    )
    exponent: float | None = number(
        1.0,
        "",
        "Exponent m of the intensity cos(theta)**m: 0 is uniform over the hemisphere, 1 is Lambertian.",
        minimum=0,
        maximum=LARGEST_EXPONENT,
        when=("law", "cosine_power"),
    )
    file: str | None = text(
        REQUIRED,
        "CSV file with two columns: polar angle in degrees, from 0 to at most 90 and increasing, and relative radiant "
        "intensity. It is linear between rows, zero beyond the last, and rotationally symmetric. Empty lines and "
        "text after a # are ignored.",
        "the name of a CSV file with columns angle in degrees, value",
        when=("law", "tabulated"),
    )

    def _check(self) -> None:
        if self.hole >= self.size:
            raise InputError(f"hole = {self.hole:g} is not allowed: a number below size = {self.size:g} is needed.")
