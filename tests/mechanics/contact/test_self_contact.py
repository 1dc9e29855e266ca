"""Contact is found exactly where closed forms and a test of all triangles against all say, and nowhere else."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from first_contact import box, first_contact
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from mitsuba_taxel.geometry.bezier_patches import control_points
from mitsuba_taxel.geometry.mirror import ACROSS_DIAGONAL, ACROSS_X, ACROSS_Y, MIRRORS
from mitsuba_taxel.geometry.quadratic_shapes import shape_functions
from mitsuba_taxel.geometry.volume_mesh import FACE_EDGES, TET_EDGES, VolumeMesh
from mitsuba_taxel.mechanics.contact.barriers.self_contact import ContactTest
from mitsuba_taxel.mechanics.cutting import _grid
from mitsuba_taxel.mechanics.elements.symmetry import node_images, part_between
from mitsuba_taxel.pads import CELL_SHAPES, REGIONS, Pad, mesh_pad

LIFT = 20.0
"""Height in mm at which blocks are out of the board's reach."""


def lifted(mesh):
    """The mesh over the board, glued nowhere."""
    region = np.full(len(mesh.faces), REGIONS["outer"])
    return replace(mesh, points=mesh.points + (0, 0, LIFT), face_region=region)


def moved(mesh, place):
    """The displacement to the deformed ``place`` (N, 3)."""
    return place - mesh.points


# ---- the pad against itself ------------------------------------------------------------------------------------------


def bent(mesh, angle, length, start=0.0, thickness=0.0):
    """A bar along x whose part of ``length`` from ``start`` is bent upwards by ``angle``; the rest is straight."""
    x, y, z = mesh.points.T
    z = z - LIFT - thickness / 2
    radius = length / angle
    turn = np.clip((x - start) / radius, 0, angle)
    beyond = x - start - radius * turn
    place = [
        (radius - z) * np.sin(turn) + beyond * np.cos(turn),
        y,
        LIFT + radius - (radius - z) * np.cos(turn) + beyond * np.sin(turn),
    ]
    return moved(mesh, np.stack(place, axis=1))


@pytest.mark.parametrize("size", [(6.0, 1.0, 0.5), (0.06, 0.02, 0.001)])
def test_a_bar_bent_to_a_ring_touches_its_other_end(block, size):
    mesh = lifted(block(size, (12, 2, 1)))
    angle, contact = first_contact(
        ContactTest(mesh), lambda angle: bent(mesh, angle, size[0], thickness=size[2]), 6.0, 6.4
    )
    assert angle == pytest.approx(2 * math.pi, rel=2e-8)
    assert contact.what == "itself"
    assert contact.place[0] == pytest.approx(0, abs=1e-7)


@pytest.mark.parametrize(("flap", "arc", "thickness"), [(2.0, 2.0, 0.3), (3.0, 1.5, 0.1)])
def test_flaps_folded_on_each_other_touch_with_their_tips(block, flap, arc, thickness):
    """Half the arc takes the tip, at a flap's length from its end, to the plane of symmetry."""
    mesh = lifted(block((2 * flap + arc, 1.0, thickness), (int(8 * flap + 4 * arc), 2, 1)))

    def height_of_tip(half):
        return (arc / (2 * half) - thickness / 2) * math.sin(half) + flap * math.cos(half)

    expected = 2 * brentq(height_of_tip, math.pi / 2, math.pi * 0.8, xtol=1e-14)
    angle, contact = first_contact(
        ContactTest(mesh), lambda angle: bent(mesh, angle, arc, flap, thickness), 0.9 * expected, 1.1 * expected
    )
    assert angle == pytest.approx(expected, rel=2e-8)
    assert contact.what == "itself"


@pytest.mark.parametrize("shift", [(0, 0), (0.013, 0.4)])
@pytest.mark.parametrize("gap", [1e-6, 0.0, -1e-6])
def test_flaps_in_parallel_touch_when_the_gap_is_nothing(block, gap, shift):
    """Two blocks over each other, turned together."""
    one = block((1.0, 0.7, 0.2), (4, 3, 1))
    count = len(one.points)
    points = np.concatenate([one.points, one.points + (*shift, 0.2 + gap)])
    arrays = [np.concatenate([nodes, count + nodes]) for nodes in (one.tets, one.faces)]
    mesh = VolumeMesh(points, *arrays, np.tile(one.face_region, 2), np.tile(one.face_cell, 2))
    turned = Rotation.from_rotvec([0.3, 0.2, 0.5]).apply(np.array(points)) + (0, 0, LIFT)
    contact = ContactTest(mesh).find(moved(mesh, turned))
    assert (contact is not None) == (gap <= 0)
    assert contact is None or contact.what == "itself"


