"""Conversion of the geometry of a file to a pad or body in mm: unit of length, and direction that points up."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mitsuba_taxel.geometry.geometry_error import GeometryError

AS_DRAWN = "as drawn"
DIRECTIONS = {
    AS_DRAWN: "nothing is moved",
    "x": "", "-x": "", "y": "", "-y": "", "z": "", "-z": "",
}  # fmt: skip
"""Values of ``up``."""
SMALLEST_EXTENT, LARGEST_EXTENT = 0.1, 1000.0
"""Allowed range of the longest side in mm; outside it, the file must have another scale."""
UNITS = {"m": 1000.0, "inches": 25.4, "cm": 10.0, "um": 1e-3}
"""Common units of length of files, in mm."""
LIKELY = 1.0, 500.0
"""Range of the longest side in mm for which another unit is proposed."""
USUAL = 2.0, 300.0
"""Range of the longest side in mm for which no other unit is proposed."""
COMMON = 10.0
"""Typical longest side in mm: units that come close to it are proposed first."""

MOST_CENTRES = 4
"""Largest number of cells whose centres are printed."""
OFF_CENTRE = 1e-3
"""Distance of a pad's middle from x = y = 0, relative to its width, above which a message points it out."""


class Placement(NamedTuple):
    """Unit of length and upward direction of a file of geometry.

    Attributes
    ----------
    scale : float
        Length of the file's unit in mm.
    up : str
        Direction in the file that points up, one of `DIRECTIONS`; the box around the body is then centred at x = y = 0,
        and stands on z = 0.
    prefix : str
        Prefix of the parameters' names in messages.
    """

    scale: float = 1.0
    up: str = AS_DRAWN
    prefix: str = ""

    @property
    def turn(self) -> np.ndarray:
        """Rotation (3, 3) that takes the direction in the file to z by the smallest angle; about x for -z."""
        if self.up == AS_DRAWN:
            return np.eye(3)
        up = np.eye(3)["xyz".index(self.up[-1])] * (-1 if self.up.startswith("-") else 1)
        if up[2]:
            return np.diag([1.0, up[2], up[2]])
        # A rotation by a right angle in the plane of the direction and z.
        axis = np.cross(up, [0.0, 0.0, 1.0])
        return np.outer(axis, axis) + np.array(
            [[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]]
        )

    def placed(self, points: np.ndarray) -> np.ndarray:
        """Convert points (N, 3) of the file to the coordinates of the pad, mm.

        Raises
        ------
        GeometryError
            if the body cannot be in mm; the message proposes the scale of other units.
        """
        points = self.scale * points
        self.check_extent(points)
        if self.up == AS_DRAWN:
            return points
        points = points @ self.turn.T
        low, high = points.min(axis=0), points.max(axis=0)
        return points - [*(0.5 * (low + high))[:2], low[2]]

    def check_extent(self, points: np.ndarray) -> None:
        """Raise `GeometryError` if a body with points (N, 3) in mm is too small or too large."""
        longest = float(np.ptp(points, axis=0).max())
        if not SMALLEST_EXTENT <= longest <= LARGEST_EXTENT:
            raise GeometryError(f"its longest side is {longest:.3g} mm{self.other_units(longest)}")

    def other_units(self, longest: float) -> str:
        """Text that converts the longest side, given in mm, from other units that the file may have; empty if the
        length is usual."""
        if USUAL[0] <= longest <= USUAL[1]:
            return ""
        likely = {
            unit: longest / self.scale * scale
            for unit, scale in UNITS.items()
            if LIKELY[0] <= longest / self.scale * scale <= LIKELY[1]
        }
        nearest = sorted(likely.items(), key=lambda entry: abs(np.log(entry[1] / COMMON)))
        words = [
            f"in {unit}, {self.prefix}file_scale = {UNITS[unit]:g} makes it {size:.3g} mm" for unit, size in nearest
        ]
        return f" (if the file is {'; '.join(words)})" if words else ""

    def advice(self, extent: np.ndarray, cells: np.ndarray) -> str:
        """Text that states the size of a pad, the centres of its cells, and the parameters that may correct its
        placement.

        Parameters
        ----------
        extent : (2, 3) array_like
            Lowest and highest coordinates of the pad, mm.
        cells : (K, 2, 3) array_like
            Lowest and highest coordinates of each of K cells, mm.
        """
        low, high = np.asarray(extent)
        shown = ", ".join(f"({x:.3g}, {y:.3g})" for x, y in np.mean(cells, axis=1)[:MOST_CENTRES, :2] + 0.0)
        more = ", ..." if len(cells) > MOST_CENTRES else ""
        words = f"the pad is {' x '.join(f'{size:.3g}' for size in high - low)} mm, with cells at {shown}{more} mm"
        if self.scale == 1:
            words += self.other_units(float((high - low).max()))
        middle = 0.5 * (low + high)[:2]
        if self.up == AS_DRAWN and np.abs(middle).max() > OFF_CENTRE * (high - low)[:2].max():
            words += f"; {self.prefix}file_up = 'z' centres it, from ({middle[0]:.3g}, {middle[1]:.3g})"
        return words


UNMOVED = Placement()
"""Placement of a file in mm whose geometry is neither turned nor moved."""
