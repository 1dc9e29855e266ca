"""The union type of all kinds of pads, for annotations."""

from mitsuba_taxel.pads.block import Block
from mitsuba_taxel.pads.pad_file import PadFile
from mitsuba_taxel.pads.parametric.pad import Pad

AnyPad = Pad | PadFile | Block
"""A pad with cells, a pad from a file, or a block without cells."""
