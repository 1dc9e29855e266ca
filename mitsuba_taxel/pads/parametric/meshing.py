"""Second-order tetrahedral mesh of a pad by Netgen, graded towards the edges where the stress is singular."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.geometry.element_maps import worst_element
from mitsuba_taxel.geometry.mirror import ACROSS_DIAGONAL, ACROSS_X, ACROSS_Y, mirrored
from mitsuba_taxel.geometry.second_order import edge_ends
from mitsuba_taxel.geometry.untangling import untangled
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.pads.cells.fillet import FILLET
from mitsuba_taxel.pads.cells.mouth import ROUND_MOUTH
from mitsuba_taxel.pads.cells.rim_fillet import RimFillet
from mitsuba_taxel.pads.meshers import require_netgen
from mitsuba_taxel.pads.parametric.drawn_pad import DrawnPad
from mitsuba_taxel.pads.parametric.edge_zones import carried
from mitsuba_taxel.pads.parametric.grading import cut_towards
from mitsuba_taxel.pads.parametric.lean import leaning, leans, on_round_walls
from mitsuba_taxel.pads.parametric.outside import ROUND_OUTSIDE
from mitsuba_taxel.pads.parametric.rounding import MOST_CUT, rounding, sharp_nodes, with_round_rims
from mitsuba_taxel.pads.parametric.solid import (
    SYMMETRY,
    is_square,
    rounded,
    singular_edges,
    singular_nodes,
    symmetric_part,
)
from mitsuba_taxel.pads.regions import REGIONS

BULK_COARSENING = 1.25
"""Relative size of elements inside, where the strain is smooth: roofs stay as accurate with fewer elements."""
GRADING = 0.4
"""Netgen's parameter for the growth of elements from the walls to the inside."""
RIM_REFINEMENT = 2.0
"""Divisor of the element size along the edges where the stress is singular."""
FINER_DOMES = 0.5
"""Smallest additional factor of the size of elements on domes and their sides. On meshes finer than the default, these
elements shrink additionally, in proportion to the relative mesh size, because the remaining error of mirrors stems from
their normals."""
FINER_EDGES, EDGE_EXPONENT = 0.5, 3.0
"""Smallest value of an additional factor of the size of elements along the singular edges of flat roofs, and its
exponent. On meshes finer than the default, these elements shrink additionally, by this power of the relative mesh size,
because the error of slopes under tangential forces arises there."""
CUT = 0.2
"""Position of the cut of elements at a singular edge, relative to their length."""
CURVATURE_SAFETY = 2.0
"""Elements per radius of curvature. Round walls and caps may have fewer if the requested size is larger; a dome may
not, as elements along its rim would be distorted."""
SLENDER = 10.0
"""Height of a side wall, relative to the size of the cell, above which only the dome gets small elements: otherwise the
wall would have them over its full height."""
SLENDER_WALL, ALONG_SLENDER_WALL = 0.3, 0.19
"""Thickness of walls, relative to the height of their sides, below which their elements are limited to this length
relative to the height. Such walls buckle in waves about as long as they are high; larger elements, which divide the
waves unevenly, would bend them too early."""
REFINEMENTS = (1.0, 1.06, 1.12, 1.18, 1.25, 1.35, 1.5, 2.0, 3.0)
"""Divisors of all element sizes, tried in turn until no element is too distorted. They start close to 1, as a larger
divisor gives more elements."""
LEAST_QUALITY = 0.2
"""Least determinant of an element's map, relative to that of the straight element."""
UNITS_OF_HEIGHT = 4.0
"""Height of every pad during meshing: Netgen has absolute tolerances."""
MOST_ELEMENTS = 1_000_000

_NETGEN_TET = [0, 1, 2, 3, 4, 7, 5, 6, 8, 9]
_NETGEN_FACE = [0, 1, 2, 5, 3, 4]
"""Netgen's nodes in the order of `TET_EDGES` and `FACE_EDGES`."""

WIDTH, WIDEST = 0.7, 0.4
"""Width of the fillets of cuboid cells with which they are meshed, relative to the size of elements along edges, and
its limit relative to the thinnest part of the pad and half the cell."""

CORNER = 0.65
"""Size of elements at the corners of cuboid cells, relative to that on fillets."""
BLUNT, WIDEST_BLUNT = 0.6, 0.3
"""Size of elements on the fillets of mouths and of the outside, relative to the radius; and the largest radius with
which they are meshed, if they are narrower, relative to the thinnest part beside them."""
STRAIGHT = 1e-6
"""Distance of a midpoint from the chord, relative to the radius of the fillets of cuboid cells, or else to the size of
the cells, at which an edge counts as straight."""

