"""What every kind of indenter has to satisfy, also one that is defined in a script; all are drawn from the registry."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from mitsuba_taxel.geometry.mirror import MIRRORS
from mitsuba_taxel.geometry.surfaces.cutaway import is_closed
from mitsuba_taxel.geometry.surfaces.triangles import volume
from mitsuba_taxel.mechanics import Indenter
from mitsuba_taxel.mechanics.contact.indenter_shape import IndenterShape
from mitsuba_taxel.parameters import Number, parameters_of

KINDS = tuple(IndenterShape.kinds())


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    file = tmp_path_factory.mktemp("bodies") / "ball.stl"
    trimesh.creation.icosphere(3, 1.5).export(file)
    return str(file)


def example(kind, file, seed, upright=False, **about):
    """An indenter of a kind with random dimensions, and unless it stays upright a random angle and tilt if it has
    them."""
    random = np.random.default_rng(seed)
    given = {"shape": kind, **about}
    for name, parameter in parameters_of(Indenter).items():
        if kind not in parameter.when:
            continue
        if parameter.default_text == "":
            given[name] = random.uniform(1.0, 3.0) if isinstance(parameter, Number) else file
        elif name in ("angle", "tilt") and not upright:
            given[name] = random.uniform(-30, 30)
    return Indenter(**given).body


each_kind = pytest.mark.parametrize("kind", KINDS)


@each_kind
@pytest.mark.parametrize("upright", [True, False])
def test_normal_and_curvature_are_the_derivatives_of_the_distance(kind, upright, file):
    body = example(kind, file, 1, upright)
    points = np.random.default_rng(2).uniform([-1.5, -1.5, -0.5], [1.5, 1.5, 0.6], (150, 3))
    gap, step = body.gap(points), 1e-5
    for axis in range(3):
        ahead, behind = (body.gap(points + sign * step * np.eye(3)[axis]) for sign in (1, -1))
        slope, bend = (ahead.size - behind.size) / (2 * step), (ahead.normal - behind.normal) / (2 * step)
        near = np.abs(gap.size) < 0.3
        for rate, own in ((slope, gap.normal[:, axis]), (bend, gap.curvature[:, :, axis])):
            off = np.abs(rate - own).reshape(len(points), -1).max(axis=1)[near]
            assert np.mean(off < 1e-5) > 0.9  # the others are where the surface has an edge or its curvature jumps


@each_kind
def test_the_lowest_point_is_the_tip_and_near_the_surface_distances_are_euclidean(kind, file):
    body = example(kind, file, 3)
    level = np.stack(np.meshgrid(*[np.linspace(-4, 4, 401)] * 2, [0.0]), axis=-1).reshape(-1, 3)
    lowest = body.gap(level).size.min()
    assert abs(lowest) < 0.03 or body.unbounded
    points = np.random.default_rng(4).uniform([-1.5, -1.5, -0.5], [1.5, 1.5, 0.6], (100, 3))
    gap = body.gap(points)
    near = np.abs(gap.size) < 0.2
    off = body.gap(points - gap.size[:, None] * gap.normal).size[near]
    assert np.mean(np.abs(off) < 2e-3) > 0.95


@each_kind
@pytest.mark.parametrize("at", [(0.0, 0.0), (1.0, 0.0), (0.0, -0.5), (1.0, 1.0)])
def test_mirrors_that_it_keeps_map_its_distances(kind, at, file):
    for upright in (True, False):
        body = example(kind, file, 5, upright, at=at)
        points = np.random.default_rng(6).uniform([-2, -2, 0], [2, 2, 2], (50, 3))
        start = body.start(points[body.highest(points)])
        for mirror in filter(body.keeps, MIRRORS):
            image = np.array([mirror.image(point) for point in points])
            here = body.gap(points - start).size
            np.testing.assert_allclose(body.gap(image - start).size, here, atol=1e-9)


@each_kind
@pytest.mark.parametrize("reach", [0.7, 30.0])
def test_it_is_drawn_where_it_is(kind, reach, file):
    body = example(kind, file, 7)
    vertices, triangles = body.surface(reach)
    assert is_closed(triangles) and volume(vertices, triangles) > 0
    gap = body.gap(vertices).size
    rounded = 0.02 if kind == "file" else 1e-9
    assert gap.max() < rounded and np.mean(gap > -rounded - 1e-9) > 0.02


@each_kind
def test_contacts_do_not_shrink_with_the_depth(kind, file):
    body = example(kind, file, 8)
    radii = np.array([body.contact_radius(depth) for depth in (1e-3, 0.05, 0.2, 1.0)])
    assert (radii > 0).all() and (radii[1:] >= radii[:-1]).all() and (radii <= 10 * body.thickness).all()
    assert np.isinf(radii).all() == body.unbounded
    assert 0 < body.pressure_length(0.1) <= radii[-1]
    away = body.distance_to_steepest_pressure(np.array([[40.0, 0.0, 0.0], [0.0, 40.0, 0.0]]), 0.2)
    assert away.max() > 30


def test_a_kind_that_lacks_something_fails_when_it_is_defined():
    with pytest.raises(TypeError, match=r"indenter 'wedge'.*lacks contact_grows.*contact_radius.*own_gap.*unbounded"):
        type("Wedge", (IndenterShape,), {}, name="wedge")
    assert "wedge" not in IndenterShape.kinds()


def test_a_kind_of_ones_own_is_chosen_by_name_and_has_its_parameters():
    class Sharper(IndenterShape.named("sphere"), name="sharper"):
        meaning = "a ball of a third of its radius"
        uses = ("radius",)

        def __init__(self, indenter):
            super().__init__(SimpleNamespace(radius=indenter.radius / 3, at=indenter.at, angle=None, tilt=None))

    try:
        own, ball = Indenter("sharper", radius=3.0), Indenter("sphere", radius=1.0)
        points = np.random.default_rng(9).normal(size=(9, 3))
        np.testing.assert_array_equal(own.body.gap(points).size, ball.body.gap(points).size)
        assert "sharper" in parameters_of(Indenter)["radius"].when
    finally:
        del IndenterShape._registry["sharper"]
