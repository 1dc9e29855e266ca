"""Patches on all that scatters light within a cell: its walls, which move, and its package, which does not."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mitsuba_taxel.mechanics.surface.wall_patches import WallPatches

ROUNDED = 1e-3
"""Of packages, relative to a cell's size: they lie where LEDs are, in single precision."""


@dataclass(frozen=True, eq=False)
class CellPatches:
    """Patches of walls, followed by those on a package.

    Attributes
    ----------
    walls : WallPatches
        F of them.
    package : (G, 15, 3) ndarray
        Positions in mm.
    """

    walls: WallPatches
    package: np.ndarray

    @property
    def rest(self) -> np.ndarray:
        """(F + G, 15, 3) mm, undeformed."""
        return np.concatenate([self.walls.rest, self.package])

    @property
    def pattern(self) -> np.ndarray:
        """(F + G, 15, 3) mm, undeformed and roughly, the same for cells that are equal but for their place."""
        grain = ROUNDED * np.ptp(self.walls.pattern)
        package = np.round((self.package - self.walls.shift) / grain) * grain
        return np.concatenate([self.walls.pattern, package]) + 0.0  # no negative zeros

    def carried(self, nodal: np.ndarray) -> np.ndarray:
        """(F + G, 15, 3) displacement or its rate, from that of the elements' nodes (N, 3)."""
        return self._with_package(self.walls.carried(nodal))

    def moved(self, parameter: str, displacement: np.ndarray) -> np.ndarray:
        """(F + G, 15, 3) mm per mm of a dimension of the pad; see :meth:`WallPatches.moved`."""
        return self._with_package(self.walls.moved(parameter, displacement))

    def _with_package(self, of_walls: np.ndarray) -> np.ndarray:
        return np.concatenate([of_walls, np.zeros_like(self.package)])
