"""Rough walls: closed, of the shape that was asked for, and carried by the deformation."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.surfaces.slivers import without_slivers
from mitsuba_taxel.mechanics import (
    Grooves,
    LayerSteps,
    NeoHookean,
    RandomRoughness,
    check_finish,
    load_path,
    tessellate,
)
from mitsuba_taxel.mechanics.locate import displacement_gradient
from mitsuba_taxel.pads import CELL_SHAPES, REGIONS, Pad

pytestmark = pytest.mark.usefixtures("mechanics_error_unknown")

MESH_SIZE = 1.2
FINISHES = {
    "steps": LayerSteps(0.1),
    "steps of a tilted mould": LayerSteps(0.15, (1, 2, 3)),
    "steps along a wall": LayerSteps(0.2, (1, 0, 0)),
    "grooves": Grooves(0.2, 0.04),
    "slanted grooves": Grooves(0.2, 0.04, (1, 1, 0.3)),
    "random": RandomRoughness(0.01, 0.3),
}


def state_of(cell, force=(0, 0, 0), columns=1):
    return load_path(Pad(cell, rows=1, columns=columns), NeoHookean(), [force], mesh_size=MESH_SIZE)[0]


def homogeneous(state, gradient):
    """The state with the displacement of a homogeneous deformation."""
    return replace(state, displacement=state.mesh.points @ (gradient - np.eye(3)).T)


def normals(surface, chosen):
    """Area vectors of the chosen triangles."""
    a, b, c = (surface.vertices[surface.triangles[chosen, k]] for k in range(3))
    return 0.5 * np.cross(b - a, c - a)


def enclosed(surface):
    a, b, c = (surface.vertices[surface.triangles[:, k]] for k in range(3))
    return np.einsum("ij,ij->", a, np.cross(b, c)) / 6


def assert_closed(surface):
    """Each edge has one triangle on either side, which go round it in opposite senses."""
    edges = surface.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2).astype(np.int64)
    forth = np.sort(edges[:, 0] * len(surface.vertices) + edges[:, 1])
    back = np.sort(edges[:, 1] * len(surface.vertices) + edges[:, 0])
    assert np.all(np.diff(forth) > 0)
    np.testing.assert_array_equal(forth, back)
    assert np.all(np.bincount(surface.triangles.ravel(), minlength=len(surface.vertices)))


@pytest.mark.parametrize("cell", CELL_SHAPES)
@pytest.mark.parametrize("finish", FINISHES.values(), ids=FINISHES)
def test_rough_surfaces_are_closed_and_tagged(cell, finish):
    state = state_of(cell, columns=2)
    smooth, rough = tessellate(state, 6), tessellate(state, 6, finish)
    assert_closed(rough)
    assert np.linalg.norm(normals(rough, slice(None)), axis=1).min() > 0
    assert enclosed(rough) == pytest.approx(enclosed(smooth), rel=0.02)
    for region in ("roof", "side"):
        assert set(np.unique(rough.cell[rough.region == REGIONS[region]])) == {1, 2}
    for region in ("bottom", "top", "outer"):
        chosen = rough.region == REGIONS[region]
        assert not rough.cell[chosen].any()
    bottom = rough.vertices[rough.triangles[rough.region == REGIONS["bottom"]]]
    assert not bottom[..., 2].any()
    for region in ("top", "outer"):
        before, after = (normals(s, s.region == REGIONS[region]).sum(axis=0) for s in (smooth, rough))
        np.testing.assert_allclose(after, before, atol=1e-12)


def test_steps_on_a_dome_are_treads_and_risers():
    """Their treads lie on multiples of the layer height and cover the dome's base once."""
    height = 0.07
    surface = tessellate(state_of("hemispheric"), 12, LayerSteps(height))
    roof = surface.region == REGIONS["roof"]
    area = normals(surface, roof)
    size = np.linalg.norm(area, axis=1)
    tread = np.abs(area[:, 2]) > 0.5 * size
    np.testing.assert_allclose(area[tread][:, :2] / size[tread, None], 0, atol=1e-6)
    np.testing.assert_allclose(area[~tread][:, 2] / size[~tread], 0, atol=1e-6)
    assert (area[tread][:, 2] < 0).all()  # they look down, into the cell
    levels = surface.vertices[surface.triangles[roof]][tread][..., 2] / height
    np.testing.assert_allclose(levels, np.rint(levels), atol=1e-6)
    assert set(np.rint(levels).astype(int).ravel()) == set(range(7, 26))  # 0.5 to 1.775 mm
    smooth = tessellate(state_of("hemispheric"), 12)
    base = -normals(smooth, smooth.region == REGIONS["roof"])[:, 2].sum()
    assert size[tread].sum() == pytest.approx(base, rel=1e-9)
    assert base == pytest.approx(math.pi * 1.275**2, rel=2e-3)


