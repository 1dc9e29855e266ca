"""Isotropic light at the horizon of its start, against solid angles of what is above it."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.pads import Pad
from mitsuba_taxel.sensing import PadSensor
from mitsuba_taxel.sensing.diffuse.diffuse_cells import DiffuseCells
from mitsuba_taxel.transport.cell import Cell, Mesh, ScatteringWalls
from mitsuba_taxel.transport.horizon import fraction_above
from mitsuba_taxel.transport.laws.ends import CosineFactor, End
from mitsuba_taxel.transport.patches import LATTICE

WIDTH, DEPTH = 2.0, 0.6
"""mm, of a square roof and of the wall that hangs from one of its sides."""
RIM = 1.075
"""mm, radius of the rim of a roof that is a spherical cap."""


def test_shares_of_triangles_above_a_line():
    """Against counted points."""
    rng = np.random.default_rng(3)
    heights = rng.normal(size=(200, 3))
    heights = heights[(heights.min(axis=1) < 0) & (heights.max(axis=1) > 0)]
    points = rng.dirichlet((1, 1, 1), 40_000)
    counted = (points @ heights.T > 0).mean(axis=0)
    share, by_corner = fraction_above(heights)
    np.testing.assert_allclose(share, counted, atol=5 * 0.5 / 200)
    assert fraction_above(np.array([[-1.0, 0.0, 1.0]]))[0] == pytest.approx(0.5)
    for corner in range(3):
        step = 1e-6 * np.eye(3)[corner]
        change = (fraction_above(heights + step)[0] - fraction_above(heights - step)[0]) / 2e-6
        np.testing.assert_allclose(by_corner[:, corner], change, rtol=1e-3, atol=1e-3)


def rectangle(corner, along, across, count):
    """(F, 15, 3) patches, whose area normals are along x across."""
    corner, along, across = (np.array(each, dtype=float) for each in (corner, along, across))
    lattice = np.column_stack([1 - LATTICE.sum(axis=1), LATTICE])
    places = []
    for i, j in np.ndindex(*count):
        a, b, c, d = (
            corner + (i + k) / count[0] * along + (j + m) / count[1] * across
            for k, m in ((0, 0), (1, 0), (1, 1), (0, 1))
        )
        places += [lattice @ np.array([a, b, c]), lattice @ np.array([a, c, d])]
    return np.array(places)


def solid_angle(at, corners):
    """Of a flat polygon seen from a point, by triangles. Source: A. van Oosterom, J. Strackee, The Solid Angle of a
    Plane Triangle, IEEE Transactions on Biomedical Engineering 30, 1983."""
    away = np.array(corners) - at
    total = 0.0
    for b, c in zip(away[1:], away[2:], strict=False):
        a = away[0]
        la, lb, lc = (np.linalg.norm(each) for each in (a, b, c))
        below = la * lb * lc + (a @ b) * lc + (a @ c) * lb + (b @ c) * la
        total += 2 * np.arctan2(abs(a @ np.cross(b, c)), below)
    return total


def above(corners, at, normal):
    """The part of a polygon above a plane (I. E. Sutherland, G. W. Hodgman, Reentrant Polygon Clipping, 1974)."""
    kept = []
    for one, other in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        here, there = (one - at) @ normal, (other - at) @ normal
        if here > 0:
            kept.append(one)
        if here * there < 0:
            kept.append(one + (other - one) * here / (here - there))
    return kept


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("tilt", [0.02, 0.05])
def test_a_strip_of_the_wall_beside_a_tilted_roof_is_hidden(tilt, degree):
    """It is narrower than a patch: without shares, light on the wall is off by 2.5 to 9.5 %."""
    corner, along, across = np.array([WIDTH / 2, -WIDTH / 2, 1.0]), np.array([0, WIDTH, 0]), np.array([0, 0, -DEPTH])
    roof = rectangle((-WIDTH / 2, -WIDTH / 2, 1), along, (WIDTH, 0, 0), (3, 3))
    rest = np.concatenate([roof, rectangle(corner, along, across, (4, 2))])
    moved = rest.copy()
    moved[: len(roof), :, 2] -= tilt * (roof[:, :, 0] + WIDTH / 2)
    mesh = Mesh(rest, degree)
    starts = mesh.own < len(roof)
    at, normal = mesh.targets.interpolated(moved)[starts], np.array([-tilt, 0.0, -1.0]) / np.hypot(1, tilt)
    corners = np.array([corner, corner + along, corner + along + across, corner + across])
    expected = np.mean([solid_angle(point, above(corners, point, normal)) / (2 * np.pi) for point in at])

    def light(have_edges):
        end = End(np.zeros((1, 3)), np.ones(1), np.array([0.0, 0.0, 1.0]), CosineFactor(1.0, 0.0))
        walls = ScatteringWalls(moved, rest, np.ones(len(rest)), np.zeros(len(rest)), have_edges=have_edges)
        return Cell(mesh, walls, end, end)._exchange[starts][:, ~starts].sum(axis=1).mean()

    assert light(True) == pytest.approx(expected, rel=7e-3)
    assert light(False) != pytest.approx(expected, rel=2e-2)


def test_slopes_are_those_of_the_light():
    """As the roof tilts further: differences of sums with random weights."""
    rng = np.random.default_rng(4)
    corner, along, across = np.array([WIDTH / 2, -WIDTH / 2, 1.0]), np.array([0, WIDTH, 0]), np.array([0, 0, -DEPTH])
    roof = rectangle((-WIDTH / 2, -WIDTH / 2, 1), along, (WIDTH, 0, 0), (2, 2))
    rest = np.concatenate([roof, rectangle(corner, along, across, (3, 1))])
    moved, velocity = rest.copy(), np.zeros_like(rest)
    moved[: len(roof), :, 2] -= 0.04 * (roof[:, :, 0] + WIDTH / 2)
    velocity[: len(roof), :, 2] = -(roof[:, :, 0] + WIDTH / 2)  # it tilts further
    mesh, ones = Mesh(rest, 2), np.ones(len(rest))
    led, phototransistor = (
        End(np.array([[x, 0.0, 0.0]]), ones[:1], np.array([0.0, 0.0, 1.0]), CosineFactor(1 / np.pi, 1.0))
        for x in (-0.3, 0.3)
    )

    def cell(step):
        walls = ScatteringWalls(moved + step * velocity, rest, 0.9 * ones, 0 * ones, have_edges=True)
        return Cell(mesh, walls, led, phototransistor)

    step = 1e-5
    given = rng.uniform(size=len(mesh.own)), rng.uniform(size=len(mesh.own))
    difference = given[0] @ (cell(step)._exchange - cell(-step)._exchange) @ given[1] / (2 * step)
    here = cell(0.0)
    at_points = mesh.interpolation @ given[1]
    slopes = here._slopes(mesh.pairs.weight * given[0][mesh.pairs.target] * at_points[mesh.pairs.point], 1.0)
    by_end, by_normal = np.stack(slopes.by_end, axis=1), mesh.by_target(slopes.by_normal)
    moving = (
        mesh.pairs.points.interpolated(velocity)[mesh.pairs.point]
        - mesh.targets.interpolated(velocity)[mesh.pairs.target]
    )
    turning = np.zeros_like(by_normal)
    ahead, back = (mesh.targets.positions_and_areas(moved + sign * step * velocity)[1] for sign in (1, -1))
    for sign, area in ((1, ahead), (-1, back)):
        turning += sign * area / np.linalg.norm(area, axis=1, keepdims=True) / (2 * step)
    wider = (mesh.pairs.points.positions_and_areas(moved + sign * step * velocity)[1] for sign in (1, -1))
    facing = np.subtract(*wider) / (2 * step)
    by_area = np.stack(slopes.by_area, axis=1)
    slope = (by_end * moving).sum() + (by_normal * turning).sum() + (by_area * facing[mesh.pairs.point]).sum()
    assert slope == pytest.approx(difference, rel=1e-3)


def test_a_horizon_that_crosses_no_piece():
    """As at rest, where walls stand on flat roofs at right angles: all light counts, and has derivatives."""
    roof = rectangle((-WIDTH / 2, -WIDTH / 2, 1), (0, WIDTH, 0), (WIDTH, 0, 0), (1, 1))
    ones, up = np.ones(len(roof)), np.array([0.0, 0.0, 1.0])
    ends = [End(np.array([[x, 0.0, 0.0]]), ones[:1], up, CosineFactor(1 / np.pi, 1.0)) for x in (-0.3, 0.3)]
    cells = [
        Cell(Mesh(roof, 2), ScatteringWalls(roof, roof, 0.9 * ones, 0 * ones, have_edges=edged), *ends)
        for edged in (True, False)
    ]
    assert cells[0].reading == cells[1].reading > 0
    np.testing.assert_array_equal(*(cell.gradient() for cell in cells))


def flat_radius(radius, bend, power):
    """Where a cap stops to be concave if its rim is raised by bend * (r / RIM)^power."""
    r = np.linspace(0.6, 1, 4001) * RIM
    inwards = bend * power * (power - 1) * r ** (power - 2) / RIM**power - radius**2 / (radius**2 - r**2) ** 1.5
    return r[np.argmax(inwards > 0)] if inwards[-1] > 0 else RIM


def opening(at, normal, height, lowest, count=2048, points=3001):
    """Solid angle of the opening of a roof seen from a point, above its horizon: what is within all circles of the roof
    between the radius ``lowest`` and the rim, as angles from the direction of the rim's middle."""
    axis = np.array([0, 0, height(RIM)]) - at
    axis /= np.linalg.norm(axis)
    first = np.cross(axis, [0.3, 0.5, 0.8])
    first /= np.linalg.norm(first)
    second = np.cross(axis, first)
    around = (np.arange(count) + 0.5) / count * 2 * np.pi
    across = np.cos(around) * (first @ normal) + np.sin(around) * (second @ normal)
    limit, here = np.arctan2(axis @ normal, -across) % np.pi, np.hypot(at[0], at[1])
    smallest = max(lowest, 0.85 * here + 0.15 * RIM)
    for radius in np.linspace(RIM, smallest, 10 if lowest < RIM else 1, endpoint=False):
        gap = np.hypot(here - radius, at[2] - height(radius))
        angle = np.sinh(np.linspace(-1, 1, points) * np.arcsinh(np.pi * RIM / gap))
        angle = np.arctan2(at[1], at[0]) + np.pi * angle / angle.max()
        circle = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(points, height(radius))], 1) - at
        turn = np.unwrap(np.arctan2(circle @ second, circle @ first))
        away = np.arctan2(np.hypot(circle @ first, circle @ second), circle @ axis)
        order = slice(None, None, 1 if turn[0] < turn[-1] else -1)
        start = turn[order][0]
        limit = np.minimum(limit, np.interp(start + (around - start) % (2 * np.pi), turn[order], away[order]))
    return (1 - np.cos(limit)).mean() * 2 * np.pi


