"""Meshes that follow a pad's dimensions: morphed ones fill the changed pad, and their elements stay valid."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from walls_of_pads import PADS, off_the_walls, volume

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.element_maps import curved_volume, worst_element
from mitsuba_taxel.geometry.second_order import edge_ends
from mitsuba_taxel.pads import Pad
from mitsuba_taxel.pads.parametric.lean import leaning
from mitsuba_taxel.pads.parametric.pad import LENGTHS
from mitsuba_taxel.pads.parametric.velocities import mesh_velocity
from mitsuba_taxel.pads.regions import REGIONS

every_case = pytest.mark.parametrize(("shape", "dimension"), [(s, d) for s in PADS for d in LENGTHS])


@cache
def mesh_of(shape):
    return PADS[shape].mesh(4.0)


def morphed(mesh, velocity, step):
    return replace(mesh, points=mesh.points + step * velocity)


@every_case
def test_a_morphed_mesh_has_the_surface_of_the_changed_pad(shape, dimension):
    pad, mesh = PADS[shape], mesh_of(shape)
    velocity = mesh_velocity(pad, mesh, dimension)
    step = 0.02
    other = morphed(mesh, velocity, step)
    changed = pad.changed(**{dimension: getattr(pad, dimension) + step})
    assert off_the_walls(pad, mesh).max() < 1e-12
    assert off_the_walls(changed, other).max() < 1e-10
    assert worst_element(other)[0] > 0.5 * worst_element(mesh)[0]


@every_case
def test_the_rate_of_a_meshs_volume_is_that_of_the_pads(shape, dimension):
    pad, mesh, step = PADS[shape], mesh_of(shape), 1e-3
    velocity = mesh_velocity(pad, mesh, dimension)
    found, expected = (
        (volume_of(step) - volume_of(-step)) / (2 * step)
        for volume_of in (
            lambda change: curved_volume(morphed(mesh, velocity, change)),
            lambda change: volume(pad.changed(**{dimension: getattr(pad, dimension) + change})),
        )
    )
    exact = shape == "parallelepiped" or dimension in ("wall", "height")
    assert found == pytest.approx(expected, rel=1e-8 if exact else 0.01, abs=1e-10)


@pytest.mark.parametrize("name", [name for name in PADS["profile"].dimensions if name not in LENGTHS])
@pytest.mark.parametrize("shape", ["profile", "square"])
def test_a_mesh_follows_the_points_of_a_profile(shape, name):
    """To first order: a wall is the root of a spline of the square of r."""
    pad, mesh = PADS[shape], mesh_of(shape)
    velocity, off = mesh_velocity(pad, mesh, name), []
    for step in (-2e-2, -1e-2):
        changed = pad.changed(**{name: pad.dimensions[name] + step})
        off.append(off_the_walls(changed, morphed(mesh, velocity, step)).max())
    assert off[0] < 2e-4
    assert off[1] < 0.3 * off[0] + 1e-10
    rate = (volume(pad) - volume(changed)) / 1e-2
    assert (curved_volume(mesh) - curved_volume(morphed(mesh, velocity, -1e-2))) / 1e-2 == pytest.approx(rate, rel=0.03)


@pytest.mark.parametrize(
    ("shape", "name"),
    [
        (shape, name)
        for shape in ("parallelepiped", "hemispheric", "profile", "square", "frustum")
        for name in PADS[shape].dimensions
    ],
)
def test_a_mesh_of_leaning_cells_follows(shape, name):
    """To first order, as their slope is a quotient of dimensions, and exactly with their lean and the pitch."""
    pad = replace(PADS[shape], top_x=0.3, top_y=-0.2)
    mesh = leaning(pad, mesh_of(shape))
    velocity, off = mesh_velocity(pad, mesh, name), []
    for step in (-2e-2, -1e-2):
        changed = pad.changed(**{name: pad.dimensions[name] + step})
        off.append(off_the_walls(changed, morphed(mesh, velocity, step)).max())
    assert off_the_walls(pad, mesh).max() < 1e-12
    assert off[0] < 3e-4
    assert off[1] < 0.3 * off[0] + 1e-10
    assert name not in ("top_x", "top_y", "pitch") or off[0] < 1e-10


@pytest.mark.parametrize("shape", PADS)
def test_middles_of_straight_edges_stay_there(shape):
    pad, mesh = PADS[shape], mesh_of(shape)
    curved = np.isin(mesh.face_region, [REGIONS[name] for name in pad.shape.round_regions])
    free = np.setdiff1d(np.arange(mesh.corner_count, len(mesh.points)), mesh.faces[curved])
    ends = edge_ends(mesh.tets)[free - mesh.corner_count]
    velocity = mesh_velocity(pad, mesh, "cell_size")
    np.testing.assert_allclose(velocity[free], velocity[ends].mean(axis=1), atol=1e-14)


def test_a_height_of_cells_that_was_not_given_follows():
    free, given = Pad("hemispheric"), Pad("hemispheric", cell_height=1.775)
    assert free == given
    assert free.changed(cell_size=2.0) == Pad("hemispheric", cell_size=2.0)
    assert given.changed(cell_size=2.0) == Pad("hemispheric", cell_size=2.0, cell_height=1.775)
    assert free.changed(wall=2.0).changed(cell_size=2.0).cell_height == 1.5
    assert free.changed(cell_height=1.7).changed(cell_size=2.0).cell_height == 1.7


def test_the_roof_of_such_a_cell_rises_with_its_size():
    mesh = mesh_of("hemispheric")
    highest = mesh.points[:, 2][np.unique(mesh.faces[mesh.face_region == REGIONS["roof"]])].max()
    at_top = np.flatnonzero(mesh.points[:, 2] == highest)
    pads = PADS["hemispheric"], Pad("hemispheric", rows=1, columns=2, cell_height=1.775)
    follows, stays = (mesh_velocity(pad, mesh, "cell_size")[at_top, 2] for pad in pads)
    np.testing.assert_allclose(follows, 0.5, atol=1e-12)
    np.testing.assert_allclose(stays, 0.0, atol=1e-12)


def test_a_dimension_at_its_limit_has_a_derivative():
    pad, mesh = PADS["cylindrical"], mesh_of("cylindrical")
    highest = pad.height - 0.01 * pad.cell_size
    flattened = morphed(mesh, mesh_velocity(pad, mesh, "cell_height"), highest - pad.cell_height)
    rates = mesh_velocity(pad.changed(cell_height=highest), flattened, "cell_height")
    on_roof = np.unique(mesh.faces[mesh.face_region == REGIONS["roof"]])
    np.testing.assert_allclose(rates[on_roof], np.tile([0.0, 0.0, 1.0], (len(on_roof), 1)), atol=1e-10)


@pytest.mark.parametrize(
    ("parameter", "message"),
    [("rows", "continuously"), ("cell", "continuously"), ("length", "cell_height"), (3, "cell_height")],
)
def test_what_has_no_derivative_is_refused(parameter, message):
    with pytest.raises(InputError, match=message):
        mesh_velocity(PADS["cylindrical"], mesh_of("cylindrical"), parameter)
