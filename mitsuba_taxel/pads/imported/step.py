"""Second-order tetrahedral mesh of the solid in a STEP file, by Netgen, graded and mirrored like parametric pads."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.geometry.element_maps import curved_volume, worst_element
from mitsuba_taxel.geometry.mirror import MIRRORS, Mirror
from mitsuba_taxel.geometry.second_order import positive, second_order
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.pads.imported.isolated_process import run_isolated
from mitsuba_taxel.pads.imported.local_sizes import SingularEdges, patch_sizes
from mitsuba_taxel.pads.imported.placement import AS_DRAWN, Placement
from mitsuba_taxel.pads.imported.regions import FacedSurface, tagged
from mitsuba_taxel.pads.imported.round_faces import on_round_faces
from mitsuba_taxel.pads.imported.rules import Rule
from mitsuba_taxel.pads.imported.surfaces import VOLUME_TOLERANCE, check_mesh_size
from mitsuba_taxel.pads.imported.symmetric_part import PLANE, TOLERANCE, completed, exactly_on, group_of, planes_of
from mitsuba_taxel.pads.imported.triangles.curvature import radii
from mitsuba_taxel.pads.imported.triangles.snapping import Patches
from mitsuba_taxel.pads.meshers import require_netgen
from mitsuba_taxel.pads.parametric.grading import cut_towards
from mitsuba_taxel.pads.parametric.meshing import (
    BULK_COARSENING,
    CURVATURE_SAFETY,
    CUT,
    LEAST_QUALITY,
    REFINEMENTS,
    RIM_REFINEMENT,
)

_NETGEN_EDGES = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))
"""Corners whose edge carries nodes 4 to 9 of Netgen's tetrahedron."""
FINER = 1.2
"""Divisor of the element size, relative to parametric pads, whose sizes are tuned to their shapes."""
SURVEY_SAFETY = 4.0
"""Triangles per radius of curvature for the survey of a body."""
MOST_IMAGES = 300
"""Number of points of the surface whose mirror images are tested."""


def mesh_step(path: Path, digest: str, rules: tuple[Rule, ...], mesh_size: float, placement: Placement) -> VolumeMesh:
    """Mesh of the only solid in a STEP file.

    Parameters
    ----------
    path : Path
        The file.
    digest : str
        Digest of the file's content, for caches.
    rules : tuple[Rule, ...]
        Rules that assign regions to faces.
    mesh_size : float
        Length of the edges of elements, mm.
    placement : Placement
        Placement by which the file is scaled, turned and moved.

    Returns
    -------
    VolumeMesh
        Undeformed quadratic tetrahedra with tagged faces.

    Raises
    ------
    GeometryError
        if the file cannot be read, or its solid is not a pad.
    ComputationError
        if meshing fails.
    """
    survey = surveyed(path, digest, rules, placement)
    check_mesh_size(mesh_size, survey.volume)
    # Netgen may fail on a part cut from the body, or cut it incorrectly.
    for mirrors in (survey.mirrors, ()) if survey.mirrors else ((),):
        mesh = _good_mesh(_read_as(path, placement), survey, mirrors, mesh_size, last=not mirrors)
        if mesh is not None:
            return mesh
    raise ComputationError(f"the mesh does not fill the whole pad: choose another mesh_size than {mesh_size:g}.")


def _read_as(path: Path, placement: Placement) -> dict[str, object]:
    """Arguments that tell the worker process how to read a STEP file: path, scale, rotation and position."""
    up = "" if placement.up == AS_DRAWN else placement.up
    return {"path": str(path), "scale": placement.scale, "turn": placement.turn, "centred": bool(up)}


