"""The surfaces of a scene for a picture of the sensor: sectioned pads and whole packages on a board."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.surfaces.cutaway import Half, cut_open, is_closed
from mitsuba_taxel.geometry.surfaces.triangles import components, neighbours, unit, volume
from mitsuba_taxel.kernels.protocols import PadShape, is_pad
from mitsuba_taxel.kernels.surfaces.regions import ALL_REGIONS, BODY_REGIONS
from mitsuba_taxel.report.picture.indenters import indenter_surface

if TYPE_CHECKING:
    import mitsuba as mi

FACING = np.array([0.0, 1.0, 0.0])
"""Normal of the cut, towards the side that remains."""
SHEET = 0.2
"""Thickness of rectangles in mm."""
RIM, BOARD = 0.06, 0.04
"""Overhang and thickness of the board, relative to the diagonal of the parts on the board."""
OTHER = "plate"
"""Material of shapes without regions."""


@dataclass(frozen=True, eq=False)
class ShownPart:
    """A surface of V vertices and T triangles to be drawn in a picture of a sensor.

    Attributes
    ----------
    vertices : (V, 3) ndarray
        Vertices in mm.
    triangles : (T, 3) ndarray
        Vertex numbers, counter-clockwise seen from outside.
    material : (T,) ndarray
        Name of a region of a pad or a package, ``cut``, ``board``, ``indenter`` or ``plate``.
    cell : (T,) ndarray
        Number of the cell that a roof or side belongs to, 0 elsewhere.
    pressure : (T, 3) ndarray or None
        Contact pressure in MPa of an indenter at the corners of the triangles; None without an indenter.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    material: np.ndarray
    cell: np.ndarray
    pressure: np.ndarray | None = None

    @property
    def is_package(self) -> bool:
        """Whether the part is the package of a photo-reflector."""
        return bool(np.isin(self.material, list(BODY_REGIONS)).any())

    def chosen(self, which: np.ndarray) -> ShownPart:
        """The part with the selected triangles only."""
        pressure = None if self.pressure is None else self.pressure[which]
        return ShownPart(self.vertices, self.triangles[which], self.material[which], self.cell[which], pressure)

    def range(self, axis: int) -> tuple[float, float]:
        """Smallest and largest coordinate of the triangles along an axis, in mm."""
        coordinates = self.vertices[self.triangles][..., axis]
        return float(coordinates.min()), float(coordinates.max())


def shown_parts(
    scene: mi.Scene, cut: float | str = "middle", magnify: float = 1.0
) -> tuple[list[ShownPart], float | None]:
    """Collect the surfaces of a ``mi.Scene`` for a picture, and cut them open.

    Of pads and other surfaces, the part at y > cut remains. Photo-reflectors are not cut, like fasteners in technical
    drawings. A board is added. Rectangles are shown as thin sheets, except those at the height of the board; a
    rectangle with an LED or a phototransistor is shown in the colour of that part. Other shapes without triangles are
    omitted.

    Parameters
    ----------
    scene : mi.Scene
        A loaded scene.
    cut : float or str
        Coordinate y in mm; ``middle`` for the centres of the middle row of cells (of photo-reflectors without a pad),
        ``none`` for no cut.
    magnify : float
        Factor of the displacements of deformable pads; packages do not move.

    Returns
    -------
    parts : list[ShownPart]
        Surfaces with their materials.
    cut : float or None
        Position of the cut along y, in mm.

    Raises
    ------
    InputError
        if the scene contains no mesh, or the cut does not intersect the parts.
    """
    solids = [solid for shape in scene.shapes() if (solid := _solid(shape, magnify)) is not None]
    bodies = [body for shape in scene.shapes() if (body := _indenter(shape, magnify)) is not None]
    sheets = [_sheet(shape) for shape in scene.shapes() if shape.class_name() == "Rectangle"]
    if not solids:
        raise InputError("the scene contains no mesh, so nothing can be shown: a pad or another shape is needed.")
    ground = min(solid.range(2)[0] for solid in solids)
    shown = [*solids, *bodies, *(sheet for sheet in sheets if sheet.range(2)[1] > ground + 1e-3 * SHEET)]
    offset = None if cut == "none" else middle_row(solids) if cut == "middle" else float(cut)
    if offset is not None:
        low, high = min(solid.range(1)[0] for solid in solids), max(solid.range(1)[1] for solid in solids)
        if not low < offset < high:
            raise InputError(f"cut = {offset:g} is not allowed: above {low:.4g} and below {high:.4g} mm is needed.")
    board = _board(solids)
    if offset is not None:
        shown = [visible for solid in shown if len((visible := _opened(solid, offset)).triangles)]
    return [*shown, board], offset


