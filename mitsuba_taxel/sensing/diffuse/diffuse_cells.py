"""Cells with diffuse walls, each with its LED and phototransistor, whose light can be computed without random
numbers."""

from __future__ import annotations

import pickle
import threading
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsuba_taxel.backend import llvm
from mitsuba_taxel.backend.packets import in_packets
from mitsuba_taxel.backend.plugin_objects import kind_of
from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.kernels.protocols import PadShape, is_package, is_pad
from mitsuba_taxel.kernels.walls import walls_by_region
from mitsuba_taxel.pads.parametric.pad import Pad
from mitsuba_taxel.pads.regions import REGIONS
from mitsuba_taxel.sensing.diffuse.cell_patches import CellPatches
from mitsuba_taxel.sensing.diffuse.diffuse_taxels import (
    PHOTOTRANSISTOR_POINTS,
    NotDiffuse,
    PackageFaces,
    Taxel,
    diffuse_taxels,
    scattered_shares,
)
from mitsuba_taxel.sensing.scene.taxels import taxels_of
from mitsuba_taxel.transport.cell import Cell, Mesh, ScatteringWalls
from mitsuba_taxel.transport.patch_cuts import PatchCuts, cut_at_plane, uncut
from mitsuba_taxel.transport.patches import LATTICE

if TYPE_CHECKING:
    from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
    from mitsuba_taxel.mechanics.surface.wall_patches import WallPatches
    from mitsuba_taxel.pads import PadFile

MOST_FACES = 400
"""Limit of patches on the walls of a cell: time and memory grow with their square, to some 20 s and 4 GB."""
MOST_KEPT = 120
"""Largest number of patches of a cell whose pairs of points, then some 70 MB, and solutions, of 15 MB, are kept."""
PROBES, LEAKS = 4096, 4
"""Rays from each LED to test whether it lights only its own cell, and how many of them may leak between triangles."""
CLEARANCE = 3e-3
"""Offset of the ends of rays between walls, relative to the longest: the distance of triangles from the walls."""
COVER, BEYOND = 5.0, 1.01
"""Deepest ends of such rays within the silicone, relative to that, and how much further on they begin."""
EDGED = 5.0
"""How much larger errors of light are relative to the difference of two solutions where walls that scatter meet at
sharp edges, near which polynomials do not follow the light between them: compared with random paths."""
QUADRATURE, AT_EDGES, AT_ISOTROPIC_EDGES = 5e-5, 1.5e-4, 6e-4
"""Standard deviation of a reading by the quadrature that all solutions share; where walls that scatter meet at sharp
edges; and where they scatter isotropically there. Against spheres, and against patches of 0.6 of the size under load,
readings differ by up to 1.1e-4; with edges from random paths by up to 2.4e-4 and 1.1e-3."""
_MESHING = threading.Lock()
"""Held while the pairs of points of a cell are found, which others wait for."""


class NotFollowed(ComputationError):
    """Light without random numbers would take too long, or leave out too much that is blocked."""


@dataclass(frozen=True, eq=False)
class CellWalls:
    """The scattering walls of a cell, and the faces of its package.

    Attributes
    ----------
    number : int
        Of the cell in its pad, from 1.
    faces : ndarray
        Numbers of the mesh faces that define the patches: those of the cell or, in a built-in pad, of an equal one.
    cuts : PatchCuts
        The F patches into which they are cut.
    has_edges : bool
        Whether they meet at sharp edges.
    package : (G, 15, 3) ndarray
        Patches on the package.
    isotropic, lambertian : (F + G,) ndarray
        Share of the incident light that each scatters with this law.
    """

    number: int
    faces: np.ndarray
    cuts: PatchCuts
    has_edges: bool
    package: np.ndarray
    isotropic: np.ndarray
    lambertian: np.ndarray


