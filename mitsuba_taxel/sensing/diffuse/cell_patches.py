"""Patches on the surfaces that scatter light within a cell: its walls, which move, and its package, which does not.

The phototransistor receives nothing from below its plane, where the response to light on the walls has a kink. Patches
are cut along this plane.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mitsuba_taxel.transport.patch_cuts import PatchCuts

if TYPE_CHECKING:
    from mitsuba_taxel.mechanics.surface.wall_patches import WallPatches

ROUNDED = 1e-3
"""Grain of the positions of packages, relative to the size of a cell: they follow LEDs, in single precision."""


@dataclass(frozen=True, eq=False)
class CellPatches:
    """Patches of walls, followed by those on a package.

    Attributes
    ----------
    faces : WallPatches
        Faces of the mesh of the walls.
    cuts : PatchCuts
        The F patches into which they are cut.
    package : (G, 15, 3) ndarray
        Positions in mm.
    """

    faces: WallPatches
    cuts: PatchCuts
    package: np.ndarray

    @property
    def rest(self) -> np.ndarray:
        """Undeformed positions (F + G, 15, 3) of the patches, in mm."""
        return self._with_package(self.faces.rest, self.package)

    @property
    def pattern(self) -> np.ndarray:
        """Rounded positions (F + G, 15, 3) in mm, undeformed, the same for cells that differ by a translation only."""
        grain = ROUNDED * np.ptp(self.faces.pattern)
        package = np.round((self.package - self.faces.shift) / grain) * grain
        return self._with_package(self.faces.pattern, package) + 0.0  # no negative zeros

    def carried(self, nodal: np.ndarray) -> np.ndarray:
        """Displacement (F + G, 15, 3) of the patches, or its rate, from the displacement (N, 3) of the nodes."""
        return self._with_package(self.faces.carried(nodal), np.zeros_like(self.package))

    def moved(self, parameter: str, displacement: np.ndarray) -> np.ndarray:
        """Rates of change of the patches' positions with a dimension of the pad; see :meth:`WallPatches.moved`.

        Parameters
        ----------
        parameter : str
            Name of the dimension.
        displacement : (N, 3) ndarray
            Displacement of the nodes of the elements, in mm.

        Returns
        -------
        (F + G, 15, 3) ndarray
            Velocities in mm per mm of the dimension.
        """
        return self._with_package(self.faces.moved(parameter, displacement), np.zeros_like(self.package))

    def _with_package(self, of_faces: np.ndarray, of_package: np.ndarray) -> np.ndarray:
        return np.concatenate([self.cuts.of(of_faces), of_package])
