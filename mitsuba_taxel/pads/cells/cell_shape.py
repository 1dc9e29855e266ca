"""The interface of all shapes of cells."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.kinds import Kind
from mitsuba_taxel.pads.cells.mouth import Mouth, mouth
from mitsuba_taxel.parameters import Number

if TYPE_CHECKING:
    from mitsuba_taxel.pads.cells.fillet import Fillet

ON_FLAT_WALLS, ON_ROUND_WALLS = 1.6, 2.0
"""Divisors of the element size on the walls of cells: elements of curved walls are smaller, to follow the shape."""

Difference = Callable[[Callable[[Any], np.ndarray]], np.ndarray]
"""Function that returns the change of a function of the cell shape when the dimensions of the pad change."""


class Dimensions(Protocol):
    """Interface: the dimensions of a pad that determine the shape of its cells; see `Pad`."""

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
    def wall(self) -> float: ...
    @property
    def fillet(self) -> float: ...
    @property
    def mouth(self) -> Mouth | None: ...
    @property
    def extent(self) -> tuple[float, float, float]: ...


@dataclass(frozen=True, kw_only=True)
class LightSizes:
    """Element sizes at which the readings of loaded cells are accurate, relative to the default size of their pad.

    With them the error of readings is about 0.03 % for diffuse walls of domes, and 0.3 % for mirrors and rough mirrors
    (`taxel bench domes`).

    Attributes
    ----------
    diffuse : float or None
        Relative size for cells whose walls are all diffuse; None if the default size is accurate enough for them.
    mirrors : float
        Relative size for cells with a mirror or a glossy wall.
    mirrors_side_by_side : float
        Relative size for such cells in pads of several cells.
    """

    diffuse: float | None
    mirrors: float
    mirrors_side_by_side: float


FLAT_ROOF = LightSizes(diffuse=None, mirrors=0.5, mirrors_side_by_side=0.6)
"""Sizes for flat roofs. A mirror that a load bends acts as a lens. Its curvature is wrong by a third on elements of the
default size, and by some 2 to 4 % on these."""


class CellShape(Kind, family="cell"):
    """A shape of cells, with the dimensions of a pad.

    Lengths are in mm. Unless stated otherwise, positions are those of an upright cell whose mouth is centred at the
    origin of z = 0: the shear of leaning cells is applied afterwards. The meridian is the outline (r, z) of a cell on
    one side of its axis; for a square section it is taken at the middle of a side.

    Parameters
    ----------
    pad : Pad
        Dimensions of the pad.

    Attributes
    ----------
    default_height_words : str
        `default_height`, in words for lists of parameters.
    face_refinement : float
        Divisor of the element size on roof and side, such as `ON_ROUND_WALLS`.
    least_elements : int
        Smallest number of elements of a cell, however large they are.
    has_curved_rim : bool
        Whether a curved roof joins the side smoothly. Elements must then be small compared with the radii of curvature,
        or those along the rim would be distorted.
    finer_power : float
        On meshes finer than the default one, elements on a round roof have their default size times the relative
        element size of the mesh to this power.
    finer_inside : bool
        True if elements inside keep their default size on meshes finer than the default one.
    light_sizes : LightSizes or None
        Element sizes that light needs; None if the default size is accurate enough for walls of all kinds.
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
        """Height of cells whose `cell_height` is not set, mm."""

    @property
    @abstractmethod
    def side_height(self) -> float:
        """Height of the side wall, below the roof, mm."""

    @property
    def cell_height(self) -> float:
        """The parameter `cell_height` of the pad, in mm."""
        assert self.pad.cell_height is not None
        return self.pad.cell_height

    @property
    def radius(self) -> float:
        """Half the width of the cell's mouth at the board, in mm."""
        return 0.5 * self.pad.cell_size

    @property
    def top(self) -> float:
        """Height of the cell's highest point in mm."""
        return self.cell_height

    @property
    def dimensions(self) -> Mapping[str, float]:
        """Values, by name, of the continuous parameters that only this shape has."""
        own = {name: parameter for name, parameter in self.own_parameters().items() if isinstance(parameter, Number)}
        return {name: self.value(name) for name in own}

    def parameters_at(self, dimensions: Mapping[str, float]) -> dict[str, Any]:
        """Arguments with which a pad is constructed so that the shape's `dimensions` have new values.

        Parameters
        ----------
        dimensions : Mapping[str, float]
            New values of all `dimensions`, by name.

        Returns
        -------
        dict[str, Any]
            Arguments of a pad by name.
        """
        return dict(dimensions)

    def value(self, name: str) -> Any:
        """Value of a parameter that only this shape has.

        Parameters
        ----------
        name : str
            Name of the parameter.

        Returns
        -------
        Any
            The value set for the pad, or the default.
        """
        return getattr(self.pad, name)

    def check(self) -> None:
        """Refuse values of the shape's own parameters that are not allowed.

        Raises
        ------
        InputError
            if a value is not allowed.
        """

    def check_side(self, least: float) -> None:
        """Raise `InputError` if the side wall is lower than a limit.

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
        """Whether horizontal sections are squares; otherwise they are circles."""

    @property
    @abstractmethod
    def round_regions(self) -> tuple[str, ...]:
        """Names of the curved regions, ``roof`` and ``side``, in this order; empty if both are flat."""

    @property
    @abstractmethod
    def has_sharp_rim(self) -> bool:
        """Whether roof and side meet at an edge, where the stress is singular."""

    @property
    @abstractmethod
    def has_ridges(self) -> bool:
        """Whether the roof has edges, at which its walls meet."""

    @property
    @abstractmethod
    def roof_radius(self) -> float | None:
        """Radius of the sphere of a roof above a vertical side, infinite if it is flat, mm; None for other cells."""

    @abstractmethod
    def onto_wall(
        self, region: str, points: np.ndarray, axis: np.ndarray, beside: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Project points onto a curved wall.

        Parameters
        ----------
        region : str
            One of `round_regions`.
        points : (N, 3) ndarray
            Points near the wall, in the frame of the pad, mm.
        axis : (N, 3) ndarray
            For each point, the position of its cell's axis at z = 0.
        beside : (N, 3) ndarray, optional
            For each point, a neighbour on the same wall. Points on the edges of a square section belong to two walls;
            the neighbour decides.

        Returns
        -------
        projected : (N, 3) ndarray
            The nearest positions on the wall, in the frame of the pad, mm.
        gradient : (N, 3, 3) ndarray
            Derivative of the projected positions with respect to the points.
        """

    def rounded(self, points: np.ndarray, axis: np.ndarray, on: Mapping[str, np.ndarray]) -> np.ndarray:
        """Move the nodes of a mesh that lie on curved walls exactly onto these walls.

        Parameters
        ----------
        points, axis : (N, 3) ndarray
            See :meth:`onto_wall`.
        on : Mapping[str, (N,) ndarray]
            For each of the regions ``roof``, ``side`` and ``bottom``, whether a node lies on it.

        Returns
        -------
        (N, 3) ndarray
            All nodes, mm.
        """
        points = points.copy()
        for name in self.round_regions:
            points[on[name]] = self.onto_wall(name, points[on[name]], axis[on[name]], None)[0]
        return points

    def filleted(self, radius: float) -> Fillet:
        """Create the rounded edges (fillets) inside the cell.

        Parameters
        ----------
        radius : float
            Radius of the fillets, mm.

        Returns
        -------
        Fillet
            Fillets, with lengths in mm.

        Raises
        ------
        InputError
            if edges of this shape cannot be rounded, or not by this radius.
        """
        raise InputError(
            f"fillet = {radius:g} is not allowed: the edges of these {self.name} cells cannot be rounded, 0 is needed."
        )

    def mouth(self, radius: float, beside: float) -> Mouth:
        """Round the edge of the cell's mouth, at the bottom of the pad.

        Parameters
        ----------
        radius : float
            Radius of the fillet, mm.
        beside : float
            Thickness of the silicone beside the mouth that belongs to this cell, mm.

        Returns
        -------
        Mouth
            The fillet, with lengths in mm.

        Raises
        ------
        InputError
            if the mouth of this shape cannot be rounded, or not by this radius.
        """
        fillet = self.pad.fillet
        straight = float(self.filleted(fillet).outline()[-2, 1]) if fillet else self.side_height
        inwards, down = self.wall_tangents()[0]
        corner = fillet if self.is_square else None
        return mouth("mouth_fillet", self.radius, radius, float(inwards / down), corner, straight, beside)

    @abstractmethod
    def holds(self, points: np.ndarray, slack: float) -> np.ndarray:
        """Mask of the points that lie inside the hollow of the cell.

        Parameters
        ----------
        points : (N, M, 3) ndarray
            N x M points relative to the middle of the mouth, mm.
        slack : float
            Required distance from the wall, mm.

        Returns
        -------
        (N, M) ndarray of bool
            Whether each point lies within, more than ``slack`` from the wall.
        """

    # Solids and meshes.

    @abstractmethod
    def solid(self, x: float, y: float) -> Any:
        """The cell as a solid, with faces named ``roof`` and ``side``.

        It extends below the board, so that cutting it out of the pad leaves a clean rim.

        Parameters
        ----------
        x, y : float
            Position of the axis of the cell on the board, mm.

        Returns
        -------
        netgen.occ.TopoDS_Shape
            The solid.
        """

    @abstractmethod
    def shifts(self, target: Any, points: np.ndarray, difference: Difference) -> np.ndarray:
        """Displacements of points of the silicone when the dimensions of a pad with upright cells change.

        A point on a wall stays on it, at the same relative position; the outside of the pad moves with its extent. See
        `shifts_between_planes` and `shifts_along_rays`.

        Parameters
        ----------
        target : CellShape
            The same shape with the new dimensions.
        points : (N, 3) ndarray
            Points of the silicone, mm.
        difference : Callable
            ``difference(f)`` returns f(target) - f(self) without loss of digits. Use it instead of a subtraction where
            positions are not linear in the dimensions, because rates are computed from small changes.

        Returns
        -------
        (N, 3) ndarray
            Displacement of each point, mm.
        """

    # Drawings and moulds.

    def as_profile(self, points: int) -> np.ndarray:
        """Points of the equivalent profile; see `Pad.as_profile`.

        Parameters
        ----------
        points : int
            Number of points.

        Returns
        -------
        (points, 2) ndarray
            r and z, relative to `radius` and `top`, from the rim to the crown.

        Raises
        ------
        InputError
            if the shape has no equivalent profile.
        """
        names = [name for name, kind in CellShape.kinds().items() if kind.as_profile is not CellShape.as_profile]
        raise InputError(
            f"cell = {self.name!r} is not allowed: it cannot be written as a profile; one of {', '.join(names)} is "
            "needed."
        )

    @abstractmethod
    def outline(self) -> np.ndarray:
        """The outline (r, z) of the cell on one side of its axis, from the middle of the roof to the board.

        Returns
        -------
        (M, 2) ndarray
            Points (r, z) of the meridian, mm.
        """

    def section(self) -> np.ndarray:
        """Outline of the wall in the x-z plane, for cells that lean in this plane.

        Returns
        -------
        (M, 2) ndarray
            Points (x, z) from the board over the roof to the board, relative to the middle of the mouth, mm.
        """
        half = self.filleted(self.pad.fillet).outline() if self.pad.fillet else self.outline()
        if self.pad.mouth is not None:
            half = np.concatenate([half[:-1], self.pad.mouth.outline()])
        outline = np.concatenate([half[::-1] * [-1, 1], half])
        return outline + outline[:, 1:] * [self.pad.slope[0], 0.0]

    @abstractmethod
    def wall_tangents(self) -> np.ndarray:
        """Tangents of the cell's outline, downwards, for the draft angles of the mould.

        Returns
        -------
        (N, 2) ndarray
            The tangent of the side first; then, if the roof must release from the mould as well, those along the roof.
            Their lengths are arbitrary.
        """

    @abstractmethod
    def bend_radii(self) -> np.ndarray:
        """Radii of curvature of the roof, sheared if it leans, along its meridian. The rim is left out.

        Returns
        -------
        (N,) ndarray
            Radii in mm; empty if the roof is flat.
        """

    @abstractmethod
    def view_angles(self) -> np.ndarray:
        """Angles, at N points of the roof, between its surface and the rays to them from the middle of the mouth.

        An angle of 0 or less means that the ray does not reach the point from inside the cell.

        Returns
        -------
        (N,) ndarray
            Angles in degrees; empty for shapes whose whole roof is always seen from there.
        """