@pytest.mark.parametrize("cells", [(2, 1, 1), (4, 3, 2)])
def test_faces_fold_on_each_other_at_a_common_edge(block, cells):
    """Both halves of the top turn about its middle line, until they lie on each other at a right angle."""
    mesh = lifted(block((2.0, 1.0, 1.0), cells))

    def folded(angle):
        place = mesh.points - (1, 0, LIFT + 1)
        c, s = np.cos(angle), np.sin(angle) * -np.sign(place[:, 0])
        x, z = place[:, 0], place[:, 2]
        below = (z < 0) & (x == 0)
        place = np.stack([np.where(below, 0, c * x + s * z), place[:, 1], np.where(below, z, -s * x + c * z)], axis=1)
        straight = mesh.tets[:, 4:].ravel()
        place[straight] = place[mesh.tets[:, TET_EDGES]].mean(axis=2).reshape(-1, 3)
        return moved(mesh, place + (1, 0, LIFT + 1))

    angle, contact = first_contact(ContactTest(mesh), folded, 1.4, 1.6)
    # The bisector of nearly the same directions is as good as the rounding of nodes over the angle: 1e-14 / 1e-7.
    assert angle == pytest.approx(math.pi / 2, rel=1e-7)
    assert contact.what == "itself"


@pytest.mark.parametrize(("past", "said"), [(-0.001, "nothing"), (0.001, "a fold"), (0.05, "a contact")])
def test_a_groove_folds_along_its_edge(block, past, said):
    """What is beside the edge of a groove is pushed past the other side's; a strip of 0.03 mm may be."""
    mesh = block((4.0, 1.0, 1.0), (4, 2, 1))
    x, y, z = mesh.points.T
    at = np.array([0, 0.99, 1, 1.01, 2])
    x = np.interp(x, np.arange(5), at)
    mesh = lifted(replace(mesh, points=np.stack([x, y, z * (1 + 0.5 * np.abs(x - 1))], axis=1)))
    pushed = np.where(z == 1, np.interp(x, at, [0, 1 + past, 1, 1 - past, 2]) - x, 0.0)
    displacement = np.stack([pushed * (1 - np.abs(2 * y - 1)), 0 * x, 0 * x], axis=1)
    contact, fold = ContactTest(mesh).find(displacement), ContactTest(mesh).find_fold(displacement)
    assert (contact is not None) == (said == "a contact")
    assert (fold is not None) == (said != "nothing")
    assert fold is None or fold[0] == pytest.approx(1, abs=0.05)


@pytest.mark.parametrize("chosen", [0, 5])
def test_a_side_wall_bulges_against_the_opposite_one(chosen):
    """A face whose mid-edge nodes move by a bulges by 4/3 a in its middle, where there is no node."""
    pad = Pad(rows=1, columns=1)
    mesh = mesh_pad(pad, 1.25)
    centre = mesh.points[mesh.faces[:, :3]].mean(axis=1)
    wall = np.isclose(centre[:, 0], -pad.cell_size / 2) & (mesh.face_region == REGIONS["side"])
    at_border = np.isin(mesh.faces[:, 3:], mesh.faces[~wall, 3:]).any(axis=1)
    face = np.flatnonzero(wall & ~at_border)[chosen]
    push = np.zeros_like(mesh.points)
    push[mesh.faces[face, 3:], 0] = 1
    amplitude, contact = first_contact(ContactTest(mesh), lambda a: a * push, 1.8, 2.0)
    assert amplitude == pytest.approx(0.75 * pad.cell_size, rel=2e-8)
    assert contact.what == "itself"
    assert contact.place == pytest.approx((pad.cell_size / 2, *centre[face, 1:]), abs=1e-3)


# ---- all against all -------------------------------------------------------------------------------------------------


def segments_meet_triangles(start, end, triangle):
    """Whether segments (n, 3) go through triangles (n, 3, 3), by solving for the point."""
    a, b, c = triangle[:, 0], triangle[:, 1], triangle[:, 2]
    matrix = np.stack([start - end, b - a, c - a], axis=2)
    size = np.linalg.norm(matrix, axis=1)
    regular = np.abs(np.linalg.det(matrix)) > 1e-9 * size.prod(axis=1)
    t, u, v = np.linalg.solve(matrix[regular], (start - a)[regular][:, :, None])[:, :, 0].T
    meets = np.zeros(len(a), dtype=bool)
    meets[regular] = (t >= 0) & (t <= 1) & (u >= 0) & (v >= 0) & (u + v <= 1)
    return meets


