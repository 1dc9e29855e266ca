"""Cells with diffuse walls, each with its LED and phototransistor, whose light can be computed without random
numbers."""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsuba_taxel.backend import llvm
from mitsuba_taxel.backend.packets import in_packets
from mitsuba_taxel.backend.plugin_objects import kind_of
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.kernels.faces import FaceGrid
from mitsuba_taxel.kernels.protocols import LedEmitter, PadShape, PhototransistorSensor, is_package, is_pad, is_wall
from mitsuba_taxel.kernels.taxel_pair import TaxelPair
from mitsuba_taxel.kernels.walls import walls_by_region
from mitsuba_taxel.pads.pad import REGIONS
from mitsuba_taxel.sensing.cell_patches import CellPatches
from mitsuba_taxel.sensing.taxels import taxels_of
from mitsuba_taxel.transport.box import Box
from mitsuba_taxel.transport.box_faces import BoxFaces, faces_of
from mitsuba_taxel.transport.cell import Cell, Mesh, ScatteringWalls
from mitsuba_taxel.transport.ends import AngularLaw, CosineFactor, End, uniform_cone
from mitsuba_taxel.transport.patches import LATTICE
from mitsuba_taxel.transport.polar_cone import BLUNT, PolarCone
from mitsuba_taxel.transport.rules import disc_annulus_rule, rectangle_rule, square_annulus_rule
from mitsuba_taxel.transport.tabulated_law import TabulatedLaw

if TYPE_CHECKING:
    from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
    from mitsuba_taxel.mechanics.surface.wall_patches import WallPatches
    from mitsuba_taxel.pads import Pad, PadFile

LED_POINTS, PHOTOTRANSISTOR_POINTS = 2, 8
"""Points along a side of a quarter of the LED, and of the phototransistor: more change readings by less than 1e-6."""
MOST_FACES = 400
"""Limit of patches on the walls of a cell: time and memory grow with their square, to some 20 s and 4 GB."""
MOST_KEPT = 100
"""Largest number of patches of a cell whose pairs of points, then some 50 MB, and solutions, of 10 MB, are kept."""
PROBES, LEAKS = 4096, 4
"""Rays from each LED to test whether it lights only its own cell, and how many of them may leak between triangles."""
SINGLE = 1e-7
"""Relative rounding error of single precision."""
CLEARANCE = 3e-3
"""Offset of the ends of rays between walls, relative to the longest: the distance of triangles from the walls."""
NARROWEST = 0.05
"""Radians within which laws of tables may fall from their largest value."""
KINKED = 4.0
"""How much larger errors of light are relative to the difference of two solutions if a law has kinks, as polynomials
follow these more slowly: compared with patches of 0.6 of the size, by tables of five rows."""
HORIZON, NEARLY_DARK = 1e-4, 1e-3
"""Cosine, and relative response, at the end of a table that is a step if both are larger."""
COVER, BEYOND = 5.0, 1.01
"""Deepest ends of such rays within the silicone, relative to that, and how much further on they begin."""


IntoPad = Callable[..., np.ndarray]
"""Takes points, or directions if ``is_direction``, from the scene to the pad."""


class NotDiffuse(InputError):
    """The scene needs random paths."""


class NotFollowed(ComputationError):
    """Light without random numbers would take too long, or leave out too much that is blocked."""


@dataclass(frozen=True, eq=False)
class Taxel:
    """One LED and its phototransistor.

    Attributes
    ----------
    power : float
        Of the LED, in W.
    led, phototransistor : End
        In the frame of the pad.
    body : Box or None
        Their package, in that frame.
    package : PackageFaces or None
        Those of its faces that scatter light.
    """

    power: float
    led: End
    phototransistor: End
    body: Box | None
    package: PackageFaces | None

    @property
    def light_share(self) -> float:
        """Factor of the errors of its light, as the difference of two solutions tells them."""
        return KINKED if self.led.law.has_kinks or self.phototransistor.law.has_kinks else 1.0

    @property
    def middle(self) -> np.ndarray:
        """(2,) mm, between LED and phototransistor."""
        return (self.led.points.mean(axis=0) + self.phototransistor.points.mean(axis=0))[:2] / 2


