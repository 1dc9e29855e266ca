"""Extreme cases of indenters from STL files. The measuring process writes these files itself."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.evidence.extremes.case import ExtremeCase, with_flaw
from mitsuba_taxel.evidence.extremes.cases import CELL
from mitsuba_taxel.evidence.extremes.table_case import TableCase
from mitsuba_taxel.evidence.rows.row import MechanicsRow
from mitsuba_taxel.mechanics.contact.indenter import Indenter
from mitsuba_taxel.mechanics.elements.loads import IndenterDisplacement

if TYPE_CHECKING:
    from trimesh import Trimesh

SIDE = 2.0
"""Edge length of the bodies, in mm."""
DEPTH = 0.3
"""Depth to which they are pressed, in mm."""


@dataclass(frozen=True)
class SolidCase(TableCase):
    """An extreme case: a cell that is pressed by a body from an STL file.

    Attributes
    ----------
    solid : Callable[[], Trimesh]
        The body, in mm.
    tilt : float
        Angle between the axis of the body and the normal of the pad, in degrees.
    refused : bool
        Whether the program must refuse the body.
    """

    ROW = MechanicsRow
    name: str
    solid: Callable[[], Trimesh]
    tilt: float = 0.0
    refused: bool = False

    def measured(self) -> MechanicsRow:
        """Solve this case in the present process, check the result independently, and return the row of the table."""
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder, "body.stl")
            self.solid().export(file)
            try:
                load = IndenterDisplacement(Indenter(file=str(file), tilt=self.tilt))
            except InputError as error:
                message = str(error).replace(str(file), file.name)
                return with_flaw(MechanicsRow(self.name, f"refused: {message}"), self.refused)
            return ExtremeCase(self.name, CELL, load=load, value=(0.0, 0.0, -DEPTH), refused=self.refused).measured()


def solid_cases() -> list[SolidCase]:
    """All cases: bodies with sharp edges and corners, and an open surface."""
    return [
        SolidCase("pressed by a box from a file, with its edge", _box, tilt=45.0),
        SolidCase("pressed by a pyramid from a file, with its tip", _pyramid),
        SolidCase("pressed by an open box from a file", _open_box, refused=True),
    ]


def _box() -> Trimesh:
    import trimesh  # here and below, as nothing else in the table needs it

    return trimesh.creation.box((SIDE, SIDE, SIDE))


def _pyramid() -> Trimesh:
    """A pyramid whose tip points down, as a closed surface of triangles in mm."""
    import trimesh

    corners = SIDE / 2 * np.array([[0, 0, 0], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]])
    return trimesh.convex.convex_hull(corners)


def _open_box() -> Trimesh:
    box = _box()
    box.update_faces(box.face_normals[:, 2] < 0.5)
    return box