def _good_mesh(
    solid: dict[str, object], survey: Survey, mirrors: tuple[Mirror, ...], mesh_size: float, last: bool
) -> VolumeMesh | None:
    """Mesh a solid with several refinements; returns the first mesh without distorted elements, or None. With ``last``,
    a complete mesh with distorted elements is accepted too."""
    for refinement in REFINEMENTS:
        try:
            mesh = completed(_meshed(solid, survey, mirrors, mesh_size, FINER * refinement), mirrors)
        except ComputationError:
            if last:
                raise
            return None
        complete = abs(curved_volume(mesh) / survey.volume - 1) < VOLUME_TOLERANCE
        if complete and worst_element(mesh)[0] >= LEAST_QUALITY:
            return mesh
    return mesh if last and complete else None


@dataclass(frozen=True, eq=False)
class Survey:
    """Properties of a solid with F faces that its meshing needs: volume, symmetries, regions, and edges with singular
    stress.

    Attributes
    ----------
    volume, diagonal, height : float
        Volume in mm³; diagonal and height in mm.
    mirrors : tuple[Mirror, ...]
        Mirror planes, which form a group.
    region, cell : (F,) ndarray
        Code of the region and number of the cell of each face.
    patches : Patches
        Smooth patches of triangles (T, 3) that approximate the surface.
    patch_region : (T,) ndarray
        Code of the region of each of these triangles.
    face : (T,) ndarray
        Face of each of these triangles.
    singular : SingularEdges
        Edges where the stress is singular.
    """

    volume: float
    diagonal: float
    height: float
    mirrors: tuple[Mirror, ...]
    region: np.ndarray
    cell: np.ndarray
    patches: Patches
    patch_region: np.ndarray
    face: np.ndarray
    singular: SingularEdges


@kept(4)  # used again for the second mesh of the error estimate
def surveyed(path: Path, digest: str, rules: tuple[Rule, ...], placement: Placement) -> Survey:
    """Compute the properties of the solid in a STEP file that meshing needs.

    Parameters
    ----------
    path : Path
        The file.
    digest : str
        Digest of the file's content, for caches.
    rules : tuple[Rule, ...]
        Rules that assign regions to faces.
    placement : Placement
        Placement by which the file is scaled, turned and moved.

    Returns
    -------
    Survey
        Survey, with lengths in mm.

    Raises
    ------
    GeometryError
        if the file cannot be read, or its solid is not a pad.
    """
    require_netgen("a pad from a STEP file")
    solid = _read_as(path, placement)
    raw = run_isolated("survey_step", {**solid, "curvature_safety": SURVEY_SAFETY})
    points, triangles, face = raw["points"], raw["triangles"], raw["face"]
    placement.check_extent(points)
    by_triangle, by_cell = tagged(FacedSurface(points, triangles, face, raw["names"].tolist()), rules, placement)
    region, cell = np.zeros((2, len(raw["names"])), dtype=int)
    region[face], cell[face] = by_triangle, by_cell
    patches = Patches(points, triangles, by_triangle, by_cell)
    singular = SingularEdges(patches, by_triangle, face)
    diagonal, height = float(np.linalg.norm(np.ptp(points, axis=0))), float(points[:, 2].max())
    mirrors = _mirrors(solid, points, triangles, face, region, TOLERANCE * diagonal)
    volume = float(raw["volume"])
    return Survey(
        volume=volume,
        diagonal=diagonal,
        height=height,
        mirrors=mirrors,
        region=region,
        cell=cell,
        patches=patches,
        patch_region=by_triangle,
        face=face,
        singular=singular,
    )


def _mirrors(
    solid: dict[str, object],
    points: np.ndarray,
    triangles: np.ndarray,
    face: np.ndarray,
    region: np.ndarray,
    tolerance: float,
) -> tuple[Mirror, ...]:
    """The mirrors under which the body and its regions are invariant; this is tested at points on the whole surface."""
    node, first = np.unique(triangles, return_index=True)
    chosen = np.unique(np.linspace(0, len(node) - 1, MOST_IMAGES).astype(int))
    node, region_of_node = node[chosen], region[np.repeat(face, 3)[first[chosen]]]
    # A point on several faces is assigned to one of them: its image lies on the images of all.
    matrices = np.array([mirror.image(np.eye(3)) for mirror in MIRRORS])
    request = {**solid, "region": region, "points": points[node], "at": region_of_node, "matrices": matrices}
    invariant = run_isolated("mirrors_of_step", {**request, "tolerance": tolerance})["kept"]
    return group_of(mirror for mirror, holds in zip(MIRRORS, invariant, strict=True) if holds)