MESHING_LOCK = threading.RLock()
"""Lock for all calls of Netgen, which is not thread-safe."""


def mesh_pad(pad: DrawnPad, mesh_size: float) -> VolumeMesh:
    """Mesh a pad with elements of about ``mesh_size`` mm, finer around the cells, finest where the stress is singular.

    An octant of a square pad, or a quadrant of another, is meshed with upright cells and mirrored, so that the mesh has
    exactly the pad's symmetry. The mesh of leaning cells is then sheared.

    Parameters
    ----------
    pad : DrawnPad
        The pad, with lengths in mm.
    mesh_size : float
        Length of the edges of elements, mm.

    Returns
    -------
    VolumeMesh
        Undeformed quadratic tetrahedra with tagged faces.

    Raises
    ------
    InputError
        if ``mesh_size`` is not a finite length above 0, if it or the number of cells needs more elements than fit in
        memory, or without Netgen.
    ComputationError
        if Netgen fails, or leaves an inverted element that cannot be repaired.
    """
    check_room(pad, mesh_size)
    for refinement in REFINEMENTS:
        mesh = _symmetric_mesh(pad, mesh_size, refinement)
        quality, position = worst_element(mesh)
        if not quality >= LEAST_QUALITY:
            continue
        for mirror in (*([ACROSS_DIAGONAL] if is_square(pad) else []), ACROSS_X, ACROSS_Y):
            mesh = mirrored(mesh, mirror)
        mesh = _numbered(mesh, pad)
        if not leans(pad):
            return mesh
        mesh = leaning(pad, mesh)
        quality, position = worst_element(mesh)
        if quality >= LEAST_QUALITY:
            return mesh
    x, y, z = position
    raise ComputationError(
        f"the mesh has a distorted element near ({x:.3g}, {y:.3g}, {z:.3g}) mm: choose another mesh_size than "
        f"{mesh_size:g}."
    )


def check_room(pad: DrawnPad, mesh_size: float) -> None:
    """Refuse an invalid mesh size, or a mesh with more elements than fit in memory.

    Parameters
    ----------
    pad : DrawnPad
        The pad, with lengths in mm.
    mesh_size : float
        Length of the edges of elements, mm.

    Raises
    ------
    InputError
        if the size, or the number of cells, is not allowed.
    """
    if not (math.isfinite(mesh_size) and mesh_size > 0):
        raise InputError(f"mesh_size = {mesh_size:g} is not allowed: a finite number above 0 is needed.")
    most_cells = MOST_ELEMENTS // pad.shape.least_elements
    if pad.rows * pad.columns > most_cells:
        raise InputError(
            f"rows = {pad.rows}, columns = {pad.columns} are not allowed: at most {most_cells} {pad.cell} cells can be "
            "meshed."
        )
    smallest = (8 * math.prod(pad.extent) / MOST_ELEMENTS) ** (1 / 3)
    if mesh_size < smallest and mesh_size >= 0.5 * pad.default_mesh_size:  # the default size, which no user has set
        size = " x ".join(f"{side:.3g}" for side in pad.extent)
        raise InputError(
            f"cell_size = {pad.cell_size:g} mm in a pad of {size} mm is not allowed: its thinnest parts need "
            f"elements of {mesh_size:.2g} mm, but at least {smallest:.2g} mm is possible in a pad of this size. "
            "Lengths are in mm."
        )
    if mesh_size < smallest:
        raise InputError(f"mesh_size = {mesh_size:g} is not allowed: at least {smallest:.2g} is needed for this pad.")
    wall, largest = _slender_wall(pad)
    if pad.shape.face_refinement * largest < smallest:
        raise InputError(
            f"rows = {pad.rows}, columns = {pad.columns} are not allowed with walls of {wall:g} mm, which need "
            f"elements of {largest:.2g} mm: fewer cells or thicker walls are needed."
        )


def _symmetric_mesh(pad: DrawnPad, mesh_size: float, refinement: float) -> VolumeMesh:
    """The mesh of the symmetric part of the upright pad.

    Elements at singular and at rounded edges are cut, and nodes are moved onto the exact walls; see `rounding`."""
    if pad.mouth is not None or pad.outside is not None:
        wide = _with_wide_edges(pad, _local_sizes(pad, mesh_size)[1] / refinement)
        mesh = _with_wide_or_sharp_edges(wide, mesh_size, refinement)
        if not worst_element(mesh)[0] >= 0.5 * LEAST_QUALITY:
            return mesh
        if wide.mouth_fillet != pad.mouth_fillet or wide.outer_fillet != pad.outer_fillet:
            mesh = replace(mesh, points=snapped(_narrowed(mesh, wide, pad), pad))
        return untangled(mesh, LEAST_QUALITY)
    return _with_wide_or_sharp_edges(pad, mesh_size, refinement)


