"""The second state: that of the path on other elements, and its weights by the actual ratio of their sizes."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.base.convergence import TYPICAL_SLOPE_ERROR
from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.geometry.surfaces.triangles import area_normals
from mitsuba_taxel.mechanics import NeoHookean, SpreadForce, State, linearise, load_path, second_state
from mitsuba_taxel.mechanics.continuation.load_segment import INTERPOLATION_TOLERANCE
from mitsuba_taxel.mechanics.continuation.pad_path import PadPath, pad_path
from mitsuba_taxel.mechanics.errors.second_meshes import SecondMeshes
from mitsuba_taxel.pads import REGIONS, Pad

PAD = Pad("parallelepiped", rows=1, columns=1)
FORCE = (0.0, 0.0, -0.8)


def size_of_elements(mesh):
    """Mean of those of the solid and of the cells' walls, in mm, up to a factor."""
    return len(mesh.tets) ** (-1 / 6) * np.count_nonzero(mesh.face_cell) ** (-1 / 4)


def mean_of_roofs(state: State, field: np.ndarray) -> np.ndarray:
    """Mean of a field (N, 3) over the roofs, by the middles of edges."""
    roof = state.mesh.faces[state.mesh.face_region == REGIONS["roof"]]
    area = np.linalg.norm(area_normals(state.mesh.points, roof), axis=1)
    return area @ field[roof[:, 3:]].mean(axis=1) / area.sum()


def roof_rate(state: State) -> float:
    """Mean rate of the roofs' sinking by the normal force, in mm/N."""
    return mean_of_roofs(state, linearise(state).by_value((0.0, 0.0, 1.0)))[2]


def test_it_is_the_state_of_the_path_on_larger_elements(fresh):
    (first,) = load_path(PAD, NeoHookean(), np.array([FORCE]), mesh_size=2.0)
    second = second_state(PAD, NeoHookean(), FORCE, mesh_size=2.0)
    (alone,) = load_path(PAD, NeoHookean(), np.array([FORCE]), mesh_size=4.0)
    assert len(second.state.mesh.tets) < len(first.mesh.tets)
    np.testing.assert_array_equal(second.state.mesh.points, alone.mesh.points)
    apart = np.sqrt(np.mean((second.state.displacement - alone.displacement) ** 2))  # steps differ; both interpolate
    assert apart <= 2 * INTERPOLATION_TOLERANCE * np.abs(alone.displacement).max()


def test_a_difference_counts_as_that_of_a_quadratic_error(fresh):
    """A quantity d(h) = d + c h^2 on both meshes: share |d(h') - d(h)| is its error c h^2, and so is share_of_sum times
    the sum of both errors."""
    (first,) = load_path(PAD, NeoHookean(), np.array([FORCE]), mesh_size=2.0)
    second = second_state(PAD, NeoHookean(), FORCE, mesh_size=2.0)
    here, there = (3.0 * size_of_elements(mesh) ** 2 for mesh in (first.mesh, second.state.mesh))
    assert second.share * abs(there - here) == pytest.approx(here)
    assert second.share_of_sum * (there + here) == pytest.approx(here)


@pytest.mark.parametrize("cell", ["parallelepiped", "spherical"])
def test_the_share_of_the_difference_bounds_the_error_of_a_rate(cell, fresh):
    """Against elements of 0.45 times the size, which lack a fifth of a quadratic error."""
    pad = Pad(cell, rows=1, columns=1)
    (state,), (fine,) = (
        load_path(pad, NeoHookean(), np.array([FORCE]), mesh_size=part * pad.default_mesh_size) for part in (1, 0.45)
    )
    second = second_state(pad, NeoHookean(), FORCE)
    stated = second.share * abs(roof_rate(second.state) - roof_rate(state))
    stated = max(stated, second.least * abs(roof_rate(state)))
    assert abs(roof_rate(fine) - roof_rate(state)) < 2 * (1 - 0.45**2) * stated


@pytest.mark.parametrize(
    ("cell", "force"), [("parallelepiped", (0.5, 0, -1)), ("cylindrical", (0, 0, -2)), ("spherical", (0, 0, -2))]
)
def test_large_elements_are_compared_with_the_default_ones(cell, force, fresh):
    """Elements of twice the size would be the same; the true error is that against a fine mesh."""
    pad = Pad(cell, rows=1, columns=1)
    load, size = SpreadForce(), 2.4 * Pad().default_mesh_size
    (state,), (fine,) = (load_path(pad, NeoHookean(), [force], load=load, mesh_size=one) for one in (size, 0.7))
    (second, _) = next(iter(SecondMeshes(pad_path(pad, NeoHookean(), load, size))))
    assert second.mesh_size == pad.default_mesh_size
    means = (mean_of_roofs(one, one.displacement) for one in (state, fine))
    assert np.linalg.norm(np.subtract(*means)) < 2 * state.error.displacement


def test_the_least_error_goes_with_the_size_to_the_power_of_one_and_a_half(fresh):
    default = PAD.default_mesh_size
    for size in (0.8 * default, default):
        least = second_state(PAD, NeoHookean(), FORCE, mesh_size=size).least
        assert least == pytest.approx(TYPICAL_SLOPE_ERROR * (size / default) ** 1.5)


def test_no_second_mesh_is_none_rather_than_no_error(fresh, monkeypatch):
    for meshes in ("__iter__", "coarsest"):
        monkeypatch.setattr(SecondMeshes, meshes, lambda self: iter(()))
    assert second_state(PAD, NeoHookean(), FORCE, mesh_size=2.0) is None


def test_where_the_path_on_larger_elements_ends_the_next_finer_one_tells(fresh, monkeypatch):
    state = PadPath.state

    def ends(self, value, obstacles=None):
        if self.mesh_size > 2.0:
            raise ComputationError("the path ends")
        return state(self, value, obstacles)

    monkeypatch.setattr(PadPath, "state", ends)
    second = second_state(PAD, NeoHookean(), FORCE, mesh_size=2.0)
    (first,) = load_path(PAD, NeoHookean(), np.array([FORCE]), mesh_size=2.0)
    assert len(second.state.mesh.tets) > len(first.mesh.tets)
