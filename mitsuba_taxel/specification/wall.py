"""Parameters of walls."""

from __future__ import annotations

from dataclasses import dataclass

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.parameters import REQUIRED, choice, number, text
from mitsuba_taxel.specification.specification import Specification
from mitsuba_taxel.specification.wall_materials import WALL_MATERIALS

SCATTERING = {
    "mirror": "",
    "lambertian": "cosine law",
    "isotropic": "equal probability per solid angle",
    "absorbing": "",
    "mixed": "",
    "rough_mirror": "",
}
_REFLECTING = ("scattering", *(word for word in SCATTERING if word != "absorbing"))
SMALLEST_SLOPE = 0.01
"""Least rms slope in degrees: Mitsuba increases slopes below 0.004 (its alpha is at least 1e-4), and rounding errors of
slopes are about 1e-7 / cos(theta)."""


def _fraction_of(what: str) -> float:
    doc = f"Fraction of the reflected light that follows {what}; the three fractions sum to 1."
    return number(0.0, "", doc, minimum=0, maximum=1, when=("scattering", "mixed"))


@dataclass(frozen=True)
class Wall(Specification):
    """Reflecting or absorbing wall of a cell, a plate or a package: reflectance and scattering law."""

    plugin = "wall"

    scattering: str = choice("lambertian", SCATTERING, "Law of reflection.")
    reflectance: float | None = number(
        1.0,
        "",
        "Fraction of the light that is reflected.",
        minimum=0,
        maximum=1,
        when=_REFLECTING,
        without="reflectance_table or material",
    )
    reflectance_table: str | None = text(
        None,
        "CSV file of wavelength in nm, increasing, and reflectance, 0 to 1; `reflectance` is left out.",
        "the name of a CSV file",
        when=_REFLECTING,
        without="material",
    )
    specular: float | None = _fraction_of("the law of mirrors")
    lambertian: float | None = _fraction_of("the cosine law")
    isotropic: float | None = _fraction_of("the isotropic law")
    rms_slope: float | None = number(
        REQUIRED,
        "degrees",
        "Angle whose tangent is the root mean square slope along one axis of the wall (not of both axes combined).",
        minimum=SMALLEST_SLOPE,
        maximum=45,
        hint="; use scattering = 'mirror' for less",
        when=("scattering", "rough_mirror"),
    )
    material: str | None = choice(
        None,
        {name: material.title for name, material in WALL_MATERIALS.items()},
        "Measured material, whose reflectance at the wavelength of the LEDs is used. It says nothing on `scattering`.",
        when=_REFLECTING,
        without="reflectance or reflectance_table",
    )

    def _check(self) -> None:
        if self.specular is None or self.lambertian is None or self.isotropic is None:
            return
        total = self.specular + self.lambertian + self.isotropic
        if abs(total - 1) > 1e-6:
            raise InputError(
                f"specular = {self.specular:g}, lambertian = {self.lambertian:g}, isotropic = {self.isotropic:g} are "
                f"not allowed: their sum is {total:.8g} and must be 1, as they divide the reflected light."
            )


ABSORBING = Wall("absorbing")
ISOTROPIC = Wall("isotropic")