def _with_wide_edges(pad: DrawnPad, edge_size: float) -> DrawnPad:
    """Copy of a pad with wider fillets of mouths and of the outside: about as wide as elements along edges, in mm."""
    thinnest = min(pad.wall, 0.5 * (pad.pitch - pad.cell_size) if pad.rows * pad.columns > 1 else math.inf)
    radii = [pad.mouth_fillet, pad.outer_fillet]
    rooms = [min(thinnest, pad.side_height - pad.fillet), thinnest]
    wide = (min(WIDTH * edge_size, WIDEST_BLUNT * room) for room in rooms)
    return pad.with_blunt_edges(*(max(r, width) if r else 0.0 for r, width in zip(radii, wide, strict=True)))


def _with_wide_or_sharp_edges(pad: DrawnPad, mesh_size: float, refinement: float) -> VolumeMesh:
    """Mesh of the symmetric part of an upright pad. Fillets of mouths and of the outside are meshed with their true
    radius."""
    edges, below = pad.edges, -pad.cell_size
    if edges is None:
        mesh = _generated(pad, mesh_size, refinement)
        mesh = cut_towards(mesh, singular_nodes(mesh, pad), CUT)
        return replace(mesh, points=snapped(rounded(mesh, pad), pad))
    edge_size = _local_sizes(pad, mesh_size)[1] / refinement
    if isinstance(edges, RimFillet):
        sharp = pad.with_fillet(0.0)
        marked = edges.width > MOST_CUT * edge_size
        cell = partial(edges.marked_solid, below=below) if marked else None
        mesh = with_round_rims(_generated(sharp, mesh_size, refinement, cell, edges.width), pad, CUT, marked)
        return replace(mesh, points=snapped(mesh.points, pad))
    # Fillets as wide as elements, which then move onto narrower fillets.
    room = min(0.5 * pad.cell_size, pad.side_height, 2 * pad.wall, 2 * (pad.height - pad.top_of_cell))
    room = min(room, pad.pitch - pad.cell_size) if pad.rows * pad.columns > 1 else room
    wide = pad.with_fillet(max(pad.fillet, min(WIDTH * edge_size, WIDEST * room)))
    assert wide.edges is not None
    cell = partial(wide.edges.solid, below=below)
    mesh = _generated(wide, mesh_size, refinement, cell, 0.25 * math.pi * wide.fillet)
    mesh = cut_towards(mesh, singular_nodes(mesh, wide), CUT)
    mesh = replace(mesh, points=snapped(rounded(mesh, wide), wide))
    return untangled(replace(mesh, points=snapped(_narrowed(mesh, wide, pad), pad)), LEAST_QUALITY)


def _narrowed(mesh: VolumeMesh, wide: DrawnPad, pad: DrawnPad) -> np.ndarray:
    """Nodes (N, 3) of a mesh after its fillets have been narrowed, from the radius in the pad ``wide`` to the radius in
    ``pad``.
    """
    sharp = sharp_nodes(wide, mesh, mesh.points)
    points = sharp + wide.shape.shifts(pad.shape, sharp, lambda function: function(pad.shape) - function(wide.shape))
    points = carried(wide, pad, sharp, points)
    points += rounding(pad, mesh, points)
    ends = edge_ends(mesh.tets)
    middles = mesh.points[ends].mean(axis=1)
    tolerance = STRAIGHT * (wide.fillet or pad.cell_size)
    straight = np.linalg.norm(mesh.points[mesh.corner_count :] - middles, axis=1) < tolerance
    straight &= ~on_round_walls(pad, mesh)[mesh.corner_count :]
    points[mesh.corner_count :][straight] = points[ends[straight]].mean(axis=1)
    return points


