"""Patches on the surfaces that scatter light within a cell: its walls, which move, and its package, which is fixed.

A patch is a curved triangle with 15 nodes (a polynomial of degree 4). The phototransistor receives no light from below
its plane. Its response over the walls has a kink at this plane, and patches are cut along it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mitsuba_taxel.transport.patch_cuts import PatchCuts

if TYPE_CHECKING:
    from mitsuba_taxel.mechanics.surface.wall_patches import WallPatches

ROUNDED = 1e-3
"""Positions of packages are rounded to this fraction of the size of a cell, because they follow from those of LEDs,
which have single precision."""


@dataclass(frozen=True, eq=False)
class CellPatches:
    """Patches of a cell: F on its walls, followed by G on its package. A patch has 15 nodes.

    Attributes
    ----------
    faces : WallPatches
        The faces of the mesh on the walls, before they are cut.
    cuts : PatchCuts
        The F patches into which the faces are cut.
    package : (G, 15, 3) ndarray
        Positions of the nodes of the patches on the package, in mm.
    """

    faces: WallPatches
    cuts: PatchCuts
    package: np.ndarray

    @property
    def rest(self) -> np.ndarray:
        """Undeformed positions (F + G, 15, 3) of the patches' nodes, in mm."""
        return self._with_package(self.faces.rest, self.package)

    @property
    def pattern(self) -> np.ndarray:
        """Undeformed positions (F + G, 15, 3) of the nodes of all patches, in mm relative to the cell. They are
        rounded, so that they are equal for cells that differ by a translation only."""
        grain = ROUNDED * np.ptp(self.faces.pattern)
        package = np.round((self.package - self.faces.shift) / grain) * grain
        return self._with_package(self.faces.pattern, package) + 0.0  # no negative zeros

    def carried(self, nodal: np.ndarray) -> np.ndarray:
        """Displacement (F + G, 15, 3) of the patches' nodes, or its rate, from that (N, 3) of the N nodes of the finite
        elements.
        """
        return self._with_package(self.faces.carried(nodal), np.zeros_like(self.package))

    def moved(self, parameter: str, displacement: np.ndarray) -> np.ndarray:
        """Velocities of the patches' nodes while a dimension of the pad changes; see :meth:`WallPatches.moved`.

        Parameters
        ----------
        parameter : str
            Name of the dimension of the pad.
        displacement : (N, 3) ndarray
            Displacement of the N nodes of the finite elements, in mm.

        Returns
        -------
        (F + G, 15, 3) ndarray
            Velocities of the nodes of F patches on walls and G on the package, in mm per mm of the dimension.
        """
        return self._with_package(self.faces.moved(parameter, displacement), np.zeros_like(self.package))

    def _with_package(self, of_faces: np.ndarray, of_package: np.ndarray) -> np.ndarray:
        return np.concatenate([self.cuts.of(of_faces), of_package])
