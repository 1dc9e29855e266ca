"""Power that a photo-reflector receives from a white card above it, by quadrature over the emitter's rays.

Rays leave the emitter as in `mitsuba_taxel.parts.mirror`. Each irradiates a point of the card, which scatters by
Lambert's law; from a point of radiance L a detector's die receives T(t) L times the projected solid angle in air of its
area, 1 / (2 R) d(sin^2 t)/dR by area at a lateral distance R, through its window. Light that returns to the package is
absorbed.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.parts.mirror import mirror_curve
from mitsuba_taxel.parts.part import Part
from mitsuba_taxel.parts.refraction import (
    die_points,
    emitted_rays,
    passes_window,
    refracted,
    relative_radiance,
    sobol_points,
    transmittance,
)


def card_curve(part: Part, heights: Any) -> np.ndarray:
    """Power on the detector under a card that scatters by Lambert's law.

    Parameters
    ----------
    part : Part
        Emitter and detector.
    heights : float or (N,) array_like
        Of the card above the windows in mm, parallel to them; it is larger than the light that it meets.

    Returns
    -------
    (N,) ndarray
        In W per W that the emitter's die sends into the resin, for a reflectance of 1, to about 1 %.

    Raises
    ------
    InputError
        if a height is not above 0.
    """
    emitter, detector, index = part.emitter, part.detector, part.resin_index
    uniform = sobol_points(6)
    start, heading, sine = emitted_rays(emitter, uniform[:, :4])
    end = die_points(detector, uniform[:, 4:])
    beneath, cosine = sine / np.sqrt(index**2 - sine**2), np.sqrt(1 - sine**2)
    out = start + emitter.die_depth * beneath[:, None] * heading
    emitted = transmittance(index, cosine) * relative_radiance(emitter, cosine) * passes_window(emitter, out) / index**2
    powers = []
    for height in np.atleast_1d(heights).tolist():
        if not height > 0:
            raise InputError(f"height = {height!r} is not allowed: a number of mm above 0 is needed.")
        apart = end - out - height * (sine / cosine)[:, None] * heading  # from the point on the card
        distance = np.linalg.norm(apart, axis=1)
        angle, geometry = refracted(index, height, detector.die_depth, distance)
        within = np.sin(angle) / np.sqrt(index**2 - np.sin(angle) ** 2)
        back = end - detector.die_depth * within[:, None] * apart / distance[:, None]
        received = transmittance(index, np.cos(angle)) * detector.relative_to_lambert(np.cos(angle))
        received *= geometry * passes_window(detector, back) * detector.die_width * detector.die_length / np.pi
        powers.append(float((emitted * received).mean()))
    return np.array(powers)


def distance_model(part: Part, heights: Any) -> np.ndarray:
    """Power on the detector under the reflector of the part's distance curve, of reflectance 1.

    Parameters
    ----------
    part : Part
        Emitter and detector.
    heights : float or (N,) array_like
        Of the reflector above the windows, mm.

    Returns
    -------
    (N,) ndarray
        As `mirror_curve` or `card_curve` gives it.

    Raises
    ------
    InputError
        if a height is not above 0.
    """
    return (card_curve if part.distance_reflector == "white card" else mirror_curve)(part, heights)
