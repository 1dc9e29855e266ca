"""Cells with diffuse walls, an LED and a phototransistor, whose light can be computed without random numbers."""

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
    scattered_fractions,
)
from mitsuba_taxel.sensing.scene.taxels import taxels_of
from mitsuba_taxel.transport.cell import Cell, Mesh, ScatteringWalls
from mitsuba_taxel.transport.patch_cuts import PatchCuts, cut_at_plane, uncut
from mitsuba_taxel.transport.patches import LATTICE

if TYPE_CHECKING:
    from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
    from mitsuba_taxel.mechanics.surface.wall_patches import WallPatches
    from mitsuba_taxel.pads import AnyPad

MOST_FACES = 400
"""Largest number of patches of a cell. Time and memory grow with its square, to about 20 s and 4 GB."""
MOST_KEPT = 120
"""Largest number of patches of a cell that is cached. Its pairs of points take about 70 MB, a solution 15 MB."""
PROBES, LEAKS = 4096, 4
"""Number of rays from each LED that test whether it lights its own cell only, and number of rays that may leak between
triangles."""
CLEARANCE = 3e-3
"""Offset of the ends of rays from walls, relative to the longest ray. It exceeds the distance between walls and their
triangles."""
COVER, BEYOND = 5.0, 1.01
"""Ends of these rays may lie within the silicone: largest depth, relative to the offset; and factor by which an end is
moved beyond the surface, relative to its depth."""
EDGED = 5.0
"""Factor of the error of the light for cells whose scattering walls meet at sharp edges, because polynomials do not
approximate the light near an edge well. It was found by comparison with random paths."""
QUADRATURE, AT_EDGES, AT_ISOTROPIC_EDGES = 5e-5, 1.5e-4, 6e-4
"""Relative standard deviation of a reading due to the quadrature, which is the same for all solutions: without sharp
edges between scattering walls, with such edges, and with such edges between isotropic walls. Readings differ by up to
1.1e-4 from closed forms for spheres, and from patches of 0.6 of the size under load; with edges, they differ from
random paths by up to 2.4e-4 and 1.1e-3."""
_MESHING = threading.Lock()
"""Lock with which one thread at a time computes the pairs of points of a cell, which others then take from the
cache."""


class NotFollowed(ComputationError):
    """The light cannot be computed without random numbers: it would take too long, or walls occlude too much of it."""


@dataclass(frozen=True, eq=False)
class CellWalls:
    """The patches of one cell, and the fractions of the incident light that they scatter.

    Attributes
    ----------
    number : int
        Number of the cell in its pad, from 1.
    faces : ndarray
        Numbers of the mesh faces on the scattering walls: those of the cell or, in a built-in pad, of an equal cell.
    cuts : PatchCuts
        The F patches into which these faces are cut.
    has_edges : bool
        Whether the faces meet at sharp edges.
    package : (G, 15, 3) ndarray
        Positions in mm of the 15 nodes of each of G patches on the package.
    isotropic, lambertian : (F + G,) ndarray
        Fractions of the incident light that each patch scatters isotropically, and by Lambert's law.
    """

    number: int
    faces: np.ndarray
    cuts: PatchCuts
    has_edges: bool
    package: np.ndarray
    isotropic: np.ndarray
    lambertian: np.ndarray


