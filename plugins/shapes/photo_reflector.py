"""LED and phototransistor in one package, or a whole array of them."""

from __future__ import annotations

from itertools import pairwise

import mitsuba as mi
import numpy as np

from mitsuba_taxel.backend.plugin_objects import make_plugin
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.kernels.faces import FaceGrid, similarity_scale
from mitsuba_taxel.kernels.mesh_adapter import Places, add_face_attribute, initialize_mesh
from mitsuba_taxel.kernels.parameters import number, whole_number
from mitsuba_taxel.kernels.regions import BODY_REGIONS

MOST_TAXELS = 100_000
SHORTEST, LONGEST = 1e-8, 1e8
"""Sides of a package in mm: beyond, areas or products of them leave single precision."""
_ROUNDING = 1e-6
"""Relative error of lengths that Mitsuba keeps in single precision, as it does the components of vectors."""


class PhotoReflector(mi.Mesh):
    r"""
    .. _shape-photo_reflector:

    Photo-reflector (:monosp:`photo_reflector`)
    -------------------------------------------

    .. pluginparameters::

     * - rows, columns
       - |int|
       - Size of the array; columns run along +x, rows from +y to -y. (Default: 1, 1)

     * - pitch
       - |float|
       - Distance between neighbours, in mm. (Default: 3.55)

     * - spacing
       - |float|
       - Distance between the centres of LED (at -spacing/2) and phototransistor (at +spacing/2) along x, in mm.
         (Default: 0.9)

     * - body
       - |vector|
       - Extent of the package along x, y and z, in mm. (Default: 1.46, 1.06, 0.5)

     * - to_world
       - |transform|
       - Rigid motion, with at most a uniform scale. The body stands on z = 0, its centre on x = y = 0.
         (Default: none)

     * - (nested)
       - |emitter|
       - One `annular_led`, repeated in each body.

     * - (nested)
       - |sensor|
       - One `phototransistor`, repeated in each body.

     * - (nested)
       - |bsdf|
       - What the package is made of: a `region` that says so for :monosp:`body`, :monosp:`led` and
         :monosp:`phototransistor`, or any other BSDF, which then covers the body alone. (Default: absorbing)

    Body, LED face and phototransistor face form one closed surface: the top is cut along the edges of the two
    faces, and the face attribute :monosp:`face_region` tells the three apart. Faces of which nothing is said absorb;
    the dark centre of an LED belongs to its face. Defaults are those of the NJL5908AR.

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
        self.rows = whole_number(props, "rows", 1, minimum=1, maximum=1000)
        self.columns = whole_number(props, "columns", 1, minimum=1, maximum=1000)
        if self.rows * self.columns > MOST_TAXELS:
            raise InputError(
                f"rows = {self.rows}, columns = {self.columns} are not allowed: at most {MOST_TAXELS} photo-reflectors "
                "are possible."
            )
        self.pitch = number(props, "pitch", 3.55, above=0)
        self.spacing = number(props, "spacing", 0.9, minimum=0)
        self.body = np.array(props.get("body", mi.ScalarVector3f(1.46, 1.06, 0.5)), dtype=float)
        if not np.all(np.isfinite(self.body) & (self.body > 0)):
            raise InputError(f"body = {_words(self.body)} is not allowed: three finite numbers above 0 are needed.")
        self.to_world = props.get("to_world", mi.ScalarTransform4f())
        sides = self.body * similarity_scale(np.array(self.to_world.matrix, dtype=float))
        if not np.all((sides >= SHORTEST) & (sides <= LONGEST)):
            raise InputError(
                f"body = {_words(self.body)} is not allowed: with the scale of to_world, sides from {SHORTEST:g} to "
                f"{LONGEST:g} mm are needed."
            )
        led, detector = self._nested(props)
        self.sizes = {"led": (led.side, led.side), "phototransistor": (detector.width, detector.depth)}
        self._check_layout()
        _cover_the_body(props)
        vertices, triangles = _body(self.body, *self._cuts())
        self.built = self._repeat(vertices, triangles)
        initialize_mesh(self, props, Places(self.built[0], None), self.built[1])
        regions = self._regions(vertices[triangles].mean(axis=1))
        add_face_attribute(self, "region", np.tile(regions, self.rows * self.columns))
        detector.spread_film(self.rows, self.columns)

    @staticmethod
    def _nested(props: mi.Properties) -> tuple[mi.Emitter, mi.Sensor]:
        leds = [value for _, value in props.objects() if isinstance(value, mi.Emitter)]
        detectors = [value for _, value in props.objects() if isinstance(value, mi.Sensor)]
        if len(leds) != 1 or not hasattr(leds[0], "side"):
            raise InputError(
                f"photo_reflector: exactly one annular_led must be nested in it, not {len(leds)} emitters."
            )
        if len(detectors) != 1 or not hasattr(detectors[0], "depth"):
            raise InputError(
                f"photo_reflector: exactly one phototransistor must be nested in it, not {len(detectors)} sensors."
            )
        return leds[0], detectors[0]

    def _check_layout(self) -> None:
        length, width, _ = self.body
        (led_x, led_y), (detector_x, detector_y) = self.sizes["led"], self.sizes["phototransistor"]
        closest = 0.5 * (led_x + detector_x)
        furthest = length - max(led_x, detector_x)
        slack = 1 + _ROUNDING
        if not closest / slack <= self.spacing <= furthest * slack:
            raise InputError(
                f"spacing = {self.spacing:g} is not allowed: from {closest:g} (LED and phototransistor touch) "
                f"to {furthest:g} (the edge of the body) is needed."
            )
        if max(led_y, detector_y) > width * slack:
            raise InputError(
                f"body = {_words(self.body)} is not allowed: its y extent must hold {max(led_y, detector_y):g}."
            )
        closest_pitch = max(length if self.columns > 1 else 0.0, width if self.rows > 1 else 0.0)
        if self.pitch < closest_pitch / slack:
            raise InputError(
                f"pitch = {self.pitch:g} is not allowed: at least {closest_pitch:g} is needed, or bodies overlap."
            )

    def is_as_built(self) -> bool:
        """Whether vertices and triangles are still those that LED and phototransistor were set into."""
        parameters, (vertices, triangles) = mi.traverse(self), self.built
        same = np.array_equal(parameters["faces"], triangles.ravel())
        return same and np.array_equal(parameters["vertex_positions"], vertices.astype(np.float32).ravel())

    def face_grid(self, name: str) -> FaceGrid:
        """Where the faces called ``led`` or ``phototransistor`` lie."""
        side = -0.5 if name == "led" else 0.5
        centre = (side * self.spacing, 0.0, self.body[2])
        return FaceGrid(self.to_world, centre, self.sizes[name], self.rows, self.columns, self.pitch)

    def _regions(self, centroids: np.ndarray) -> np.ndarray:
        """Codes (T,) of the regions of one body's triangles, given their centroids (T, 3) in mm."""
        codes = np.full(len(centroids), BODY_REGIONS["body"])
        on_top = centroids[:, 2] > self.body[2] * (1 - 1e-6)
        for side, name in ((-0.5, "led"), (0.5, "phototransistor")):
            offset = np.abs(centroids[:, :2] - (side * self.spacing, 0.0))
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
        """Where lines parallel to the axes cut the top, so that both faces are unions of its cells."""
        cuts: tuple[list[float], list[float]] = ([], [])
        for side, name in ((-0.5, "led"), (0.5, "phototransistor")):
            for axis, centre in enumerate((side * self.spacing, 0.0)):
                half = 0.5 * self.sizes[name][axis]
                cuts[axis].extend((centre - half, centre + half))
        lines = []
        for axis in (0, 1):
            half = 0.5 * self.body[axis]
            inner = [cut for cut in sorted(cuts[axis]) if abs(cut) < half * (1 - 1e-6)]
            lines.append(_distinct(np.array([-half, *inner, half])))
        return lines[0], lines[1]

    def to_string(self) -> str:
        return f"PhotoReflector[rows = {self.rows}, columns = {self.columns}, spacing = {self.spacing:g}]"


def _words(vector: np.ndarray) -> str:
    return ", ".join(f"{component:g}" for component in vector)


def _cover_the_body(props: mi.Properties) -> None:
    """Let a BSDF that tells no regions apart cover the body alone, and absorbing faces be all there is by default."""
    covers = [(name, value) for name, value in props.objects() if isinstance(value, mi.BSDF)]
    for name, cover in covers:
        if not hasattr(cover, "walls"):
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
