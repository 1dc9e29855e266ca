"""Bodies from files with mirrors and steep walls: a slotted block, against its geometry."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from mitsuba_taxel import Block
from mitsuba_taxel.geometry.mirror import ACROSS_X, ACROSS_Y, MIRRORS
from mitsuba_taxel.mechanics import Indenter
from mitsuba_taxel.mechanics.local_mesh import Refinement, mesh_under

SLOT = 0.8
"""Width in mm of the slot, along y."""
SIDES = 4.0, 3.0


@pytest.fixture(scope="module")
def slotted(tmp_path_factory):
    """The file of a block of 4 x 3 x 2 mm with a slot of 1 mm depth in its lower face."""
    x, z = (0.5 * SIDES[0], 0.5 * SLOT), (0.0, 1.0, 2.0)
    boxes = [(-x[0], -x[1], 0.0, 1.0), (x[1], x[0], 0.0, 1.0)]
    boxes += [(a, b, 1.0, z[2]) for a, b in ((-x[0], -x[1]), (-x[1], x[1]), (x[1], x[0]))]
    faces: dict[tuple[float, ...], list[np.ndarray]] = {}
    half = 0.5 * SIDES[1]
    for left, right, low, high in boxes:
        for axis in range(3):
            for end in (0, 1):
                bounds = np.array([[left, -half, low], [right, half, high]])
                turn = [(axis + 1) % 3, (axis + 2) % 3]
                ring = np.tile(bounds[end], (4, 1))
                ring[:, turn] = [[bounds[i, turn[0]], bounds[j, turn[1]]] for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))]
                ring = ring if end else ring[::-1]
                faces.setdefault(tuple(np.round(ring.mean(axis=0), 9)), []).append(ring)
    triangles = []  # four in each face, so that they keep the mirrors
    for rings in faces.values():
        if len(rings) == 1:  # a face that two boxes share is inside
            (ring,) = rings
            middle = ring.mean(axis=0)
            triangles += [np.stack([a, b, middle]) for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True)]
    corners = np.array(triangles)
    solid = trimesh.Trimesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
    solid.merge_vertices()
    assert solid.is_watertight and solid.volume == pytest.approx(SIDES[0] * SIDES[1] * 2 - SLOT * SIDES[1])
    file = tmp_path_factory.mktemp("bodies") / "slotted.stl"
    solid.export(file)
    return file


def test_a_body_from_a_file_keeps_its_own_mirrors(slotted, tmp_path):
    def kept(**changes):
        return [mirror for mirror in MIRRORS if Indenter(file=slotted, **changes).body.keeps(mirror)]

    assert kept() == [ACROSS_X, ACROSS_Y] and kept(angle=90.0) == [ACROSS_X, ACROSS_Y]
    assert kept(at=(0.5, 0.0)) == [ACROSS_Y] and kept(at=(0.5, 1.0)) == [] and kept(angle=30.0) == []
    # A body with a wedge on one side only.
    body = trimesh.load(slotted)
    body.vertices[np.argmax(body.vertices @ [1.0, 0.1, 1.0])] += [0.1, 0.0, 0.0]
    body.export(tmp_path / "lopsided.stl")
    changed = Indenter(file=tmp_path / "lopsided.stl")
    assert not changed.body.keeps(ACROSS_X) and not changed.body.keeps(ACROSS_Y)


def test_walls_are_the_edges_of_the_contact_and_elements_are_small_there(slotted):
    body = Indenter(file=slotted).body
    distance = body.solid.distance
    walls, cell = distance.walls(0.3), distance.spacing
    x, y = 0.5 * SIDES[0], 0.5 * SIDES[1]
    from_edges = np.minimum(
        np.min([np.abs(np.abs(walls[:, 0]) - at) for at in (0.5 * SLOT, x)], axis=0), np.abs(np.abs(walls[:, 1]) - y)
    )
    assert len(walls) > 100 and from_edges.max() < 1.5 * cell
    assert (np.abs(np.abs(walls[:, 0]) - 0.5 * SLOT) < 1.5 * cell).mean() > 0.3  # both sides of the slot

    block = Block(width=10.0, depth=8.0, height=3.0)
    mesh = mesh_under(block.mesh(1.0), Indenter(file=slotted), Refinement())
    centre = mesh.points[mesh.tets[:, :4]].mean(axis=1)
    size = np.cbrt(6 * np.abs(np.linalg.det(mesh.points[mesh.tets[:, 1:4]] - mesh.points[mesh.tets[:, :1]])))
    top = centre[:, 2] > 2.8
    in_slot = top & (np.abs(centre[:, 0]) < 0.5 * SLOT) & (np.abs(centre[:, 1]) < y)
    beside = (centre[:, 2] > 2.0) & (np.abs(centre[:, 0]) > 4.0)
    assert size[in_slot].max() < 0.5 * SLOT and size[beside].mean() > 2 * size[in_slot].mean()


def test_a_ball_from_a_file_has_no_walls(tmp_path):
    trimesh.creation.icosphere(subdivisions=3, radius=2.0).export(tmp_path / "ball.stl")
    body = Indenter(file=tmp_path / "ball.stl").body
    assert len(body.solid.distance.walls(0.2)) == 0
    assert body.pressure_length(0.2) == body.contact_radius(0.2) == pytest.approx(np.sqrt(0.5 * 0.2 * 4), rel=0.15)
