"""Grids of small rectangular faces: LEDs or phototransistors.

Emitter and sensor use them for points on a face and for the face at a point, so that the numbers of taxels agree.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsuba_taxel.backend.packets import in_packets
from mitsuba_taxel.parameters.similarity import similarity_scale


class FaceGrid:
    """Congruent parallel rectangles on a regular grid, numbered row by row from (-x, +y).

    Parameters
    ----------
    to_world : mi.ScalarTransform4f
        Rigid motion and uniform scale from the frame of the carrier; normals of the faces are along its +z.
    centre : (3,) ndarray
        Centre of the grid in the frame of the carrier.
    size : (2,) ndarray
        Extent of a face along x and y of the carrier.
    rows, columns : int
        Size of the grid; rows run from +y to -y, columns along +x.
    pitch : float
        Distance between neighbours.
    """

    def __init__(self, to_world, centre, size, rows: int = 1, columns: int = 1, pitch: float = 0.0) -> None:
        matrix = np.array(to_world.matrix, dtype=float)
        scale = similarity_scale(matrix)
        column, row = np.meshgrid(np.arange(columns), np.arange(rows))
        local = np.zeros((rows * columns, 3))
        local[:, 0] = (column.ravel() - (columns - 1) / 2) * pitch
        local[:, 1] = ((rows - 1) / 2 - row.ravel()) * pitch
        local += np.asarray(centre, dtype=float)
        world = local @ matrix[:3, :3].T + matrix[:3, 3]

        self.rows, self.columns = rows, columns
        self.count = rows * columns
        self.scale = scale
        # No kernels are launched here: an integrator of Mitsuba may call this while it records a kernel.
        self.centres = mi.Point3f(*(mi.Float(in_packets(c)) for c in world.T))
        axes = matrix[:3, :3].T / scale
        self.frame = mi.Frame3f(*(_opaque(mi.Vector3f, axis) for axis in axes))
        self.origin = _opaque(mi.Point3f, world[0])
        self.size = _opaque(mi.Vector2f, [scale * extent for extent in size])
        self.area = dr.opaque(mi.Float, scale**2 * size[0] * size[1])
        self.pitch = dr.opaque(mi.Float, scale * pitch if pitch > 0 else 1.0)
        self.last = (columns - 1, rows - 1)

    def point(self, index: mi.UInt32, offset: mi.Point2f) -> mi.Point3f:
        """World position of a point of face ``index``. ``offset`` is its distance from the centre of the face along x
        and y, in world units.
        """
        centre = dr.gather(mi.Point3f, self.centres, index)
        return centre + self.frame.to_world(mi.Vector3f(offset.x, offset.y, 0))

    def locate(self, p: mi.Point3f) -> tuple[mi.UInt32, mi.Point2f]:
        """Find the face (LED or phototransistor) whose centre is nearest to a point ``p``. Returns its number, and the
        offset of ``p`` from its centre.
        """
        local = self.frame.to_local(p - self.origin)
        column = self._nearest(local.x, self.last[0])
        row = self._nearest(-local.y, self.last[1])
        offset = mi.Point2f(local.x - column * self.pitch, local.y + row * self.pitch)
        return mi.UInt32(row) * self.columns + mi.UInt32(column), offset

    def offset(self, index: mi.UInt32, p: mi.Point3f) -> mi.Point2f:
        """Offset of ``p`` from the centre of face ``index``, along x and y of the face."""
        local = self.frame.to_local(p - dr.gather(mi.Point3f, self.centres, index))
        return mi.Point2f(local.x, local.y)

    def is_at_height(self, p: mi.Point3f) -> mi.Bool:
        """Whether ``p`` lies in the plane of the faces."""
        return dr.abs(self.frame.to_local(p - self.origin).z) <= 1e-3 * self.size.y

    def _nearest(self, distance: mi.Float, last: int) -> mi.Float:
        """Index, from 0 to ``last``, of the grid line nearest to a distance from the first line."""
        return dr.clip(dr.round(distance / self.pitch), 0, last)


def _opaque(kind: type, values) -> Any:
    """Vector whose components are inputs of kernels instead of literals, so that other values need no new kernel."""
    return kind(*(dr.opaque(mi.Float, float(value)) for value in values))
