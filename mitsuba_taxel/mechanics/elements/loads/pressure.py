"""Load by the pressure of a fluid."""

from __future__ import annotations

from dataclasses import dataclass

from mitsuba_taxel.mechanics.elements.loads.load import Load


@dataclass(frozen=True)
class Pressure(Load, name="pressure", rank=4):
    """A hydrostatic pressure on top and outside, normal to the deformed surface. The cells are vented."""

    meaning = "of a fluid on top and outside"
    quantity = "pressure"
    unit = "MPa"
    components = 1
    follows_surface = True
    loads_rim = False
    uses = ("pressure",)