@pytest.mark.parametrize("height", [0.02, 0.0375, 0.045])
def test_steps_that_need_many_triangles_are_closed(height):
    """Some cut edges into 16 parts at places where coincident points of two faces were once told apart."""
    assert_closed(tessellate(state_of("hemispheric"), 12, LayerSteps(height)))


def test_risers_stand_where_the_dome_is_midway_between_levels():
    height = 0.15
    surface = tessellate(state_of("hemispheric"), 12, LayerSteps(height))
    roof = np.flatnonzero(surface.region == REGIONS["roof"])
    area = normals(surface, roof)
    corners = surface.vertices[surface.triangles[roof[np.abs(area[:, 2]) < 1e-9]]]
    middle = 0.5 * (corners[..., 2].min(axis=1) + corners[..., 2].max(axis=1)) - 0.5
    radius = np.hypot(corners[..., 0], corners[..., 1])
    expected = np.sqrt(1.275**2 - middle**2)
    np.testing.assert_allclose(radius, expected[:, None].repeat(3, axis=1), atol=8e-3)  # mesh of 1.2 mm


@pytest.mark.parametrize("layer_height, roof", [(0.31, 1.55), (0.25, 1.5), (0.2, 1.6), (0.1, 1.6)])
def test_a_flat_roof_moves_to_the_nearest_level(layer_height, roof):
    """On a level it stays, half-way it goes up; walls along the print direction stay plane and where they are."""
    state = state_of("parallelepiped")
    surface = tessellate(state, 4, LayerSteps(layer_height))
    corners = surface.vertices[surface.triangles]
    np.testing.assert_allclose(corners[surface.region == REGIONS["roof"]][..., 2], roof, atol=1e-9)
    side = corners[surface.region == REGIONS["side"]]
    np.testing.assert_allclose(np.abs(side[..., :2]).max(axis=-1), 1.275, atol=1e-9)
    area = np.linalg.norm(normals(surface, surface.region == REGIONS["side"]), axis=1).sum()
    assert area == pytest.approx(4 * 2.55 * roof)
    if roof == 1.55:
        assert enclosed(surface) == pytest.approx(enclosed(tessellate(state, 4)), rel=1e-12)


def test_a_round_wall_along_the_print_direction_does_not_change():
    """Its roof lies on a level; the triangles come in another order."""
    from scipy.spatial import cKDTree

    state = state_of("cylindrical")
    smooth, rough = tessellate(state, 12), tessellate(state, 12, LayerSteps(0.31))
    assert len(rough.triangles) == len(smooth.triangles)
    before, after = (
        np.hstack([s.vertices[s.triangles].mean(axis=1), normals(s, slice(None))]) for s in (smooth, rough)
    )
    assert cKDTree(before).query(after)[0].max() < 1e-12


def test_steps_of_a_tilted_mould_lie_along_and_across_its_direction():
    direction = np.array([1.0, 0.0, 1.0]) / math.sqrt(2)
    surface = tessellate(state_of("parallelepiped"), 4, LayerSteps(0.2, (1, 0, 1)))
    chosen = surface.region == REGIONS["roof"]
    area = normals(surface, chosen)
    cosine = area @ direction / np.linalg.norm(area, axis=1)
    assert np.minimum(np.abs(cosine), np.abs(np.abs(cosine) - 1)).max() < 1e-6
    tread = np.abs(cosine) > 0.5
    levels = surface.vertices[surface.triangles[chosen]][tread] @ direction / 0.2
    np.testing.assert_allclose(levels, np.rint(levels), atol=1e-6)
    # What a plane at 45 degrees projects on across and along the direction, but for steps cut off at its edges.
    assert -area[tread] @ direction @ np.ones(tread.sum()) == pytest.approx(2.55**2 / math.sqrt(2), rel=0.06)


