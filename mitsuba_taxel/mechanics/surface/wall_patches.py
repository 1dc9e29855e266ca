"""The curved walls of cells as patches of fourth degree, and how they move with the displacement and the dimensions."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mitsuba_taxel.geometry.quadratic_shapes import shape_functions
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.surface.tessellation import placed
from mitsuba_taxel.pads.pad import Pad
from mitsuba_taxel.pads.pad_file import PadFile

STEP = 1e-4
"""Of a dimension in mm, for the central difference of places on round walls."""


@dataclass(frozen=True, eq=False)
class WallPatches:
    """Faces of a mesh of finite elements, each with places at a lattice.

    Parameters
    ----------
    mesh : VolumeMesh
    pad : Pad or PadFile
        Where undeformed round walls are.
    faces : (F,) ndarray
        Numbers of the faces of the mesh.
    lattice : (K, 2) ndarray
        As (s, t), along two sides of a face.
    """

    mesh: VolumeMesh
    pad: Pad | PadFile
    faces: np.ndarray
    lattice: np.ndarray

    @property
    def rest(self) -> np.ndarray:
        """(F, K, 3) mm, undeformed."""
        return self._placed(self.mesh.points, self.pad)

    def carried(self, nodal: np.ndarray) -> np.ndarray:
        """(F, K, 3) of a displacement of the nodes (N, 3), or of its rate."""
        return np.einsum("kn,fnc->fkc", self._shapes, nodal[self.mesh.faces[self.faces]])

    def moved(self, parameter: str, velocity: np.ndarray) -> np.ndarray:
        """(F, K, 3) mm per mm of a dimension of the pad, undeformed, as nodes move by ``velocity`` (N, 3)."""
        assert isinstance(self.pad, Pad)
        value = getattr(self.pad, parameter)
        ahead, behind = (
            self._placed(self.mesh.points + step * velocity, replace(self.pad, **{parameter: value + step}))
            for step in (STEP, -STEP)
        )
        return (ahead - behind) / (2 * STEP)

    @property
    def _shapes(self) -> np.ndarray:
        return shape_functions(np.column_stack([1 - self.lattice.sum(axis=1), self.lattice]))

    def _placed(self, nodes: np.ndarray, pad: Pad | PadFile) -> np.ndarray:
        points = self.carried(nodes)
        face = np.repeat(self.faces, len(self.lattice))
        return placed(self.mesh, face, points.reshape(-1, 3), pad)[0].reshape(points.shape)
