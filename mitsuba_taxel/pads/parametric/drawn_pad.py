"""The properties of a pad of parametric cells that drawing and meshing use."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from mitsuba_taxel.pads.cells import CellShape
from mitsuba_taxel.pads.cells.cell_shape import Dimensions
from mitsuba_taxel.pads.cells.fillet import Fillet

if TYPE_CHECKING:
    from typing_extensions import Self


class DrawnPad(Dimensions, Protocol):
    """Interface: the properties of a `Pad` that drawing and meshing use."""

    @property
    def cell(self) -> str: ...
    @property
    def top_x(self) -> float: ...
    @property
    def top_y(self) -> float: ...
    def with_fillet(self, radius: float) -> Self: ...
    @property
    def edges(self) -> Fillet | None: ...
    @property
    def curved_regions(self) -> tuple[str, ...]: ...
    @property
    def shape(self) -> CellShape: ...
    @property
    def top_of_cell(self) -> float: ...
    @property
    def side_height(self) -> float: ...
    @property
    def thinnest_wall(self) -> float: ...
    @property
    def default_mesh_size(self) -> float: ...
    @property
    def cell_centres(self) -> list[tuple[float, float]]: ...
