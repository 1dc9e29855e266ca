"""Rates of a deformed surface's vertices, against differences of surfaces of morphed and changed pads."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.mechanics import (
    NeoHookean,
    SpreadForce,
    State,
    linearise,
    surface_gradient,
    surface_rates,
    tessellate,
)
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import LoadedPad
from mitsuba_taxel.pads import CELL_SHAPES, Pad, PadFile, mesh_velocity

PADS = {shape: Pad(shape, rows=1, columns=2) for shape in CELL_SHAPES}
SUBDIVISION = 3


def state_of(mesh, displacement):
    pressure = np.zeros(mesh.corner_count)
    return State(mesh, NeoHookean(), SpreadForce(), np.zeros(3), displacement, pressure, 1.0, 0.0, 0, True)


@cache
def bent(shape):
    """A pad bent by any smooth displacement."""
    mesh = PADS[shape].mesh(4.0)
    x, y, z = mesh.points.T
    return state_of(mesh, 0.05 * np.stack([np.sin(x + z), y * z, -z - 0.1 * x * y], axis=1))


@pytest.fixture
def solid(tmp_path):
    """What says that round walls of a mesh are those of a solid."""
    (tmp_path / "pad.step").write_bytes(b"")
    return PadFile(tmp_path / "pad.step")


def difference(state, velocity, pad_at, step):
    def vertices(change):
        mesh = replace(state.mesh, points=state.mesh.points + change * velocity)
        return tessellate(state_of(mesh, state.displacement), SUBDIVISION, pad=pad_at(change)).vertices

    return (vertices(step) - vertices(-step)) / (2 * step)


@pytest.mark.parametrize("shape", CELL_SHAPES)
@pytest.mark.parametrize("cells", [None, [2]])
def test_rates_by_displacement_are_exact_and_their_transpose(shape, cells):
    state, rng = bent(shape), np.random.default_rng(0)
    rate = rng.standard_normal(state.displacement.shape)
    found = surface_rates(state, SUBDIVISION, PADS[shape], rate, cells=cells)
    there = state_of(state.mesh, state.displacement + rate)
    ahead, here = (tessellate(s, SUBDIVISION, cells=cells, pad=PADS[shape]).vertices for s in (there, state))
    np.testing.assert_allclose(found, ahead - here, atol=1e-13)
    gradient = rng.standard_normal(here.shape)
    back = surface_gradient(state, SUBDIVISION, gradient, cells)
    assert np.vdot(back, rate) == pytest.approx(np.vdot(gradient, found), rel=1e-12)


@pytest.mark.parametrize("dimension", ["cell_size", "cell_height", "pitch"])
@pytest.mark.parametrize("shape", CELL_SHAPES)
def test_vertices_follow_a_dimension_of_the_pad(shape, dimension, solid):
    state, pad = bent(shape), PADS[shape]
    velocity = mesh_velocity(pad, state.mesh, dimension)
    for known, pad_at in [
        (pad, lambda change: pad.changed(**{dimension: getattr(pad, dimension) + change})),
        (solid, lambda change: solid),
        (None, lambda change: None),
    ]:
        found = surface_rates(state, SUBDIVISION, known, np.zeros_like(velocity), velocity)
        np.testing.assert_allclose(found, difference(state, velocity, pad_at, 1e-4), atol=1e-7)


def test_a_wall_that_does_not_stay_round_goes_along_with_its_elements(solid):
    state = bent("hemispheric")
    velocity = state.mesh.points * [[1.0, 0.0, 0.0]]
    found, without = (
        surface_rates(state, SUBDIVISION, pad, np.zeros_like(velocity), velocity) for pad in (solid, None)
    )
    np.testing.assert_array_equal(found, without)


def test_a_moved_mesh_keeps_its_triangles():
    state = bent("hemispheric")
    mesh = replace(state.mesh, points=state.mesh.points * [1.5, 1.0, 1.0])  # cut anew, its edges have other segments
    moved = replace(state, mesh=mesh)
    own, kept = (tessellate(moved, SUBDIVISION, cut_of=cut_of) for cut_of in (None, state.mesh))
    here = tessellate(state, SUBDIVISION)
    assert len(own.triangles) != len(here.triangles)
    np.testing.assert_array_equal(kept.triangles, here.triangles)
    rates = surface_rates(state, SUBDIVISION, None, 0 * mesh.points, mesh.points - state.mesh.points)
    np.testing.assert_allclose(kept.vertices - here.vertices, rates, atol=1e-12)


def test_a_reading_of_the_surface_by_load_and_shape_is_that_of_full_solves():
    """The whole chain, for the volume between the surface and z = 0, by one back-solve."""
    pad, value = Pad("cylindrical", rows=1, columns=1), np.array([0.5, 0.0, -1.0])
    mesh = pad.mesh(4.0)
    velocity = mesh_velocity(pad, mesh, "cell_size")

    def solved(mesh, value, near=None):
        loaded = LoadedPad(mesh, NeoHookean())
        start = loaded.gather(near.displacement, near.pressure) if near else np.zeros(loaded.unknowns)
        fields = loaded.split(loaded.equilibrium(start, value))
        return State(mesh, NeoHookean(), SpreadForce(), value, *fields, 1.0, 0.0, 0, True)

    def reading(state, pad):
        vertices = tessellate(state, SUBDIVISION, pad=pad).vertices
        return (vertices**2).sum(), 2 * vertices

    state = solved(mesh, value)
    _, slope = reading(state, pad)
    gradient = surface_gradient(state, SUBDIVISION, slope)
    found = linearise(state).pull_back(gradient, {"cell_size": velocity})
    by_size = found.shape["cell_size"] + np.vdot(
        slope, surface_rates(state, SUBDIVISION, pad, np.zeros_like(velocity), velocity)
    )
    step = 1e-3
    morphed = [replace(mesh, points=mesh.points + k * step * velocity) for k in (1, -1)]
    pads = [pad.changed(cell_size=pad.cell_size + k * step) for k in (1, -1)]
    ahead, behind = (reading(solved(m, value, state), p)[0] for m, p in zip(morphed, pads, strict=True))
    assert by_size == pytest.approx((ahead - behind) / (2 * step), rel=1e-5)
    ahead, behind = (reading(solved(mesh, value + [k * 1e-2, 0, 0], state), pad)[0] for k in (1, -1))
    assert found.value[0] == pytest.approx((ahead - behind) / 2e-2, rel=1e-4)


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda s: surface_rates(s, 2, None, s.displacement[1:]), r"displacement_rate = \(\d+, 3\) is not allowed"),
        (lambda s: surface_rates(s, 2, None, s.displacement, s.displacement[1:]), "shape_velocity = "),
        (lambda s: surface_rates(s, 2, None, s.displacement, cells=[7]), "read_cells = 7"),
        (lambda s: surface_gradient(s, 2, s.displacement), r"gradient = \(\d+, 3\) is not allowed"),
    ],
)
def test_what_does_not_fit_is_refused(ask, message):
    with pytest.raises(InputError, match=message):
        ask(bent("cylindrical"))