class DiffuseCells:
    """A loaded scene of one pad whose cells contain one taxel each.

    Patches for the light are the faces of a mesh of the default size, whatever the size of the finite elements. In
    built-in pads they are those of the cell with the fewest for all cells, whose pairs of points are found once.

    Parameters
    ----------
    scene : mi.Scene
    points : int
        Along a side of each phototransistor.
    patch_size : float, optional
        Size in mm of the patches for the light instead of the default.

    Raises
    ------
    NotDiffuse
        with the reason, if the scene is of another kind, or other surfaces reflect light.
    NotFollowed
        if a cell has too many patches.
    """

    def __init__(self, scene: mi.Scene, points: int = PHOTOTRANSISTOR_POINTS, patch_size: float | None = None) -> None:
        if not llvm.is_fit():
            raise NotDiffuse(f"light without random numbers needs an LLVM of version {llvm.OLDEST_LLVM} or newer")
        self.scene = scene
        self.pad = _pad_of(scene)
        self.patch_size = patch_size
        self._mesh = _mesh_of(self.pad.pad, patch_size or self.pad.pad.default_mesh_size)
        placed = self._into_pad, self._scale
        pairs = taxels_of(scene)
        self.taxels = [taxel for pair in pairs for taxel in diffuse_taxels(pair, *placed, points)]
        self._refuse_other_walls([pair.led.get_shape().ptr for pair in pairs if pair.coplanar])
        shares = {
            REGIONS[name]: scattered_shares(wall)
            for name, wall in walls_by_region(self.pad.bsdf()).items()
            if name in REGIONS
        }
        scatters = np.isin(self._mesh.face_region, [region for region, share in shares.items() if any(share)])
        places = _places_of(self._mesh, self.pad.pad, scatters)
        self.cells = [self._cell(taxel, shares, scatters, places) for taxel in self.taxels]
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

    def _refuse_other_walls(self, packages: list[int]) -> None:
        """Raise if anything but the pad, and packages with an LED and its phototransistor, reflects light."""
        for shape in self.scene.shapes():
            for name, wall in () if shape.ptr in (self.pad.ptr, *packages) else walls_by_region(shape.bsdf()).items():
                if any(scattered_shares(wall)):
                    part = f"the {name} of a {kind_of(shape)}" if name else f"a {kind_of(shape)}"
                    raise NotDiffuse(f"{part} sends light back, and only walls of pad and packages are followed")

    def _cell(
        self, taxel: Taxel, shares: dict[int, tuple[float, float]], scatters: np.ndarray, places: _Places
    ) -> CellWalls:
        nearest = np.linalg.norm(places.centres - taxel.middle, axis=1).argmin()
        faces = np.flatnonzero(scatters & (self._mesh.face_cell == places.drawn[nearest]))
        if not len(faces):
            raise NotDiffuse("no wall of a cell sends light back")
        number = int(places.number[nearest])
        edged = _have_edges(self._mesh, self.pad.pad, tuple(faces.tolist()))
        cuts = uncut(len(faces))
        if edged:  # domes are right without
            at = _patches(self.pad.state.mesh, self._mesh, self.pad.pad, tuple(faces.tolist()), number).rest
            cuts = cut_at_plane(at, taxel.phototransistor.points.mean(axis=0), taxel.phototransistor.normal)
        each = np.array([shares[region] for region in self._mesh.face_region[faces[cuts.parent]].tolist()])
        package = np.empty((0, len(LATTICE), 3))
        if taxel.package is not None:
            package, of_package = taxel.package.cut(self._cuts(taxel.package))
            each = _with_package(each, of_package)
        if len(each) - len(cuts.parent) + len(faces) > MOST_FACES:
            raise NotFollowed(
                f"light without random numbers takes too long between the {len(each)} patches of a cell: "
                f"{MOST_FACES} at most are allowed."
            )
        return CellWalls(number, faces, cuts, edged, package, *each.T)

    def _cuts(self, package: PackageFaces) -> np.ndarray:
        """Parts of a package's faces, which are no larger than the patches of walls."""
        return package.faces.cuts(self.patch_size or self.pad.pad.default_mesh_size)

    def _refuse_other_cells(self) -> None:
        """Raise if an LED lights scattering walls of another cell."""
        if len({cell.number for cell in self.cells}) < len(self.cells):
            raise NotDiffuse("two photo-reflectors lie in one cell")
        surface = self.pad.surface
        regions = np.unique(self._mesh.face_region[np.concatenate([cell.faces for cell in self.cells])])
        directions = _hemisphere(PROBES)
        for taxel, cell in zip(self.taxels, self.cells, strict=True):
            hit = self._hits(taxel.led.points.mean(axis=0), directions @ _frame(taxel.led.normal))
            strange = np.isin(surface.region[hit], regions) & (surface.cell[hit] != cell.number)
            if np.count_nonzero(strange) > LEAKS:
                raise NotDiffuse(f"the LED in cell {cell.number} lights walls of cell {surface.cell[hit][strange][0]}")

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
        occluded = hit.is_valid()
        for package in filter(is_package, self.scene.shapes()):
            occluded &= hit.shape != mi.ShapePtr(package)
        return np.array(occluded)

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
        mesh, faces = elements or self.pad.state.mesh, tuple(cell.faces.tolist())
        return CellPatches(_patches(mesh, self._mesh, self.pad.pad, faces, cell.number), cell.cuts, cell.package)

    def light_mesh(self, number: int, degree: int) -> Mesh:
        """The quadrature on the walls of a cell."""
        pattern = self.patches(number).pattern
        return _kept_mesh(pattern, degree) if len(pattern) <= MOST_KEPT else Mesh(pattern, degree)

    def cell_like(self, number: int, before: DiffuseCells) -> CellWalls:
        """A cell, with the faces of its package cut as in the scene before one of its parameters changed.

        Raises
        ------
        NotDiffuse
            if there are other patches.
        """
        cell, known = self.cells[number], before.cells[number]
        one, other = before.taxels[number].package, self.taxels[number].package
        scattered = np.column_stack([cell.isotropic, cell.lambertian])
        first, walls = np.unique(cell.cuts.parent, return_index=True)[1], len(cell.cuts.parent)
        package, of_package = cell.package, scattered[walls:, 1]
        if one is not None and other is not None and len(one.shares) == len(other.shares):
            package, of_package = other.cut(before._cuts(one))
        same = cell.number == known.number and np.array_equal(cell.faces, known.faces)
        if not (same and package.shape == known.package.shape):
            raise NotDiffuse("a wall begins to send light back, or dies to touch, as the parameter changes")
        each = _with_package(scattered[first][known.cuts.parent], of_package).T
        return CellWalls(cell.number, cell.faces, known.cuts, cell.has_edges, package, *each)

    def light_share(self, number: int) -> float:
        """Factor of the errors of a cell's light, as the difference of two solutions tells them.

        Kinks and edges multiply: a cylinder with both is 0.7 % off, where the root of the sum of their squares states
        0.3 % (`taxel bench light`, number 102).
        """
        return self.taxels[number].light_share * (EDGED if self.cells[number].has_edges else 1.0)

    def quadrature_share(self, number: int) -> float:
        """Relative error of a reading that no difference of two solutions tells."""
        cell = self.cells[number]
        if not cell.has_edges:
            return QUADRATURE
        return AT_ISOTROPIC_EDGES if cell.isotropic.any() else AT_EDGES

    def walls_alike(self, one: int, other: int) -> bool:
        """Whether the walls of two cells scatter equally, judged by all of their properties."""
        shares = (np.column_stack([cell.isotropic, cell.lambertian]) for cell in (self.cells[one], self.cells[other]))
        each = [np.unique(rows, axis=0, return_counts=True) for rows in shares]
        return all(np.array_equal(*pair) for pair in zip(*each, strict=True))

    def solved(self, number: int, mesh: Mesh, places: np.ndarray) -> Cell:
        """The light in a cell, whose patches are at ``places`` (F + G, 15, 3)."""
        taxel, cell = self.taxels[number], self.cells[number]
        rest, package = self.patches(number).rest, len(cell.package)
        walls = ScatteringWalls(places, rest, cell.isotropic, cell.lambertian, package, cell.has_edges)
        parts = walls, taxel.led, taxel.phototransistor, taxel.body
        return kept_cell(mesh, pickle.dumps(parts)) if len(places) <= MOST_KEPT else Cell(mesh, *parts)


