"""Parameters of photo-reflectors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.parameters import nested, number, transform, vector, whole
from mitsuba_taxel.parameters.similarity import similarity_scale
from mitsuba_taxel.specification.annular_led import AnnularLed
from mitsuba_taxel.specification.phototransistor import Phototransistor
from mitsuba_taxel.specification.specification import Specification
from mitsuba_taxel.specification.wall import ABSORBING, Wall

MOST_TAXELS = 100_000
SHORTEST, LONGEST = 1e-8, 1e8
"""Sides of a package in mm: beyond, areas or products of them leave single precision."""
_ROUNDING = 1e-6
"""Relative error of lengths that Mitsuba keeps in single precision, as it does the components of vectors."""


@dataclass(frozen=True)
class PhotoReflector(Specification):
    """An array of photo-reflectors; the defaults are those of the NJL5908AR."""

    plugin = "photo_reflector"

    rows: int = whole(1, 1, 1000, "Rows of the array, from +y to -y.")
    columns: int = whole(1, 1, 1000, "Columns of the array, along +x.")
    pitch: float = number(3.55, "mm", "Distance between neighbours.", above=0, common=(0.1, 200))
    body: tuple[float, float, float] = vector(
        (1.46, 1.06, 0.5), "mm", "Extent of the package along x, y and z.", above=0, common=(0.05, 100)
    )
    spacing: float = number(
        0.9,
        "mm",
        "Distance between the centres of LED (at -spacing/2) and phototransistor (at +spacing/2) along x.",
        minimum=0,
        common=(0.02, 100),
    )
    to_world: Any = transform(
        "Rigid motion, with at most a uniform scale. The body stands on z = 0, its centre on x = y = 0."
    )
    led: AnnularLed = nested("emitter", AnnularLed, AnnularLed(), "One `annular_led`, repeated in each body.")
    phototransistor: Phototransistor = nested(
        "sensor", Phototransistor, Phototransistor(), "One `phototransistor`, repeated in each body."
    )
    wall: Wall = nested(
        "bsdf",
        Wall,
        ABSORBING,
        "What the package is made of: a `region` that says so for `body`, `led` and `phototransistor`, or any other "
        "BSDF, which then covers the body alone.",
        default_words="absorbing",
    )

    def _check(self) -> None:
        if self.rows * self.columns > MOST_TAXELS:
            raise InputError(
                f"rows = {self.rows}, columns = {self.columns} are not allowed: at most {MOST_TAXELS} photo-reflectors "
                "are possible."
            )
        scale = 1.0 if self.to_world is None else similarity_scale(np.array(self.to_world.matrix, dtype=float))
        if not all(SHORTEST <= scale * side <= LONGEST for side in self.body):
            raise InputError(
                f"body = {self._extent} is not allowed: with the scale of to_world, sides from {SHORTEST:g} to "
                f"{LONGEST:g} mm are needed."
            )
        self._check_layout()

    @property
    def _extent(self) -> str:
        return ", ".join(f"{side:g}" for side in self.body)

    def _check_layout(self) -> None:
        length, width, _ = self.body
        closest = 0.5 * (self.led.size + self.phototransistor.width)
        furthest = length - max(self.led.size, self.phototransistor.width)
        slack = 1 + _ROUNDING
        if not closest / slack <= self.spacing <= furthest * slack:
            raise InputError(
                f"spacing = {self.spacing:g} is not allowed: from {closest:g} (LED and phototransistor touch) "
                f"to {furthest:g} (the edge of the body) is needed."
            )
        widest = max(self.led.size, self.phototransistor.depth)
        if widest > width * slack:
            raise InputError(f"body = {self._extent} is not allowed: its y extent must hold {widest:g}.")
        closest_pitch = max(length if self.columns > 1 else 0.0, width if self.rows > 1 else 0.0)
        if self.pitch < closest_pitch / slack:
            raise InputError(
                f"pitch = {self.pitch:g} is not allowed: at least {closest_pitch:g} is needed, or bodies overlap."
            )