@dataclass(frozen=True, eq=False)
class PackageFaces:
    """Faces of a package that scatter light by Lambert's law.

    Attributes
    ----------
    faces : BoxFaces
        R of them.
    shares : (R,) ndarray
        Share of the incident light that each scatters.
    """

    faces: BoxFaces
    shares: np.ndarray

    def cut(self, cuts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Patches (G, 15, 3) for numbers of parts (R, 2), see :meth:`BoxFaces.cuts`, and the share (G,) of each."""
        return self.faces.places(cuts), np.repeat(self.shares, 2 * cuts.prod(axis=1))


@dataclass(frozen=True, eq=False)
class CellWalls:
    """The scattering walls of a cell, and the faces of its package.

    Attributes
    ----------
    faces : (F,) ndarray
        Numbers of the mesh faces that define the patches.
    package : (G, 15, 3) ndarray
        Patches on the package.
    isotropic, lambertian : (F + G,) ndarray
        Share of the incident light that each scatters with this law.
    """

    faces: np.ndarray
    package: np.ndarray
    isotropic: np.ndarray
    lambertian: np.ndarray


class DiffuseCells:
    """A loaded scene of one pad whose cells contain one taxel each.

    Patches for the light are the faces of a mesh of the default size, whatever the size of the finite elements.

    Parameters
    ----------
    scene : mi.Scene
    points : int
        Along a side of each phototransistor.

    Raises
    ------
    NotDiffuse
        with the reason, if the scene is of another kind, or other surfaces reflect light.
    NotFollowed
        if a cell has too many patches.
    """

    def __init__(self, scene: mi.Scene, points: int = PHOTOTRANSISTOR_POINTS) -> None:
        if not llvm.is_fit():
            raise NotDiffuse(f"light without random numbers needs an LLVM of version {llvm.OLDEST_LLVM} or newer")
        self.scene = scene
        self.pad = _pad_of(scene)
        self._mesh = _mesh_of(self.pad.pad)
        placed = self._into_pad, self._scale
        self.taxels = [taxel for pair in taxels_of(scene) for taxel in _taxels(pair, *placed, points)]
        self._refuse_other_walls()
        shares = {
            REGIONS[name]: _shares(wall) for name, wall in walls_by_region(self.pad.bsdf()).items() if name in REGIONS
        }
        self.cells = [self._cell(taxel, shares) for taxel in self.taxels]
        self._refuse_other_cells()

    def _into_pad(self, points: np.ndarray, is_direction: bool = False) -> np.ndarray:
        """Points or unit directions in world coordinates, transformed to the frame of the pad."""
        turn, shift = self.pad.to_world[:3, :3], self.pad.to_world[:3, 3]
        moved = points if is_direction else points - shift
        inside = np.linalg.solve(turn, moved.T).T
        return inside / np.linalg.norm(inside, axis=-1, keepdims=True) if is_direction else inside

    @property
    def _scale(self) -> float:
        return float(np.cbrt(np.linalg.det(self.pad.to_world[:3, :3])))

    def _refuse_other_walls(self) -> None:
        """Raise if anything but the pad, and packages with an LED and its phototransistor, reflects light."""
        followed = [self.pad.ptr, *(pair.led.get_shape().ptr for pair in taxels_of(self.scene) if pair.coplanar)]
        for shape in self.scene.shapes():
            for name, wall in () if shape.ptr in followed else walls_by_region(shape.bsdf()).items():
                if any(_shares(wall)):
                    part = f"the {name} of a {kind_of(shape)}" if name else f"a {kind_of(shape)}"
                    raise NotDiffuse(f"{part} sends light back, and only walls of pad and packages are followed")

    def _cell(self, taxel: Taxel, shares: dict[int, tuple[float, float]]) -> CellWalls:
        mesh = self._mesh
        numbers = np.unique(mesh.face_cell[mesh.face_cell > 0])
        centres = [mesh.points[mesh.faces[mesh.face_cell == number]].mean(axis=(0, 1))[:2] for number in numbers]
        number = numbers[np.argmin(np.linalg.norm(np.array(centres) - taxel.middle, axis=1))]
        scatter = [region for region, share in shares.items() if any(share)]
        faces = np.flatnonzero((mesh.face_cell == number) & np.isin(mesh.face_region, scatter))
        if not len(faces):
            raise NotDiffuse("no wall of a cell sends light back")
        each = np.array([shares[region] for region in mesh.face_region[faces].tolist()])
        package = np.empty((0, *LATTICE.shape[:1], 3))
        if taxel.package is not None:
            package, of_package = taxel.package.cut(self._cuts(taxel.package))
            each = _with_package(each, of_package)
        if len(each) > MOST_FACES:
            raise NotFollowed(
                f"light without random numbers takes too long between the {len(each)} patches of a cell: "
                f"{MOST_FACES} at most are allowed."
            )
        return CellWalls(faces, package, *each.T)

    def _cuts(self, package: PackageFaces) -> np.ndarray:
        """Parts of a package's faces, which are no larger than the patches of walls."""
        return package.faces.cuts(self.pad.pad.default_mesh_size)

    def _refuse_other_cells(self) -> None:
        """Raise if an LED lights scattering walls of another cell."""
        of_cells = np.concatenate([cell.faces for cell in self.cells])
        if len(np.unique(of_cells)) < len(of_cells):
            raise NotDiffuse("two photo-reflectors lie in one cell")
        surface = self.pad.surface
        owners = [np.unique(self._mesh.face_cell[cell.faces]) for cell in self.cells]
        regions = np.unique(self._mesh.face_region[of_cells])
        directions = _hemisphere(PROBES)
        for taxel, owner in zip(self.taxels, owners, strict=True):
            hit = self._hits(taxel.led.points.mean(axis=0), directions @ _frame(taxel.led.normal))
            strange = np.isin(surface.region[hit], regions) & ~np.isin(surface.cell[hit], owner)
            if np.count_nonzero(strange) > LEAKS:
                raise NotDiffuse(f"the LED in cell {owner[0]} lights walls of cell {surface.cell[hit][strange][0]}")

    def _hits(self, start: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """Numbers of the pad's triangles that rays from a point hit first."""
        ray = self._rays(np.broadcast_to(start, directions.shape), directions)
        found = self.scene.ray_intersect_preliminary(ray)
        number = np.array(found.prim_index)
        ours = np.array(found.is_valid()) & np.array(found.shape == mi.ShapePtr(self.pad))
        return number[ours]

    def _rays(self, start: np.ndarray, away: np.ndarray) -> mi.Ray3f:
        """Rays in world coordinates, from points and along vectors in the frame of the pad."""
        turn, shift = self.pad.to_world[:3, :3], self.pad.to_world[:3, 3]
        origin, direction = (
            mi.Vector3f(*(in_packets(part) for part in each.T)) for each in (start @ turn.T + shift, away @ turn.T)
        )
        return mi.Ray3f(mi.Point3f(origin), direction)

    def hidden_share(self, sources: np.ndarray, ends: np.ndarray, share: np.ndarray) -> float:
        """Share of a reading on paths that are occluded by anything but the package; see :meth:`Cell.flows`.

        Patches are coarser than the triangles of the walls, which may cover an end of a path at an edge: what it leaves
        the silicone through does not occlude it.
        """
        clear = CLEARANCE * np.linalg.norm(sources[:, 0] - ends[:, 0], axis=1).max(initial=0)
        start, end = (each[:, 0] + clear * each[:, 1] for each in (sources, ends))
        hidden = np.flatnonzero(self._occluded(start, end))
        if len(hidden):
            start, end = start[hidden], end[hidden]
            covered = self._covered(start, end - start, COVER * clear), self._covered(end, start - end, COVER * clear)
            start, end = (1 - covered[0]) * start + covered[0] * end, (1 - covered[1]) * end + covered[1] * start
            hidden = hidden[self._occluded(start, end)]
        return float(share[hidden].sum())

    def _occluded(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """(N,) whether anything but the package stands between points."""
        _, hit = self._first(start, end - start)
        occluded = np.array(hit.is_valid())
        for package in filter(is_package, self.scene.shapes()):
            occluded &= ~np.array(hit.shape == mi.ShapePtr(package))
        return occluded

    def _covered(self, start: np.ndarray, way: np.ndarray, deepest: float) -> np.ndarray:
        """(N, 1) shares of ways from points, up to where they leave the silicone if it covers these by ``deepest`` mm
        at most."""
        ray, hit = self._first(start, way)
        normal = hit.compute_surface_interaction(ray, mi.RayFlags.Minimal).n
        leaves = hit.is_valid() & (hit.shape == mi.ShapePtr(self.pad)) & (dr.dot(ray.d, normal) > 0)
        share = np.array(dr.select(leaves, hit.t, 0.0))
        return np.where(share * np.linalg.norm(way, axis=1) <= deepest, BEYOND * share, 0.0)[:, None]

    def _first(self, start: np.ndarray, way: np.ndarray) -> tuple[mi.Ray3f, mi.PreliminaryIntersection3f]:
        """Rays that end with each way, and the first surfaces that they hit."""
        ray = self._rays(start, way)
        ray.maxt = mi.Float(1.0)
        return ray, self.scene.ray_intersect_preliminary(ray)

    def patches(self, number: int, elements: VolumeMesh | None = None) -> CellPatches:
        """The undeformed walls of a cell, with their dependence on the displacement of the pad's elements or others,
        and the faces of its package."""
        cell = self.cells[number]
        walls = _patches(elements or self.pad.state.mesh, self._mesh, self.pad.pad, tuple(cell.faces.tolist()))
        return CellPatches(walls, cell.package)

    def light_mesh(self, number: int, degree: int) -> Mesh:
        """The quadrature on the walls of a cell."""
        rest = self.patches(number).rest
        return _kept_mesh(rest.tobytes(), degree) if len(rest) <= MOST_KEPT else Mesh(rest, degree)

    def cell_like(self, number: int, before: DiffuseCells) -> CellWalls:
        """A cell, with the faces of its package cut as in the scene before one of its parameters changed.

        Raises
        ------
        NotDiffuse
            if there are other patches.
        """
        cell, known = self.cells[number], before.cells[number]
        one, other = before.taxels[number].package, self.taxels[number].package
        if one is not None and other is not None and len(one.shares) == len(other.shares):
            package, shares = other.cut(before._cuts(one))
            of_walls = np.column_stack([cell.isotropic, cell.lambertian])[: len(cell.faces)]
            cell = CellWalls(cell.faces, package, *_with_package(of_walls, shares).T)
        if not (np.array_equal(cell.faces, known.faces) and cell.package.shape == known.package.shape):
            raise NotDiffuse("a wall begins to send light back, or dies to touch, as the parameter changes")
        return cell

    def walls_alike(self, one: int, other: int) -> bool:
        """Whether the walls of two cells scatter equally, judged by all of their properties."""
        shares = (np.column_stack([cell.isotropic, cell.lambertian]) for cell in (self.cells[one], self.cells[other]))
        each = [np.unique(rows, axis=0, return_counts=True) for rows in shares]
        return all(np.array_equal(*pair) for pair in zip(*each, strict=True))

    def solved(self, number: int, mesh: Mesh, places: np.ndarray) -> Cell:
        """The light in a cell, whose walls are at ``places`` (F, 15, 3)."""
        taxel, cell = self.taxels[number], self.cells[number]
        walls = ScatteringWalls(places, cell.isotropic, cell.lambertian, len(cell.package))
        parts = walls, taxel.led, taxel.phototransistor, taxel.body
        return kept_cell(mesh, pickle.dumps(parts)) if len(places) <= MOST_KEPT else Cell(mesh, *parts)


def _pad_of(scene: mi.Scene) -> PadShape:
    pads = [shape for shape in scene.shapes() if is_pad(shape)]
    if len(pads) != 1:
        raise NotDiffuse(f"the scene holds {len(pads)} deformable pads, and one is needed")
    if pads[0].finish is not None:
        raise NotDiffuse("the pad's cells have a finish")
    return pads[0]


@lru_cache(maxsize=4)
def _mesh_of(pad: Pad | PadFile) -> VolumeMesh:
    """The mesh whose faces are the patches for the light."""
    from mitsuba_taxel.mechanics.path.meshes import pad_mesh

    return pad_mesh(pad, pad.default_mesh_size)


@lru_cache(maxsize=32)
def _patches(elements: VolumeMesh, walls: VolumeMesh, pad: Pad | PadFile, faces: tuple[int, ...]) -> WallPatches:
    """Cached for the states of a path, as its points have to be located in the elements."""
    from mitsuba_taxel.mechanics.surface.wall_patches import WallPatches

    return WallPatches(elements, walls, pad, np.array(faces), LATTICE)


@lru_cache(maxsize=20)
def _kept_mesh(rest: bytes, degree: int) -> Mesh:
    """Cached for other states of the pad, as its pairs of points take half the time of a solution."""
    return Mesh(np.frombuffer(rest).reshape(-1, len(LATTICE), 3), degree)


@lru_cache(maxsize=80)
def kept_cell(mesh: Mesh, parts: bytes) -> Cell:
    """Cached for the derivatives of a reading, and for studies that read a scene again: enough for three states of nine
    cells, which the search for steps and meshes has solved before."""
    return Cell(mesh, *pickle.loads(parts))


def _shares(wall: mi.BSDF) -> tuple[float, float]:
    """Shares of the light that a wall scatters isotropically and by Lambert's law; it reflects nothing else."""
    if not is_wall(wall):
        raise NotDiffuse(f"a surface is a {kind_of(wall)}, not a wall")
    if wall.scattering == "absorbing":
        return 0.0, 0.0
    if wall.reflectance is None:
        raise NotDiffuse("a wall's reflectance is a table")
    reflectance, scattering, stated = float(wall.reflectance[0]), wall.scattering, wall.specification
    if reflectance == 0:
        return 0.0, 0.0
    if scattering == "mixed" and not stated.specular:
        return reflectance * (stated.isotropic or 0.0), reflectance * (stated.lambertian or 0.0)
    if scattering not in ("isotropic", "lambertian"):
        raise NotDiffuse(f"a wall is a mirror in part: scattering = {scattering!r}")
    return (reflectance, 0.0) if scattering == "isotropic" else (0.0, reflectance)


def _taxels(pair: TaxelPair, into_pad: IntoPad, scale: float, points: int) -> list[Taxel]:
    if pair.is_below_windows:
        raise NotDiffuse("LED and phototransistor lie below windows, where light is bent")
    stated = pair.led.specification
    size, hole = (pair.led.faces.scale * side for side in (stated.size, stated.hole))
    if stated.shape == "square":
        emitting = square_annulus_rule(size, hole, LED_POINTS, LED_POINTS)
    else:
        emitting = disc_annulus_rule(size, hole, LED_POINTS, 4 * LED_POINTS)
    width, depth = (float(side) for side in np.array(pair.sensor.faces.size, dtype=float).ravel())
    sensitive = rectangle_rule(width, depth, points, points)
    bodies = _bodies(pair, into_pad, scale)
    packages = [_scattering_faces(pair, body) for body in bodies]
    live = float(pair.led.power[0])  # in single precision, and perhaps changed in the loaded scene
    power = stated.power if math.isclose(live, stated.power, rel_tol=SINGLE) else live
    laws = _law_of_led(pair.led), _law_of_phototransistor(pair.sensor)
    leds = _ends(pair.led.faces, emitting, laws[0], into_pad)
    sensors = _ends(pair.sensor.faces, sensitive, laws[1], into_pad)
    return [
        Taxel(
            power,
            replace(led, weights=led.weights / led.weights.sum()),
            replace(sensor, weights=sensor.weights / scale**2),
            body,
            package,
        )
        for led, sensor, body, package in zip(leds, sensors, bodies, packages, strict=True)
    ]


def _bodies(pair: TaxelPair, into_pad: IntoPad, scale: float) -> list[Box | None]:
    """Boxes of the packages with the LEDs of a pair at their tops."""
    package, faces = pair.led.get_shape(), pair.led.faces
    centres = np.array(faces.centres, dtype=float).T
    if not is_package(package):
        return [None] * len(centres)
    axes = np.stack([np.array(axis, dtype=float).ravel() for axis in (faces.frame.s, faces.frame.t, faces.frame.n)])
    half = 0.5 * faces.scale * package.body
    side = package.sides["led"]
    inwards = -faces.scale * (side.x * axes[0] + side.y * axes[1]) - half[2] * axes[2]
    turned = into_pad(axes, is_direction=True)
    return [Box(into_pad(centre + inwards), turned, half / scale) for centre in centres]


def _scattering_faces(pair: TaxelPair, body: Box | None) -> PackageFaces | None:
    """The faces of a package with LED and phototransistor that scatter light; None if there are none."""
    package = pair.led.get_shape()
    walls = walls_by_region(package.bsdf())
    if not (body is not None and pair.coplanar and is_package(package)):
        return None
    each = [_shares(walls[name]) if name in walls else (0.0, 0.0) for name in (*package.sides, "body")]
    if any(isotropic for isotropic, _ in each):
        raise NotDiffuse(
            "a package scatters light isotropically, which ends with a step along the horizon of its faces"
        )
    shares = np.array([lambertian for _, lambertian in each])
    scale = 2 * body.half[:2] / package.body[:2]
    dies = [np.array([[s.x, s.y], [s.die_width, s.die_length]]) * scale for s in package.sides.values()]
    openings = [(x - a / 2, x + a / 2, y - b / 2, y + b / 2) for (x, y), (a, b) in (die.tolist() for die in dies)]
    found = faces_of(body, openings)
    kept = shares[found.kind] > 0
    return PackageFaces(found.among(kept), shares[found.kind[kept]]) if kept.any() else None


def _with_package(of_walls: np.ndarray, of_package: np.ndarray) -> np.ndarray:
    """(F + G, 2) shares scattered isotropically and by Lambert's law, from those of walls (F, 2) and of a package."""
    return np.concatenate([of_walls, np.column_stack([np.zeros_like(of_package), of_package])])


def _ends(faces: FaceGrid, rule: tuple[np.ndarray, np.ndarray], law: AngularLaw, into_pad: IntoPad) -> list[End]:
    axes = np.stack([np.array(axis, dtype=float).ravel() for axis in (faces.frame.s, faces.frame.t, faces.frame.n)])
    offsets, weights = rule
    around = offsets @ axes[:2]
    normal = into_pad(axes[2], is_direction=True)
    centres = np.array(faces.centres, dtype=float).T
    return [End(into_pad(centre + around), weights, normal, law) for centre in centres]


def _law_of_led(led: LedEmitter) -> AngularLaw:
    stated = led.specification
    if led.table is not None:
        return _tabulated(led.table, "the LED's law")
    if stated.law == "uniform_solid_angle":
        assert stated.cone_angle is not None  # set with this law
        return uniform_cone(np.cos(np.radians(stated.cone_angle)))
    if stated.law == "uniform_polar_angle":
        assert stated.cone_angle is not None  # set with this law
        if (angle := np.radians(stated.cone_angle)) < 2 * BLUNT:
            raise NotDiffuse(f"the LED's cone is narrower than {np.degrees(2 * BLUNT):.2g} degrees")
        return PolarCone(float(angle))
    if stated.law == "lambertian":
        return CosineFactor(1 / np.pi, 1.0)
    if stated.law == "cosine_power":
        assert stated.exponent is not None  # this law needs it
        return CosineFactor((stated.exponent + 1) / (2 * np.pi), stated.exponent)
    raise NotDiffuse(f"the LED's law is {stated.law}")


def _law_of_phototransistor(sensor: PhototransistorSensor) -> AngularLaw:
    stated = sensor.specification
    if sensor.table is not None:
        cosines, values = sensor.table
        if cosines[0] > HORIZON and values[0] > NEARLY_DARK * values.max():
            raise NotDiffuse("the phototransistor's response ends with a step")
        return _tabulated((cosines, values), "the phototransistor's response")
    if stated.response == "ideal":
        return CosineFactor(1.0, 0.0)
    if stated.response == "cosine_power":
        assert stated.exponent is not None  # this response needs it
        return CosineFactor(1.0, stated.exponent - 1)
    raise NotDiffuse(f"the phototransistor's response is {stated.response}")


def _tabulated(table: tuple[np.ndarray, np.ndarray], what: str) -> AngularLaw:
    law = TabulatedLaw(*table)
    if law.width(np.ones(1)) < NARROWEST:
        raise NotDiffuse(f"{what} changes by its largest value within {np.degrees(NARROWEST):.0f} degrees")
    return law


def _hemisphere(count: int) -> np.ndarray:
    """(N, 3) directions around +z, evenly distributed on a spiral."""
    z = (np.arange(count) + 0.5) / count
    turn = np.arange(count) * np.pi * (3 - np.sqrt(5))
    across = np.sqrt(1 - z**2)
    return np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1)


def _frame(normal: np.ndarray) -> np.ndarray:
    """(3, 3) rows: two directions across a normal, and the normal."""
    across = np.linalg.svd(normal[None])[2][1:]
    return np.concatenate([across, normal[None]])
