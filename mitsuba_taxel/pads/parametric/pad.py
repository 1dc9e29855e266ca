"""The dimensions of a pad."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from statistics import mode
from typing import TYPE_CHECKING, Any, ClassVar

from mitsuba_taxel.base.arguments import as_numbers, check_whole
from mitsuba_taxel.base.display import Displayed
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.processes.activities import activity
from mitsuba_taxel.base.sources import own_code
from mitsuba_taxel.pads.cells import CellShape, Shaft
from mitsuba_taxel.pads.cells.meridian import as_text
from mitsuba_taxel.pads.cells.profile import MOST_POINTS, Profile
from mitsuba_taxel.pads.parametric.outside import Outside, outside
from mitsuba_taxel.parameters import REQUIRED, Kinded, Points, choice, kind, number, parameter_field, text, whole

if TYPE_CHECKING:
    from typing_extensions import Self

    from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
    from mitsuba_taxel.pads.cells.fillet import Fillet
    from mitsuba_taxel.pads.cells.mouth import Mouth

CELL_SHAPES = tuple(name for name, shape in CellShape.kinds().items() if issubclass(shape, Shaft))
"""The shapes with a vertical side: those of the paper."""
LENGTHS = ("pitch", "wall", "height", "cell_size", "cell_height", "top_x", "top_y")
"""Names of the dimensions of all pads."""
FILLETS = ("fillet", "mouth_fillet", "outer_fillet")
"""Names of the dimensions that are radii of rounded edges, and 0 for sharp ones."""

DEFAULT_MESH_SIZE = 1.25
"""Default size of the finite elements, in mm, for a pad with cells and walls like the paper's."""
TYPICAL_CELL, TYPICAL_THICKNESS = 2.55, 1.0
"""Side of a cell, and least thickness of the silicone beside or above it, of such a pad, in mm."""

MIN_THICKNESS = 0.01
"""Least thickness of a wall or roof, relative to the cell size."""
LARGEST_LEAN = 0.5
"""Largest shift of a roof, relative to the wall: elements beside it may fold if squeezed more."""


def _default_heights() -> str:
    """Text for the documentation: the default height of cells, first the most common one, then the exceptions by shape.
    """
    words = {name: shape.default_height_words for name, shape in CellShape.kinds().items()}
    usual = mode(words.values())
    return "; ".join([usual, *(f"{name} {height}" for name, height in words.items() if height != usual)])


