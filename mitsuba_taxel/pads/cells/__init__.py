"""Shapes of cells: one class each, in its own file, bound to the dimensions of a pad.

A new shape is one file in this folder with a subclass of `CellShape`. `Shaft` (vertical side) and `MeridianCell` (roof
and side given by curves) leave less to write. Everything that depends on the shape is a member of the class."""

from mitsuba_taxel.base.kinds import import_all
from mitsuba_taxel.pads.cells.cell_shape import ON_FLAT_WALLS, ON_ROUND_WALLS, CellShape, LightSizes
from mitsuba_taxel.pads.cells.meridian import Meridian, flat_meridian, roof_meridian
from mitsuba_taxel.pads.cells.meridian_cell import MeridianCell
from mitsuba_taxel.pads.cells.shaft import Shaft

import_all(__name__, __path__)

__all__ = [
    "ON_FLAT_WALLS",
    "ON_ROUND_WALLS",
    "CellShape",
    "LightSizes",
    "Meridian",
    "MeridianCell",
    "Shaft",
    "flat_meridian",
    "roof_meridian",
]