def _pad_of(scene: mi.Scene) -> PadShape:
    pads = [shape for shape in scene.shapes() if is_pad(shape)]
    if len(pads) != 1:
        raise NotDiffuse(f"the scene holds {len(pads)} deformable pads, and one is needed")
    if pads[0].finish is not None:
        raise NotDiffuse("the pad's cells have a finish")
    return pads[0]


@kept(4)
def _mesh_of(pad: Pad | PadFile, size: float) -> VolumeMesh:
    """The mesh whose faces are the patches for the light."""
    from mitsuba_taxel.mechanics.meshes import pad_mesh

    return pad_mesh(pad, size)


class _Places(NamedTuple):
    """Cells of a pad: their numbers (K,), their places (K, 2) in mm, and the numbers (K,) of those whose faces are the
    patches."""

    number: np.ndarray
    centres: np.ndarray
    drawn: np.ndarray


def _places_of(mesh: VolumeMesh, pad: Pad | PadFile, scatters: np.ndarray) -> _Places:
    """The cells of a pad, with faces (F,) some of which scatter light."""
    if isinstance(pad, Pad):
        centres = np.array(pad.cell_centres)
        fewest = np.bincount(mesh.face_cell[scatters], minlength=1 + len(centres))[1:].argmin()
        return _Places(np.arange(1, 1 + len(centres)), centres, np.full(len(centres), 1 + fewest))
    numbers = np.unique(mesh.face_cell[mesh.face_cell > 0])
    of_cells = [mesh.points[mesh.faces[mesh.face_cell == number]] for number in numbers]
    return _Places(numbers, np.array([points.mean(axis=(0, 1))[:2] for points in of_cells]), numbers)


