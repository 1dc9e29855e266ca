"""Second-order tetrahedral mesh of a pad by Netgen."""

from __future__ import annotations

import math
import threading
from typing import Any

import numpy as np

from mitsuba_taxel.errors import ComputationError, InputError
from mitsuba_taxel.pads.mirror import ACROSS_DIAGONAL, ACROSS_X, ACROSS_Y, mirrored
from mitsuba_taxel.pads.pad import DEFAULT_MESH_SIZE, REGIONS, Pad
from mitsuba_taxel.pads.quality import worst_element
from mitsuba_taxel.pads.solid import SYMMETRY, is_square, symmetric_part
from mitsuba_taxel.pads.volume_mesh import FACE_EDGES, TET_EDGES, VolumeMesh

RIM_REFINEMENT = 2.0
"""How much smaller elements are along the edges glued to the board, where the stress is singular."""
CURVATURE_SAFETY = (2.0, 2.5, 3.0, 4.0, 6.0)
"""Elements per radius of curvature, tried in turn until no element is too distorted."""
LEAST_QUALITY = 0.2
"""Least determinant of an element's map, relative to that of the straight element."""
MOST_ELEMENTS = 1_000_000

MESHING_LOCK = threading.RLock()
"""Held round every call of Netgen, which is not safe in several threads at once."""


def mesh_pad(pad: Pad, mesh_size: float = DEFAULT_MESH_SIZE) -> VolumeMesh:
    """Mesh a pad with elements of about ``mesh_size`` mm, finer along the edges glued to the board.

    An octant of a square pad, a quadrant of another is meshed and mirrored, so that the mesh has the pad's symmetry
    to the last bit.

    Raises
    ------
    InputError
        if ``mesh_size`` is not a finite length above 0, or asks for more elements than fit in memory.
    ComputationError
        if Netgen fails, or leaves an element inverted that cannot be mended.
    """
    if not (math.isfinite(mesh_size) and mesh_size > 0):
        raise InputError(f"mesh_size = {mesh_size:g} is not allowed: a finite number above 0 is needed.")
    smallest = (8 * math.prod(pad.extent) / MOST_ELEMENTS) ** (1 / 3)
    if mesh_size < smallest:
        raise InputError(f"mesh_size = {mesh_size:g} is not allowed: at least {smallest:.2g} is needed for this pad.")
    for curvature_safety in CURVATURE_SAFETY:
        with MESHING_LOCK:
            mesh = _read(_generate(pad, mesh_size, curvature_safety), pad)
        quality, place = worst_element(mesh)
        if quality >= LEAST_QUALITY:
            for mirror in (*([ACROSS_DIAGONAL] if is_square(pad) else []), ACROSS_X, ACROSS_Y):
                mesh = mirrored(mesh, mirror)
            return _numbered(mesh, pad)
    x, y, z = place
    raise ComputationError(
        f"the mesh has a distorted element near ({x:.3g}, {y:.3g}, {z:.3g}) mm: choose another mesh_size than "
        f"{mesh_size:g}."
    )


def _generate(pad: Pad, mesh_size: float, curvature_safety: float) -> Any:
    from netgen.meshing import MeshingParameters, NgException, SetMessageImportance
    from netgen.occ import OCCGeometry

    SetMessageImportance(0)
    try:
        solid = symmetric_part(pad)
        glued = _glued_edges(solid, pad)
        for edge in glued:
            edge.maxh = mesh_size / RIM_REFINEMENT
        parameters = MeshingParameters(maxh=mesh_size, grading=0.4, curvaturesafety=curvature_safety)
        mesh = OCCGeometry(solid).GenerateMesh(parameters)
        mesh.SecondOrder()
    except NgException as error:
        raise ComputationError(f"meshing the pad failed: {' '.join(str(error).split())}.") from error
    return mesh


def _glued_edges(solid: Any, pad: Pad) -> list[Any]:
    """The edges at the board, but for those that only the cut along a plane of symmetry made."""
    cut = {edge for face in solid.faces if face.name == SYMMETRY for edge in face.edges}
    return [edge for edge in solid.edges if edge.bounding_box[1].z < 1e-6 * pad.height and edge not in cut]


