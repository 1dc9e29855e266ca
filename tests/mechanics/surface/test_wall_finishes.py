"""Finishes of roof and side: each is on its own wall, and leaves the surface closed."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.mechanics import (
    Grooves,
    LayerSteps,
    NeoHookean,
    RandomRoughness,
    SeparateFinish,
    check_finish,
    load_path,
    tessellate,
)
from mitsuba_taxel.pads import REGIONS, Pad

pytestmark = pytest.mark.usefixtures("mechanics_error_unknown")

LEANING = Pad("cylindrical", rows=1, columns=1, cell_size=2, wall=1, top_x=0.2)
SEPARATE = {
    "steps on the roof": SeparateFinish(roof=LayerSteps(0.15, (0, 0, 1), offset=0.06)),
    "tilted steps on the roof": SeparateFinish(roof=LayerSteps(0.15, (1, 2, 3))),
    "steps on the side": SeparateFinish(side=LayerSteps(0.2, (1, 0, 0), offset=-0.1)),
    "grooves on the side": SeparateFinish(side=Grooves(0.2, 0.04, (0, 0, 1))),
    "random roof": SeparateFinish(roof=RandomRoughness(0.01, 0.3)),
    "steps and grooves": SeparateFinish(LayerSteps(0.15), Grooves(0.2, 0.04, (0, 1, 1))),
    "random heights and tilted steps": SeparateFinish(RandomRoughness(0.01, 0.3), LayerSteps(0.2, (1, 0, 1))),
    "grooves and random heights": SeparateFinish(Grooves(0.2, 0.04), RandomRoughness(0.01, 0.3)),
    "steps of a frustum's side": LayerSteps(0.15, (0, 0, 1), offset=0.05),
}


def pad_of(cell):
    return LEANING if cell == "leaning" else Pad(cell, rows=1, columns=1)


def surface_of(pad, subdivision, finish, force=(0, 0, 0)):
    state = load_path(pad, NeoHookean(), [force], mesh_size=1.2)[0]
    return tessellate(state, subdivision, finish, pad=pad)


def areas(surface, region):
    a, b, c = (surface.vertices[surface.triangles[surface.region == REGIONS[region], k]] for k in range(3))
    return 0.5 * np.cross(b - a, c - a)


def corners(surface, region):
    return surface.vertices[surface.triangles[surface.region == REGIONS[region]]]


def enclosed(surface):
    a, b, c = (surface.vertices[surface.triangles[:, k]] for k in range(3))
    return np.einsum("ij,ij->", a, np.cross(b, c)) / 6


@pytest.mark.parametrize("cell", ["parallelepiped", "hemispheric", "frustum", "leaning"])
@pytest.mark.parametrize("finish", SEPARATE.values(), ids=SEPARATE)
def test_surfaces_are_closed(cell, finish):
    """Each edge has one triangle on either side, which go round it in opposite senses; no silicone is lost."""
    pad = pad_of(cell)
    smooth, rough = surface_of(pad, 5, None), surface_of(pad, 5, finish)
    edges = rough.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2).astype(np.int64)
    forth = np.sort(edges[:, 0] * len(rough.vertices) + edges[:, 1])
    assert np.all(np.diff(forth) > 0)
    np.testing.assert_array_equal(forth, np.sort(edges[:, 1] * len(rough.vertices) + edges[:, 0]))
    assert enclosed(rough) == pytest.approx(enclosed(smooth), rel=0.02)
    np.testing.assert_allclose(corners(rough, "bottom")[..., 2], 0, atol=2e-5)  # a cone's mouth is that exact
    for region in ("top", "outer"):
        np.testing.assert_allclose(areas(rough, region).sum(axis=0), areas(smooth, region).sum(axis=0), atol=1e-12)


def test_grooves_of_the_roof_leave_the_side_plane():
    """The side's edge follows the roof; the profile of the roof is the stated one."""
    surface = surface_of(Pad("parallelepiped", rows=1, columns=1), 6, SeparateFinish(roof=Grooves(0.25, 0.06)))
    np.testing.assert_allclose(np.abs(corners(surface, "side")[..., :2]).max(axis=-1), 1.275, atol=1e-9)
    roof = corners(surface, "roof")
    x, height = roof[..., 0], 1.55 - roof[..., 2]
    np.testing.assert_allclose(height, 0.06 * (0.5 - 2 * np.abs((x / 0.25 + 0.5) % 1 - 0.5)), atol=1e-9)


