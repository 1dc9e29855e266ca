"""Second-order tetrahedral mesh of the body in a STEP file by Netgen."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mitsuba_taxel.pads.meshing import CURVATURE_SAFETY, LEAST_QUALITY, MOST_ELEMENTS, REFINEMENTS, RIM_REFINEMENT
from mitsuba_taxel.pads.quality import worst_element
from mitsuba_taxel.pads.regions import FacedSurface, tagged
from mitsuba_taxel.pads.rules import Rule
from mitsuba_taxel.pads.sandbox import run_apart
from mitsuba_taxel.pads.second_order import positive, second_order
from mitsuba_taxel.pads.surfaces import check_extent, check_mesh_size
from mitsuba_taxel.pads.volume_mesh import VolumeMesh

_NETGEN_EDGES = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))
"""Corners whose edge carries nodes 4 to 9 of Netgen's tetrahedron."""


def mesh_step(path: Path, rules: Sequence[Rule], mesh_size: float) -> VolumeMesh:
    """Mesh of the one solid in a STEP file, finer along the edges on the board.

    Raises
    ------
    Flaw
        if the file cannot be read, or its solid is no pad.
    ComputationError
        if meshing fails.
    """
    for refinement in REFINEMENTS:
        curvature_safety = CURVATURE_SAFETY * refinement
        sizes = {"mesh_size": mesh_size, "rim_refinement": RIM_REFINEMENT, "most_elements": MOST_ELEMENTS}
        raw = run_apart("mesh_step", {"path": str(path.resolve()), "curvature_safety": curvature_safety, **sizes})
        check_mesh_size(mesh_size, float(raw["volume"]))
        mesh = _tagged_mesh(raw, rules)
        if worst_element(mesh)[0] >= LEAST_QUALITY:
            break
    return mesh


def _tagged_mesh(raw: dict[str, np.ndarray], rules: Sequence[Rule]) -> VolumeMesh:
    check_extent(raw["points"])
    corners, middles = raw["tets"][:, :4].astype(np.int64) - 1, raw["tets"][:, 4:10].astype(np.int64) - 1
    points, tets, faces = second_order(*positive(raw["points"], corners))
    # Both count the edges in the order of their corners.
    ends = np.sort(corners[:, np.array(_NETGEN_EDGES)].reshape(-1, 2), axis=1)
    _, first = np.unique(ends, axis=0, return_index=True)
    points[-len(first) :] = raw["points"][middles.ravel()[first]]

    face = np.empty(len(faces), dtype=int)
    named = np.searchsorted(np.unique(corners), raw["faces"][:, :3].astype(np.int64) - 1)
    face[_by_corners(faces[:, :3])] = raw["face"][_by_corners(named)]
    region, cell = tagged(FacedSurface(points, faces[:, :3], face, raw["names"].tolist()), rules)
    return VolumeMesh(points, tets, faces, region, cell)


def _by_corners(triangles: np.ndarray) -> np.ndarray:
    """Order of triangles by their corners, whatever these begin with."""
    return np.lexsort(np.sort(triangles, axis=1).T)