def _read(mesh: Any, pad: Pad) -> VolumeMesh:
    """The mesh of the symmetric part, with its nodes exactly on the planes that they belong to."""
    points = np.array(mesh.Coordinates(), dtype=float)
    surface = mesh.Elements2D().NumPy()
    tets = _sorted_nodes(mesh.Elements3D().NumPy()["nodes"], points, TET_EDGES)
    faces = _sorted_nodes(surface["nodes"], points, FACE_EDGES)
    names = [mesh.GetBCName(int(i)) for i in range(surface["index"].max())]
    region = np.array([REGIONS.get(name, 0) for name in names])[surface["index"] - 1]
    assert set(names) <= {*REGIONS, SYMMETRY}, names
    points = _snapped(points, pad)
    tets = _right_handed(tets, points)
    faces = _outward(faces[region > 0], tets, points)
    return VolumeMesh(points, tets, faces, region[region > 0], np.zeros(len(faces), dtype=int))


def _sorted_nodes(nodes: np.ndarray, points: np.ndarray, edges: tuple[tuple[int, int], ...]) -> np.ndarray:
    """Corners and mid-edge nodes of elements (zero-based), the latter in the order of ``edges``.

    Netgen has an order of its own; each edge takes the node nearest to its middle.
    """
    corners = max(max(edge) for edge in edges) + 1
    nodes = nodes[:, : corners + len(edges)].astype(np.int64) - 1
    middle = np.stack([points[nodes[:, list(edge)]].mean(axis=1) for edge in edges], axis=1)
    candidates = points[nodes[:, corners:]]
    distance = np.linalg.norm(middle[:, :, None] - candidates[:, None], axis=-1)
    order = distance.argmin(axis=2)
    assert np.all(np.sort(order, axis=1) == np.arange(len(edges))), "a mid-edge node is not near its edge"
    nodes[:, corners:] = np.take_along_axis(nodes[:, corners:], order, axis=1)
    return nodes


def _right_handed(tets: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Tetrahedra with positive volume: those that have not get their second and third corner swapped."""
    a, b, c, d = (points[tets[:, k]] for k in range(4))
    negative = np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) < 0
    swap = [0, 2, 1, 3, 6, 5, 4, 7, 9, 8]
    return np.where(negative[:, None], tets[:, swap], tets)


def _outward(faces: np.ndarray, tets: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Boundary triangles turned counter-clockwise seen from outside."""
    owners: dict[tuple[int, ...], int] = {}
    for corners in ((0, 1, 2, 3), (0, 1, 3, 2), (0, 2, 3, 1), (1, 2, 3, 0)):
        keys = np.sort(tets[:, corners[:3]], axis=1)
        owners.update(zip(map(tuple, keys), tets[:, corners[3]], strict=True))
    inside = np.array([owners[tuple(key)] for key in np.sort(faces[:, :3], axis=1)])
    a, b, c = (points[faces[:, k]] for k in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), points[inside] - a) > 0
    swap = [0, 2, 1, 5, 4, 3]
    return np.where(inward[:, None], faces[:, swap], faces)


def _snapped(points: np.ndarray, pad: Pad) -> np.ndarray:
    """Nodes within rounding of the planes of symmetry, the bottom or the top, exactly on them."""
    tolerance = 1e-7 * pad.height
    points = np.where(np.abs(points) < tolerance, 0.0, points)
    points[np.abs(points[:, 2] - pad.height) < tolerance, 2] = pad.height
    if is_square(pad):
        on_diagonal = np.abs(points[:, 0] - points[:, 1]) < tolerance
        points[on_diagonal, 1] = points[on_diagonal, 0]
    return points


def _numbered(mesh: VolumeMesh, pad: Pad) -> VolumeMesh:
    """The mesh with each roof and side face given the number of its cell, and corners before other nodes."""
    corners = np.zeros(len(mesh.points), dtype=bool)
    corners[mesh.tets[:, :4]] = True
    order = np.argsort(~corners, kind="stable")
    new = np.empty_like(order)
    new[order] = np.arange(len(order))

    centre = mesh.points[mesh.faces[:, :3], :2].mean(axis=1)
    distance = np.linalg.norm(centre[:, None] - np.array(pad.cell_centres), axis=-1)
    in_cell = np.isin(mesh.face_region, (REGIONS["roof"], REGIONS["side"]))
    cell = np.where(in_cell, distance.argmin(axis=1) + 1, 0)
    return VolumeMesh(mesh.points[order], new[mesh.tets], new[mesh.faces], mesh.face_region, cell)
