"""Cells with flat walls from STEP files, however they are turned and whichever planes of symmetry cut them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mitsuba_taxel.geometry.element_maps import curved_volume
from mitsuba_taxel.geometry.volume_mesh import TET_EDGES
from mitsuba_taxel.mechanics.elements.symmetry import node_images
from mitsuba_taxel.pads.pad_file import PadFile, mesh_pad_file
from mitsuba_taxel.pads.parametric.meshing import MESHING_LOCK

RADIUS, DEPTH = 1.5, 1.9
BLOCK = (8.0, 5.0, 4.0)


def prism_pad(path, corners, turn, centres):
    """A block with prismatic cells of ``corners`` corners, turned by ``turn`` degrees, as a STEP file."""
    from netgen.occ import Axes, Box, Pnt, WorkPlane, X, Z

    with MESHING_LOCK:
        solid = Box(Pnt(-BLOCK[0] / 2, -BLOCK[1] / 2, 0), Pnt(BLOCK[0] / 2, BLOCK[1] / 2, BLOCK[2]))
        for x, y in centres:
            angles = 2 * np.pi * np.arange(corners + 1) / corners + math.radians(turn)
            outline = [(x + RADIUS * math.cos(a), y + RADIUS * math.sin(a)) for a in angles]
            plane = WorkPlane(Axes((0, 0, -1), n=Z, h=X)).MoveTo(*outline[0])
            for corner in outline[1:]:
                plane = plane.LineTo(*corner)
            solid = solid - plane.Face().Extrude(1 + DEPTH)
        solid.WriteStep(str(path))
    return PadFile(path)


@pytest.mark.parametrize(
    ("corners", "turn", "centres", "mirrors"),
    [
        (6, 0.0, [(-2.0, 0.0), (2.0, 0.0)], 2),  # corners on one plane
        (4, 0.0, [(0.0, 0.0)], 2),  # corners on both
        (3, 30.0, [(0.0, 0.2)], 1),
        (8, 22.5, [(-2.0, 0.0), (2.0, 0.0)], 2),  # walls across them
        (5, 7.0, [(0.2, 0.1)], 0),
        (6, 17.0, [(-2.0, 0.0), (2.0, 0.0)], 0),
    ],
)
def test_flat_walls_stay_flat_and_corners_stay_corners(tmp_path, corners, turn, centres, mirrors):
    mesh = mesh_pad_file(prism_pad(tmp_path / "pad.step", corners, turn, centres), 2.0)
    area = corners / 2 * RADIUS**2 * math.sin(2 * math.pi / corners)
    assert curved_volume(mesh) == pytest.approx(math.prod(BLOCK) - len(centres) * area * DEPTH, rel=1e-9)
    # Straight edges: mid-edge nodes are the middles.
    ends = mesh.points[mesh.tets[:, np.array(TET_EDGES)]]
    assert np.abs(mesh.points[mesh.tets[:, 4:10]] - ends.mean(axis=2)).max() < 1e-9
    # The surface is closed, and each mirror maps corners of elements onto such corners.
    edges = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    assert np.all(np.unique(edges, axis=0, return_counts=True)[1] == 2)
    images = node_images(mesh)
    assert len(images) == mirrors
    for image in images.values():
        assert np.all(image[: mesh.corner_count] < mesh.corner_count)
