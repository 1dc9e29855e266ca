"""The walls of a loaded scene, as Python objects."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from mitsuba_taxel.errors import InputError


def walls_of(scene: Any) -> Iterator[Any]:
    """Each BSDF of each shape, those nested in a `region` one by one."""
    for shape in scene.shapes():
        bsdf = shape.bsdf()
        yield from getattr(bsdf, "walls", {"": bsdf}).values()


def set_wavelength(scene: Any, leds: list[Any]) -> None:
    """Tell the walls with a table of reflectance the wavelength of the LEDs.

    Raises
    ------
    InputError
        if LEDs of several wavelengths light such a wall at once, or a table does not reach their wavelength.
    """
    for wall in walls_of(scene):
        if getattr(wall, "needs_wavelength", False):
            wavelengths = sorted({led.wavelength for led in leds})
            if len(wavelengths) > 1:
                raise InputError(
                    f"wall: LEDs of {', '.join(f'{nm:g}' for nm in wavelengths)} nm shine at once on a wall with a "
                    "reflectance_table: only taxel_tracer, taxel_path and analog_tracer take them one by one."
                )
            wall.set_wavelength(wavelengths[0])


def is_bounded_from_detector(wall: Any) -> bool:
    """Whether the weight of a path that comes from the detector stays bounded at this wall.

    An isotropic wall is not reciprocal: from the detector it carries 1 / (2 cos(theta)), see `wall`.
    """
    scattering = getattr(wall, "scattering", "")
    return scattering != "isotropic" and not (scattering == "mixed" and float(wall.law.shares[2][0]) > 0)
