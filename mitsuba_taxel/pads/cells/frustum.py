"""Conical cells."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.pads.cells.cell_shape import FLAT_ROOF, ON_ROUND_WALLS
from mitsuba_taxel.pads.cells.meridian import Meridian, flat_meridian, of_quadric
from mitsuba_taxel.pads.cells.meridian_cell import MeridianCell
from mitsuba_taxel.parameters import Number, Parameter


class Frustum(MeridianCell, name="frustum", rank=6):
    """A cell in the shape of a truncated cone: a conical side and a flat roof."""

    meaning = "a cone with a flat roof"
    default_height_words = "1.55"
    default_height = 1.55
    is_square = False
    round_regions = ("side",)
    face_refinement = ON_ROUND_WALLS
    least_elements = 400
    has_curved_rim = False
    light_sizes = FLAT_ROOF

    @classmethod
    def own_parameters(cls) -> Mapping[str, Parameter]:
        doc = "Diameter of the roof of a cell, at most `cell_size`."
        return {"roof_size": Number(default=1.5, unit="mm", doc=doc, above=0, common=(0.1, 100))}

    @property
    def roof(self) -> Meridian:
        return flat_meridian(0.5 * self.value("roof_size"), self.cell_height)

    def check(self) -> None:
        if self.value("roof_size") > self.pad.cell_size:
            raise InputError(
                f"roof_size = {self.value('roof_size'):g} is not allowed: at most cell_size = {self.pad.cell_size:g} "
                "mm is needed."
            )

    def as_profile(self, points: int) -> np.ndarray:
        return of_quadric(1.0, 1.0, points) * [self.value("roof_size") / self.pad.cell_size, 1.0]