def _generated(
    pad: DrawnPad,
    mesh_size: float,
    refinement: float,
    cell: Callable[[float, float], Any] | None = None,
    fillet_size: float = math.inf,
) -> VolumeMesh:
    """Mesh of the symmetric part of a pad by Netgen. ``cell`` may replace the solids of the cells; elements on fillets
    have at most ``fillet_size`` mm.
    """
    require_netgen("meshing a pad")
    with MESHING_LOCK:
        from netgen.meshing import MeshingParameters, NgException, SetMessageImportance
        from netgen.occ import OCCGeometry, Pnt

        SetMessageImportance(0)
        unit = pad.height / UNITS_OF_HEIGHT
        face_size, edge_size = (size / refinement for size in _local_sizes(pad, mesh_size))
        shape, curvature_safety = pad.shape, CURVATURE_SAFETY * refinement
        slender = pad.side_height > SLENDER * pad.cell_size
        if slender or not shape.has_curved_rim:
            curvature_safety = min(curvature_safety, 0.5 * pad.cell_size / face_size)
        if shape.is_square and pad.fillet:
            curvature_safety = min(curvature_safety, pad.fillet / fillet_size)
        if (pad.mouth_fillet or pad.outer_fillet) and not shape.has_curved_rim:
            curvature_safety = min(curvature_safety, 1 / BLUNT)
        try:
            solid = symmetric_part(pad, cell or pad.shape.solid).Scale(Pnt(0, 0, 0), 1 / unit)
            for face in solid.faces:
                if face.name in ("roof", "side"):
                    face.maxh = face_size / unit
                if face.name == ROUND_MOUTH:
                    face.maxh = min(face_size, BLUNT * pad.mouth_fillet) / unit
                if face.name == ROUND_OUTSIDE:
                    is_corner = _largest_side(face) < 1.01 * pad.outer_fillet / unit
                    face.maxh = (CORNER if is_corner else 1.0) * BLUNT * pad.outer_fillet / unit
                if face.name == FILLET:
                    is_corner = _largest_side(face) < 1.01 * pad.fillet / unit
                    face.maxh = min(face_size, CORNER * fillet_size if is_corner else fillet_size) / unit
                if slender and face.name == "roof" and shape.roof_radius:
                    face.maxh = min(face_size, shape.roof_radius / CURVATURE_SAFETY / refinement) / unit
            for edge in singular_edges(solid, pad):
                edge.maxh = edge_size / unit
            inside = _finer(pad, mesh_size) if shape.finer_inside else 1.0
            parameters = MeshingParameters(
                maxh=BULK_COARSENING * mesh_size / inside / unit,
                grading=GRADING / math.sqrt(inside),
                curvaturesafety=curvature_safety,
                parallel_meshing=False,  # threads bring no gain for one solid, and are ten times slower on busy cores
            )
            mesh = OCCGeometry(solid).GenerateMesh(parameters)
            mesh.SecondOrder()
        except NgException as error:
            reason = " ".join(str(error).split())
            raise ComputationError(
                f"meshing the pad failed: {reason}. Choose another mesh_size than {mesh_size:g}."
            ) from error
        return _read(mesh, pad, unit)


def _largest_side(face: Any) -> float:
    """Largest side of the box that bounds a face of a solid."""
    low, high = face.bounding_box
    return float(max(high.x - low.x, high.y - low.y, high.z - low.z))


def _local_sizes(pad: DrawnPad, mesh_size: float) -> tuple[float, float]:
    """Sizes of elements on roofs and side walls, and along singular edges, in mm.

    Where silicone is thin beside a round wall, the sagitta of the elements' curved edges is at most a quarter of its
    thickness."""
    shape = pad.shape
    finer = _finer(pad, mesh_size) ** shape.finer_power
    wall, largest = _slender_wall(pad)
    if shape.round_regions:
        thinnest = min(wall, pad.height - pad.top_of_cell)
        largest = min(largest, math.sqrt(pad.cell_size * thinnest))  # a chord s of a circle has a sagitta s^2 / (4 d)
    along_edges = _finer_edges(pad, mesh_size) * mesh_size / RIM_REFINEMENT
    return min(finer * mesh_size / shape.face_refinement, largest), min(along_edges, largest)


def _slender_wall(pad: DrawnPad) -> tuple[float, float]:
    """Thickness of the thinnest wall in mm, and the largest element size in mm along it. The size is infinite unless
    the wall is slender.
    """
    wall = pad.thinnest_wall
    if pad.rows * pad.columns > 1:
        wall = min(wall, pad.pitch - pad.cell_size)
    is_slender = wall < SLENDER_WALL * pad.side_height
    return wall, ALONG_SLENDER_WALL * pad.side_height if is_slender else math.inf


def _finer(pad: DrawnPad, mesh_size: float) -> float:
    """Factor of the element size on round roofs on meshes finer than the default: the relative mesh size, down to
    `FINER_DOMES`; 1 on coarser meshes and for flat roofs."""
    return min(max(mesh_size / pad.default_mesh_size, FINER_DOMES), 1.0) if "roof" in pad.shape.round_regions else 1.0


