"""Every shape of cell keeps what its class promises; a new one lacks nothing, and works wherever the others do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.path import Path

from mitsuba_taxel import Pad
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.element_maps import curved_volume
from mitsuba_taxel.pads import mesh_velocity
from mitsuba_taxel.pads.cells import CellShape, MeridianCell, roof_meridian
from mitsuba_taxel.pads.cells.meridian import from_axis
from mitsuba_taxel.pads.parametric.drawings import solids
from mitsuba_taxel.pads.parametric.round_walls import onto_round_walls
from mitsuba_taxel.pads.regions import REGIONS
from mitsuba_taxel.parameters import Number
from mitsuba_taxel.specification.deformable_pad import DeformablePad

GIVEN = {"profile": {"profile": "0.9 0.5; 0.6 0.9; 0 1", "section": "square"}}
"""What shapes need beside their defaults."""
every_shape = pytest.mark.parametrize("cell", CellShape.kinds())


def pad_of(cell, **given):
    return Pad(cell, 1, 1, **GIVEN.get(cell, {}), **given)


def test_a_shape_that_lacks_a_member_fails_when_its_class_is_made():
    with pytest.raises(TypeError, match="cell 'bare': .*Bare lacks bend_radii, .*least_elements, .*onto_wall, .*solid"):

        class Bare(CellShape, name="bare"):
            face_refinement = 2.0

    assert "bare" not in CellShape.kinds()


@every_shape
def test_solids_meshes_and_outlines_have_one_volume(cell):
    pad = pad_of(cell)
    r, z = pad.shape.outline().T
    section = 4.0 if pad.shape.is_square else np.pi
    pieces = section * (z[:-1] - z[1:]) * (r[:-1] ** 2 + r[:-1] * r[1:] + r[1:] ** 2) / 3  # of cones
    hollow = 4.55**3 - solids(pad)["pad"].mass
    assert pieces.sum() == pytest.approx(hollow, rel=1e-4)
    assert curved_volume(pad.mesh(2.0)) == pytest.approx(4.55**3 - hollow, rel=1e-3)
    assert z[:-1].max() == pytest.approx(pad.top_of_cell, rel=1e-4) and z[-2] == pytest.approx(pad.side_height)


@every_shape
def test_what_lies_within_is_that_inside_the_outline(cell):
    pad = pad_of(cell)
    points = np.random.default_rng(0).uniform([-1.4, -1.4, 0], [1.4, 1.4, 1.9], (300, 3))
    across = from_axis(pad.shape.is_square, points)[0]
    outline = pad.shape.outline()
    within = Path([*outline, [0.0, 0.0]]).contains_points(np.column_stack([across, points[:, 2]]))
    assert np.array_equal(pad.shape.holds(points[:, None], 0.0)[:, 0], within) and 50 < within.sum() < 250


@every_shape
def test_nodes_lie_on_the_walls_and_follow_every_dimension(cell):
    """To second order in a change of it."""
    pad = replace(pad_of(cell), columns=2)
    mesh = pad.mesh(4.0)
    faces = np.isin(mesh.face_region, [REGIONS[name] for name in pad.shape.round_regions])
    nodes, middles = mesh.faces[faces], mesh.points[mesh.faces[faces, :3]].mean(axis=1)
    about = [np.repeat(values, 6) for values in (mesh.face_region[faces], mesh.face_cell[faces])]

    def off(other, points):
        at = points[nodes].reshape(-1, 3)
        return np.abs(onto_round_walls(other, at, *about, np.repeat(middles, 6, axis=0))[0] - at).max(initial=0.0)

    assert off(pad, mesh.points) < 1e-12
    for name, value in pad.dimensions.items():
        velocity = mesh_velocity(pad, mesh, name)
        aside = [off(pad.changed(**{name: value - step}), mesh.points - step * velocity) for step in (2e-2, 1e-2)]
        assert aside[0] < 3e-4 and aside[1] < 0.3 * aside[0] + 1e-10, name


@pytest.fixture
def paraboloid():
    """A shape of the user, forgotten afterwards."""

    class Paraboloid(MeridianCell, name="test_paraboloid"):
        """Down to the board but for a side of a tenth of its height, with a crown of any height."""

        default_height_words, default_height = "1.55", 1.55
        is_square, has_curved_rim, light_sizes = False, True, None
        face_refinement, least_elements = 2.0, 400

        @classmethod
        def own_parameters(cls):
            return {"crown": Number(default=1.2, unit="mm", doc="Height of the crown.", above=0)}

        @property
        def top(self):
            return self.value("crown")

        @property
        def roof(self):
            return roof_meridian(f"1 {0.1 * self.cell_height / self.top!r}; 0 1", self.radius, self.top)

    yield Paraboloid
    del CellShape._registry["test_paraboloid"]


def test_a_shape_of_the_user_meshes_and_is_a_cell_of_scenes(paraboloid):
    pad = Pad("test_paraboloid", 1, 1, crown=1.8)
    mesh = pad.mesh(2.0)
    hollow = np.pi * 1.275**2 * (0.155 + 0.5 * (1.8 - 0.155))
    assert curved_volume(mesh) == pytest.approx(4.55**3 - hollow, rel=1e-4)
    velocity, other = mesh_velocity(pad, mesh, "crown"), pad.changed(crown=1.81)
    rate = (curved_volume(replace(mesh, points=mesh.points + 0.01 * velocity)) - curved_volume(mesh)) / 0.01
    assert rate == pytest.approx(-0.5 * np.pi * 1.275**2, rel=0.01) and other.top_of_cell == 1.81
    with pytest.raises(InputError, match="cell = 'test_paraboloid' is not allowed: it cannot be written as a profile"):
        pad.as_profile()
    assert DeformablePad(cell="test_paraboloid", rows=1, columns=1, crown=1.8).build_pad() == pad
