"""Cylindrical cells."""

from mitsuba_taxel.pads.cells.shaft import RoundShaft


class Cylindrical(RoundShaft, name="cylindrical", rank=2):
    """A cell in the shape of a cylinder with a flat roof."""