def test_grooves_of_the_side_leave_the_roof_plane():
    surface = surface_of(
        Pad("parallelepiped", rows=1, columns=1), 6, SeparateFinish(side=Grooves(0.25, 0.06, (0, 0, 1)))
    )
    np.testing.assert_allclose(corners(surface, "roof")[..., 2], 1.55, atol=1e-9)
    side = corners(surface, "side")
    inner = np.abs(side[..., :2]).min(axis=(1, 2)) < 1.1
    outwards = np.abs(side[inner][..., :2]).max(axis=-1) - 1.275
    phase = np.abs((side[inner][..., 2] / 0.25 + 0.5) % 1 - 0.5)
    np.testing.assert_allclose(outwards, -0.06 * (0.5 - 2 * phase), atol=1e-9)


def test_steps_and_grooves_are_each_on_their_wall():
    """A dome of treads and risers above a grooved cylinder: each is the surface of its own finish alone."""
    pad = Pad("hemispheric", rows=1, columns=1)
    steps, grooves = LayerSteps(0.15), Grooves(0.2, 0.04, (0, 0, 1))
    both = surface_of(pad, 6, SeparateFinish(steps, grooves))
    roof = surface_of(pad, 6, SeparateFinish(roof=steps))
    direction = np.abs(areas(both, "roof")[:, 2]) / np.linalg.norm(areas(both, "roof"), axis=1)
    tread = direction > 0.5
    levels = corners(both, "roof")[tread][..., 2] / 0.15
    np.testing.assert_allclose(levels, np.rint(levels), atol=1e-6)
    assert areas(both, "roof")[tread][:, 2].sum() == pytest.approx(
        areas(roof, "roof")[np.abs(areas(roof, "roof")[:, 2]) > 1e-9][:, 2].sum(), rel=0.05
    )
    side = corners(both, "side")
    below = side[..., 2].max(axis=1) < 0.35
    radius = np.hypot(side[below][..., 0], side[below][..., 1])
    phase = np.abs((side[below][..., 2] / 0.2 + 0.5) % 1 - 0.5)
    np.testing.assert_allclose(radius, 1.275 - 0.04 * (0.5 - 2 * phase), atol=2e-3)


@pytest.mark.parametrize(
    "layer_height, offset, roof",
    [(0.2, 0, 1.6), (0.2, 0.05, 1.65), (0.2, -0.06, 1.54), (0.2, 0.15, 1.55), (0.2, 0.2, 1.6)],
)
def test_a_flat_roof_moves_to_the_nearest_level_of_the_print(layer_height, offset, roof):
    """Levels lie at the offset plus multiples of the layer height: half-way, the roof goes up."""
    pad = Pad("parallelepiped", rows=1, columns=1)
    for finish in (
        LayerSteps(layer_height, offset=offset),
        SeparateFinish(roof=LayerSteps(layer_height, offset=offset)),
    ):
        surface = surface_of(pad, 4, finish)
        np.testing.assert_allclose(corners(surface, "roof")[..., 2], roof, atol=1e-9)
        area = np.linalg.norm(areas(surface, "side"), axis=1).sum()
        assert area == pytest.approx(4 * 2.55 * roof)
    down = surface_of(pad, 4, LayerSteps(layer_height, (0, 0, -1), offset=-offset))
    nearest = roof if abs(roof - 1.55) < 0.09 else 1.55 - abs(roof - 1.55)  # half-way, the next along the direction
    np.testing.assert_allclose(corners(down, "roof")[..., 2], nearest, atol=1e-9)


def test_treads_of_a_dome_start_at_the_offset():
    surface = surface_of(Pad("hemispheric", rows=1, columns=1), 12, LayerSteps(0.1, offset=0.03))
    area = areas(surface, "roof")
    tread = np.abs(area[:, 2]) > 0.5 * np.linalg.norm(area, axis=1)
    levels = (corners(surface, "roof")[tread][..., 2] - 0.03) / 0.1
    np.testing.assert_allclose(levels, np.rint(levels), atol=1e-6)


