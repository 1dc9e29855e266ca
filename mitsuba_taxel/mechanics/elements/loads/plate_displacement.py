"""Load by a prescribed displacement of a rigid plate on the top."""

from __future__ import annotations

from dataclasses import dataclass

from mitsuba_taxel.mechanics.elements.loads.load import Load


@dataclass(frozen=True)
class PlateDisplacement(Load, name="plate_displacement", rank=3):
    """Load by a prescribed displacement of a rigid plate that is bonded to the top and does not rotate."""

    meaning = "of such a plate"
    quantity = "displacement"
    unit = "mm"
    components = 3
    bonded_plate = True
    loads_rim = False
    uses = ("displacement",)
