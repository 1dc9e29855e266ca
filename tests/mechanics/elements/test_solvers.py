"""Factors of single precision say of a matrix what those of double precision do."""

from __future__ import annotations

import importlib.util
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import scipy.sparse as sparse

from mitsuba_taxel.mechanics import (
    Indenter,
    IndenterDisplacement,
    NeoHookean,
    PlateDisplacement,
    Pressure,
    SpreadForce,
    load_path,
)
from mitsuba_taxel.mechanics.elements import solvers
from mitsuba_taxel.mechanics.elements.assembly import Assembly
from mitsuba_taxel.mechanics.elements.constraints import number_unknowns
from mitsuba_taxel.mechanics.elements.solvers import Rslab, SuperLu, available_solvers, symmetric_product
from mitsuba_taxel.mechanics.equilibrium.pad_parts import loaded_pad
from mitsuba_taxel.pads import Pad

SIDE = 18
BOTH = [Rslab, SuperLu]


@pytest.fixture(scope="module")
def laplacian():
    """Of a square grid, with its least eigenvalue in closed form."""
    beside = np.full(SIDE - 1, -1.0)
    line = sparse.diags_array([beside, np.full(SIDE, 2.0), beside], offsets=[-1, 0, 1])
    one = sparse.eye_array(SIDE)
    least = 4 - 4 * np.cos(np.pi / (SIDE + 1))
    return sparse.csc_matrix(sparse.kron(line, one) + sparse.kron(one, line)), least


@pytest.mark.parametrize("distance", [0.5, 1e-2, 1e-4, 1e-6, 1e-8, 1e-10])
@pytest.mark.parametrize("beyond", [False, True])
@pytest.mark.parametrize("solver", BOTH)
def test_the_inertia_is_right_however_near_an_eigenvalue_is_to_zero(solver, distance, beyond, laplacian):
    matrix, least = laplacian
    shift = least * (1 + distance if beyond else 1 - distance)
    shifted = sparse.csc_matrix(sparse.tril(matrix - shift * sparse.eye_array(SIDE**2)))
    factor = solver().factor(shifted)
    assert factor.negative_pivots == int(beyond)
    rhs = np.arange(float(SIDE**2))
    found = factor.solve(rhs)
    np.testing.assert_allclose(symmetric_product(shifted, found), rhs, atol=1e-13 * np.abs(found).max())


@pytest.mark.parametrize("solver", BOTH)
def test_a_solution_is_right_to_all_digits_and_a_rough_one_to_some(solver, laplacian):
    matrix, _ = laplacian
    exact = np.random.default_rng(1).standard_normal(SIDE**2)
    factor = solver().factor(sparse.csc_matrix(sparse.tril(matrix)))
    np.testing.assert_allclose(factor.solve(matrix @ exact), exact, atol=1e-13)
    np.testing.assert_allclose(factor.solve_roughly(matrix @ exact), exact, atol=1e-4)
    both = factor.solve_many(matrix @ np.column_stack([exact, 2 * exact]))
    np.testing.assert_allclose(both, np.column_stack([exact, 2 * exact]), atol=1e-3)


@pytest.mark.parametrize("solver", BOTH)
def test_a_saddle_point_has_as_many_negative_eigenvalues_as_constraints(solver):
    """Zeros on the diagonal may be left out of the pattern. A factor stays when the next one is made."""
    random = np.random.default_rng(0)
    constraints = np.eye(20, 60) + sparse.random_array((20, 60), density=0.2, rng=random)
    matrix = np.block([[np.eye(60), constraints.T], [constraints, np.zeros((20, 20))]])
    exact, made = random.standard_normal(80), solver()
    first, second = (made.factor(sparse.csc_matrix(np.tril(each))) for each in (matrix, 2 * matrix))
    assert first.negative_pivots == second.negative_pivots == 20
    np.testing.assert_allclose(first.solve(matrix @ exact), exact, atol=1e-12)
    np.testing.assert_allclose(second.solve(matrix @ exact), exact / 2, atol=1e-12)


@pytest.mark.parametrize("solver", BOTH)
def test_a_singular_matrix_is_refused(solver):
    with pytest.raises(RuntimeError):
        solver().factor(sparse.csc_matrix(np.tril(np.ones((5, 5)))))