def test_grooves_on_a_flat_roof_have_the_asked_profile():
    pitch, depth = 0.25, 0.06
    surface = tessellate(state_of("parallelepiped"), 6, Grooves(pitch, depth))
    roof = surface.triangles[surface.region == REGIONS["roof"]]
    inner = np.abs(surface.vertices[roof][..., :2]).max(axis=(1, 2)) < 1.1
    x, height = surface.vertices[roof[inner]][..., 0], 1.55 - surface.vertices[roof[inner]][..., 2]
    phase = np.abs((x / pitch + 0.5) % 1 - 0.5)  # 0 on a ridge, 1/2 in a valley
    np.testing.assert_allclose(height, depth * (0.5 - 2 * phase), atol=1e-9)
    assert np.ptp(height) == pytest.approx(depth, rel=1e-9)
    area = normals(surface, surface.region == REGIONS["roof"])[inner]
    size = np.linalg.norm(area, axis=1)
    slope = np.degrees(np.arccos(-area[:, 2] / size))
    np.testing.assert_allclose(slope, math.degrees(math.atan(2 * depth / pitch)), atol=1e-5)
    assert size.sum() / -area[:, 2].sum() == pytest.approx(math.hypot(1, 2 * depth / pitch), rel=1e-9)
    mean_square = (size * (height**2).mean(axis=1)).sum() / size.sum()
    assert mean_square < depth**2 / 4


def test_random_roughness_has_the_asked_statistics():
    """Over independent seeds: rms and correlation of the heights at pairs of points, each within five sigma."""
    seeds, length, rms = 400, 0.2, 0.01
    points = np.array([[0.3, -0.2, 1.55]]) + np.array([[0, 0, 0], [0.1, 0, 0], [0.12, 0.16, 0], [0, 0.3, 0.1]])
    heights = np.array([RandomRoughness(rms, length, seed).heights(points) for seed in range(seeds)]) / rms
    assert np.abs(heights.mean(axis=0)).max() < 5 / math.sqrt(seeds)
    assert np.abs((heights**2).mean(axis=0) - 1).max() < 5 * math.sqrt(2 / seeds)
    distance = np.linalg.norm(points - points[0], axis=1)
    found = (heights * heights[:, :1]).mean(axis=0)
    np.testing.assert_allclose(found, np.exp(-((distance / length) ** 2)), atol=5 * math.sqrt(2 / seeds))
    kurtosis = (heights**4).mean(axis=0)
    assert np.abs(kurtosis - 3).max() < 5 * math.sqrt(96 / seeds)


def test_a_randomly_rough_roof_has_them_too():
    """Averages over the roofs of two cells, of some 250 independent patches."""
    rms, length = 0.01, 0.15
    surface = tessellate(state_of("parallelepiped", columns=2), 6, RandomRoughness(rms, length, 5))
    used = np.unique(surface.triangles[surface.region == REGIONS["roof"]])
    points = surface.vertices[used]
    relative = points[:, :2] - [(np.sign(x) * 1.775, 0) for x in points[:, 0]]
    inner = np.abs(relative).max(axis=1) < 1.2
    height = 1.55 - points[inner, 2]
    assert height.std() == pytest.approx(rms, rel=0.15)
    assert abs(height.mean()) < 0.3 * rms
    left = points[inner, 0] < 0
    assert abs(height[left].max() - height[~left].max()) > 1e-4 * rms  # cells differ


