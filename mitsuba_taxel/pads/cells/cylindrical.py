"""Cylindrical cells."""

from mitsuba_taxel.pads.cells.shaft import RoundShaft


class Cylindrical(RoundShaft, name="cylindrical", rank=2):
    """A cylinder with a flat roof."""