def test_an_analysis_is_shared_by_matrices_of_one_pattern(monkeypatch):
    """By several threads at once, too; solutions keep their bits, as it does not depend on the entries."""
    rslab = pytest.importorskip("rslab")
    random, analysed, analyse = np.random.default_rng(5), [], rslab.analyze
    monkeypatch.setattr(rslab, "analyze", lambda *given, **named: (analysed.append(1), analyse(*given, **named))[1])
    lower = sparse.csc_matrix(sparse.tril(sparse.random_array((300, 300), density=0.02, rng=random)))
    lower = sparse.csc_matrix(lower + 10 * sparse.eye_array(300))
    entries = random.normal(lower.data, 0.1, (8, lower.nnz))
    matrices = [sparse.csc_matrix((data, lower.indices, lower.indptr)) for data in entries]
    rhs = random.normal(size=300)
    Rslab().factor(lower)
    with ThreadPoolExecutor(4) as pool:
        shared = list(pool.map(lambda matrix: Rslab().factor(matrix).solve(rhs), matrices))
    assert len(analysed) == 1
    monkeypatch.setattr(solvers, "KEPT_UNKNOWNS", 0)
    for matrix, found in zip(matrices, shared, strict=True):
        np.testing.assert_array_equal(found, Rslab().factor(matrix).solve(rhs))
        np.testing.assert_allclose(symmetric_product(matrix, found), rhs, atol=1e-9)
    assert len(analysed) == 9


ONE, LAW = Pad(rows=1, columns=1), NeoHookean(4.16, 0.49)
LOADS = [
    (SpreadForce(), (0.2, 0.1, -1.5)),
    (PlateDisplacement(), (0.0, 0.0, -0.3)),
    (Pressure(), (0.1,)),
    (IndenterDisplacement(Indenter("plane")), (0.0, 0.0, -0.2)),
]


@pytest.fixture
def without(fresh, monkeypatch):
    """States of a pad, solved anew as if some packages were not installed."""

    def solved(*hidden, load, value, pad=ONE, material=LAW, mesh_size=3.0):
        fresh()
        loaded_pad.cache_clear()
        find = importlib.util.find_spec
        with monkeypatch.context() as patch:
            patch.setattr(
                importlib.util, "find_spec", lambda name, *more: None if name in hidden else find(name, *more)
            )
            assert not set(hidden) & set(available_solvers())
            return load_path(pad, material, [value], load=load, mesh_size=mesh_size)[0]

    yield solved
    loaded_pad.cache_clear()


@pytest.mark.parametrize(("load", "value"), LOADS, ids=[type(load).__name__ for load, _ in LOADS])
def test_load_paths_are_the_same_without_rslab(load, value, without):
    """Stability is judged by both."""
    pytest.importorskip("rslab")
    usual, other = without(load=load, value=value), without("rslab", load=load, value=value)
    assert usual.stability_checked and other.stability_checked
    np.testing.assert_allclose(other.displacement, usual.displacement, atol=1e-7 * np.abs(usual.displacement).max())
    np.testing.assert_allclose(other.pressure, usual.pressure, atol=1e-5 * np.abs(usual.pressure).max())


@pytest.mark.parametrize("poisson_ratio", [0.0, 0.49, 0.4999, 0.499999, 0.5])
@pytest.mark.parametrize("solver", BOTH)
def test_tangents_of_any_compressibility_have_the_inertia_that_their_eigenvalues_say(solver, poisson_ratio, block):
    """Of a glued column that is stable, and of the same one far beyond buckling, where its pressures are wrong too."""
    mesh = block((1.0, 1.0, 4.0), (1, 1, 4), distortion=0.2, curvature=0.05)
    numbering = number_unknowns(mesh, np.abs(mesh.points[:, 2]) < 1e-9)
    assembly = Assembly(mesh, NeoHookean(4.16, poisson_ratio), numbering)
    rhs, made = np.random.default_rng(2).standard_normal(assembly.unknowns), solver()
    unstable = []
    for stretch, pressure in ((1.0, 0.0), (0.6, 0.0), (0.6, -3.0)):
        displacement = mesh.points * (np.array([stretch**-0.5, stretch**-0.5, stretch]) - 1)
        state = assembly.evaluate(displacement, np.full(mesh.corner_count, pressure))
        lower = assembly.matrix(state.entries)
        factor = made.factor(lower)
        whole = lower.toarray()
        negative = np.count_nonzero(np.linalg.eigvalsh(whole, UPLO="L") < 0)
        assert factor.negative_pivots == negative
        unstable.append(negative - numbering.pressures)
        residual = symmetric_product(lower, factor.solve(rhs)) - rhs
        assert np.linalg.norm(residual) < 1e-11 * np.linalg.norm(rhs)
    assert unstable[0] == 0 < unstable[2]
