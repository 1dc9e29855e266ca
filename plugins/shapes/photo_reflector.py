"""LED and phototransistor in one package, or a whole array of them."""

from __future__ import annotations

from itertools import pairwise

import mitsuba as mi
import numpy as np

from mitsuba_taxel.backend.plugin_objects import found, kind_of, make_plugin
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.kernels.faces import FaceGrid
from mitsuba_taxel.kernels.mesh_adapter import Places, add_face_attribute, initialize_mesh
from mitsuba_taxel.kernels.protocols import is_region
from mitsuba_taxel.kernels.regions import BODY_REGIONS
from mitsuba_taxel.parts.part import SUFFIX
from mitsuba_taxel.specification.photo_reflector import PhotoReflector as Parameters


class PhotoReflector(mi.Mesh):
    r"""
    .. _shape-photo_reflector:

    Photo-reflector (:monosp:`photo_reflector`)
    -------------------------------------------

    Body, LED face and phototransistor face form one closed surface: the top is cut along the edges of the two faces,
    and the face attribute :monosp:`face_region` distinguishes the three. Regions without a BSDF absorb; the dark centre
    of an LED belongs to its face. Defaults are those of the paper's NJL5908AR; a :monosp:`part` of the catalogue has
    its own dies.

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
        if "part" in props and str(props["part"]).endswith(SUFFIX):
            props["part"] = str(found(props["part"]))
        self.specification = stated = Parameters.read(props)
        package = stated.package
        led, face = package.led, package.phototransistor
        if stated.part is not None:
            for part in (led, face):
                words = part.to_dict()
                props[part.plugin] = make_plugin(words.pop("type"), **words)
        detector = _phototransistor_of(props)
        self.rows, self.columns, self.pitch = stated.rows, stated.columns, stated.pitch
        self.centres = {"led": package.led_x, "phototransistor": package.phototransistor_x}
        self.body = np.array(package.body)
        self.to_world = stated.to_world or mi.ScalarTransform4f()
        self.sizes = {"led": (led.size, led.size), "phototransistor": (face.width, face.depth)}
        _cover_the_body(props)
        vertices, triangles = _body(self.body, *self._cuts())
        self.built = self._repeat(vertices, triangles)
        initialize_mesh(self, props, Places(self.built[0], None), self.built[1])
        regions = self._regions(vertices[triangles].mean(axis=1))
        add_face_attribute(self, "region", np.tile(regions, self.rows * self.columns))
        detector.spread_film(self.rows, self.columns)

    def is_as_built(self) -> bool:
        """Whether vertices and triangles are unchanged since LED and phototransistor were set into them."""
        parameters, (vertices, triangles) = mi.traverse(self), self.built
        same = np.array_equal(parameters["faces"], triangles.ravel())
        return same and np.array_equal(parameters["vertex_positions"], vertices.astype(np.float32).ravel())

    def face_grid(self, name: str) -> FaceGrid:
        """Positions of the faces called ``led`` or ``phototransistor``."""
        centre = (self.centres[name], 0.0, self.body[2])
        return FaceGrid(self.to_world, centre, self.sizes[name], self.rows, self.columns, self.pitch)

    def _regions(self, centroids: np.ndarray) -> np.ndarray:
        """Codes (T,) of the regions of one body's triangles, given their centroids (T, 3) in mm."""
        codes = np.full(len(centroids), BODY_REGIONS["body"])
        on_top = centroids[:, 2] > self.body[2] * (1 - 1e-6)
        for name, x in self.centres.items():
            offset = np.abs(centroids[:, :2] - (x, 0.0))
            codes[on_top & np.all(offset < 0.5 * np.array(self.sizes[name]), axis=1)] = BODY_REGIONS[name]
        return codes

    def _repeat(self, vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Vertices (V, 3) in the world and triangles (T, 3) of all bodies, given those of one."""
        column, row = np.meshgrid(np.arange(self.columns), np.arange(self.rows))
        shift = np.zeros((self.rows * self.columns, 1, 3))
        shift[:, 0, 0] = (column.ravel() - (self.columns - 1) / 2) * self.pitch
        shift[:, 0, 1] = ((self.rows - 1) / 2 - row.ravel()) * self.pitch
        all_vertices = (vertices[None] + shift).reshape(-1, 3)
        offsets = len(vertices) * np.arange(self.rows * self.columns)[:, None, None]
        matrix = np.array(self.to_world.matrix, dtype=float)
        return all_vertices @ matrix[:3, :3].T + matrix[:3, 3], (triangles[None] + offsets).reshape(-1, 3)

    def _cuts(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions of grid lines on the top, such that both faces are unions of grid cells."""
        cuts: tuple[list[float], list[float]] = ([], [])
        for name, x in self.centres.items():
            for axis, centre in enumerate((x, 0.0)):
                half = 0.5 * self.sizes[name][axis]
                cuts[axis].extend((centre - half, centre + half))
        lines = []
        for axis in (0, 1):
            half = 0.5 * self.body[axis]
            inner = [cut for cut in sorted(cuts[axis]) if abs(cut) < half * (1 - 1e-6)]
            lines.append(_distinct(np.array([-half, *inner, half])))
        return lines[0], lines[1]

    def to_string(self) -> str:
        led, phototransistor = self.centres.values()
        return f"PhotoReflector[rows = {self.rows}, columns = {self.columns}, spacing = {phototransistor - led:g}]"


def _phototransistor_of(props: mi.Properties) -> mi.Sensor:
    """The nested phototransistor; raises `InputError` unless there is exactly one, and one LED."""
    for kind, plugin, what in ((mi.Emitter, "annular_led", "emitters"), (mi.Sensor, "phototransistor", "sensors")):
        made = [value for _, value in props.objects() if isinstance(value, kind)]
        if len(made) != 1 or kind_of(made[0]) != plugin:
            raise InputError(f"photo_reflector: exactly one {plugin} must be nested in it, not {len(made)} {what}.")
    return made[0]


def _cover_the_body(props: mi.Properties) -> None:
    """Let a BSDF other than a `region` cover the body alone; by default all faces absorb."""
    covers = [(name, value) for name, value in props.objects() if isinstance(value, mi.BSDF)]
    for name, cover in covers:
        if not is_region(cover):
            props[name] = make_plugin("region", body=cover)
    if not covers:
        props["bsdf"] = make_plugin("wall", scattering="absorbing")


def _distinct(values: np.ndarray) -> np.ndarray:
    """Sorted ``values`` without those closer than 1e-6 of their range to the one before."""
    keep = np.diff(values, prepend=-np.inf) > 1e-6 * (values[-1] - values[0])
    return values[keep]


def _body(size: np.ndarray, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A closed box on z = 0, all of its faces cut along the lines ``x`` and ``y``."""
    vertices: list[tuple[float, float, float]] = []
    number: dict[tuple[float, float, float], int] = {}
    triangles: list[tuple[int, int, int]] = []

    def vertex(x: float, y: float, z: float) -> int:
        p = (x, y, z)
        if p not in number:
            number[p] = len(vertices)
            vertices.append(p)
        return number[p]

    def quad(a, b, c, d) -> None:
        i, j, k, m = vertex(*a), vertex(*b), vertex(*c), vertex(*d)
        triangles.extend(((i, j, k), (i, k, m)))

    top = float(size[2])
    xs, ys = [float(v) for v in x], [float(v) for v in y]
    for x0, x1 in pairwise(xs):
        for y0, y1 in pairwise(ys):
            quad((x0, y0, top), (x1, y0, top), (x1, y1, top), (x0, y1, top))
            quad((x0, y0, 0.0), (x0, y1, 0.0), (x1, y1, 0.0), (x1, y0, 0.0))
        quad((x0, ys[0], 0.0), (x1, ys[0], 0.0), (x1, ys[0], top), (x0, ys[0], top))
        quad((x1, ys[-1], 0.0), (x0, ys[-1], 0.0), (x0, ys[-1], top), (x1, ys[-1], top))
    for y0, y1 in pairwise(ys):
        quad((xs[0], y1, 0.0), (xs[0], y0, 0.0), (xs[0], y0, top), (xs[0], y1, top))
        quad((xs[-1], y0, 0.0), (xs[-1], y1, 0.0), (xs[-1], y1, top), (xs[-1], y0, top))
    return np.array(vertices), np.array(triangles)