def _finer_edges(pad: DrawnPad, mesh_size: float) -> float:
    """Factor of the element size along singular edges on meshes finer than the default, down to `FINER_EDGES`; 1 on
    coarser meshes and for round roofs."""
    relative = (mesh_size / pad.default_mesh_size) ** EDGE_EXPONENT
    return 1.0 if "roof" in pad.shape.round_regions else min(max(relative, FINER_EDGES), 1.0)


def _read(mesh: Any, pad: DrawnPad, unit: float) -> VolumeMesh:
    """Netgen's mesh of the symmetric part in mm, with nodes moved exactly onto the planes to which they belong."""
    points = unit * np.array(mesh.Coordinates(), dtype=float)
    surface = mesh.Elements2D().NumPy()
    tets = mesh.Elements3D().NumPy()["nodes"][:, _NETGEN_TET].astype(np.int64) - 1
    faces = surface["nodes"][:, _NETGEN_FACE].astype(np.int64) - 1
    of_fillets = {FILLET: "side", ROUND_MOUTH: "side", ROUND_OUTSIDE: "outer"}
    names = [mesh.GetBCName(int(i)) for i in range(surface["index"].max())]
    names = [of_fillets.get(name, name) for name in names]
    region = np.array([REGIONS.get(name, 0) for name in names])[surface["index"] - 1]
    assert set(names) <= {*REGIONS, SYMMETRY}, names
    points = snapped(points, pad)
    tets = _right_handed(tets, points)
    faces = _outward(faces[region > 0], tets, points)
    return VolumeMesh(points, tets, faces, region[region > 0], np.zeros(len(faces), dtype=int))


def _right_handed(tets: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Orient tetrahedra to positive volume: inverted tetrahedra get their second and third corner swapped."""
    a, b, c, d = (points[tets[:, k]] for k in range(4))
    negative = np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) < 0
    swap = [0, 2, 1, 3, 6, 5, 4, 7, 9, 8]
    return np.where(negative[:, None], tets[:, swap], tets)


def _outward(faces: np.ndarray, tets: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Orient boundary triangles counter-clockwise as seen from outside the silicone."""
    opposite: dict[tuple[int, ...], int] = {}
    for corners in ((0, 1, 2, 3), (0, 1, 3, 2), (0, 2, 3, 1), (1, 2, 3, 0)):
        sorted_corners = np.sort(tets[:, corners[:3]], axis=1)
        opposite.update(zip(map(tuple, sorted_corners), tets[:, corners[3]], strict=True))
    inside = np.array([opposite[tuple(key)] for key in np.sort(faces[:, :3], axis=1)])
    a, b, c = (points[faces[:, k]] for k in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), points[inside] - a) > 0
    swap = [0, 2, 1, 5, 4, 3]
    return np.where(inward[:, None], faces[:, swap], faces)


def snapped(points: np.ndarray, pad: DrawnPad) -> np.ndarray:
    """The points, moved exactly onto the planes of symmetry, the bottom or the top if they lie within rounding errors
    of such a plane.

    Parameters
    ----------
    points : (N, 3) ndarray
        Positions in mm.
    pad : DrawnPad
        Pad for its height and symmetry.

    Returns
    -------
    (N, 3) ndarray
        Positions in mm.
    """
    tolerance = 1e-7 * pad.height
    points = np.where(np.abs(points) < tolerance, 0.0, points)
    points[np.abs(points[:, 2] - pad.height) < tolerance, 2] = pad.height
    if is_square(pad):
        on_diagonal = np.abs(points[:, 0] - points[:, 1]) < tolerance
        points[on_diagonal, 1] = points[on_diagonal, 0]
    return points


def _numbered(mesh: VolumeMesh, pad: DrawnPad) -> VolumeMesh:
    """Number the mesh: corners before other nodes, and roof and side faces by cell."""
    from scipy.spatial import cKDTree

    corners = np.zeros(len(mesh.points), dtype=bool)
    corners[mesh.tets[:, :4]] = True
    order = np.argsort(~corners, kind="stable")
    new = np.empty_like(order)
    new[order] = np.arange(len(order))

    centre = mesh.points[mesh.faces[:, :3], :2].mean(axis=1)
    nearest = cKDTree(pad.cell_centres).query(centre)[1]
    in_cell = np.isin(mesh.face_region, (REGIONS["roof"], REGIONS["side"]))
    cell = np.where(in_cell, nearest + 1, 0)
    return VolumeMesh(mesh.points[order], new[mesh.tets], new[mesh.faces], mesh.face_region, cell)
