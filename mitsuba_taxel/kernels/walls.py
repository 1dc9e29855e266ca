"""The walls of a loaded scene, as Python objects."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.kernels.protocols import is_led, is_region


def walls_of(scene: Any) -> Iterator[Any]:
    """Each BSDF of each shape; those nested in a `region` individually."""
    for shape in scene.shapes():
        bsdf = shape.bsdf()
        yield from walls_by_region(bsdf).values()


def walls_by_region(bsdf: Any) -> Mapping[str, Any]:
    """BSDFs of a `region` by name; any other BSDF under an empty name."""
    return bsdf.walls if is_region(bsdf) else {"": bsdf}


def wall_at(bsdf: Any, region: str) -> Any:
    """The BSDF of a region of a shape; None if a `region` has none for it."""
    return bsdf.walls.get(region) if is_region(bsdf) else bsdf


def set_wavelength(scene: Any, leds: list[Any]) -> None:
    """Set the wavelength of walls with a reflectance table, if all LEDs have the same."""
    for wall in _walls_with_table(scene):
        wall.set_wavelength(leds[0].wavelength)


def refuse_unknown_wavelength(scene: Any, one_by_one: bool) -> None:
    """Raise if the reflectance of a wall with a table is not defined.

    Parameters
    ----------
    one_by_one : bool
        Whether LEDs are traced individually, and so may have different wavelengths.

    Raises
    ------
    InputError
        if LEDs of several wavelengths light such a wall at once, an emitter has none, or a table does not cover it.
    """
    walls = list(_walls_with_table(scene))
    if not walls:
        return
    if not all(is_led(emitter) for emitter in scene.emitters()):
        raise InputError("wall: a reflectance_table needs the wavelength of an annular_led, and other emitters shine.")
    wavelengths = sorted({led.wavelength for led in scene.emitters()})
    if len(wavelengths) > 1 and not one_by_one:
        raise InputError(
            f"wall: LEDs of {', '.join(f'{nm:g}' for nm in wavelengths)} nm shine at once on a wall with a "
            "reflectance_table: only taxel_tracer, taxel_path and analog_tracer take them one by one."
        )
    for wall in walls:
        for nm in wavelengths:
            wall.table.at(nm)


def _walls_with_table(scene: Any) -> Iterator[Any]:
    return (wall for wall in walls_of(scene) if getattr(wall, "needs_wavelength", False))


def is_bounded_from_detector(wall: Any) -> bool:
    """Whether weights of paths from the detector stay bounded at this wall.

    An isotropic wall is not reciprocal: from the detector its weight is 1 / (2 cos(theta)), see `wall`.
    """
    scattering = getattr(wall, "scattering", "")
    return scattering != "isotropic" and not (scattering == "mixed" and float(wall.law.shares[2][0]) > 0)