@kept(32)
def _have_edges(mesh: VolumeMesh, pad: Pad | PadFile, faces: tuple[int, ...]) -> bool:
    """Cached for all cells with the same faces."""
    from mitsuba_taxel.mechanics.surface.tessellation import have_edges

    return have_edges(mesh, np.array(faces), pad)


@kept(32)
def _patches(
    elements: VolumeMesh, walls: VolumeMesh, pad: Pad | PadFile, faces: tuple[int, ...], cell: int
) -> WallPatches:
    """Cached for the states of a path, as its points have to be located in the elements."""
    from mitsuba_taxel.mechanics.surface.wall_patches import WallPatches

    return WallPatches(elements, walls, pad, np.array(faces), cell, LATTICE)


def _kept_mesh(pattern: np.ndarray, degree: int) -> Mesh:
    with _MESHING:
        return _found_mesh(pattern.tobytes(), degree)


@kept(20)
def _found_mesh(pattern: bytes, degree: int) -> Mesh:
    """Cached for other cells and states of the pad, as its pairs of points take half the time of a solution."""
    return Mesh(np.frombuffer(pattern).reshape(-1, len(LATTICE), 3), degree)


@kept(80)
def kept_cell(mesh: Mesh, parts: bytes) -> Cell:
    """A solved cell, cached for the derivatives of a reading, and for studies that read a scene again.

    There is room for three states of nine cells, which the search for steps and meshes has solved before.

    Parameters
    ----------
    mesh : Mesh
        Its patches.
    parts : bytes
        Its other arguments, pickled.

    Returns
    -------
    Cell
        Of the transport of light.
    """
    return Cell(mesh, *pickle.loads(parts))


def _with_package(of_walls: np.ndarray, of_package: np.ndarray) -> np.ndarray:
    """(F + G, 2) shares scattered isotropically and by Lambert's law, from those of walls (F, 2) and of a package."""
    return np.concatenate([of_walls, np.column_stack([np.zeros_like(of_package), of_package])])


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
