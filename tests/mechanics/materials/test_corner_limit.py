"""The pressure at which a sharp corner under a force of constant direction is unstable."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.optimize import brentq, fsolve

from mitsuba_taxel.geometry.volume_mesh import TET_EDGES, TET_FACES, VolumeMesh
from mitsuba_taxel.mechanics.elements.loads import SpreadForce
from mitsuba_taxel.mechanics.elements.model import Model
from mitsuba_taxel.mechanics.elements.solvers import make_solver
from mitsuba_taxel.mechanics.elements.symmetry import part_between
from mitsuba_taxel.mechanics.materials import corner_limit
from mitsuba_taxel.mechanics.materials.corner_limit import corner_limit as limit_of
from mitsuba_taxel.mechanics.materials.laws import MooneyRivlin, NeoHookean, Yeoh
from mitsuba_taxel.mechanics.materials.silicones import silicone
from mitsuba_taxel.pads import REGIONS

LAW = NeoHookean(1.0, 0.5)


def test_a_corner_in_elements_is_unstable_there_as_they_become_smaller():
    """Elements shrink by one half from one to the next towards the corner, which is clamped far away. What is missing
    falls with the square of the logarithm of the smallest."""
    levels = np.array([2, 4, 6])
    found = np.array([_unstable_at(count) for count in levels])
    limit = limit_of(LAW) / LAW.shear_modulus
    assert np.all(np.diff(found) < 0) and found[-1] > limit
    end, *_ = fsolve(lambda fit: fit[0] + fit[1] / (levels + fit[2]) ** 2 - found, (0.7, 2.0, 1.0))
    assert end == pytest.approx(limit, rel=0.03)


def test_polynomials_of_a_higher_degree_change_little(monkeypatch):
    found = []
    for degree in (6, 8, 10):
        monkeypatch.setattr(corner_limit, "DEGREE", degree)
        corner_limit._functions.cache_clear()
        found.append(limit_of.__wrapped__(LAW) / LAW.shear_modulus)
    corner_limit._functions.cache_clear()
    np.testing.assert_allclose(found, 0.7061, atol=1e-3)


def test_laws_that_are_equal_have_equal_limits():
    assert limit_of(MooneyRivlin(0.5, 0.0, 0.49)) == pytest.approx(limit_of(NeoHookean(2.98, 0.49)), rel=1e-5)
    assert limit_of(Yeoh(0.5, poisson_ratio=0.49)) == pytest.approx(limit_of(NeoHookean(2.98, 0.49)), rel=1e-5)
    assert limit_of(NeoHookean(7.0, 0.5)) == pytest.approx(7 * limit_of(LAW), rel=1e-5)
    assert limit_of(NeoHookean(1.0, 0.49999)) == pytest.approx(limit_of(LAW), rel=1e-3)


@pytest.mark.parametrize("law", [NeoHookean(1.0, 0.0), NeoHookean(1.0, 0.3), silicone("dragon_skin_20")])
def test_limits_of_other_silicones(law):
    """Stiffening ones bear more, compressible ones less."""
    assert 0.35 < limit_of(law) / law.shear_modulus < 0.85


def _unstable_at(levels: int) -> float:
    """Nominal pressure, in shear moduli, from which on an octant of elements is unstable."""
    mesh, solver = _octant(-np.concatenate([0.5 ** np.arange(levels + 1), [0.0]])), make_solver()
    model = Model(part_between(mesh, {}, ()), LAW, SpreadForce(), {})

    def surplus(stretch: float) -> float:
        gradient, pressure = np.diag([stretch**-0.5, stretch**-0.5, stretch]), -LAW.shear_modulus / stretch
        pressure += LAW.shear_modulus * (2 / stretch + stretch**2) / 3  # of the isochoric stress
        stress = LAW.shear_modulus * (stretch - stretch**-2)
        moved = mesh.points @ (gradient - np.eye(3))
        state = model.evaluate(moved, np.full(mesh.corner_count, pressure), np.array([0.0, 0.0, stress]))
        assert np.abs(state.residual).max() < 1e-12  # of homogeneous uniaxial stress
        negative = solver.factor(model.assembly.matrix(state.entries)).negative_pivots
        return negative - model.numbering.pressures - 0.5

    stretch = brentq(surplus, 0.7, 0.82, xtol=2e-4)  # 1.34 and 0.67 shear moduli
    return stretch**-2 - stretch


def _octant(places: np.ndarray) -> VolumeMesh:
    """Cubes between ``places`` (n,) along each axis, cut into six tetrahedra; the corner is at 0, loaded along z."""
    count = len(places)
    number = np.arange(count**3).reshape(count, count, count)
    corners = np.stack(np.meshgrid(places, places, places, indexing="ij"), axis=-1).reshape(-1, 3)
    tets = []
    for order in itertools.permutations(range(3)):
        steps = np.cumsum([np.zeros(3, int), *np.eye(3, dtype=int)[list(order)]], axis=0)
        of_cubes = [number[tuple(slice(first, count - 1 + first) for first in step)].ravel() for step in steps]
        if np.linalg.det(steps[1:]) < 0:
            of_cubes[1], of_cubes[2] = of_cubes[2], of_cubes[1]
        tets.append(np.stack(of_cubes, axis=1))
    of_tets = np.concatenate(tets)
    edges, which = np.unique(
        np.sort(of_tets[:, np.array(TET_EDGES)].reshape(-1, 2), axis=1), axis=0, return_inverse=True
    )
    points = np.concatenate([corners, corners[edges].mean(axis=1)])
    of_tets = np.concatenate([of_tets, len(corners) + which.reshape(-1, 6)], axis=1)
    faces = of_tets[:, np.array(TET_FACES)].reshape(-1, 6)
    _, first, times = np.unique(np.sort(faces[:, :3], axis=1), axis=0, return_index=True, return_counts=True)
    faces = faces[first[times == 1]]
    region = np.full(len(faces), REGIONS["outer"])
    region[(points[faces, 2] == 0).all(axis=1)] = REGIONS["top"]
    region[(points[faces] == places[0]).all(axis=1).any(axis=1)] = REGIONS["bottom"]
    return VolumeMesh(points, of_tets, faces, region, np.zeros(len(faces), dtype=int))
