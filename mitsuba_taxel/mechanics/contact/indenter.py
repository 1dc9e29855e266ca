"""A rigid indenter: its kind, dimensions, position and orientation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.sources import own_code
from mitsuba_taxel.mechanics.contact.indenter_shape import IndenterShape
from mitsuba_taxel.mechanics.contact.indenters.file import File
from mitsuba_taxel.pads.imported.placement import AS_DRAWN, DIRECTIONS
from mitsuba_taxel.parameters import REQUIRED, Kinded, choice, kind, number, text

STEEPEST = 80.0
"""Largest tilt in degrees."""


_SHAPE = ("shape",)
"""Parameter on which others depend: each kind of body uses only some of the parameters."""


@dataclass(frozen=True)
class Indenter(Kinded):
    """A rigid indenter above the pad, whose tip starts at the height of the pad's highest point.

    Raises
    ------
    InputError
        if a value is not finite or out of range, or a file holds no closed surface.
    """

    shape: str = kind(
        "sphere",
        IndenterShape,
        "Body that presses on the pad.",
        name="indenter",
    )
    radius: float | None = number(
        REQUIRED,
        "mm",
        "Radius of the ball, the rod or the punch.",
        above=0,
        common=(0.02, 500),
        when=_SHAPE,
        name="indenter_radius",
    )
    at: Sequence[float] = (0.0, 0.0)
    """Position of the tip, x and y in mm."""
    angle: float | None = number(
        0.0,
        "degrees",
        "Rotation of the body about z, from x to y; it also rotates the direction of the tilt.",
        when=_SHAPE,
        name="indenter_angle",
    )
    tilt: float | None = number(
        0.0,
        "degrees",
        "Angle by which the body is tilted from upright: a rotation about y, from z to x, before the rotation about z. "
        "Its centre is that of the end of a punch or, for a file, x = y = 0 at its lowest height. The tip is then the "
        "lowest point of the tilted body. A plate starts where it touches the pad.",
        minimum=-STEEPEST,
        maximum=STEEPEST,
        when=_SHAPE,
        name="indenter_tilt",
    )
    edge_radius: float | None = number(
        None,
        "mm",
        "Radius of the rounded edge of a punch, at most the radius of the punch.",
        above=0,
        common=(0.002, 500),
        when=_SHAPE,
        name="indenter_edge_radius",
        default_words="a tenth of the radius of the punch",
    )
    friction: float = number(0.0, "", "Coefficient of Coulomb's friction.", minimum=0, common=(0, 2))
    file: str | None = text(
        REQUIRED,
        "A closed surface as STL, PLY or OBJ, in mm. Its lowest point is the tip, and its x = y = 0 is at the position "
        "of the indenter; edges are rounded by a fiftieth of its longest side.",
        "the name of a file",
        when=_SHAPE,
        name="indenter_file",
    )
    file_scale: float | None = number(
        1.0,
        "",
        "Length of the file's unit in mm: 25.4 for inches, 1000 for m.",
        above=0,
        when=_SHAPE,
        name="indenter_file_scale",
    )
    file_up: str | None = choice(
        AS_DRAWN,
        DIRECTIONS,
        "Direction in the file that points up. If it is given, the centre of the box around the body is at the "
        "position of the indenter.",
        when=_SHAPE,
        name="indenter_file_up",
    )
    digest: str = field(default="", init=False, repr=False)
    """Digest of the content of a file, and of the code of a user's own kind: cached states depend on both."""

    def __post_init__(self) -> None:
        if self.file is not None:
            object.__setattr__(self, "file", str(self.file))
            if self.shape == type(self).shape:
                object.__setattr__(self, "shape", File.name)
        super().__post_init__()

    def _check(self) -> None:
        try:
            x, y = (float(coordinate) for coordinate in self.at)
        except (TypeError, ValueError, OverflowError):
            x = y = math.nan
        if not (math.isfinite(x) and math.isfinite(y)):
            raise InputError(
                f"indenter at = {self.at!r} is not allowed: two finite numbers, x and y in mm, are needed."
            )
        object.__setattr__(self, "at", (x, y))
        object.__setattr__(self, "digest", self.body.digest() + own_code(type(self.body)))
        self.body.check()

    @cached_property
    def body(self) -> IndenterShape:
        """The rigid body with this indenter's kind and dimensions. Its methods compute distances, symmetries and the
        surface.
        """
        return IndenterShape.named(self.shape)(self)
