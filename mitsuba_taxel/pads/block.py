"""A pad without cells: a block, glued to a clear plate, whose coated top a camera sees from inside."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import numpy as np

from mitsuba_taxel.base.display import Displayed
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.processes.activities import activity
from mitsuba_taxel.pads.parametric.pad import Pad
from mitsuba_taxel.parameters import REQUIRED, Checked, field_of, number

if TYPE_CHECKING:
    from mitsuba_taxel.geometry.volume_mesh import VolumeMesh

ELEMENTS_ALONG = 0.3
"""Default size of the finite elements, relative to the smallest side of the block."""
LOWEST_CORNER = 0.1
"""Least height of the corners of a domed top, relative to the height of the block."""


@dataclass(frozen=True)
class Block(Checked, Displayed):
    """A block of silicone without cells (all lengths in mm).

    The bottom at z = 0 is glued to a clear plate and is the window; the centre is x = y = 0. The top is coated, and a
    camera sees it from inside: it is a plane, or part of a sphere with its highest point above the centre. The other
    faces are outside faces.

    Raises
    ------
    InputError
        if a value is not finite or out of range, or the corners below a domed top would be too low.
    """

    width: float = number(REQUIRED, "mm", "Side of the block along x.", above=0, common=(0.5, 500))
    depth: float = number(REQUIRED, "mm", "Side of the block along y.", above=0, common=(0.5, 500))
    height: float = field_of(Pad, "height")
    top_radius: float | None = number(
        None,
        "mm",
        "Radius of the sphere of a domed top; the corners of the block must be at least a tenth of its height.",
        above=0,
        common=(0.5, 5000),
        default_words="a plane top",
    )

    def _check(self) -> None:
        if self.top_radius is None:
            return
        corner, lowest = 0.5 * math.hypot(self.width, self.depth), LOWEST_CORNER * self.height
        # The sagitta s of a chord of half length c: R = (c^2 + s^2) / (2 s).
        most = self.height - lowest
        least = (corner**2 + most**2) / (2 * most) if most < corner else corner
        if self.top_radius < least:
            raise InputError(
                f"top_radius = {self.top_radius:g} is not allowed: at least {least:.4g} mm is needed for a block of "
                f"{self.width:g} x {self.depth:g} mm, so that its corners are at least {lowest:.3g} mm high."
            )

    @property
    def extent(self) -> tuple[float, float, float]:
        """Outer dimensions of the block along x, y and z, in mm."""
        return self.width, self.depth, self.height

    @property
    def identity(self) -> dict[str, object]:
        """Values that identify the block and its meshes, as JSON values."""
        return {"cell": "none"} | asdict(self)

    @property
    def default_mesh_size(self) -> float:
        """Default size of the finite elements in mm, rounded to three digits."""
        return float(f"{ELEMENTS_ALONG * min(self.extent):.3g}")

    def top_at(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Height of the undeformed top.

        Parameters
        ----------
        x, y : (N,) ndarray
            Positions within the block, mm.

        Returns
        -------
        (N,) ndarray
            Height of the top at each position, in mm.
        """
        if self.top_radius is None:
            return np.full(np.shape(x), self.height)
        return self.height - (x**2 + y**2) / (self.top_radius + np.sqrt(self.top_radius**2 - x**2 - y**2))

    def mesh(self, mesh_size: float) -> VolumeMesh:
        """The block's volume mesh; see `mesh_block`.

        Parameters
        ----------
        mesh_size : float
            Length of the edges of elements, mm.

        Returns
        -------
        VolumeMesh
            Undeformed quadratic tetrahedra with tagged faces.

        Raises
        ------
        InputError
            if the size is not allowed.
        ComputationError
            if an element is too distorted.
        """
        from mitsuba_taxel.pads.block_meshing import mesh_block

        with activity(f"meshing, elements of {mesh_size:.3g} mm"):
            return mesh_block(self, mesh_size)
