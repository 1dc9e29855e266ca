"""Meshes moved from one pad onto another: they have its surface, valid elements, and the symmetries of both."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from walls_of_pads import PADS, off_the_walls, volume

from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.geometry.element_maps import curved_volume, worst_element
from mitsuba_taxel.geometry.mirror import ACROSS_X, ACROSS_Y
from mitsuba_taxel.mechanics.elements.symmetry import node_images
from mitsuba_taxel.mechanics.meshes import pad_mesh
from mitsuba_taxel.pads import Pad
from mitsuba_taxel.pads.parametric.morphing import moved_onto, stretches
from mitsuba_taxel.pads.parametric.pad import CELL_SHAPES, LENGTHS
from mitsuba_taxel.pads.parametric.velocities import mesh_velocity

FAR = {"pitch": 0.3, "wall": -0.2, "height": 0.4, "cell_size": 0.15, "cell_height": 0.15}
"""In mm: large changes of the dimensions, all at once."""
POINTS = {"profile_r1": 0.04, "profile_z1": -0.05, "profile_r2": -0.05, "profile_z2": 0.1, "profile_r4": 0.03}


@cache
def mesh_of(shape):
    return PADS[shape].mesh(2.5)


def far_from(pad, share=1.0, **more):
    changes = FAR | (POINTS if pad.profile else {}) | more
    return pad.changed(**{name: pad.dimensions[name] + share * change for name, change in changes.items()})


@pytest.mark.parametrize("lean", [0.0, 0.25])
@pytest.mark.parametrize("shape", PADS)
def test_a_moved_mesh_has_the_surface_of_the_pad(shape, lean):
    """Its nodes lie on the walls, edges and planes to rounding; its elements are valid, and fill the pad."""
    pad = far_from(PADS[shape], 0.6 if lean else 1.0, top_y=lean).moved_from(PADS[shape])
    before = mesh_of(shape)
    mesh = moved_onto(pad, PADS[shape], before)
    assert pad.origin == PADS[shape] and np.array_equal(mesh.tets, before.tets)
    assert off_the_walls(pad, mesh).max() < 1e-12
    assert worst_element(mesh)[0] > 0.1
    approximated = curved_volume(before) / volume(PADS[shape]) - 1
    assert curved_volume(mesh) / volume(pad) - 1 == pytest.approx(approximated, rel=0.5, abs=1e-12)
    kept = (ACROSS_X,) if lean else (ACROSS_X, ACROSS_Y)
    assert tuple(node_images(mesh)) == kept, "symmetries are exact"


def test_a_square_pad_keeps_its_diagonals():
    pad = Pad("cylindrical", rows=1, columns=1)
    changed = pad.changed(wall=0.9, cell_size=2.6, cell_height=1.5)
    assert len(node_images(moved_onto(changed, pad, pad.mesh(2.5)))) == 4


@pytest.mark.parametrize("shape", PADS)
def test_a_mesh_moved_a_little_goes_with_its_velocities(shape):
    pad, mesh, step = replace(PADS[shape]), mesh_of(shape), 1e-4  # with the height of its cells given
    names = [name for name in pad.dimensions if not name.startswith("top") and pad.dimensions[name] != 1.0]
    changes = dict(zip(names, np.random.default_rng(3).uniform(-1, 1, len(names)).tolist(), strict=True))
    ends = [
        pad.changed(**{name: pad.dimensions[name] + sign * step * rate for name, rate in changes.items()})
        for sign in (1, -1)
    ]
    ahead, behind = (moved_onto(end, pad, mesh).points for end in ends)
    expected = sum(rate * mesh_velocity(pad, mesh, name) for name, rate in changes.items())
    np.testing.assert_allclose((ahead - behind) / (2 * step), expected, atol=1e-5)


def test_a_mesh_moved_nowhere_stays():
    pad = PADS["square"]
    mesh = mesh_of("square")
    np.testing.assert_allclose(moved_onto(pad, pad, mesh).points, mesh.points, atol=1e-12)


def test_origins_are_passed_on():
    pad = PADS["profile"]
    near = pad.changed(wall=0.9).moved_from(pad)
    assert near.changed(wall=1.2).moved_from(near).origin == pad and pad.origin is None
    assert near.default_mesh_size == pad.default_mesh_size != replace(near, meshed_as="").default_mesh_size
    assert near.identity["meshed_as"] and "meshed_as" not in pad.identity
    assert near.as_profile() == near and Pad("spherical", meshed_as="wall=1.1").as_profile().origin is None
    assert Pad(meshed_as="wall = 1.1, cell_size=2.5").origin == Pad(wall=1.1, cell_size=2.5)


def test_stretches_of_a_mesh_that_is_drawn_out():
    mesh = mesh_of("parallelepiped")
    drawn = replace(mesh, points=mesh.points * [2.0, 1.0, 0.5])
    np.testing.assert_allclose(stretches(mesh, drawn), 4.0)


@pytest.mark.parametrize("shape", CELL_SHAPES)
def test_what_is_too_far_is_refused(shape):
    pad = PADS[shape].changed(height=20.0).moved_from(PADS[shape])
    with pytest.raises(ComputationError, match="cannot be moved this far"):
        moved_onto(pad, PADS[shape], mesh_of(shape))


def test_meshes_in_the_cache_are_those_of_the_pad():
    pad = PADS["cylindrical"]
    moved = pad.changed(wall=1.1).moved_from(pad)
    assert np.array_equal(pad_mesh(moved, 2.5).points, moved.mesh(2.5).points)
    own = replace(moved, meshed_as="")
    assert np.array_equal(pad_mesh(own, 2.5).points, own.mesh(2.5).points)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("size=2", "names are pitch, wall"),
        ("wall", "'name=value'"),
        ("wall=thick", "'name=value'"),
        ("wall=-1", "meshed_as: wall = -1"),
    ],
)
def test_bad_origins_are_refused(text, said):
    assert set(LENGTHS) == set(Pad().dimensions)
    with pytest.raises(InputError, match=said):
        Pad(meshed_as=text)
