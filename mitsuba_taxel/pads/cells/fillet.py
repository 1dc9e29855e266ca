"""Rounded edges of cells: the interface, and the limits of their radius.

The cell of a filleted pad is the region that a ball of the fillet's radius can reach within the sharp cell; silicone
fills the rest. Fillets belong to the side."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from mitsuba_taxel.base.errors import InputError

LEAST, MOST = 0.01, 0.8
"""Least radius of a fillet, relative to the size of a cell; largest length that a fillet covers, relative to half of
the roof and to the side."""
FILLET = "fillet"
"""Name of the faces of solids that are fillets."""
ARC_POINTS = 17
"""Number of points of the outline of a fillet."""


class Fillet(ABC):
    """Interface of the rounded edges of an upright cell, whose mouth is centred at the origin."""

    @abstractmethod
    def onto_wall(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Project points on or near the wall, sharp or rounded, onto the rounded wall.

        Parameters
        ----------
        points : (N, 3) ndarray
            Positions in mm.

        Returns
        -------
        projected : (N, 3) ndarray
            Projected positions in mm.
        gradient : (N, 3, 3) ndarray
            Derivative of the projected positions with respect to the points.
        """

    @abstractmethod
    def holds(self, points: np.ndarray, slack: float) -> np.ndarray:
        """Mask of those points of the sharp-edged cell that also lie within the rounded cell.

        Parameters
        ----------
        points : (N, M, 3) ndarray
            Points within the sharp cell, mm.
        slack : float
            Required distance from the wall, mm.

        Returns
        -------
        (N, M) ndarray of bool
            Mask of the points.
        """

    @abstractmethod
    def outline(self) -> np.ndarray:
        """The meridian of the rounded cell, in the form of :meth:`CellShape.outline` of the cell with sharp edges."""

    @abstractmethod
    def solid(self, x: float, y: float, below: float) -> Any:
        """The rounded cell as a solid, with faces named ``roof``, ``fillet`` and ``side``.

        Parameters
        ----------
        x, y : float
            Position of its axis on the board, mm.
        below : float
            Lowest z of the solid, mm.

        Returns
        -------
        netgen.occ.TopoDS_Shape
            The solid.
        """


def refused(
    radius: float, size: float, largest: float, name: str = "fillet", beside: str = "half the roof and of the side"
) -> InputError:
    """Create the error for a radius of rounded edges (a fillet) that is not allowed.

    Parameters
    ----------
    radius : float
        The radius, mm.
    size : float
        Width of the mouth, mm.
    largest : float
        Largest allowed radius, mm.
    name : str
        Name of the parameter.
    beside : str
        Reason for the limit of the radius, in words.

    Returns
    -------
    InputError
        Error for the caller to raise.
    """
    digits = 3 - math.ceil(math.log10(largest))
    largest = math.floor(largest * (1 + 1e-9) * 10.0**digits) / 10.0**digits
    return InputError(
        f"{name} = {radius:g} is not allowed: 0 for sharp edges, or {LEAST * size:.3g} to {largest:g} mm is needed, "
        f"{LEAST:.0%} of cell_size to {MOST:.0%} of {beside}."
    )
