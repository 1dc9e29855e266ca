"""The walls of a loaded scene, as Python objects."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import mitsuba as mi

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.kernels.protocols import LedEmitter, WallBsdf, is_led, is_region, is_wall


def walls_of(scene: mi.Scene) -> Iterator[mi.BSDF]:
    """All BSDFs of all shapes, including those nested in a `region`.

    Parameters
    ----------
    scene : mi.Scene
        A loaded scene.

    Yields
    ------
    mi.BSDF
        A BSDF for each use; a BSDF that is used several times is repeated.
    """
    for shape in scene.shapes():
        bsdf = shape.bsdf()
        yield from walls_by_region(bsdf).values()


def walls_by_region(bsdf: mi.BSDF) -> Mapping[str, mi.BSDF]:
    """BSDFs of a `region` by the name of the region. Any other BSDF is returned under an empty name.

    Parameters
    ----------
    bsdf : mi.BSDF
        BSDF of a shape.

    Returns
    -------
    Mapping[str, mi.BSDF]
        BSDFs by name of the region.
    """
    return bsdf.walls if is_region(bsdf) else {"": bsdf}


def wall_at(bsdf: mi.BSDF, region: str) -> mi.BSDF | None:
    """The BSDF of a region of a shape.

    Parameters
    ----------
    bsdf : mi.BSDF
        BSDF of the shape; unless it is a `region`, it covers all regions.
    region : str
        Name of a region.

    Returns
    -------
    mi.BSDF or None
        The BSDF; None if a `region` has no BSDF for that region.
    """
    return bsdf.walls.get(region) if is_region(bsdf) else bsdf


def scatters_evenly(bsdf: mi.BSDF) -> bool:
    """Whether any wall scatters light isotropically, entirely or as a component.

    Parameters
    ----------
    bsdf : mi.BSDF
        A `region` or the wall of all regions.

    Returns
    -------
    bool
        True if there is such a wall.
    """
    walls = (wall for wall in walls_by_region(bsdf).values() if is_wall(wall))
    return any(wall.scattering == "isotropic" or bool(wall.specification.isotropic) for wall in walls)


def set_wavelength(scene: mi.Scene, leds: Sequence[LedEmitter]) -> None:
    """Set the wavelength of walls with a reflectance table to that of the first LED.

    Parameters
    ----------
    scene : mi.Scene
        Scene with the walls.
    leds : sequence of LedEmitter
        LEDs, at least one.

    Raises
    ------
    InputError
        if a table does not cover that wavelength.
    """
    for wall in _walls_with_table(scene):
        wall.set_wavelength(leds[0].wavelength)


def refuse_unknown_wavelength(scene: mi.Scene, one_by_one: bool) -> None:
    """Raise `InputError` if the reflectance of a wall with a table is unknown at the wavelength of the light.

    Parameters
    ----------
    scene : mi.Scene
        A loaded scene.
    one_by_one : bool
        Whether LEDs are traced individually, so that their wavelengths may differ.

    Raises
    ------
    InputError
        if LEDs of several wavelengths illuminate such a wall together, an emitter has no wavelength, or a table does
        not cover a wavelength.
    """
    tables = [wall.table for wall in _walls_with_table(scene) if wall.table]
    if not tables:
        return
    if not all(is_led(emitter) for emitter in scene.emitters()):
        raise InputError(
            f"wall: {tables[0].parameter} needs the wavelength of the light: every emitter must be an annular_led."
        )
    wavelengths = sorted({led.wavelength for led in scene.emitters()})
    if len(wavelengths) > 1 and not one_by_one:
        raise InputError(
            f"wall: LEDs of {', '.join(f'{nm:g}' for nm in wavelengths)} nm illuminate a wall with "
            f"{tables[0].parameter} together: use taxel_tracer, taxel_path or analog_tracer, which trace them "
            "individually."
        )
    for table in tables:
        for nm in wavelengths:
            table.at(nm)


def _walls_with_table(scene: mi.Scene) -> Iterator[WallBsdf]:
    """Walls of a scene whose reflectance is given by a table over the wavelength."""
    return (wall for wall in walls_of(scene) if is_wall(wall) and wall.needs_wavelength)


def scatters(bsdf: mi.BSDF | None, law: str) -> bool:
    """Whether a BSDF is a `wall` with a scattering law.

    Parameters
    ----------
    bsdf : mi.BSDF or None
        BSDF of a shape or a region.
    law : str
        Name of the law, such as ``lambertian``.

    Returns
    -------
    bool
        Whether it is such a wall; False for None.
    """
    return is_wall(bsdf) and bsdf.scattering == law


def reflectance_of(bsdf: mi.BSDF | None) -> float | None:
    """Reflectance of a `wall`.

    Parameters
    ----------
    bsdf : mi.BSDF or None
        BSDF of a shape or a region.

    Returns
    -------
    float or None
        Reflectance from 0 to 1; None for other BSDFs, and until the wavelength for a table is set.
    """
    return float(bsdf.reflectance[0]) if is_wall(bsdf) and bsdf.reflectance is not None else None


def absorbs(bsdf: mi.BSDF | None) -> bool:
    """Whether a BSDF is a `wall` that reflects no light.

    Parameters
    ----------
    bsdf : mi.BSDF or None
        BSDF of a shape or a region; None for a region without a BSDF.

    Returns
    -------
    bool
        Whether it absorbs all light; True for None.
    """
    return bsdf is None or reflectance_of(bsdf) == 0


def has_mirrors(scene: mi.Scene) -> bool:
    """Whether any `wall` of a scene has a specular or glossy component.

    Parameters
    ----------
    scene : mi.Scene
        A loaded scene.

    Returns
    -------
    bool
        True if there is such a wall.
    """
    return any(is_wall(wall) and wall.is_directed for wall in walls_of(scene))


def is_bounded_from_detector(wall: mi.BSDF) -> bool:
    """Whether weights of paths from the detector are bounded at a wall.

    An isotropic wall is not reciprocal: from the detector its weight is 1 / (2 cos(theta)), see `wall`.

    Parameters
    ----------
    wall : mi.BSDF
        A wall of any law.

    Returns
    -------
    bool
        Whether weights are bounded; False for isotropic walls and walls with an isotropic component.
    """
    return not (scatters(wall, "isotropic") or (scatters(wall, "mixed") and float(wall.law.fractions[2][0]) > 0))
