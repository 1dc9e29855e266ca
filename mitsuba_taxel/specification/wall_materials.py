"""Measured walls by name: reflectance near the wavelengths of photo-reflectors, with sources and spread.

There is no number without a published source. Materials without one are listed all the same, and refused where their
reflectance is needed: it depends on pigment and thickness, and has to be measured.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mitsuba_taxel.base.errors import InputError

SHOWN_AT = 925.0
"""Wavelength in nm of the values in the catalogue's table: that of the LED of the paper's photo-reflector."""


@dataclass(frozen=True)
class Measured:
    """Reflectance of one measured sample or product.

    Attributes
    ----------
    source : str
        Publication, with the method.
    rows : tuple[tuple[float, float], ...]
        Wavelengths in nm, increasing, and reflectances.
    spread : float
        Half of the range of reflectances that the source states.
    """

    source: str
    rows: tuple[tuple[float, float], ...]
    spread: float = 0.0


@dataclass(frozen=True)
class WallMaterial:
    """A material of walls with its measured reflectance.

    Attributes
    ----------
    name : str
        Name in a scene.
    title : str
        Description of the material.
    law : str
        Value of ``scattering`` of a `wall` that is nearest to the sample; empty if unknown.
    measured : tuple[Measured, ...]
        Measurements; empty if none is known.
    note : str
        Limits of the data, or the reason why there are none.
    """

    name: str
    title: str
    law: str = ""
    measured: tuple[Measured, ...] = ()
    note: str = ""

    parameter = "material"

    @property
    def covers(self) -> tuple[float, float] | None:
        """Range of wavelengths in nm in which all measurements have values; None without data."""
        if not self.measured:
            return None
        return max(m.rows[0][0] for m in self.measured), min(m.rows[-1][0] for m in self.measured)

    def at(self, nm: float) -> float:
        """Reflectance at a wavelength: the mean of the measurements, each interpolated linearly.

        Parameters
        ----------
        nm : float
            Wavelength in nm.

        Returns
        -------
        float
            Reflectance from 0 to 1.

        Raises
        ------
        InputError
            if there are no data at this wavelength.
        """
        return float(np.mean(self._values(nm)))

    def spread(self, nm: float) -> float:
        """Half of the range of reflectances at a wavelength in nm, over all sources and their stated ranges.

        Raises
        ------
        InputError
            if there are no data at this wavelength.
        """
        values = self._values(nm)
        spreads = np.array([m.spread for m in self.measured])
        return float((values + spreads).max() - (values - spreads).min()) / 2

    def _values(self, nm: float) -> np.ndarray:
        covers = self.covers
        if covers is None or not covers[0] <= nm <= covers[1]:
            known = (
                "its reflectance is unknown" if covers is None else f"its data cover {covers[0]:g} to {covers[1]:g} nm"
            )
            raise InputError(
                f"material = {self.name!r} has no data at {nm:g} nm: {known}; state reflectance or reflectance_table "
                "instead."
            )
        return np.array([np.interp(nm, *np.transpose(m.rows)) for m in self.measured])


def _polished(source: str, rows: Sequence[tuple[float, float, float]]) -> Measured:
    """Reflectance of a polished surface at normal incidence, from rows of wavelength in nm, refractive index and
    extinction coefficient."""
    reflectances = tuple((nm, ((n - 1) ** 2 + k**2) / ((n + 1) ** 2 + k**2)) for nm, n, k in rows)
    return Measured(f"{source}; reflectance at normal incidence by Fresnel's formula", reflectances)


_ALUMINIUM = (
    _polished(
        "optical constants of A. D. Rakic, Applied Optics 34, 4755 (1995), doi:10.1364/AO.34.004755, evaporated films",
        [(885.61, 2.2802, 8.1134), (911.66, 1.9739, 8.3058), (939.28, 1.6784, 8.5970), (968.63, 1.4867, 9.0655)],
    ),
    _polished(
        "optical constants of K. M. McPeak et al., ACS Photonics 2, 326 (2015), doi:10.1021/ph5004237, evaporated",
        [
            (880, 1.854996083, 7.243411521),
            (890, 1.750120449, 7.309782595),
            (900, 1.64715608, 7.393045594),
            (910, 1.557188172, 7.48978204),
            (920, 1.483545494, 7.592621895),
            (930, 1.415213787, 7.70342976),
            (940, 1.355589911, 7.812465936),
            (950, 1.302164463, 7.928721983),
            (960, 1.25976713, 8.04593147),
        ],
    ),
    _polished(
        "optical constants of F. Cheng et al., ACS Nano 10, 9852 (2016), doi:10.1021/acsnano.6b05556, a grown film",
        [
            (885.60, 1.48243, 6.81583),
            (904.99, 1.33076, 6.94190),
            (925.26, 1.21266, 7.10504),
            (939.27, 1.15085, 7.22077),
            (953.72, 1.09684, 7.33792),
            (961.12, 1.07150, 7.39616),
        ],
    ),
)
_MEASURE = "reflectance depends on pigment and thickness"

WALL_MATERIALS: dict[str, WallMaterial] = {
    material.name: material
    for material in (
        WallMaterial(
            "aluminium",
            "a clean film of aluminium",
            "mirror",
            _ALUMINIUM,
            "rolled, anodised or aged plates reflect less, and scatter",
        ),
        WallMaterial(
            "sintered_ptfe",
            "white sintered PTFE of at least 99 % in the visible",
            "lambertian",
            (
                Measured(
                    "Labsphere, Spectralon Diffuse Reflectance Targets, data sheet PB-13025-000 Rev. 00 (2015), "
                    "table 1, 8 degrees/hemispherical: 0.975 to 0.995 from 750 to 1600 nm",
                    ((750.0, 0.985), (1600.0, 0.985)),
                    0.01,
                ),
            ),
            "for thick, clean samples",
        ),
        WallMaterial("white_silicone", "silicone with white pigment", note=_MEASURE),
        WallMaterial("black_silicone", "silicone with black pigment", note=_MEASURE),
        WallMaterial("white_plastic", "moulded white plastic", note=_MEASURE),
        WallMaterial(
            "white_paint",
            "white acrylic paint on a print",
            note="G. Gibertoni and L. Rovati, Acta IMEKO 15 (2026), doi:10.21014/actaimeko.v15i2.2253, state 0.70 to "
            "0.86 for commercial acrylic coatings over 300 to 1000 nm, but no value at a wavelength",
        ),
        WallMaterial("black_print", "black plastic of a printer", note=_MEASURE),
    )
}
"""Materials of walls by name."""


def wall_table() -> list[tuple[str, ...]]:
    """The catalogue of measured walls as rows of text.

    Returns
    -------
    list[tuple[str, ...]]
        For each material: name, description, reflectance at `SHOWN_AT` with its spread, wavelengths with data, nearest
        law, and sources with limits.
    """
    rows: list[tuple[str, ...]] = []
    for material in WALL_MATERIALS.values():
        value, covers = "unknown", "none"
        if material.covers is not None:
            value = f"{material.at(SHOWN_AT):.3f} ± {material.spread(SHOWN_AT):.3f}"
            covers = "{:g} to {:g} nm".format(*material.covers)
        sources = ". ".join(
            text[0].upper() + text[1:] for text in (*(m.source for m in material.measured), material.note)
        )
        rows.append((material.name, material.title, value, covers, material.law or "unknown", f"{sources}."))
    return rows
