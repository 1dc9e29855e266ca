"""The walls of a loaded scene, as Python objects."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import mitsuba as mi

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.kernels.protocols import LedEmitter, WallBsdf, is_led, is_region, is_wall


def walls_of(scene: mi.Scene) -> Iterator[mi.BSDF]:
    """Each BSDF of each shape; those nested in a `region` individually.

    Parameters
    ----------
    scene : mi.Scene
        A loaded one.

    Yields
    ------
    mi.BSDF
        As often as it is used.
    """
    for shape in scene.shapes():
        bsdf = shape.bsdf()
        yield from walls_by_region(bsdf).values()


def walls_by_region(bsdf: mi.BSDF) -> Mapping[str, mi.BSDF]:
    """BSDFs of a `region` by name; any other BSDF under an empty name.

    Parameters
    ----------
    bsdf : mi.BSDF
        Of a shape.

    Returns
    -------
    Mapping[str, mi.BSDF]
        At least one if it is no `region`.
    """
    return bsdf.walls if is_region(bsdf) else {"": bsdf}


def wall_at(bsdf: mi.BSDF, region: str) -> mi.BSDF | None:
    """The BSDF of a region of a shape; None if a `region` has none for it.

    Parameters
    ----------
    bsdf : mi.BSDF
        Of a shape.
    region : str
        One of `REGIONS`.

    Returns
    -------
    mi.BSDF or None
        Any BSDF that is no `region` is that of all regions.
    """
    return bsdf.walls.get(region) if is_region(bsdf) else bsdf


def scatters_evenly(bsdf: mi.BSDF) -> bool:
    """Whether a part of its walls scatters light isotropically.

    Parameters
    ----------
    bsdf : mi.BSDF
        A `region` or the wall of all regions.

    Returns
    -------
    bool
        Whether one of its walls does, at least in part.
    """
    walls = (wall for wall in walls_by_region(bsdf).values() if is_wall(wall))
    return any(wall.scattering == "isotropic" or bool(wall.specification.isotropic) for wall in walls)


def set_wavelength(scene: mi.Scene, leds: Sequence[LedEmitter]) -> None:
    """Set the wavelength of walls with a reflectance table to that of the first LED.

    Parameters
    ----------
    scene : mi.Scene
        With the walls.
    leds : sequence of LedEmitter
        At least one.

    Raises
    ------
    InputError
        if a table does not cover it.
    """
    for wall in _walls_with_table(scene):
        wall.set_wavelength(leds[0].wavelength)


def refuse_unknown_wavelength(scene: mi.Scene, one_by_one: bool) -> None:
    """Raise if the reflectance of a wall with a table is not defined.

    Parameters
    ----------
    scene : mi.Scene
        A loaded one.
    one_by_one : bool
        Whether LEDs are traced individually, and so may have different wavelengths.

    Raises
    ------
    InputError
        if LEDs of several wavelengths light such a wall at once, an emitter has none, or a table does not cover it.
    """
    tables = [wall.table for wall in _walls_with_table(scene) if wall.table]
    if not tables:
        return
    if not all(is_led(emitter) for emitter in scene.emitters()):
        raise InputError("wall: a reflectance_table needs the wavelength of an annular_led, and other emitters shine.")
    wavelengths = sorted({led.wavelength for led in scene.emitters()})
    if len(wavelengths) > 1 and not one_by_one:
        raise InputError(
            f"wall: LEDs of {', '.join(f'{nm:g}' for nm in wavelengths)} nm shine at once on a wall with a "
            "reflectance_table: only taxel_tracer, taxel_path and analog_tracer take them one by one."
        )
    for table in tables:
        for nm in wavelengths:
            table.at(nm)


def _walls_with_table(scene: mi.Scene) -> Iterator[WallBsdf]:
    return (wall for wall in walls_of(scene) if is_wall(wall) and wall.needs_wavelength)


def scatters(bsdf: mi.BSDF | None, law: str) -> bool:
    """Whether it is a `wall` with this ``scattering``.

    Parameters
    ----------
    bsdf : mi.BSDF or None
        Of a shape or a region.
    law : str
        Such as ``lambertian``.

    Returns
    -------
    bool
        False for None.
    """
    return is_wall(bsdf) and bsdf.scattering == law


def reflectance_of(bsdf: mi.BSDF | None) -> float | None:
    """Reflectance of a `wall`; None for other BSDFs, and before the wavelength for its table is known.

    Parameters
    ----------
    bsdf : mi.BSDF or None
        Of a shape or a region.

    Returns
    -------
    float or None
        From 0 to 1.
    """
    return float(bsdf.reflectance[0]) if is_wall(bsdf) and bsdf.reflectance is not None else None


def absorbs(bsdf: mi.BSDF | None) -> bool:
    """Whether it is a `wall` that reflects nothing; None stands for a region without a BSDF.

    Parameters
    ----------
    bsdf : mi.BSDF or None
        Of a shape or a region.

    Returns
    -------
    bool
        True for None.
    """
    return bsdf is None or reflectance_of(bsdf) == 0


def has_mirrors(scene: mi.Scene) -> bool:
    """Whether a `wall` of a scene reflects as a mirror does, at least in part.

    Parameters
    ----------
    scene : mi.Scene
        A loaded one.

    Returns
    -------
    bool
        Whether one does.
    """
    return any(is_wall(wall) and wall.is_directed for wall in walls_of(scene))


def is_bounded_from_detector(wall: mi.BSDF) -> bool:
    """Whether weights of paths from the detector stay bounded at this wall.

    An isotropic wall is not reciprocal: from the detector its weight is 1 / (2 cos(theta)), see `wall`.

    Parameters
    ----------
    wall : mi.BSDF
        Of any law.

    Returns
    -------
    bool
        True but for isotropic walls.
    """
    return not (scatters(wall, "isotropic") or (scatters(wall, "mixed") and float(wall.law.shares[2][0]) > 0))