def _meshed(
    solid: dict[str, object], survey: Survey, mirrors: tuple[Mirror, ...], mesh_size: float, refinement: float
) -> VolumeMesh:
    """Mesh of the symmetric part; its faces along the mirror planes have the region `PLANE`."""
    planes = planes_of(mirrors)
    sizes = patch_sizes(survey.patches, survey.patch_region, mesh_size) / refinement
    face_size = np.full(len(survey.region), np.inf)
    np.minimum.at(face_size, survey.face, sizes[survey.patches.patch])
    # One size for all faces; faces of stronger curvature have their own sizes.
    curved = float((radii(survey.patches) / sizes).min())
    safety = min(max(curved, 1.0), CURVATURE_SAFETY * refinement)
    raw = run_isolated(
        "mesh_step",
        {
            **solid,
            "planes": np.array([mirror.normal for mirror in planes], dtype=float).reshape(-1, 2),
            "mesh_size": BULK_COARSENING * mesh_size / refinement,
            "face_size": face_size,
            "edge_size": mesh_size / RIM_REFINEMENT / refinement,
            "singular": survey.singular.between,
            "curvature_safety": safety,
        },
    )
    mesh, face = _read(raw, survey)
    rounding = 1e-7 * survey.diagonal
    exact = exactly_on(mesh.points, planes, survey.height, rounding)
    singular = survey.singular.nodes(exact, mesh.faces, face)
    singular |= survey.singular.nodes_on_planes(exact, planes, rounding)
    cut = cut_towards(VolumeMesh(exact, mesh.tets, mesh.faces, np.arange(len(face)), mesh.face_cell), singular, CUT)
    parent = cut.face_region
    points = on_round_faces(exact, mesh.faces, face, cut.points, cut.faces, face[parent])
    points = exactly_on(points, planes, survey.height, rounding)
    return VolumeMesh(points, cut.tets, cut.faces, mesh.face_region[parent], mesh.face_cell[parent])


def _read(raw: dict[str, np.ndarray], survey: Survey) -> tuple[VolumeMesh, np.ndarray]:
    """Convert Netgen's mesh. Returns the mesh, and the number (B,) of the solid's face on which each of its boundary
    triangles lies."""
    corners, middles = raw["tets"][:, :4].astype(np.int64) - 1, raw["tets"][:, 4:10].astype(np.int64) - 1
    points, tets, faces = second_order(*positive(raw["points"], corners))
    # Both number the edges in the order of their corners.
    ends = np.sort(corners[:, np.array(_NETGEN_EDGES)].reshape(-1, 2), axis=1)
    _, first = np.unique(ends, axis=0, return_index=True)
    points[-len(first) :] = raw["points"][middles.ravel()[first]]

    face = np.empty(len(faces), dtype=int)
    named = np.searchsorted(np.unique(corners), raw["faces"][:, :3].astype(np.int64) - 1)
    if len(named) != len(faces):
        raise ComputationError(
            "meshing the pad failed: the triangles on its faces do not close. Choose another mesh_size; if that does "
            "not help, check that the file is a closed solid."
        )
    face[_by_corners(faces[:, :3])] = raw["face"][_by_corners(named)]
    region = np.where(face < 0, PLANE, survey.region[face])
    return VolumeMesh(points, tets, faces, region, np.where(face < 0, 0, survey.cell[face])), face


def _by_corners(triangles: np.ndarray) -> np.ndarray:
    """Order (T,) in which triangles are sorted by their corner numbers. The order does not depend on the corner that
    comes first in a triangle.
    """
    return np.lexsort(np.sort(triangles, axis=1).T)
