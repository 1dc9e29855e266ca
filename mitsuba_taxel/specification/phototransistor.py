"""Parameters of the phototransistor."""

from __future__ import annotations

from dataclasses import dataclass

from mitsuba_taxel.parameters import REQUIRED, Nested, choice, number, text
from mitsuba_taxel.specification.specification import Specification

RESPONSES = {
    "ideal": "cos(theta), the area that faces the beam",
    "cosine_power": "cos(theta)**exponent",
    "tabulated": "",
}


@dataclass(frozen=True)
class Phototransistor(Specification):
    """Phototransistor: its light-sensitive area and its angular response."""

    plugin = "phototransistor"
    nested = (
        Nested(
            kind="film",
            doc="Irradiance map of a phototransistor; it must have a box filter.",
            default_words="one pixel",
        ),
        Nested(
            kind="sampler",
            doc="Source of random numbers; the integrators of this package need the default.",
            default_words="owen_sobol",
        ),
    )

    width: float = number(0.52, "mm", "Extent of the light-sensitive area along x.", above=0, common=(0.002, 100))
    depth: float = number(0.3, "mm", "Extent of the light-sensitive area along y.", above=0, common=(0.002, 100))
    response: str = choice(
        "ideal", RESPONSES, "Dependence of the reading on the angle theta of a parallel beam to the normal."
    )
    exponent: float | None = number(
        1.0, "", "Exponent of the cosine; 1 is ideal.", minimum=1, maximum=1e4, when=("response", "cosine_power")
    )
    file: str | None = text(
        REQUIRED,
        "CSV file with two columns: angle in degrees, from 0 to at most 90 and increasing, and relative response to a "
        "parallel beam, as data sheets show it (it includes the cosine). It is linear between rows, zero beyond the "
        "last, and normalised to 1 at 0 degrees. Empty lines and text after a # are ignored.",
        "the name of a CSV file with columns angle in degrees, value",
        when=("response", "tabulated"),
    )
    quantum_efficiency: float = number(
        1.0, "", "Electrons per photon on the axis, for the `responsivity`.", above=0, maximum=1
    )
