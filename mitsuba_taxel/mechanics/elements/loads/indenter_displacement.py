"""Load by a prescribed displacement of a rigid indenter."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mitsuba_taxel.base.arguments import require
from mitsuba_taxel.mechanics.contact.indenter import Indenter
from mitsuba_taxel.mechanics.elements.loads.load import Load
from mitsuba_taxel.parameters import values_of

POSITION = "indenter_x", "indenter_y"
USES = ("indenter", *POSITION, "friction")


@dataclass(frozen=True)
class IndenterDisplacement(Load, name="indenter_displacement", rank=5):
    """Load by a prescribed displacement of a rigid indenter, which does not rotate."""

    indenter: Indenter = field()  # type: ignore[misc]

    meaning = "of a rigid body that touches the pad from above"
    quantity = "displacement"
    unit = "mm"
    components = 3
    loads_rim = False
    uses = ("displacement", *USES)
    position = POSITION

    def __post_init__(self) -> None:
        super().__post_init__()
        require("indenter", self.indenter, Indenter, "an Indenter")

    @classmethod
    def why_no_first_contact(cls, change: np.ndarray) -> str:
        return "a dragged indenter has a separate path at each position" if change[:2].any() else ""

    @classmethod
    def of_scene(cls, pad: Any, find: Any, **about: Any) -> IndenterDisplacement:
        return cls(pad.build_indenter(find), **about)

    def scene_values(self) -> dict[str, Any]:
        x, y = self.indenter.at
        return {"indenter_x": x, "indenter_y": y, **values_of(self.indenter)}