def middle_row(parts: list[ShownPart]) -> float:
    """y in mm of the middle row of cells or, without a pad, of photo-reflectors.

    If the number of rows is even, the middle row with the lower y is used; without rows, the middle of all parts.
    """
    ranges = [
        solid.chosen(solid.cell == cell).range(1) for solid in parts for cell in np.unique(solid.cell[solid.cell > 0])
    ]
    ranges = ranges or [body.range(1) for solid in parts if solid.is_package for body in _bodies(solid)]
    if not ranges:
        every = [solid.range(1) for solid in parts]
        ranges = [(min(low for low, _ in every), max(high for _, high in every))]
    centres = sorted((0.5 * (low + high) for low, high in ranges), reverse=True)
    return round(centres[len(centres) // 2], 4) + 0.0


def _bodies(solid: ShownPart) -> list[ShownPart]:
    number = components(len(solid.triangles), neighbours(solid.triangles)[1])
    return [solid.chosen(number == body) for body in range(number.max() + 1)]


def _solid(shape: mi.Shape, magnify: float) -> ShownPart | None:
    """Closed surface of a mesh of a scene, for a picture; None for other shapes."""
    import mitsuba as mi

    displacement: np.ndarray | float = 0.0
    pressure = None
    if is_pad(shape) and shape.contact_pressure is not None:
        pressure = shape.contact_pressure[shape.surface.triangles]
    if magnify != 1 and is_pad(shape):
        displacement, shape = (magnify - 1) * _displacements(shape), shape.closed()
    parameters = mi.traverse(shape)
    if "vertex_positions" not in parameters or not len(parameters["faces"]):
        return None
    vertices = np.array(parameters["vertex_positions"], dtype=float).reshape(-1, 3) + displacement
    triangles = np.array(parameters["faces"]).reshape(-1, 3).astype(np.int64)
    region, cell = (
        np.array(parameters[name]).astype(int) if name in parameters else np.zeros(len(triangles), dtype=int)
        for name in ("face_region", "face_cell")
    )
    # Many files repeat the vertices of every triangle.
    vertices, number = np.unique(vertices, axis=0, return_inverse=True)
    triangles = number.reshape(-1)[triangles]
    if is_closed(triangles) and volume(vertices, triangles) < 0:
        triangles = triangles[:, ::-1]
        pressure = None if pressure is None else pressure[:, ::-1]
    names = {code: name for name, code in ALL_REGIONS.items()}
    material = np.array([names.get(code, OTHER) for code in region.tolist()])
    return ShownPart(vertices, triangles, material, cell, pressure)


def _indenter(shape: mi.Shape, magnify: float) -> ShownPart | None:
    surface = indenter_surface(shape, magnify) if is_pad(shape) else None
    if surface is None:
        return None
    count = len(surface[1])
    return ShownPart(*surface, np.full(count, "indenter"), np.zeros(count, dtype=int))


def _displacements(pad: PadShape) -> np.ndarray:
    """Displacements (V, 3) in mm, from the unloaded state, of the vertices of a pad's closed surface."""
    turn, shift = pad.to_world[:3, :3], pad.to_world[:3, 3]
    return np.einsum("vi,ji->vj", pad.surface.vertices, turn) + shift - pad.undeformed.vertices


def _sheet(rectangle: mi.Shape) -> ShownPart:
    """A rectangle as a thin sheet behind its front face."""
    import mitsuba as mi

    to_world = np.array(mi.traverse(rectangle)["to_world"].matrix, dtype=float).reshape(4, 4)
    x, y, centre = to_world[:3, 0], to_world[:3, 1], to_world[:3, 3]
    corners = np.array([centre - x - y, centre + x - y, centre + x + y, centre - x + y])
    face = "led" if rectangle.is_emitter() else "phototransistor" if rectangle.is_sensor() else ""
    sheet = _box(corners, -SHEET * unit(np.cross(x, y)), "body" if face else OTHER)
    front = np.isin(sheet.triangles, range(4)).all(axis=1)
    return replace(sheet, material=np.where(front & bool(face), face, sheet.material))


def _board(parts: list[ShownPart]) -> ShownPart:
    low, high = np.transpose(
        [[f(solid.range(k)[n] for solid in parts) for n, f in enumerate((min, max))] for k in range(3)]
    )
    size = float(np.linalg.norm(high - low))
    (west, south), (east, north) = low[:2] - RIM * size, high[:2] + RIM * size
    corners = np.array([[west, south], [east, south], [east, north], [west, north]])
    return _box(np.insert(corners, 2, low[2], axis=1), np.array([0, 0, -BOARD * size]), "board")


def _box(front: np.ndarray, depth: np.ndarray, material: str) -> ShownPart:
    """Closed surface of a box. ``front`` (4, 3) contains the corners of its front, counter-clockwise seen from outside,
    and ``depth`` is the vector (3,) from front to back."""
    quads = np.array([[0, 1, 2, 3], [7, 6, 5, 4], *([k, k + 4, (k + 1) % 4 + 4, (k + 1) % 4] for k in range(4))])
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return ShownPart(np.concatenate([front, front + depth]), triangles, np.full(12, material), np.zeros(12, dtype=int))


def _opened(solid: ShownPart, offset: float) -> ShownPart:
    """Part of a closed surface that remains after the cut; the section is closed by a cap."""
    if solid.is_package:
        return solid
    half = cut_open(solid.vertices, solid.triangles, FACING, offset)
    old = half.source >= 0
    face = "cut" if solid.cell.any() else solid.material[0]
    material = np.where(old, solid.material[half.source], face)
    pressure = None if solid.pressure is None else _at_corners(solid, half)
    return ShownPart(half.vertices, half.triangles, material, np.where(old, solid.cell[half.source], 0), pressure)


def _at_corners(solid: ShownPart, half: Half) -> np.ndarray:
    """Pressure (T, 3) at the corners of cut triangles: linear within each original triangle, and 0 on the section."""
    assert solid.pressure is not None
    pressure = np.zeros(half.triangles.shape)
    pressed = (half.source >= 0) & (solid.pressure.max(axis=1)[half.source] > 0)
    corners, values = solid.vertices[solid.triangles[half.source[pressed]]], solid.pressure[half.source[pressed]]
    sides, offsets = corners[:, 1:] - corners[:, :1], half.vertices[half.triangles[pressed]] - corners[:, :1]
    along = np.einsum("tcj,tjk->tck", offsets, np.linalg.pinv(sides))
    pressure[pressed] = values[:, :1] + np.einsum("tck,tk->tc", along, values[:, 1:] - values[:, :1])
    return np.maximum(pressure, 0.0)
