"""Slopes that triangles between random heights lose, and the multiple of them that blunt heights lose."""

import numpy as np
import pytest

from mitsuba_taxel import Grooves, LayerSteps, RandomRoughness
from mitsuba_taxel.base.convergence import FACETS_SHARE
from mitsuba_taxel.mechanics.surface.finish import BLUNTING
from mitsuba_taxel.mechanics.surface.relief import SmoothSurface
from mitsuba_taxel.mechanics.surface.wall_finishes import SeparateFinish, with_blunt_heights
from mitsuba_taxel.pads.regions import REGIONS

RMS, LENGTH, CELLS, SEEDS = 0.01, 1.0, 96, 12
NEIGHBOURS = np.array([[1, 0], [0.5, 0.75**0.5], [-0.5, 0.75**0.5], [-1, 0], [-0.5, -(0.75**0.5)], [0.5, -(0.75**0.5)]])


def roof(edge):
    """A flat roof of equilateral triangles, seen from the silicone above it, and its inner triangles."""
    i, j = np.meshgrid(np.arange(CELLS), np.arange(CELLS), indexing="ij")
    vertices = edge * np.stack([i + 0.5 * j, 0.75**0.5 * j, 0 * i], axis=-1).reshape(-1, 3)
    number = np.arange(CELLS**2).reshape(CELLS, CELLS)
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[:-1, 1:], number[1:, 1:]
    triangles = np.concatenate([np.stack(corners, axis=-1).reshape(-1, 3) for corners in ((a, c, b), (b, c, d))])
    at_rim = np.isin(np.arange(CELLS), (0, 1, CELLS - 2, CELLS - 1))
    inner = ~(at_rim[:, None] | at_rim).ravel()
    surface = SmoothSurface(vertices, triangles, np.full(len(triangles), REGIONS["roof"]))
    return surface, inner[triangles].all(axis=1)


def square_slope(finish, edge):
    """Mean square slope of the triangles, and its standard error, from several seeds."""
    surface, inner = roof(edge)
    values = []
    for seed in range(SEEDS):
        height = finish(seed).relief(surface).offset[:, 2]
        corners, levels = surface.vertices[surface.triangles[inner], :2], height[surface.triangles[inner]]
        sides, rises = corners[:, 1:] - corners[:, :1], levels[:, 1:] - levels[:, :1]
        values.append(np.square(np.linalg.solve(sides, rises[..., None])).sum(axis=(1, 2)).mean())
    return np.mean(values), np.std(values, ddof=1) / SEEDS**0.5


def expected(edge, blunting):
    """Its expectation: 2 / (3 edge^2) times the mean squares of the rises along three sides."""
    points = np.concatenate([[[0, 0]], NEIGHBOURS])
    weights = np.array([1 - blunting, *[blunting / 6] * 6])
    both = np.concatenate([points, points + [1, 0]])
    rise = np.concatenate([-weights, weights])
    distance = edge * np.linalg.norm(both[:, None] - both, axis=2)
    return 2 / edge**2 * RMS**2 * rise @ np.exp(-((distance / LENGTH) ** 2)) @ rise


@pytest.mark.parametrize("refinement", [2.0, 4.0])
def test_slopes_of_triangles(refinement):
    """Against the expectation, which follows from the correlation, within four standard errors."""
    edge = LENGTH / refinement
    exact = 4 * RMS**2 / LENGTH**2
    for finish, blunting in (
        (lambda seed: RandomRoughness(RMS, LENGTH, seed, refinement), 0.0),
        (lambda seed: RandomRoughness(RMS, LENGTH, seed, refinement).blunt, BLUNTING),
    ):
        value, error = square_slope(finish, edge)
        assert abs(value - expected(edge, blunting)) < 4 * error
        assert error < 0.3 * (exact - expected(edge, BLUNTING))


def test_blunt_heights_lose_five_times_as_much():
    exact = 4 * RMS**2 / LENGTH**2
    for refinement, within in ((32.0, 0.01), (8.0, 0.1), (4.0, 0.25), (2.0, 0.5)):
        lost, lost_by_blunt = (exact - expected(LENGTH / refinement, blunting) for blunting in (0.0, BLUNTING))
        assert lost == pytest.approx(exact / (2 * refinement**2), rel=within)
        of_triangles = expected(LENGTH / refinement, 0.0)
        assert (of_triangles - exact + lost_by_blunt) * FACETS_SHARE == pytest.approx(lost, rel=within)


def test_only_random_heights_are_blunt():
    heights, steps, grooves = RandomRoughness(0.01, 0.2, 3), LayerSteps(0.1), Grooves(0.2, 0.05)
    assert with_blunt_heights(heights) == heights.blunt != heights
    assert with_blunt_heights(SeparateFinish(heights, steps)) == SeparateFinish(heights.blunt, steps)
    assert with_blunt_heights(SeparateFinish(None, heights)) == SeparateFinish(None, heights.blunt)
    for finish in (None, steps, grooves, SeparateFinish(steps, grooves)):
        assert with_blunt_heights(finish) is None
