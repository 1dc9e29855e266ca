"""LED and phototransistor in a package, or an array of such packages."""

from __future__ import annotations

from itertools import pairwise

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsuba_taxel.backend.plugin_objects import find_file, kind_of, make_plugin
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.kernels.protocols import is_region
from mitsuba_taxel.kernels.surfaces.mesh_adapter import Places, add_face_attribute, initialize_mesh
from mitsuba_taxel.kernels.surfaces.regions import BODY_REGIONS
from mitsuba_taxel.kernels.taxels.faces import FaceGrid
from mitsuba_taxel.kernels.taxels.windows import ResinWindow
from mitsuba_taxel.parts.part import SUFFIX
from mitsuba_taxel.specification.photo_reflector import Opening
from mitsuba_taxel.specification.photo_reflector import PhotoReflector as Parameters

ROUNDS = 12
"""Edges of a quarter of a round end in the mesh. The mesh covers 0.3 % less of the end than the window, which is round
for light that enters or leaves."""


class PhotoReflector(mi.Mesh):
    r"""
    .. _shape-photo_reflector:

    Photo-reflector (:monosp:`photo_reflector`)
    -------------------------------------------

    Body, LED face and phototransistor face form a closed surface: the top is divided along the edges of the two faces,
    and the face attribute :monosp:`face_region` distinguishes the three regions. Regions without a BSDF absorb. The
    dark centre of an LED belongs to its face.

    Defaults are those of the paper's sensor, the NJL5908AR. A :monosp:`part` of the catalogue has its own dies. If the
    dies lie below windows, the faces are the windows, and light is refracted there; the BSDF of the region determines
    what a window reflects.

    .. tabs::
        .. code-tab:: xml

            <shape type="photo_reflector">
                <integer name="rows" value="3"/> <integer name="columns" value="3"/>
                <emitter type="annular_led"/>
                <sensor type="phototransistor"/>
            </shape>

        .. code-tab:: python

            'type': 'photo_reflector', 'led': {'type': 'annular_led'}, 'detector': {'type': 'phototransistor'}
    """

    def __init__(self, props: mi.Properties) -> None:
        find_file(props, "part", SUFFIX)
        self.specification = parameters = Parameters.read(props)
        package = parameters.package
        if parameters.part is not None:
            for nested in (package.led, package.phototransistor):
                entries = nested.to_dict()
                props[nested.plugin] = make_plugin(entries.pop("type"), **entries)

        # LED and phototransistor, and the body around them.
        led, detector = _ends_of(props)
        if package.resin_index is not None:
            led.resin_index = detector.resin_index = dr.opaque(mi.Float, package.resin_index)
        self.rows, self.columns, self.pitch = parameters.rows, parameters.columns, parameters.pitch
        self.sides, self.openings, self.resin_index = package.sides, package.openings, package.resin_index
        self.body = np.array(package.body)
        self.to_world = parameters.to_world or mi.ScalarTransform4f()
        _cover_the_body(props)

        # The mesh of a body, repeated in the array.
        vertices, triangles = _body(self.body, *self._cuts())
        self.built = self._repeat(vertices, triangles)
        initialize_mesh(self, props, Places(self.built[0], None), self.built[1])
        regions = self._regions(vertices[triangles].mean(axis=1))
        add_face_attribute(self, "region", np.tile(regions, self.rows * self.columns))
        detector.spread_film(self.rows, self.columns)

    def is_as_built(self) -> bool:
        """Whether vertices and triangles are unchanged since construction, when LED and phototransistor were placed."""
        parameters, (vertices, triangles) = mi.traverse(self), self.built
        same_triangles = np.array_equal(parameters["faces"], triangles.ravel())
        return same_triangles and np.array_equal(parameters["vertex_positions"], vertices.astype(np.float32).ravel())

    def face_grid(self, name: str) -> FaceGrid:
        """Positions of the dies ``led`` or ``phototransistor`` of all packages."""
        side = self.sides[name]
        return self._grid((side.x, side.y), side.die_depth, (side.die_width, side.die_length))

    def window(self, name: str, dies: FaceGrid) -> ResinWindow | None:
        """Windows above the dies ``led`` or ``phototransistor``; None for dies in the top of the body."""
        if self.resin_index is None:
            return None
        depth, opening = self.sides[name].die_depth, self.openings[name]
        faces = self._grid(opening.centre, 0.0, opening.extent)
        return ResinWindow(dies, faces, dies.scale * depth, self.resin_index, opening.is_obround)

    def _grid(self, centre: tuple[float, float], depth: float, size: tuple[float, float]) -> FaceGrid:
        position = (*centre, self.body[2] - depth)
        return FaceGrid(self.to_world, position, size, self.rows, self.columns, self.pitch)

    def _regions(self, centroids: np.ndarray) -> np.ndarray:
        """Region codes (T,) of the triangles of a body, from their centroids (T, 3) in mm."""
        codes = np.full(len(centroids), BODY_REGIONS["body"])
        on_top = centroids[:, 2] > self.body[2] * (1 - 1e-6)
        for name, opening in self.openings.items():
            offset = np.abs(centroids[:, :2] - opening.centre)
            codes[on_top & (offset[:, 0] < _half_width(opening, offset[:, 1]))] = BODY_REGIONS[name]
        return codes

    def _repeat(self, vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Vertices (V, 3) in world coordinates and triangles (T, 3) of all bodies, from those of a single body."""
        column, row = np.meshgrid(np.arange(self.columns), np.arange(self.rows))
        shift = np.zeros((self.rows * self.columns, 1, 3))
        shift[:, 0, 0] = (column.ravel() - (self.columns - 1) / 2) * self.pitch
        shift[:, 0, 1] = ((self.rows - 1) / 2 - row.ravel()) * self.pitch
        all_vertices = (vertices[None] + shift).reshape(-1, 3)
        offsets = len(vertices) * np.arange(self.rows * self.columns)[:, None, None]
        matrix = np.array(self.to_world.matrix, dtype=float)
        return all_vertices @ matrix[:3, :3].T + matrix[:3, 3], (triangles[None] + offsets).reshape(-1, 3)

    def _cuts(self) -> tuple[np.ndarray, np.ndarray]:
        """Grid lines on the top, chosen so that both openings are unions of grid cells.

        Returns
        -------
        x : (K, L) ndarray
            Positions in mm of L lines at K values of y.
        y : (K,) ndarray
            These values, mm.
        """
        lines = []
        for axis in (0, 1):
            half = 0.5 * self.body[axis]
            cuts = [cut for opening in self.openings.values() for cut in _edges(opening, axis)]
            inner = [cut for cut in sorted(cuts) if abs(cut) < half * (1 - 1e-6)]
            lines.append(_distinct(np.array([-half, *inner, half])))
        x, y = np.tile(lines[0], (len(lines[1]), 1)), lines[1]
        for opening in (opening for opening in self.openings.values() if opening.is_obround):
            for side, line in zip((-1, 1), _edges(opening, 0), strict=True):
                column = np.abs(lines[0] - line).argmin()
                x[:, column] = opening.centre[0] + side * _half_width(
                    opening, np.abs(y - opening.centre[1]), beyond=True
                )
        return x, y

    def to_string(self) -> str:
        spacing = self.sides["phototransistor"].x - self.sides["led"].x
        return f"PhotoReflector[rows = {self.rows}, columns = {self.columns}, spacing = {spacing:g}]"


def _ends_of(props: mi.Properties) -> tuple[mi.Emitter, mi.Sensor]:
    """The nested LED and phototransistor; raises `InputError` unless there is exactly one of each kind."""
    ends = []
    for kind, plugin, plural in ((mi.Emitter, "annular_led", "emitters"), (mi.Sensor, "phototransistor", "sensors")):
        nested = [value for _, value in props.objects() if isinstance(value, kind)]
        if len(nested) != 1 or kind_of(nested[0]) != plugin:
            there = ", ".join(kind_of(value) for value in nested) or f"no {plural}"
            raise InputError(
                f"photo_reflector with {there} nested in it is not allowed: exactly one {plugin} is needed."
            )
        ends += nested
    return ends[0], ends[1]


def _cover_the_body(props: mi.Properties) -> None:
    """Apply a nested BSDF to the body only, not to LEDs and phototransistors, unless it is a `region`. Without a nested
    BSDF, all faces absorb."""
    covers = [(name, value) for name, value in props.objects() if isinstance(value, mi.BSDF)]
    for name, cover in covers:
        if not is_region(cover):
            props[name] = make_plugin("region", body=cover)
    if not covers:
        props["bsdf"] = make_plugin("wall", scattering="absorbing")


def _distinct(values: np.ndarray) -> np.ndarray:
    """Sorted values, without those that are closer to their predecessor than 1e-6 of the range."""
    keep = np.diff(values, prepend=-np.inf) > 1e-6 * (values[-1] - values[0])
    return values[keep]


def _edges(opening: Opening, axis: int) -> list[float]:
    """Positions in mm of the edges of an opening along x (axis 0), or of all its corners along y (axis 1)."""
    outwards = _outline(opening)[0].tolist() if axis else [0.5 * opening.extent[0]]
    return [opening.centre[axis] + side * half for half in outwards for side in (-1, 1)]


def _half_width(opening: Opening, distance: np.ndarray, beyond: bool = False) -> np.ndarray:
    """Half the width of an opening at distances along y from its centre.

    Outside the opening the result is 0, or the width at its end if ``beyond``.
    """
    y, x = _outline(opening)
    return np.interp(distance, y, x, right=None if beyond else 0.0)


def _outline(opening: Opening) -> tuple[np.ndarray, np.ndarray]:
    """Corners of a quarter of an opening: their distances from its centre along y and along x."""
    half = 0.5 * np.array(opening.extent)
    if not opening.is_obround:
        return half[1:], half[:1]
    turn = np.pi / (2 * ROUNDS + 1) * np.arange(ROUNDS + 1)  # the last edge is parallel to x
    return half[1] - half[0] * (1 - np.sin(turn)), half[0] * np.cos(turn)


def _body(size: np.ndarray, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A closed box on z = 0, its top and bottom divided along the grid lines of :meth:`PhotoReflector._cuts`.

    Returns
    -------
    vertices : (V, 3) ndarray
        In mm.
    triangles : (T, 3) ndarray of int
        Numbers of vertices.
    """
    vertices: list[tuple[float, float, float]] = []
    index: dict[tuple[float, float, float], int] = {}
    triangles: list[tuple[int, int, int]] = []

    def vertex(x: float, y: float, z: float) -> int:
        p = (x, y, z)
        if p not in index:
            index[p] = len(vertices)
            vertices.append(p)
        return index[p]

    def quad(a, b, c, d) -> None:
        i, j, k, m = vertex(*a), vertex(*b), vertex(*c), vertex(*d)
        triangles.extend(((i, j, k), (i, k, m)))

    top = float(size[2])
    xs, ys = [[float(v) for v in line] for line in x.T], [float(v) for v in y]
    for line, next_line in pairwise(xs):
        for (a, b, y0), (c, d, y1) in pairwise(zip(line, next_line, ys, strict=True)):
            quad((a, y0, top), (b, y0, top), (d, y1, top), (c, y1, top))
            quad((a, y0, 0.0), (c, y1, 0.0), (d, y1, 0.0), (b, y0, 0.0))
        quad((line[0], ys[0], 0.0), (next_line[0], ys[0], 0.0), (next_line[0], ys[0], top), (line[0], ys[0], top))
        quad(
            (next_line[-1], ys[-1], 0.0), (line[-1], ys[-1], 0.0), (line[-1], ys[-1], top), (next_line[-1], ys[-1], top)
        )
    west, east = xs[0][0], xs[-1][0]
    for y0, y1 in pairwise(ys):
        quad((west, y1, 0.0), (west, y0, 0.0), (west, y0, top), (west, y1, top))
        quad((east, y0, 0.0), (east, y1, 0.0), (east, y1, top), (east, y0, top))
    return np.array(vertices), np.array(triangles)
