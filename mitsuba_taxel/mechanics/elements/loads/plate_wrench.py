"""Load by a force and a moment on a rigid plate that may tilt."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.elements.loads.load import Load
from mitsuba_taxel.parameters import number


@dataclass(frozen=True)
class PlateWrench(Load, name="plate_wrench", rank=3):
    """A force and a moment on a rigid plate bonded to the top, which moves and tilts freely, as a fingertip does.

    The value is (Fx, Fy, Fz, Mx, My, Mz) in N and N mm. The force acts on a point of the plate, which moves and tilts
    with it; force and moment keep their directions. The moment is conjugate to the rotation vector of the plate: see
    ``plate_rotation``.

    Parameters
    ----------
    x, y : float
        Point of the plate on which the force acts, mm.
    height : float
        Height of this point above the undeformed top, mm.
    self_contact : bool
        False: contact under a tilting plate is not modelled.
    """

    meaning = "on a rigid plate that is bonded to the top and tilts"
    quantity = "force"
    unit = "N"
    components = 6
    bonded_plate = True
    tilts = True
    loads_rim = False
    uses = ("force", "moment")

    x: float = number(0.0, "mm", "Point of the plate on which the force acts, along x.")
    y: float = number(0.0, "mm", "The same point, along y.")
    height: float = number(0.0, "mm", "Height of this point above the undeformed top.")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.self_contact:
            raise InputError(
                f"self_contact = True is not allowed with load = {self.name!r}: contact under a tilting plate is not "
                "modelled; False is needed."
            )

    def pivot(self, mesh: VolumeMesh) -> np.ndarray:
        return np.array([self.x, self.y, mesh.points[:, 2].max() + self.height])

    def length(self, mesh: VolumeMesh) -> float:
        # A sixth of the side: a moment strains the edge of a square block as much as this force strains the block.
        return math.sqrt(self.loaded_area(mesh)) / 6

    def is_symmetric(self, mesh: VolumeMesh, mirror: Mirror, image: np.ndarray) -> bool:
        return bool(mirror.side(self.pivot(mesh)) == 0)