class DiffuseCells:
    """The cells of a loaded scene with one pad, each with one taxel and diffuse walls.

    The patches for the light are the faces of a mesh whose default size does not depend on the size of the finite
    elements. In built-in pads, all cells use the faces of the cell with the fewest faces, so that the pairs of
    quadrature points are computed once.

    Parameters
    ----------
    scene : mi.Scene
        A loaded scene.
    points : int
        Number of quadrature points along each side of a phototransistor.
    patch_size : float, optional
        Size in mm of the patches for the light instead of the default.

    Raises
    ------
    NotDiffuse
        if the light of the scene needs random paths, for example because walls are not diffuse or other surfaces
        reflect light; the message has the reason.
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
        # LEDs, phototransistors and packages in the frame of the pad; all other surfaces must absorb.
        scale = float(np.cbrt(np.linalg.det(self.pad.to_world[:3, :3])))
        pairs = taxels_of(scene)
        self.taxels = [taxel for pair in pairs for taxel in diffuse_taxels(pair, self._into_pad, scale, points)]
        packages = [pair.led.get_shape().ptr for pair in pairs if pair.coplanar]
        for shape in scene.shapes():
            for name, wall in () if shape.ptr in (self.pad.ptr, *packages) else walls_by_region(shape.bsdf()).items():
                if any(scattered_fractions(wall)):
                    surface = f"the {name} of a {kind_of(shape)}" if name else f"a {kind_of(shape)}"
                    raise NotDiffuse(
                        f"{surface} reflects light, but only light between walls of pad and packages is computed"
                    )
        # The cells: their walls that scatter light, cut into patches.
        fractions = {
            REGIONS[name]: scattered_fractions(wall)
            for name, wall in walls_by_region(self.pad.bsdf()).items()
            if name in REGIONS
        }
        regions = [region for region, scattered in fractions.items() if any(scattered)]
        scatters = np.isin(self._mesh.face_region, regions)
        pad_cells = _cells_of(self._mesh, self.pad.pad, scatters)
        self.cells = [self._cell(taxel, fractions, scatters, pad_cells) for taxel in self.taxels]
        self._refuse_other_cells()

    def _into_pad(self, points: np.ndarray, is_direction: bool = False) -> np.ndarray:
        """Transform points, or unit directions, from world coordinates to the frame of the pad."""
        linear, shift = self.pad.to_world[:3, :3], self.pad.to_world[:3, 3]
        vectors = points if is_direction else points - shift
        in_pad = np.linalg.solve(linear, vectors.T).T
        return in_pad / np.linalg.norm(in_pad, axis=-1, keepdims=True) if is_direction else in_pad

    def _cell(
        self, taxel: Taxel, fractions: dict[int, tuple[float, float]], scatters: np.ndarray, pad_cells: _PadCells
    ) -> CellWalls:
        """Build the cell nearest to a taxel. ``fractions`` are the scattered fractions (isotropic, Lambertian) by code
        of the region, and ``scatters`` marks the mesh faces that scatter light."""
        nearest = np.linalg.norm(pad_cells.centres - taxel.middle, axis=1).argmin()
        faces = np.flatnonzero(scatters & (self._mesh.face_cell == pad_cells.drawn[nearest]))
        if not len(faces):
            raise NotDiffuse("no wall of a cell reflects light")
        number = int(pad_cells.number[nearest])
        edged = _have_edges(self._mesh, self.pad.pad, tuple(faces.tolist()))
        # Walls with edges are cut along the phototransistor's plane; readings of domes do not need this.
        cuts = uncut(len(faces))
        if edged:
            at = _patches(self.pad.state.mesh, self._mesh, self.pad.pad, tuple(faces.tolist()), number).rest
            cuts = cut_at_plane(at, taxel.phototransistor.points.mean(axis=0), taxel.phototransistor.normal)
        scattered = np.array([fractions[region] for region in self._mesh.face_region[faces[cuts.parent]].tolist()])
        package = np.empty((0, len(LATTICE), 3))
        if taxel.package is not None:
            package, of_package = taxel.package.cut(self._cuts(taxel.package))
            scattered = _with_package(scattered, of_package)
        if len(scattered) - len(cuts.parent) + len(faces) > MOST_FACES:
            raise NotFollowed(
                f"light without random numbers takes too long between the {len(scattered)} patches of a cell: "
                f"{MOST_FACES} at most are allowed."
            )
        return CellWalls(number, faces, cuts, edged, package, *scattered.T)

    def _cuts(self, package: PackageFaces) -> np.ndarray:
        """Numbers (R, 2) of parts into which each of R rectangles of a package is divided along its two sides, so that
        no part is larger than the patches of walls."""
        return package.faces.cuts(self.patch_size or self.pad.pad.default_mesh_size)

    def _refuse_other_cells(self) -> None:
        """Raise if an LED lights scattering walls of another cell."""
        if len({cell.number for cell in self.cells}) < len(self.cells):
            raise NotDiffuse("two photo-reflectors lie in one cell")
        surface = self.pad.surface
        regions = np.unique(self._mesh.face_region[np.concatenate([cell.faces for cell in self.cells])])
        directions = _hemisphere(PROBES)
        for taxel, cell in zip(self.taxels, self.cells, strict=True):
            start = np.broadcast_to(taxel.led.points.mean(axis=0), directions.shape)
            ray = self._rays(start, directions @ _frame(taxel.led.normal))
            first = self.scene.ray_intersect_preliminary(ray)
            on_pad = np.array(first.is_valid()) & np.array(first.shape == mi.ShapePtr(self.pad))
            hit = np.array(first.prim_index)[on_pad]
            foreign = np.isin(surface.region[hit], regions) & (surface.cell[hit] != cell.number)
            if np.count_nonzero(foreign) > LEAKS:
                raise NotDiffuse(f"the LED in cell {cell.number} lights walls of cell {surface.cell[hit][foreign][0]}")

    def _rays(self, start: np.ndarray, away: np.ndarray) -> mi.Ray3f:
        """Rays in world coordinates, for starting points and vectors given in the frame of the pad."""
        linear, shift = self.pad.to_world[:3, :3], self.pad.to_world[:3, 3]
        origin, direction = (
            mi.Vector3f(*(in_packets(component) for component in vectors.T))
            for vectors in (start @ linear.T + shift, away @ linear.T)
        )
        return mi.Ray3f(mi.Point3f(origin), direction)

    def occluded_fraction(self, sources: np.ndarray, ends: np.ndarray, fraction: np.ndarray) -> float:
        """Fraction of a reading whose light would travel along segments that a surface other than the package occludes.

        Parameters
        ----------
        sources, ends, fraction : ndarray
            Start points and end points of segments, and the fraction of the reading on each, as :meth:`Cell.flows`
            returns them.

        Returns
        -------
        float
            Fraction, from 0 to 1.
        """
        clear = CLEARANCE * np.linalg.norm(sources[:, 0] - ends[:, 0], axis=1).max(initial=0)
        start, end = (points[:, 0] + clear * points[:, 1] for points in (sources, ends))
        occluded = np.flatnonzero(self._occluded(start, end))
        if len(occluded):
            # Patches are coarser than the triangles of the walls, so that an end at an edge may lie within the
            # silicone. The surface by which a segment leaves the silicone there does not occlude it.
            start, end = start[occluded], end[occluded]
            deepest = COVER * clear
            covered = self._covered(start, end - start, deepest), self._covered(end, start - end, deepest)
            start, end = (1 - covered[0]) * start + covered[0] * end, (1 - covered[1]) * end + covered[1] * start
            occluded = occluded[self._occluded(start, end)]
        return float(fraction[occluded].sum())

    def _occluded(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """For each of N pairs of points, whether a surface other than the package lies between them, as a mask (N,)."""
        _, hit = self._first(start, end - start)
        occluded = hit.is_valid()
        for package in filter(is_package, self.scene.shapes()):
            occluded &= hit.shape != mi.ShapePtr(package)
        return np.array(occluded)

    def _covered(self, start: np.ndarray, segment: np.ndarray, deepest: float) -> np.ndarray:
        """Fraction (N, 1) of the length of each of N segments from its start to the point where it first leaves the
        silicone; 0 if it does not leave the silicone within ``deepest`` mm."""
        ray, hit = self._first(start, segment)
        normal = hit.compute_surface_interaction(ray, mi.RayFlags.Minimal).n
        leaves = hit.is_valid() & (hit.shape == mi.ShapePtr(self.pad)) & (dr.dot(ray.d, normal) > 0)
        fraction = np.array(dr.select(leaves, hit.t, 0.0))
        return np.where(fraction * np.linalg.norm(segment, axis=1) <= deepest, BEYOND * fraction, 0.0)[:, None]

    def _first(self, start: np.ndarray, segment: np.ndarray) -> tuple[mi.Ray3f, mi.PreliminaryIntersection3f]:
        """Rays along segments, and the first surface that each hits within its segment."""
        ray = self._rays(start, segment)
        ray.maxt = mi.Float(1.0)
        return ray, self.scene.ray_intersect_preliminary(ray)

    def patches(self, number: int, elements: VolumeMesh | None = None) -> CellPatches:
        """Patches of the undeformed walls of a cell, and of its package.

        Parameters
        ----------
        number : int
            Index of the cell.
        elements : VolumeMesh, optional
            Finite elements whose displacement moves the walls; those of the pad's state by default.

        Returns
        -------
        CellPatches
            Patches in the frame of the pad.
        """
        cell = self.cells[number]
        mesh, faces = elements or self.pad.state.mesh, tuple(cell.faces.tolist())
        return CellPatches(_patches(mesh, self._mesh, self.pad.pad, faces, cell.number), cell.cuts, cell.package)

    def light_mesh(self, number: int, degree: int) -> Mesh:
        """Quadrature points on the patches of a cell, in pairs between which light is exchanged.

        Parameters
        ----------
        number : int
            Index of the cell.
        degree : int
            Degree of the polynomials that approximate the light on each patch, 1 or 2.

        Returns
        -------
        Mesh
            The quadrature. It is cached unless it is large, because the computation of its pairs of points takes half
            the time of a solution.
        """
        pattern = self.patches(number).pattern
        if len(pattern) > MOST_KEPT:
            return Mesh(pattern, degree)
        with _MESHING:
            return _kept_mesh(pattern.tobytes(), degree)

    def cell_like(self, number: int, before: DiffuseCells) -> CellWalls:
        """The cell of this scene with its patches cut as in another scene, which differs in one parameter: for a
        derivative with respect to that parameter.

        Parameters
        ----------
        number : int
            Index of the cell.
        before : DiffuseCells
            The cells of the other scene, before the parameter changed.

        Returns
        -------
        CellWalls
            Patches, with the scattered fractions and the package after the change.

        Raises
        ------
        NotDiffuse
            if the patches of both scenes do not correspond.
        """
        cell, cell_before = self.cells[number], before.cells[number]
        package_before, package_after = before.taxels[number].package, self.taxels[number].package
        scattered = np.column_stack([cell.isotropic, cell.lambertian])
        first, walls = np.unique(cell.cuts.parent, return_index=True)[1], len(cell.cuts.parent)
        package, of_package = cell.package, scattered[walls:, 1]
        if (
            package_before is not None
            and package_after is not None
            and len(package_before.fractions) == len(package_after.fractions)
        ):
            package, of_package = package_after.cut(before._cuts(package_before))
        same = cell.number == cell_before.number and np.array_equal(cell.faces, cell_before.faces)
        if not (same and package.shape == cell_before.package.shape):
            raise NotDiffuse("as the parameter changes, a wall begins to reflect light, or two dies begin to touch")
        scattered = _with_package(scattered[first][cell_before.cuts.parent], of_package)
        return CellWalls(cell.number, cell.faces, cell_before.cuts, cell.has_edges, package, *scattered.T)

    def error_factor(self, number: int) -> float:
        """Error of a cell's light, divided by the difference of two solutions on patches of two sizes.

        The factors for kinks and for edges multiply: the error of a cylinder with both is 0.7 %, whereas the root of
        the sum of their squares would state 0.3 % (`taxel bench light`, number 102).
        """
        return self.taxels[number].error_factor * (EDGED if self.cells[number].has_edges else 1.0)

    def quadrature_error(self, number: int) -> float:
        """Relative error of a reading due to the quadrature. It does not show in the difference of two solutions,
        because both have the same quadrature."""
        cell = self.cells[number]
        if not cell.has_edges:
            return QUADRATURE
        return AT_ISOTROPIC_EDGES if cell.isotropic.any() else AT_EDGES

    def walls_alike(self, first: int, second: int) -> bool:
        """Whether two cells, given by their indices, have equal numbers of patches with equal scattered fractions, so
        that their light can be compared.
        """
        fractions = (np.column_stack([self.cells[k].isotropic, self.cells[k].lambertian]) for k in (first, second))
        counts = [np.unique(rows, axis=0, return_counts=True) for rows in fractions]
        return all(np.array_equal(*pair) for pair in zip(*counts, strict=True))

    def solved(self, number: int, mesh: Mesh, positions: np.ndarray) -> Cell:
        """Compute the exchange of light in a cell.

        Parameters
        ----------
        number : int
            Index of the cell.
        mesh : Mesh
            Quadrature from :meth:`light_mesh`.
        positions : (F + G, 15, 3) ndarray
            Positions of the 15 nodes of each patch, in mm: F patches on walls, then G on the package.

        Returns
        -------
        Cell
            The solved cell; it is cached unless it is large.
        """
        taxel, cell = self.taxels[number], self.cells[number]
        rest, package = self.patches(number).rest, len(cell.package)
        walls = ScatteringWalls(positions, rest, cell.isotropic, cell.lambertian, package, cell.has_edges)
        arguments = walls, taxel.led, taxel.phototransistor, taxel.body
        if len(positions) > MOST_KEPT:
            return Cell(mesh, *arguments)
        return kept_cell(mesh, pickle.dumps(arguments))


def _pad_of(scene: mi.Scene) -> PadShape:
    pads = [shape for shape in scene.shapes() if is_pad(shape)]
    if len(pads) != 1:
        raise NotDiffuse(f"the scene holds {len(pads)} deformable pads, and one is needed")
    if pads[0].finish is not None:
        raise NotDiffuse("the pad's cells have a finish")
    return pads[0]


@kept(4)
def _mesh_of(pad: AnyPad, size: float) -> VolumeMesh:
    """The mesh of a pad whose faces are the patches for the light."""
    from mitsuba_taxel.mechanics.meshes import pad_mesh

    return pad_mesh(pad, size)


class _PadCells(NamedTuple):
    """The K cells of a pad, and the mesh faces that serve as their patches.

    ``number`` (K,) has the numbers of the cells, and ``centres`` (K, 2) their centres in mm. ``drawn`` (K,) has, for
    each cell, the number of the cell whose mesh faces it uses.
    """

    number: np.ndarray
    centres: np.ndarray
    drawn: np.ndarray


def _cells_of(mesh: VolumeMesh, pad: AnyPad, scatters: np.ndarray) -> _PadCells:
    """The cells of a pad; the mask ``scatters`` marks the faces of the mesh that scatter light."""
    if isinstance(pad, Pad):
        centres = np.array(pad.cell_centres)
        fewest = np.bincount(mesh.face_cell[scatters], minlength=1 + len(centres))[1:].argmin()
        return _PadCells(np.arange(1, 1 + len(centres)), centres, np.full(len(centres), 1 + fewest))
    numbers = np.unique(mesh.face_cell[mesh.face_cell > 0])
    of_cells = [mesh.points[mesh.faces[mesh.face_cell == number]] for number in numbers]
    return _PadCells(numbers, np.array([points.mean(axis=(0, 1))[:2] for points in of_cells]), numbers)


@kept(32)
def _have_edges(mesh: VolumeMesh, pad: AnyPad, faces: tuple[int, ...]) -> bool:
    """Whether some faces of a mesh meet at sharp edges; cached for all cells with the same faces."""
    from mitsuba_taxel.mechanics.surface.tessellation import have_edges

    return have_edges(mesh, np.array(faces), pad)


@kept(32)
def _patches(
    elements: VolumeMesh, walls: VolumeMesh, pad: AnyPad, faces: tuple[int, ...], cell: int
) -> WallPatches:
    """Patches on faces of a mesh. They are cached for all states of a load path, because their nodes must be located in
    the finite elements."""
    from mitsuba_taxel.mechanics.surface.wall_patches import WallPatches

    return WallPatches(elements, walls, pad, np.array(faces), cell, LATTICE)


@kept(20)
def _kept_mesh(pattern: bytes, degree: int) -> Mesh:
    """Quadrature on F patches (F, 15, 3), cached for equal cells and for other states of the pad."""
    return Mesh(np.frombuffer(pattern).reshape(-1, len(LATTICE), 3), degree)


@kept(80)
def kept_cell(mesh: Mesh, arguments: bytes) -> Cell:
    """Compute the exchange of light in a cell; the result is cached for the derivatives of the reading, and for studies
    that read a scene again.

    The cache holds three states of nine cells, which studies have already solved while they choose load steps and
    meshes.

    Parameters
    ----------
    mesh : Mesh
        Quadrature on the patches of the cell.
    arguments : bytes
        The other arguments of :class:`Cell`, pickled.

    Returns
    -------
    Cell
        The light in the cell.
    """
    return Cell(mesh, *pickle.loads(arguments))


def _with_package(of_walls: np.ndarray, of_package: np.ndarray) -> np.ndarray:
    """Join the scattered fractions of walls and package. Returns the fractions (F + G, 2) scattered isotropically and
    by Lambert's law, from those (F, 2) of F patches on walls and (G,) of G patches on a package."""
    return np.concatenate([of_walls, np.column_stack([np.zeros_like(of_package), of_package])])


def _hemisphere(count: int) -> np.ndarray:
    """Unit directions (``count``, 3) in the hemisphere around +z, evenly distributed on a spiral."""
    z = (np.arange(count) + 0.5) / count
    turn = np.arange(count) * np.pi * (3 - np.sqrt(5))
    across = np.sqrt(1 - z**2)
    return np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1)


def _frame(normal: np.ndarray) -> np.ndarray:
    """Orthonormal axes as rows (3, 3): two tangential directions, and the normal."""
    across = np.linalg.svd(normal[None])[2][1:]
    return np.concatenate([across, normal[None]])
