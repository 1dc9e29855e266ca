"""Load by a force on a rigid indenter."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mitsuba_taxel.base.arguments import require
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.mechanics.contact.indenter import Indenter
from mitsuba_taxel.mechanics.elements.loads.indenter_displacement import POSITION, USES, IndenterDisplacement
from mitsuba_taxel.mechanics.elements.loads.load import Load
from mitsuba_taxel.parameters import values_of


@dataclass(frozen=True)
class IndenterForce(Load, name="indenter_force", rank=6):
    """A force on a rigid indenter, which does not rotate; its displacement is unknown.

    The indenter is free to move along z and, with friction, in the directions of sideways forces. It is guided in all
    other directions.
    """

    indenter: Indenter = field()  # type: ignore[misc]

    meaning = "on such a body, along -z, and with friction sideways"
    quantity = "force"
    unit = "N"
    components = 3
    loads_rim = False
    uses = ("force", *USES)
    position = POSITION

    def __post_init__(self) -> None:
        super().__post_init__()
        require("indenter", self.indenter, Indenter, "an Indenter")

    @property
    def driven(self) -> IndenterDisplacement:
        """Load that prescribes the displacement of the same indenter. It is used to find the depth at which the
        reaction equals the force."""
        return IndenterDisplacement(self.indenter, self_contact=self.self_contact)

    def check(self, value: Sequence[float] | np.ndarray) -> None:
        """Refuse forces that contact cannot transmit; raises `InputError`."""
        x, y, z = value
        shown, friction = ", ".join(f"{component:g}" for component in value), self.indenter.friction
        if z > 0 or (not friction and (x or y)):
            without = "" if friction else "without friction "
            raise InputError(f"force = ({shown}) is not allowed: {without}an indenter only pushes, along -z.")
        if math.hypot(x, y) > -friction * z:
            raise InputError(
                f"force = ({shown}) is not allowed: with friction = {friction:g} the indenter slips sideways beyond "
                f"{-friction * z:g} N."
            )

    @classmethod
    def why_no_first_contact(cls, change: np.ndarray) -> str:
        return "paths of an indenter follow its displacement, not a force"

    @classmethod
    def of_scene(cls, pad: Any, find: Any, **about: Any) -> IndenterForce:
        return cls(pad.build_indenter(find), **about)

    def scene_values(self) -> dict[str, Any]:
        x, y = self.indenter.at
        return {"indenter_x": x, "indenter_y": y, **values_of(self.indenter)}
