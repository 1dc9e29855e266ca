"""What every shape of cells must tell."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.kinds import Kind
from mitsuba_taxel.parameters import Number

ON_FLAT_WALLS, ON_ROUND_WALLS = 1.6, 2.0
"""Divisors of the size of elements on the walls of cells: on curved ones the error of shape matters as well."""

Difference = Callable[[Callable[[Any], np.ndarray]], np.ndarray]
"""Change of what a function gives of a cell shape, as the dimensions of the pad change."""


class Dimensions(Protocol):
    """What a cell shape knows of its pad: see `Pad`."""

    @property
    def rows(self) -> int: ...
    @property
    def columns(self) -> int: ...
    @property
    def pitch(self) -> float: ...
    @property
    def height(self) -> float: ...
    @property
    def cell_size(self) -> float: ...
    @property
    def cell_height(self) -> float | None: ...
    @property
    def profile(self) -> str | None: ...
    @property
    def section(self) -> str | None: ...
    @property
    def slope(self) -> tuple[float, float]: ...
    @property
    def extent(self) -> tuple[float, float, float]: ...


@dataclass(frozen=True, kw_only=True)
class LightSizes:
    """Sizes of elements of loaded cells for accurate readings, relative to the default size of their pad.

    Diffuse walls are within 0.03 % then, mirrors and rough mirrors within 0.3 % (`taxel bench domes`).

    Attributes
    ----------
    diffuse, mirrors : float
        Where walls are diffuse; where one is a mirror, or glossy.
    mirrors_side_by_side : float
        The latter in pads of several cells.
    """

    diffuse: float
    mirrors: float
    mirrors_side_by_side: float


class CellShape(Kind, family="cell"):
    """A shape of cells, with the dimensions of a pad.

    Lengths are in mm. Places are those of an upright cell, which stands with its mouth on z = 0, unless others are
    named: what leans is sheared afterwards. A meridian is the outline of a cell on one side of its axis, as places
    (r, z); that of a square section is at the middle of a side.

    Parameters
    ----------
    pad : Pad
        Its dimensions.

    Attributes
    ----------
    default_height_words : str
        `default_height`, in words for lists of parameters.
    face_refinement : float
        Divisor of the size of elements on roof and side, such as `ON_ROUND_WALLS`.
    least_elements : int
        Number of elements that a cell has at least, however large they may be.
    has_curved_rim : bool
        Whether elements must be small compared with the radii of curvature, as those along the rim of a roof that goes
        over into the side would be distorted.
    finer_power : float
        Power of the share by which elements on a round roof are smaller on finer meshes than the default one.
    finer_inside : bool
        Whether elements inside stay as large as they are on the default mesh then.
    light_sizes : LightSizes or None
        None if the default size is accurate enough for light.
    """

    default_height_words: ClassVar[str]
    face_refinement: ClassVar[float]
    least_elements: ClassVar[int]
    has_curved_rim: ClassVar[bool]
    light_sizes: ClassVar[LightSizes | None]
    finer_power: ClassVar[float] = 1.0
    finer_inside: ClassVar[bool] = False

    def __init__(self, pad: Dimensions) -> None:
        self.pad = pad

    # Dimensions.

    @property
    @abstractmethod
    def default_height(self) -> float:
        """Height of cells of which none is given, mm."""

    @property
    @abstractmethod
    def side_height(self) -> float:
        """Height of the side wall, below the roof, mm."""

    @property
    def cell_height(self) -> float:
        """That of the pad, mm."""
        assert self.pad.cell_height is not None
        return self.pad.cell_height

    @property
    def radius(self) -> float:
        """Half the width of the mouth, mm."""
        return 0.5 * self.pad.cell_size

    @property
    def top(self) -> float:
        """Height of the highest point, mm."""
        return self.cell_height

    @property
    def dimensions(self) -> Mapping[str, float]:
        """Values of the shape's own that change continuously, by name: its parameters that are numbers."""
        own = {name: parameter for name, parameter in self.own_parameters().items() if isinstance(parameter, Number)}
        return {name: self.value(name) for name in own}

    def parameters_at(self, dimensions: Mapping[str, float]) -> dict[str, Any]:
        """The pad's parameters for other values of all `dimensions`.

        Parameters
        ----------
        dimensions : Mapping[str, float]
            Values by name, of all `dimensions`.

        Returns
        -------
        dict[str, Any]
            Arguments of a pad by name.
        """
        return dict(dimensions)

    def value(self, name: str) -> Any:
        """Value of a parameter of the shape's own.

        Parameters
        ----------
        name : str
            One of the shape's own parameters.

        Returns
        -------
        Any
            As given to the pad, or its default.
        """
        return getattr(self.pad, name)

    def check(self) -> None:
        """Refuse values of the shape's own parameters.

        Raises
        ------
        InputError
            if one is not allowed.
        """

    def check_side(self, least: float) -> None:
        """Refuse a side wall that is too low.

        Parameters
        ----------
        least : float
            Least height of the side wall, mm.

        Raises
        ------
        InputError
            if it is lower.
        """
        if self.side_height < least:
            raise InputError(
                f"cell_height = {self.top:g} is not allowed: at least {self.top - self.side_height + least:g} mm is "
                f"needed, more than the {self.name} roof alone."
            )

    # Walls.

    @property
    @abstractmethod
    def is_square(self) -> bool:
        """Whether horizontal sections are squares, else they are circles."""

    @property
    @abstractmethod
    def round_regions(self) -> tuple[str, ...]:
        """Which of ``roof`` and ``side`` are curved, in this order."""

    @property
    @abstractmethod
    def has_sharp_rim(self) -> bool:
        """Whether roof and side meet at an edge, where the stress is singular."""

    @property
    @abstractmethod
    def has_ridges(self) -> bool:
        """Whether walls of the roof meet at edges."""

    @property
    @abstractmethod
    def roof_radius(self) -> float | None:
        """Radius of the sphere of a roof above a vertical side, infinite if it is flat, mm; None for other cells."""

    @abstractmethod
    def onto_wall(
        self, region: str, points: np.ndarray, axis: np.ndarray, beside: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Points put onto the nearest place of a curved wall.

        Parameters
        ----------
        region : str
            One of `round_regions`.
        points : (N, 3) ndarray
            Near the wall, in the frame of the pad.
        axis : (N, 3) ndarray
            Where the axis of the cell of each point meets z = 0.
        beside : (N, 3) ndarray, optional
            Points near by that tell which wall each of those is on that lie on the edges of a square section.

        Returns
        -------
        places : (N, 3) ndarray
            On the wall, in the frame of the pad, mm.
        gradient : (N, 3, 3) ndarray
            Derivative of the places by the points.
        """

    def rounded(self, points: np.ndarray, axis: np.ndarray, on: Mapping[str, np.ndarray]) -> np.ndarray:
        """Nodes of a mesh, those on curved walls moved exactly onto them.

        Parameters
        ----------
        points, axis : (N, 3) ndarray
            As for :meth:`onto_wall`.
        on : Mapping[str, (N,) ndarray]
            Whether nodes lie on the regions ``roof``, ``side`` and ``bottom``.

        Returns
        -------
        (N, 3) ndarray
            All nodes, mm.
        """
        points = points.copy()
        for name in self.round_regions:
            points[on[name]] = self.onto_wall(name, points[on[name]], axis[on[name]], None)[0]
        return points

    @abstractmethod
    def holds(self, points: np.ndarray, slack: float) -> np.ndarray:
        """Which points lie within the cell.

        Parameters
        ----------
        points : (N, M, 3) ndarray
            Relative to the middle of the mouth, mm.
        slack : float
            Distance from the wall from which on a point counts as within, mm.

        Returns
        -------
        (N, M) ndarray of bool
            Whether each point lies more than ``slack`` within.
        """

    # Solids and meshes.

    @abstractmethod
    def solid(self, x: float, y: float) -> Any:
        """A cell as a solid, with faces named ``roof`` and ``side``.

        It reaches below the board, so that cutting it leaves a clean rim.

        Parameters
        ----------
        x, y : float
            Where its axis meets the board, mm.

        Returns
        -------
        netgen.occ.TopoDS_Shape
            The solid.
        """

    @abstractmethod
    def shifts(self, other: Any, points: np.ndarray, difference: Difference) -> np.ndarray:
        """Shifts of the silicone from a pad with upright cells to one of other dimensions.

        A point of a wall stays on it, at the same relative position; the outside of the pad moves with its extent. See
        `between_planes` and `along_rays`.

        Parameters
        ----------
        other : CellShape
            The same shape with the other dimensions.
        points : (N, 3) ndarray
            Of the silicone.
        difference : Callable
            Gives the change from this to the other of what a function of the shape returns; use it where shifts are no
            linear function of dimensions, as those are small where rates are computed.

        Returns
        -------
        (N, 3) ndarray
            By which each point moves, mm.
        """

    # Drawings and moulds.

    def as_profile(self, points: int) -> np.ndarray:
        """Points of the equivalent profile; see `Pad.as_profile`.

        Parameters
        ----------
        points : int
            How many.

        Returns
        -------
        (points, 2) ndarray
            r and z, relative to `radius` and `top`, from the rim to the crown.

        Raises
        ------
        InputError
            if there is no such profile.
        """
        raise InputError(f"cell = {self.name!r} is not allowed here: it has no equivalent profile.")

    @abstractmethod
    def outline(self) -> np.ndarray:
        """The meridian from the middle of the roof to the board.

        Returns
        -------
        (M, 2) ndarray
            Its points (r, z), mm.
        """

    def section(self) -> np.ndarray:
        """The wall in the plane along x in which the cell leans.

        Returns
        -------
        (M, 2) ndarray
            Its points (x, z) from the board to the board, relative to the middle of the mouth, mm.
        """
        right = self.outline()
        both = np.concatenate([right[::-1] * [-1, 1], right])
        return both + both[:, 1:] * [self.pad.slope[0], 0.0]

    @abstractmethod
    def wall_tangents(self) -> np.ndarray:
        """Tangents of the meridian, downwards.

        Returns
        -------
        (N, 2) ndarray
            Those of the side and, if a mould must be able to leave it too, along the roof; of any length.
        """

    @abstractmethod
    def bend_radii(self) -> np.ndarray:
        """Radii of curvature of the leaning roof along its meridian; its rim does not count.

        Returns
        -------
        (N,) ndarray
            In mm; empty if the roof is flat.
        """

    @abstractmethod
    def view_angles(self) -> np.ndarray:
        """Angles between the roof and rays to it from the middle of the mouth.

        Returns
        -------
        (N,) ndarray
            In degrees; empty for a shape of which none can be 0.
        """