def any_two_meet(points, triangles):
    """Whether any two triangles meet elsewhere than in common vertices: a side of one goes through the other.

    Of two with a common vertex, the sides that it is on are left out; those with a common edge never count.
    """
    low, high = points[triangles].min(axis=1), points[triangles].max(axis=1)
    near = np.all([low[:, None, k] <= high[None, :, k] for k in range(3)], axis=0)
    first, second = np.nonzero(near & near.T & ~np.eye(len(low), dtype=bool))
    one, other = triangles[first], triangles[second]
    common = (one[:, :, None] == other[:, None, :]).any(axis=2)
    for k in range(3):
        free = ~common[:, k] & ~common[:, (k + 1) % 3] & (common.sum(axis=1) < 2)
        start, end = points[one[free, k]], points[one[free, (k + 1) % 3]]
        if segments_meet_triangles(start, end, points[other[free]]).any():
            return True
    return False


def flat(mesh, place):
    """Places with the mid-edge nodes of the surface midway between corners."""
    place = place.copy()
    for k, (i, j) in enumerate(FACE_EDGES, start=3):
        place[mesh.faces[:, k]] = (place[mesh.faces[:, i]] + place[mesh.faces[:, j]]) / 2
    return place


@pytest.mark.parametrize("amplitude", [0.1, 0.14, 0.18, 0.25])
def test_flat_faces_give_the_verdict_of_all_against_all(block, amplitude):
    mesh = lifted(block((1.0, 1.0, 0.6), (2, 2, 1)))
    test = ContactTest(mesh)
    verdicts = []
    for seed in range(25):
        noise = np.random.default_rng(seed).normal(size=mesh.points.shape)
        place = flat(mesh, mesh.points + amplitude * noise)
        verdicts.append(any_two_meet(place, mesh.faces[:, :3]))
        assert (test.find(moved(mesh, place)) is not None) == verdicts[-1], seed
    assert amplitude in (0.1, 0.25) or 0 < sum(verdicts) < 25


def pieces(faces, place, barycentric, pattern):
    """Points and triangles of faces whose points at ``barycentric`` (F, P, 3) are joined by a ``pattern``."""
    weights = np.array([shape_functions(face) for face in barycentric])
    points = np.einsum("fpk,fkx->fpx", weights, place[faces])
    triangles = (points.shape[1] * np.arange(len(faces))[:, None, None] + pattern).reshape(-1, 3)
    _, first, number = np.unique(np.round(points.reshape(-1, 3), 12), axis=0, return_index=True, return_inverse=True)
    return points.reshape(-1, 3)[first], number.ravel()[triangles]


def any_pieces_meet(mesh, place):
    """Whether flat pieces of the faces meet: of all faces, and, ever smaller, next to each corner."""
    barycentric, pattern = _grid(12)
    if any_two_meet(*pieces(mesh.faces, place, np.tile(barycentric, (len(mesh.faces), 1, 1)), pattern)):
        return True
    barycentric, pattern = _grid(4)
    for corner in range(mesh.corner_count):
        at_corner = (mesh.faces[:, :3] == corner).any(axis=1)
        own = (mesh.faces[at_corner, :3] == corner).astype(float)[:, None]
        for zoom in (4, 16, 64, 256):
            if any_two_meet(*pieces(mesh.faces[at_corner], place, own + (barycentric - own) / zoom, pattern)):
                return True
    return False


@pytest.mark.parametrize("amplitude", [0.04, 0.06])
def test_curved_faces_give_the_verdict_of_all_their_pieces_against_all(block, amplitude):
    mesh = lifted(block((1.0, 1.0, 0.6), (1, 1, 1)))
    test = ContactTest(mesh)
    verdicts = []
    for seed in range(12):
        place = mesh.points + amplitude * np.random.default_rng(seed).normal(size=mesh.points.shape)
        verdicts.append(any_pieces_meet(mesh, place))
        assert (test.find(moved(mesh, place)) is not None) == verdicts[-1], seed
    assert 0 < sum(verdicts) < 12