def test_a_rim_that_bends_into_the_cell_hides_what_is_below_the_horizon():
    """Isotropic light on the roof of a dome is all that does not leave by the opening. As the rim bends, points of a
    strip of 0.1 mm along it fall below each other's horizons, which takes 0.1 % of the light from roof to roof."""
    sensor = PadSensor(Pad("spherical", 1, 1, pitch=3.58, wall=1.43, height=4.91, cell_size=2 * RIM, cell_height=1.94))
    rest = DiffuseCells(sensor.scene().load()).patches(0).rest
    rim, top = rest[..., 2].min(), rest[..., 2].max()
    radius = (RIM**2 + (top - rim) ** 2) / (2 * (top - rim))
    from_axis, mesh, power = np.hypot(rest[..., 0], rest[..., 1]), Mesh(rest), 12
    end = End(np.zeros((1, 3)), np.ones(1), np.array([0.0, 0.0, 1.0]), CosineFactor(1.0, 0.0))
    for bend in (0.0, 0.014):
        bent = rest.copy()
        bent[..., 2] += bend * (from_axis / RIM) ** power
        cell = Cell(mesh, ScatteringWalls(bent, rest, np.ones(len(rest)), np.zeros(len(rest))), end, end)
        at, area = mesh.targets.positions_and_areas(bent)
        chosen = np.flatnonzero((at[:, 1] > 0) & (at[:, 0] > at[:, 1]))  # an eighth, as of all mirror images
        weight = np.linalg.norm(area, axis=1)
        lowest = flat_radius(radius, bend, power)

        def height(r, bend=bend):
            return top - radius + np.sqrt(radius**2 - r**2) + bend * (r / RIM) ** power

        leaves = [opening(at[k], area[k] / weight[k], height, lowest) / (2 * np.pi) for k in chosen]
        to_roof = cell._exchange[chosen].sum(axis=1)
        assert (lowest < RIM) == (bend > 0) == (cell._between_walls(None).leaving().min() < 0)
        found, expected = (np.average(light, weights=weight[chosen]) for light in (to_roof, 1 - np.array(leaves)))
        assert found == pytest.approx(expected, rel=6e-5)