def test_an_inclined_side_has_treads_and_risers_as_well():
    """A cone of diameters 2.55 and 1.5 mm over 1.55 mm, printed vertically: the radius of each layer is that of the
    cone at the middle of the layer, and treads cover its projection once."""
    surface = surface_of(Pad("frustum", rows=1, columns=1), 12, LayerSteps(0.1, offset=0.05))
    area = areas(surface, "side")
    size = np.linalg.norm(area, axis=1)
    tread = np.abs(area[:, 2]) > 0.5 * size
    np.testing.assert_allclose(area[~tread][:, 2] / size[~tread], 0, atol=1e-6)
    levels = (corners(surface, "side")[tread][..., 2] - 0.05) / 0.1
    np.testing.assert_allclose(levels, np.rint(levels), atol=1e-6)
    assert size[tread].sum() == pytest.approx(math.pi * (1.275**2 - 0.75**2), rel=5e-3)
    riser = corners(surface, "side")[~tread]
    middle = np.floor((riser[..., 2].mean(axis=1) - 0.05) / 0.1) * 0.1 + 0.1
    inside = (middle > 0.1) & (middle < 1.5)
    radius = np.hypot(riser[inside][..., 0], riser[inside][..., 1])
    expected = 1.275 - (1.275 - 0.75) * middle[inside] / 1.55
    np.testing.assert_allclose(radius, expected[:, None].repeat(3, axis=1), atol=1e-3)


@pytest.mark.parametrize("cell", ["cylindrical", "parallelepiped"])
def test_a_rounded_edge_has_steps(cell):
    """Below the roof, the fillet is treads on the levels and vertical risers, and no silicone is lost."""
    pad = Pad(cell, rows=1, columns=1, fillet=0.2)
    smooth, rough = surface_of(pad, 6, None), surface_of(pad, 6, LayerSteps(0.1, offset=0.03))
    area, height = areas(rough, "side"), corners(rough, "side")[..., 2]
    slope = np.abs(area[:, 2]) / np.linalg.norm(area, axis=1)
    assert np.minimum(slope, 1 - slope).max() < 1e-6
    tread = (slope > 0.5) & (height.min(axis=1) > 0.2)
    levels = (height[tread] - 0.03) / 0.1
    np.testing.assert_allclose(levels, np.rint(levels), atol=1e-6)
    assert set(np.rint(levels).astype(int).ravel()) >= {13, 14}
    assert enclosed(rough) == pytest.approx(enclosed(smooth), rel=3e-3)


@pytest.mark.parametrize(
    "make, message",
    [
        (lambda: LayerSteps(0.1, offset=0.11), "layer_offset = 0.11 is not allowed: a number from -0.1 to 0.1 mm"),
        (lambda: LayerSteps(0.1, offset=math.nan), "layer_offset = nan"),
        (lambda: SeparateFinish(), "SeparateFinish = .*None, None.* finishes of two kinds"),
        (lambda: SeparateFinish(LayerSteps(0.1), LayerSteps(0.2)), "finishes of two kinds"),
        (lambda: SeparateFinish(roof="rough"), "roof = 'rough' is not allowed: LayerSteps"),
    ],
)
def test_impossible_finishes_are_refused(make, message):
    with pytest.raises(InputError, match=message):
        make()


@pytest.mark.parametrize(
    "finish, message",
    [
        (SeparateFinish(LayerSteps(0.1), Grooves(1, 0.6)), "groove_depth"),
        (SeparateFinish(Grooves(1e-3, 0.1), RandomRoughness(0.01, 0.5)), "groove_pitch = 0.001 .* triangles"),
        (SeparateFinish(side=LayerSteps(0.1)), "print_direction = 0, 0, 1 is not allowed .* would change nothing"),
    ],
)
def test_what_does_not_fit_is_refused(finish, message):
    pad = Pad("hemispheric", rows=1, columns=1)
    with pytest.raises(InputError, match=message):
        check_finish(finish, pad, pad.mesh(1.2), 12)