def test_the_same_seed_gives_the_same_surface():
    state = state_of("hemispheric")
    first, again, other = (tessellate(state, 4, RandomRoughness(0.01, 0.4, seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first.vertices, again.vertices)
    assert not np.array_equal(first.vertices, other.vertices)


@pytest.mark.parametrize("finish", FINISHES.values(), ids=FINISHES)
def test_a_homogeneous_deformation_carries_the_surface_as_a_whole(finish):
    gradient = np.array([[1.1, 0.05, 0.2], [0.0, 0.9, 0.1], [0.03, 0.0, 0.85]])
    state = state_of("hemispheric")
    undeformed, deformed = tessellate(state, 4, finish), tessellate(homogeneous(state, gradient), 4, finish)
    np.testing.assert_array_equal(deformed.triangles, undeformed.triangles)
    np.testing.assert_allclose(deformed.vertices, undeformed.vertices @ gradient.T, atol=1e-10)


def test_the_gradient_of_a_quadratic_displacement_is_found_at_the_nodes(block):
    mesh = block(distortion=0.1)
    x, y, z = mesh.points.T
    displacement = np.stack([x * y, z**2 - x, 0 * x], axis=1)
    expected = np.zeros((len(x), 3, 3))
    expected[:, 0, 0], expected[:, 0, 1], expected[:, 1, 0], expected[:, 1, 2] = y, x, -1, 2 * z
    np.testing.assert_allclose(displacement_gradient(mesh, displacement), expected, atol=1e-9)


@pytest.mark.parametrize("finish", [LayerSteps(0.1), Grooves(0.2, 0.1), RandomRoughness(0.02, 0.3)])
def test_on_a_pressed_pad_the_rough_surface_stays_near_the_smooth_one(finish):
    from scipy.spatial import cKDTree

    state = state_of("hemispheric", (0.5, 0, -5))
    smooth, rough = tessellate(state, 24), tessellate(state, 24, finish)
    assert_closed(rough)
    assert enclosed(rough) == pytest.approx(enclosed(smooth), rel=2e-3)
    in_cell = np.unique(rough.triangles[rough.cell > 0])
    distance = cKDTree(smooth.vertices).query(rough.vertices[in_cell])[0]
    _, _, amplitude = finish.amplitude
    assert 0.2 * amplitude < distance.max() < 1.5 * amplitude + 0.05  # the smooth vertices are 0.07 mm apart
    moved = np.abs(tessellate(state_of("hemispheric"), 24, finish).vertices - rough.vertices).max()
    assert moved > 0.04


def test_slivers_leave_a_closed_mesh():
    """A cube with a corner on the middle of an edge of its neighbour, and one vertex twice."""
    points = np.array([[0, 0, 0], [2, 0, 0], [0, 2, 0], [0, 0, 2], [1, 0, 0], [0, 0, 2]], dtype=float)
    triangles = np.array([[0, 2, 1], [0, 4, 3], [4, 1, 5], [0, 3, 2], [1, 2, 5], [0, 1, 4], [4, 5, 3], [3, 5, 2]])
    left, origin = without_slivers(points, triangles)
    a, b, c = (points[left[:, k]] for k in range(3))
    assert len(left) == len(origin) == 6
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).min() > 1
    edges = {tuple(edge) for triangle in left.tolist() for edge in zip(triangle, np.roll(triangle, -1), strict=True)}
    assert len(edges) == 18 and edges == {(end, start) for start, end in edges}


@pytest.mark.parametrize(
    "make, message",
    [
        (lambda: LayerSteps(0), "layer_height = 0 is not allowed"),
        (lambda: LayerSteps(0.1, (0, 0, 0)), "print_direction = .* not all 0"),
        (lambda: LayerSteps(0.1, (0, 1)), "print_direction = .* three finite numbers"),
        (lambda: Grooves(-1, 0.1), "groove_pitch = -1"),
        (lambda: Grooves(0.1, math.nan), "groove_depth = nan"),
        (lambda: Grooves(0.1, 0.1, (0, math.inf, 0)), "groove_direction"),
        (lambda: RandomRoughness(0, 0.1), "rms_height = 0"),
        (lambda: RandomRoughness(0.1, 0), "correlation_length = 0"),
        (lambda: RandomRoughness(0.1, 0.1, -1), "roughness_seed = -1"),
        (lambda: RandomRoughness(0.1, 0.1, 1, 0), "finish_refinement = 0"),
        (lambda: RandomRoughness(0.1, 0.1, 1, 1.5), "finish_refinement = 1.5 is not allowed: .* at least 2"),
    ],
)
def test_impossible_finishes_are_refused(make, message):
    with pytest.raises(InputError, match=message):
        make()


@pytest.mark.parametrize(
    "finish, message",
    [
        (LayerSteps(0.6), "layer_height = 0.6 is not allowed: .* at most 0.25 mm, layer_height = 0.5, is allowed"),
        (Grooves(1, 0.6), "groove_depth = 0.6"),
        (RandomRoughness(0.07, 1), "rms_height = 0.07"),
        (LayerSteps(1e-4), "layer_height = 0.0001 .* triangles"),
        (LayerSteps(1e-310), "layer_height = 1e-310 .* triangles"),
        (Grooves(1e-3, 0.1), "groove_pitch = 0.001 .* choose a larger groove_pitch"),
        (RandomRoughness(0.01, 1e-3), "correlation_length = 0.001"),
    ],
)
def test_what_does_not_fit_is_refused(finish, message):
    with pytest.raises(InputError, match=message):
        check_finish(finish, Pad("hemispheric", rows=1, columns=1), state_of("hemispheric").mesh, 12)
