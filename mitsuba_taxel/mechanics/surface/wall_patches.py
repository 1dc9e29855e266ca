"""Curved walls of cells as patches of fourth degree, and their derivatives with respect to displacement and
dimensions."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.geometry.quadratic_shapes import shape_functions
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.point_locator import Location, locator_of
from mitsuba_taxel.mechanics.surface.tessellation import placed
from mitsuba_taxel.pads.any_pad import AnyPad
from mitsuba_taxel.pads.parametric.pad import Pad
from mitsuba_taxel.pads.parametric.velocities import mesh_velocity, rate_by

STEP = 1e-4
"""Step of a dimension in mm, for finite differences of positions on round walls."""
BESIDE = 0.1
"""Allowed distance of walls from the elements that approximate them, relative to the height of the pad."""


@dataclass(frozen=True, eq=False)
class WallPatches:
    """Curved patches on the walls of a cell: lattice points on each face of a mesh, which move with the elements.

    The cells of built-in pads are equal, so that the faces of one cell represent all cells.

    Parameters
    ----------
    elements : VolumeMesh
        Undeformed mesh, at whose nodes the displacement is known.
    walls : VolumeMesh
        Mesh of the same pad, whose faces are the patches.
    pad : AnyPad
        The pad with the undeformed round walls.
    faces : (F,) ndarray
        Numbers of the F faces of ``walls`` that are used, which belong to one cell.
    cell : int
        Number of the cell that the patches represent: the cell of the faces or, in a built-in pad, any cell.
    lattice : (K, 2) ndarray
        Coordinates (s, t), along two sides of a face, of its K lattice points.
    """

    elements: VolumeMesh
    walls: VolumeMesh
    pad: AnyPad
    faces: np.ndarray
    cell: int
    lattice: np.ndarray

    @cached_property
    def pattern(self) -> np.ndarray:
        """Undeformed lattice points (F, K, 3) in mm, K on each of F faces, in the one cell whose faces are stored.
        Equal cells share them.
        """
        lattice = tuple(map(tuple, self.lattice.tolist()))
        return _pattern(self.walls, self.pad, tuple(self.faces.tolist()), lattice)

    @cached_property
    def shift(self) -> np.ndarray:
        """Vector (3,) in mm from the cell for which the faces are stored to the cell that this object represents."""
        return self._shift(self.pad)

    @cached_property
    def rest(self) -> np.ndarray:
        """Undeformed lattice points (F, K, 3) in mm, K on each of F faces, in the cell that this object represents."""
        return self.pattern + self.shift

    def carried(self, nodal: np.ndarray) -> np.ndarray:
        """Displacement, or its rate, (F, K, 3) at the K lattice points of F faces, interpolated from the values
        ``nodal`` (N, 3) at the N nodes.
        """
        return self._location.interpolate(nodal).reshape(self.rest.shape)

    def moved(self, parameter: str, displacement: np.ndarray) -> np.ndarray:
        """Derivative of the deformed lattice points on the walls with respect to a dimension of the pad.

        Parameters
        ----------
        parameter : str
            Name of the dimension; other dimensions are constant.
        displacement : (N, 3) ndarray
            Displacement of the elements' nodes, mm, constant.

        Returns
        -------
        (F, K, 3) ndarray
            Derivative in mm per mm.
        """
        assert isinstance(self.pad, Pad)
        pad = replace(self.pad)  # derived dimensions become constants
        velocity = mesh_velocity(pad, self.walls, parameter)
        motion = rate_by(
            pad,
            parameter,
            STEP,
            lambda changed, step: self._placed(self.walls.points + step * velocity, changed) + self._shift(changed),
        )
        relative_motion = motion - self.carried(mesh_velocity(pad, self.elements, parameter))
        gradient = self._location.gradient(displacement).reshape(*motion.shape, 3)
        return motion + np.einsum("fkij,fkj->fki", gradient, relative_motion)

    @cached_property
    def _location(self) -> Location:
        """Elements that contain the lattice points, and the reference coordinates of the points."""
        tolerance = BESIDE * np.ptp(self.elements.points[:, 2])
        return locator_of(self.elements).locate(self.rest.reshape(-1, 3), tolerance)

    def _shift(self, pad: AnyPad) -> np.ndarray:
        own_cell = int(self.walls.face_cell[self.faces[0]])
        if own_cell == self.cell:
            return np.zeros(3)
        assert isinstance(pad, Pad)
        (x, y), (x0, y0) = pad.cell_centres[self.cell - 1], pad.cell_centres[own_cell - 1]
        return np.array([x - x0, y - y0, 0.0])

    def _placed(self, nodes: np.ndarray, pad: AnyPad) -> np.ndarray:
        return _placed(self.walls, nodes, pad, self.faces, self.lattice)


@kept(8)
def _pattern(
    walls: VolumeMesh, pad: AnyPad, faces: tuple[int, ...], lattice: tuple[tuple[float, float], ...]
) -> np.ndarray:
    """Undeformed lattice points (F, K, 3) in mm on F faces of a mesh; all equal cells share them."""
    pattern = _placed(walls, walls.points, pad, np.array(faces), np.array(lattice))
    pattern.setflags(write=False)
    return pattern


def _placed(
    walls: VolumeMesh, nodes: np.ndarray, pad: AnyPad, faces: np.ndarray, lattice: np.ndarray
) -> np.ndarray:
    """Points (F, K, 3) in mm of a lattice on F faces of a mesh whose nodes may have moved, on the round walls of a pad.
    """
    shapes = shape_functions(np.column_stack([1 - lattice.sum(axis=1), lattice]))
    points = np.einsum("kn,fnc->fkc", shapes, nodes[walls.faces[faces]])
    face = np.repeat(faces, len(lattice))
    return placed(walls, face, points.reshape(-1, 3), pad)[0].reshape(points.shape)