@pytest.mark.parametrize(
    ("mirrors", "lift"),
    [(MIRRORS, 0.0), ((ACROSS_X, ACROSS_Y), LIFT), ((ACROSS_DIAGONAL,), LIFT)],
    ids=["an eighth", "a quarter, free", "half, free"],
)
def test_a_part_gives_the_verdict_of_the_whole(mirrors, lift):
    """Random displacements with the symmetry of the part, of which some pads touch themselves or the board; the pairs
    of faces that are looked at are those of the whole with one in the part."""
    mesh = mesh_pad(Pad("hemispheric", rows=1, columns=1), 3.0)
    mesh = replace(mesh, points=mesh.points + (0, 0, lift))
    part = part_between(mesh, node_images(mesh), mirrors)
    whole, of_part, verdicts = ContactTest(mesh), ContactTest(mesh, nodes=part.nodes), []
    for seed, amplitude in enumerate((0.005, 0.02, 0.04, 0.12)):
        noise = amplitude * np.random.default_rng(seed).normal(size=part.mesh.points.shape)
        for wall in (*part.walls, *part.walls):  # nodes on a plane stay there
            on_plane = wall.side(part.mesh.points) == 0
            noise[on_plane] = (noise[on_plane] + wall.image(noise[on_plane])) / 2
        noise[np.hypot(*part.mesh.points.T[:2]) == 0, :2] = 0.0
        if not lift:
            noise[part.mesh.points[:, 2] == 0] = 0.0
        symmetric, _ = part.expand(noise, np.zeros(part.mesh.corner_count))
        found, other = whole.find(symmetric), of_part.find(symmetric)
        assert (found is None) == (other is None) and (found is None or found.what == other.what)
        verdicts.append(found is not None)
        patches = control_points(mesh.points + symmetric, mesh.faces)[:, mesh.faces.T]
        own = np.isin(mesh.faces, part.nodes).all(axis=1)
        pairs = (np.sort(np.stack(test._close(patches)), axis=0) for test in (whole, of_part))
        expected, looked_at = (np.unique(each[:, own[each].any(axis=0)], axis=1) for each in pairs)
        np.testing.assert_array_equal(looked_at, expected)
    assert 0 < sum(verdicts) < 4


def test_rotation_does_not_change_the_verdict(block):
    mesh = lifted(block((1.0, 1.0, 0.6), (2, 2, 1)))
    test, verdicts = ContactTest(mesh), []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        place = mesh.points + 0.035 * rng.normal(size=mesh.points.shape)
        verdicts.append(test.find(moved(mesh, place)) is not None)
        turned = Rotation.random(random_state=seed).apply(place - (0, 0, LIFT)) + (0, 0, LIFT)
        assert (test.find(moved(mesh, turned)) is not None) == verdicts[-1]
    assert 0 < sum(verdicts) < 20


# ---- no false alarm --------------------------------------------------------------------------------------------------


def smooth(mesh, amplitude, seed):
    """Waves about as long as the pad, with nothing moved at the board."""
    rng = np.random.default_rng(seed)
    length = np.ptp(mesh.points, axis=0).max()
    wave, phase = rng.normal(size=(3, 3)) * 4 / length, rng.uniform(0, 6, 3)
    height = mesh.points[:, 2:] / mesh.points[:, 2].max()
    return amplitude * length * height * np.sin(mesh.points @ wave + phase)


@pytest.mark.parametrize(
    ("pad", "mesh_size"),
    [(Pad(cell, rows=1, columns=2), 0.8) for cell in CELL_SHAPES]
    + [(Pad(cell, rows=1, columns=2, pitch=2.6, wall=0.05), 0.8) for cell in CELL_SHAPES[:3]]
    + [(Pad("hemispheric", rows=1, columns=1, wall=0.05), 0.5)]
    + [
        (Pad("hemispheric", 1, 1, wall=0.1, height=0.5, cell_size=0.4, cell_height=0.3), 0.1),
        (Pad("spherical", 1, 1, wall=200, height=800, cell_size=500, cell_height=300), 150.0),
    ],
    ids=lambda value: f"{value.cell}-{value.wall:g}" if isinstance(value, Pad) else "",
)
def test_no_false_alarm(pad, mesh_size):
    mesh = mesh_pad(pad, mesh_size)
    size = pad.cell_size / 2.55
    packages = [
        box((x - 0.5 * size, y - 0.5 * size, 0), (x + 0.5 * size, y + 0.5 * size, 0.2 * size))
        for x, y in pad.cell_centres
    ]
    test = ContactTest(mesh, np.concatenate(packages))
    assert test.find(np.zeros_like(mesh.points)) is None
    pressed = mesh.points * (0, 0, -0.15)
    for seed in range(2):
        assert test.find(smooth(mesh, 0.02, seed) + pressed) is None


def test_a_turned_pad_touches_nothing():
    """Faces in one plane are so to rounding only."""
    mesh = mesh_pad(Pad("cylindrical", rows=1, columns=2), 0.8)
    for seed in range(5):
        turned = Rotation.random(random_state=seed).apply(np.array(mesh.points)) + (0, 0, 1000)
        assert (
            ContactTest(replace(mesh, points=mesh.points + (0, 0, 1000))).find(turned - mesh.points - (0, 0, 1000))
            is None
        )