@dataclass(frozen=True)
class Pad(Kinded, Displayed):
    """A block of silicone with a grid of hollow cells, open towards the board (all lengths in mm).

    The bottom is z = 0 and the centre x = y = 0. Columns run along +x, rows from +y to -y; cells are numbered
    from 1, row by row, beginning at (-x, +y). A spherical cell is a cylinder closed by the cap of a sphere of radius
    `cell_size`, a hemispheric one a cylinder closed by half a sphere; a frustum is a cone with a flat roof. A cell with
    a profile is a solid of revolution, of a straight side wall and any smooth roof, or has such walls on the four sides
    of a square section. All may lean, with their roofs off the axes.

    Raises
    ------
    InputError
        If a value is not finite or out of range, if cells overlap, or if a cell breaks through the top.

    Notes
    -----
    The defaults are the dimensions given in section 2.2.2 of "Multiphysics Simulation for the Optimization of an
    Optoelectronic-Based Tactile Sensor".
    """

    cell: str = kind("parallelepiped", CellShape, "Shape of the cells.")
    rows: int = whole(3, 1, 100, "Rows of cells, from +y to -y.")
    columns: int = whole(3, 1, 100, "Columns of cells, along +x.")
    pitch: float = number(3.55, "mm", "Distance between the centres of neighbouring cells.", above=0, common=(0.2, 200))
    wall: float = number(
        1.0, "mm", "Thickness of silicone between an outermost cell and the outside.", above=0, common=(0.02, 100)
    )
    height: float = number(
        4.55, "mm", "Height of the pad, from its bottom to the loaded top.", above=0, common=(0.2, 200)
    )
    cell_size: float = number(2.55, "mm", "Side or diameter of a cell.", above=0, common=(0.1, 100))
    cell_height: float | None = number(
        None,
        "mm",
        "Height of the highest point of a cell above the board, or of z = 1 of a profile.",
        above=0,
        common=(0.05, 100),
        default_words=_default_heights(),
    )
    profile: str | None = parameter_field(
        Points(
            default=REQUIRED,
            doc="Points 'r z', separated by ';', of the B-spline that the roof follows, from its rim to the crown on "
            "the axis, where r = 0; r is relative to half of `cell_size`, z, from the board, to `cell_height`, such "
            "as 1 0.28; 1 0.64; 0 1, a hemisphere. The whole roof must be seen from the middle of the cell's opening.",
            when=("cell",),
        )
    )
    section: str | None = choice(
        "round",
        {"round": "a solid of revolution", "square": "r is half its side, and walls are cylinders that meet at edges"},
        "Horizontal section of a cell with a profile.",
        when=("cell",),
    )
    top_x: float = number(
        0.0,
        "mm",
        "Lean of all cells along x: their walls are sheared in proportion to the height, by this length at "
        "`cell_height`. At least half of `wall` must remain beside their highest point.",
    )
    top_y: float = number(0.0, "mm", "Lean of all cells along y, as `top_x`.")
    meshed_as: str = text(
        "",
        "Dimensions of another such pad, 'name=value', separated by commas, whose mesh is moved onto this one: pads "
        "with the same origin have the same elements, so that results do not jump. Names are those of this list, and "
        "profile_r1, profile_z1 and so on; dimensions that are not named are those of this pad.",
        default_words="a mesh of its own",
    )
    fillet: float = number(
        0.0,
        "mm",
        "Radius of the rounded edge between roof and side, and of the upright edges of a parallelepiped; 0 for sharp "
        "edges. Fillets belong to the side, and are sheared with cells that lean.",
        minimum=0,
        common=(0.005, 20),
    )
    mouth_fillet: float = number(
        0.0,
        "mm",
        "Radius of the rounded edge of the mouth of cells, between the side and the bottom; 0 for sharp edges. The "
        "silicone below it is missing: the pad is glued to the board from the end of the fillet on, and the fillet "
        "belongs to the side. `cell_size` is the width above the fillet, as if the side went on down to the board.",
        minimum=0,
        common=(0.005, 20),
    )
    outer_fillet: float = number(
        0.0,
        "mm",
        "Radius of the rounded edges of the outside of the pad, upright and around the top, which becomes smaller; 0 "
        "for sharp edges. The edges at the board remain sharp.",
        minimum=0,
        common=(0.005, 20),
    )

    _height_follows: ClassVar[bool] = False
    """Whether `cell_height` is not set, and is the default height."""

    def _check(self) -> None:
        if self.cell_height is None:
            object.__setattr__(self, "_height_follows", True)
            object.__setattr__(self, "cell_height", self.shape.default_height)
        self.shape.check()
        self._check_fit()
        if self.meshed_as:
            self._read_origin()

    def _check_fit(self) -> None:
        thinnest = MIN_THICKNESS * self.cell_size
        if self.wall < thinnest:
            raise InputError(
                f"wall = {self.wall:g} is not allowed: at least {thinnest:g} mm is needed, "
                f"{MIN_THICKNESS:.0%} of cell_size."
            )
        for name in ("top_x", "top_y"):
            assert self.cell_height is not None
            most = LARGEST_LEAN * self.wall * self.cell_height / self.top_of_cell
            if abs(getattr(self, name)) > most:
                raise InputError(
                    f"{name} = {getattr(self, name):g} is not allowed: at most {most:.3g} mm to either side is needed, "
                    f"so that {1 - LARGEST_LEAN:.0%} of wall = {self.wall:g} is left."
                )
        if self.rows * self.columns > 1 and self.pitch < self.cell_size + thinnest:
            raise InputError(
                f"pitch = {self.pitch:g} is not allowed: at least {self.cell_size + thinnest:g} mm is needed for "
                f"cell_size = {self.cell_size:g}, or the cells overlap."
            )
        if self.height < self.top_of_cell + thinnest:
            raise InputError(
                f"cell_height = {self.top_of_cell:g} is not allowed: at most {self.height - thinnest:g} mm is "
                f"possible in a pad of height = {self.height:g}, or the cells break through the top."
            )
        self.shape.check_side(thinnest)
        if self.fillet:
            self.shape.filleted(self.fillet)
        _ = self.outside, self.mouth  # raise if they do not fit
        if self.mouth_fillet and self.shape.is_square and not self.fillet:
            raise InputError(
                f"mouth_fillet = {self.mouth_fillet:g} is not allowed with fillet = 0: {self.cell} cells whose mouth "
                "is rounded need rounded upright edges, too."
            )

    def changed(self, **dimensions: Any) -> Pad:
        """The pad with other dimensions, as named in `dimensions`; an unset `cell_height` takes its new default.

        Parameters
        ----------
        **dimensions : Any
            New values by the name of a parameter of the pad or of its cells, lengths in mm.

        Returns
        -------
        Pad
            A new pad; the original pad is unchanged.

        Raises
        ------
        InputError
            if the pad is not possible with these values.
        TypeError
            if there is no such parameter.
        """
        follows: dict[str, Any] = {"cell_height": None} if self._height_follows else {}
        shape_dimensions = {name: dimensions.pop(name, value) for name, value in self.shape.dimensions.items()}
        if shape_dimensions:
            dimensions = self.shape.parameters_at(shape_dimensions) | dimensions
        return replace(self, **follows | dimensions)

    def as_profile(self, points: int = 4) -> Pad:
        """The same pad with the outline of its cells given by control points, as a cell ``profile``.

        Horizontal sections of parallelepipeds stay square, those of other cells round.

        Parameters
        ----------
        points : int
            Number of control points, from 3 on.

        Returns
        -------
        Pad
            Pad with the cell ``profile``; a pad that has such cells already is returned unchanged.

        Raises
        ------
        InputError
            if ``points`` is not allowed, or cells of this shape have no equivalent profile.
        """
        check_whole("points", points, 3, MOST_POINTS)
        if self.cell == Profile.name:
            return self
        profile = as_text(self.shape.as_profile(points))
        section = "square" if self.shape.is_square else "round"
        return replace(self, cell=Profile.name, profile=profile, section=section, meshed_as="", kind_values=())

    @property
    def origin(self) -> Pad | None:
        """The pad whose mesh is moved onto this pad; None if this pad has a mesh of its own dimensions."""
        return self._read_origin() if self.meshed_as else None

    def _read_origin(self) -> Pad:
        dimensions = {}
        for entry in self.meshed_as.split(","):
            name, _, word = (text.strip() for text in entry.partition("="))
            value = as_numbers([word])
            if name not in self.dimensions or value is None:
                raise InputError(
                    f"meshed_as = {self.meshed_as!r} is not allowed: 'name=value' of dimensions, separated by commas, "
                    f"is needed; names are {', '.join(self.dimensions)}."
                )
            if name in FILLETS[1:] and not value[0]:
                raise InputError(f"meshed_as: {name} = 0 is not allowed: a length above 0 is needed, as for this pad.")
            dimensions[name] = value[0]
        try:
            return replace(self, meshed_as="").changed(**dimensions)
        except InputError as refused:
            raise InputError(f"meshed_as: {refused}") from refused

    def moved_from(self, origin: Pad) -> Pad:
        """The same pad, with a mesh that is made by moving the mesh of the pad ``origin``. If that mesh was itself
        moved, the first pad of the chain counts.

        Parameters
        ----------
        origin : Pad
            Pad with the same cells, number of taxels and parameters, except for dimensions.

        Returns
        -------
        Pad
            Pad with the dimensions of this pad.
        """
        if origin.meshed_as:
            return replace(self, meshed_as=origin.meshed_as)
        return replace(self, meshed_as=", ".join(f"{name}={value!r}" for name, value in origin.dimensions.items()))

    @property
    def dimensions(self) -> dict[str, float]:
        """Values that change continuously: lengths in mm, and r and z of each point of a profile, as ``profile_r1``.

        Sharp edges have no fillet that could become smaller."""
        fillets = {name: getattr(self, name) for name in FILLETS if getattr(self, name)}
        return {name: getattr(self, name) for name in LENGTHS} | fillets | dict(self.shape.dimensions)

    @property
    def shape(self) -> CellShape:
        """The shape of the cells: an object that knows these dimensions and computes walls, solids and outlines."""
        return CellShape.named(self.cell)(self)

    @property
    def edges(self) -> Fillet | None:
        """The rounded edges (fillet) of an upright cell; None if its edges are sharp."""
        return self.shape.filleted(self.fillet) if self.fillet else None

    def with_fillet(self, radius: float) -> Self:
        """The same pad with another fillet, and a mesh that is not moved from another pad.

        Parameters
        ----------
        radius : float
            Radius of its fillets, mm; 0 for sharp edges.

        Returns
        -------
        Pad
            A new pad.
        """
        return replace(self, fillet=radius, meshed_as="")

    def with_blunt_edges(self, mouth: float, outer: float) -> Self:
        """The same pad with other fillets of mouths and of the outside, and a mesh that is not moved from another pad.

        Parameters
        ----------
        mouth, outer : float
            Values of `mouth_fillet` and `outer_fillet`, mm.

        Returns
        -------
        Pad
            A new pad.
        """
        return replace(self, mouth_fillet=mouth, outer_fillet=outer, meshed_as="")

    @property
    def mouth(self) -> Mouth | None:
        """The rounded edge of the mouth of a cell, upright; None if it is sharp."""
        if not self.mouth_fillet:
            return None
        between = 0.5 * (self.pitch - self.cell_size) if self.rows * self.columns > 1 else math.inf
        return self.shape.mouth(self.mouth_fillet, min(self.wall - self.outer_fillet, between))

    @property
    def outside(self) -> Outside | None:
        """The rounded outside; None if its edges are sharp."""
        if not self.outer_fillet:
            return None
        return outside(self.extent, self.outer_fillet, self.thinnest_wall, self.cell_size)

    @property
    def curved_regions(self) -> tuple[str, ...]:
        """Names of the curved regions among ``roof`` and ``side``, in this order; with a `fillet`, both are curved."""
        if self.fillet:
            return ("roof", "side")
        regions = self.shape.round_regions
        return regions if not self.mouth_fillet or "side" in regions else (*regions, "side")

    @property
    def top_of_cell(self) -> float:
        """Height of the highest point of a cell above the bottom, mm."""
        return self.shape.top

    @property
    def slope(self) -> tuple[float, float]:
        """Shift (2,) of the leaning cells along x and y per mm of height; zeros for upright cells."""
        assert self.cell_height is not None
        return self.top_x / self.cell_height, self.top_y / self.cell_height

    @property
    def thinnest_wall(self) -> float:
        """Least thickness of silicone between an outermost cell and the outside, mm, as if roofs were flat."""
        return self.wall - max(map(abs, self.slope)) * self.top_of_cell

    @property
    def side_height(self) -> float:
        """Height of the side wall of a cell, below its roof, mm."""
        return self.shape.side_height

    @property
    def default_mesh_size(self) -> float:
        """Default size of the finite elements in mm, to three digits.

        It is proportional to the scale of the pad and to the square root of its relative thickness: along thin walls,
        elements may be longer than the wall is thick. A moved mesh has the default size of its origin."""
        if self.meshed_as:
            return self._read_origin().default_mesh_size
        scale = self.cell_size / TYPICAL_CELL
        thinnest = min(self.thinnest_wall, self.height - self.top_of_cell, TYPICAL_THICKNESS * scale)
        if self.rows * self.columns > 1:
            thinnest = min(thinnest, self.pitch - self.cell_size)
        return float(f"{DEFAULT_MESH_SIZE * math.sqrt(scale * thinnest / TYPICAL_THICKNESS):.3g}")

    @property
    def identity(self) -> dict[str, object]:
        """Values that identify the pad and its meshes, fit for JSON, without defaults of upright and round cells."""
        usual: dict[str, tuple] = dict.fromkeys(("top_x", "top_y", *FILLETS), (0.0,))
        usual |= {"section": (None, "round"), "meshed_as": ("",)}
        values = asdict(self)
        values |= dict(values.pop("kind_values"))
        values |= {"code": code} if (code := own_code(type(self.shape))) else {}
        return {name: value for name, value in values.items() if value not in usual.get(name, ())}

    def mesh(self, mesh_size: float, of_origin: Callable[[Pad, float], VolumeMesh] | None = None) -> VolumeMesh:
        """The pad's volume mesh; see `mesh_pad`, and `moved_onto` for a moved mesh.

        Parameters
        ----------
        mesh_size : float
            Length of the edges of elements, mm.
        of_origin : Callable[[Pad, float], VolumeMesh], optional
            Returns the mesh of the origin with an element size, for example from a cache; by default it is generated.

        Returns
        -------
        VolumeMesh
            Undeformed quadratic tetrahedra with tagged faces.

        Raises
        ------
        InputError
            if the size is not allowed, or the mesh of the origin cannot be moved this far.
        ComputationError
            if the mesher fails.
        """
        from mitsuba_taxel.pads.parametric.meshing import mesh_pad
        from mitsuba_taxel.pads.parametric.morphing import moved_onto

        origin = self.origin
        with activity(f"meshing, elements of {mesh_size:.3g} mm"):
            if origin is None:
                return mesh_pad(self, mesh_size)
            return moved_onto(self, origin, (of_origin or mesh_pad)(origin, mesh_size))

    @property
    def extent(self) -> tuple[float, float, float]:
        """Outside dimensions along x, y and z, mm."""
        around = self.cell_size + 2 * self.wall
        return (self.columns - 1) * self.pitch + around, (self.rows - 1) * self.pitch + around, self.height

    @property
    def cell_centres(self) -> list[tuple[float, float]]:
        """x and y of each cell's axis in mm, in the order of the cells' numbers."""
        return [
            ((column - (self.columns - 1) / 2) * self.pitch, ((self.rows - 1) / 2 - row) * self.pitch)
            for row in range(self.rows)
            for column in range(self.columns)
        ]
