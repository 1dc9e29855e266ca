"""Load by a force on a rigid plate on the top."""

from __future__ import annotations

from dataclasses import dataclass

from mitsuba_taxel.mechanics.elements.loads.load import Load


@dataclass(frozen=True)
class PlateForce(Load, name="plate_force", rank=2):
    """A force on a rigid plate bonded to the top, which moves but does not rotate, like the flange of a robot."""

    meaning = "on a rigid plate that is bonded to the top and does not rotate"
    quantity = "force"
    unit = "N"
    components = 3
    bonded_plate = True
    loads_rim = False
    uses = ("force",)
