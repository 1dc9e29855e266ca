"""Arcs of circles in the plane of a meridian (r, z)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Arc:
    """An arc of a circle in the plane (r, z), as a function of the angle from the r axis.

    Attributes
    ----------
    centre : (2,) ndarray
        Centre in mm.
    radius : float
        Radius in mm.
    ends : (2,) ndarray
        Ascending angles in radians.
    """

    centre: np.ndarray
    radius: float
    ends: np.ndarray

    def at(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Points of the arc and their derivatives, as :meth:`Meridian.at` returns them; ``u`` are angles in radians."""
        outwards = np.stack([np.cos(u), np.sin(u)], axis=1)
        along = np.stack([-np.sin(u), np.cos(u)], axis=1)
        return self.centre + self.radius * outwards, self.radius * along, -self.radius * outwards

    def nearest(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Nearest points of the whole circle to given points, in the form of :meth:`Meridian.nearest`."""
        away = points - self.centre
        distance = np.linalg.norm(away, axis=1)
        along = np.stack([-away[:, 1], away[:, 0]], axis=1) / distance[:, None]
        gradient = (self.radius / distance)[:, None, None] * along[:, :, None] * along[:, None, :]
        return np.arctan2(away[:, 1], away[:, 0]), gradient

    def covers(self, points: np.ndarray) -> np.ndarray:
        """Mask of the points whose direction from the centre lies within the angles of the arc.

        Parameters
        ----------
        points : (N, 2) ndarray
            (r, z) in mm.

        Returns
        -------
        (N,) ndarray of bool
            Mask of the points.
        """
        r, z = (points - self.centre).T
        low, high = np.stack([np.cos(self.ends), np.sin(self.ends)], axis=1)
        slack = -1e-9 * self.radius  # of points on the borders
        return (low[0] * z - low[1] * r >= slack) & (r * high[1] - z * high[0] >= slack)
