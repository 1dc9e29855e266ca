"""Power that a photo-reflector receives from a white card above it, by quadrature over the emitter's rays.

Rays leave the emitter as in `mitsuba_taxel.parts.mirror`. Each ray irradiates a point of the card, which scatters by
Lambert's law. From a point of radiance L, the detector's die receives through its window T(t) L times the projected
solid angle of its area in air, which is 1 / (2 R) d(sin^2 t)/dR per area at a lateral distance R. Light that returns to
the package is absorbed.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.parts.mirror import mirror_curve
from mitsuba_taxel.parts.part import Part
from mitsuba_taxel.parts.refraction import (
    POINTS,
    die_points,
    emitted_rays,
    passes_window,
    refracted,
    relative_radiance,
    sobol_points,
    transmittance,
)


def card_curve(part: Part, heights: Any, points: int = POINTS) -> np.ndarray:
    """Power on the detector under a card that scatters by Lambert's law.

    Parameters
    ----------
    part : Part
        Emitter and detector.
    heights : float or (N,) array_like
        Height of the card above the windows in mm. The card is parallel to the windows and larger than its illuminated
        area.
    points : int
        Number of rays, a power of 2.

    Returns
    -------
    (N,) ndarray
        Power in W per W that the emitter's die sends into the resin, for a reflectance of 1; accurate to about 1 %.

    Raises
    ------
    InputError
        if a height is not above 0.
    """
    # Rays from points of the emitter's die, with their power in air where they leave its window.
    emitter, detector, index = part.emitter, part.detector, part.resin_index
    uniform = sobol_points(6, points)
    start, heading, sine = emitted_rays(emitter, uniform[:, :4])
    end = die_points(detector, uniform[:, 4:])
    emitter_tangent, cosine = sine / np.sqrt(index**2 - sine**2), np.sqrt(1 - sine**2)
    exit_point = start + emitter.die_depth * emitter_tangent[:, None] * heading
    emitted = (
        transmittance(index, cosine)
        * relative_radiance(emitter, cosine)
        * passes_window(emitter, exit_point)
        / index**2
    )

    # For each height: rays from the illuminated points of the card to points of the detector's die.
    powers = []
    for height in np.atleast_1d(heights).tolist():
        if not height > 0:
            raise InputError(f"height = {height!r} is not allowed: a number of mm above 0 is needed.")
        offset = end - exit_point - height * (sine / cosine)[:, None] * heading
        distance = np.linalg.norm(offset, axis=1)
        angle, geometry = refracted(index, height, detector.die_depth, distance)
        tangent = np.sin(angle) / np.sqrt(index**2 - np.sin(angle) ** 2)
        entry_point = end - detector.die_depth * tangent[:, None] * offset / distance[:, None]
        received = transmittance(index, np.cos(angle)) * detector.relative_to_lambert(np.cos(angle))
        received *= geometry * passes_window(detector, entry_point) * detector.die_width * detector.die_length / np.pi
        powers.append(float((emitted * received).mean()))
    return np.array(powers)


def distance_model(part: Part, heights: Any, points: int = POINTS) -> np.ndarray:
    """Power on the detector under the reflector of the datasheet's distance curve, with a reflectance of 1.

    Parameters
    ----------
    part : Part
        Emitter and detector.
    heights : float or (N,) array_like
        Height of the reflector above the windows, mm.
    points : int
        Number of rays, a power of 2.

    Returns
    -------
    (N,) ndarray
        Power in W per W that the emitter's die sends into the resin: the result of `mirror_curve` or of `card_curve`.

    Raises
    ------
    InputError
        if a height is not above 0.
    """
    return (card_curve if part.distance_reflector == "white card" else mirror_curve)(
        part, heights, points
    )
