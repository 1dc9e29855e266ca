"""Direct solvers for symmetric indefinite matrices, with a common interface.

All solvers give the inertia of a matrix, the numbers of its positive and negative eigenvalues. `rslab` is preferred;
SuperLU of scipy is always available. Single precision is used where it suffices. Its rounding error E does not change
the inertia of A if no matrix between A and A + E is singular, for which it suffices that all eigenvalues of E (A +
E)^-1 lie within the unit circle (R. A. Horn and C. R. Johnson, Matrix Analysis, 2nd ed., 2013, section 5.6). Iterative
refinement then converges too.
"""

from __future__ import annotations

import math
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import scipy.sparse as sparse

from mitsuba_taxel.base.caches import Recent
from mitsuba_taxel.base.processes.system import return_freed_memory
from mitsuba_taxel.base.processes.threads import thread_count
from mitsuba_taxel.mechanics.elements.memory import is_limited, require_memory

if TYPE_CHECKING:
    from scipy.sparse.linalg import SuperLU

MOST_THREADS = 4
"""Largest number of threads of a solver; more threads bring no gain for matrices of pads."""

FEW_UNKNOWNS = 50_000
"""Number of unknowns below which a matrix is ordered by minimum fill, which is quicker; larger matrices are ordered by
nested dissection, which gives less fill."""

ANALYSIS_BYTES = 120
"""Memory per entry for the analysis of a pattern: 120 bytes with 30 000 unknowns and 88 with 125 000, as measured."""
UNPLANNED = 1.25
"""Memory for a factor, relative to the memory that the solver predicts: 1.22 with 125 000 unknowns, as measured."""

MOST_ROUNDING = 0.05
"""Largest estimated norm of E (A + E)^-1 for which a single-precision factor is used; it is typically 1e-3."""
REFINEMENTS = 10
"""Largest number of iterative refinements of a solution in full precision."""
MOST_BACKWARD_ERROR = 1e-11
"""Largest backward error of factors without row exchanges: above rounding errors, far below the errors that growing
pivots would cause."""


class Factorisation(Protocol):
    """A factored matrix A, with which linear equations A x = b are solved."""

    negative_pivots: int
    """Number of negative eigenvalues."""

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """Solution x (n,) of A x = ``rhs`` for one right-hand side (n,)."""

    def solve_roughly(self, rhs: np.ndarray) -> np.ndarray:
        """Approximate solution of A x = ``rhs``, accurate to a few digits, for use within an iteration."""

    def solve_many(self, rhs: np.ndarray) -> np.ndarray:
        """Solutions (n, k) of A x = b for the k columns b of ``rhs`` (n, k)."""


class Solver(Protocol):
    """Interface of a linear solver: it factors a sequence of matrices of one pattern, given by their lower triangles.

    It raises RuntimeError for a singular matrix, and MemoryError for lack of memory.
    """

    def factor(self, lower: sparse.csc_matrix) -> Factorisation: ...


class _RslabFactorisation:
    def __init__(self, factor: Any) -> None:
        self._factor = factor
        self.negative_pivots = int(factor.inertia[1])

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        return self._factor.solve(rhs, refine=REFINEMENTS, target=np.finfo(float).eps)

    def solve_roughly(self, rhs: np.ndarray) -> np.ndarray:
        return self._factor.solve(rhs)

    def solve_many(self, rhs: np.ndarray) -> np.ndarray:
        return self._factor.solve_many(rhs)


KEPT_UNKNOWNS = 5_000
"""Largest number of unknowns of matrices whose analyses are cached, some 5 MB each. Studies solve pads that differ in
load, material or shape only, and the analysis, which depends on the pattern alone, takes as long as a factorisation."""
_ANALYSED: Recent[Any] = Recent("analysed patterns of matrices", 32)


class Rslab:
    """Linear solver that factors a matrix as L D L^T by the package `rslab`. The sparsity pattern is analysed once,
    with the first matrix.
    """

    def __init__(self) -> None:
        self._symbolic: Any = None

    def factor(self, lower: sparse.csc_matrix) -> Factorisation:
        import rslab

        threads = "auto", min(thread_count(), MOST_THREADS)
        if lower.shape[0] >= FEW_UNKNOWNS:
            return_freed_memory()
        if self._symbolic is None:
            require_memory(ANALYSIS_BYTES * lower.nnz, "the analysis of a matrix")
            ordering = "amf" if lower.shape[0] < FEW_UNKNOWNS else "metis"
            # Each thread of the analysis reserves a stack of up to 4 GB, which would use up a limit.
            settings = {"threads": 1} if is_limited() else {}
            analyse = partial(rslab.analyze, lower, path="ldlt", ordering=ordering, **settings)
            pattern = lower.indptr, lower.indices
            self._symbolic = _ANALYSED.of(pattern, analyse) if lower.shape[0] <= KEPT_UNKNOWNS else analyse()
        self._require_memory("float32", threads)
        try:
            factorisation = _RslabFactorisation(
                self._symbolic.factor(lower.data, threads=threads, factor_dtype="float32")
            )
            if _rounding(factorisation, lower) < MOST_ROUNDING:
                return factorisation
            del factorisation
        except RuntimeError:  # singular in single precision
            pass
        self._require_memory("float64", threads)
        return _RslabFactorisation(self._symbolic.factor(lower.data, threads=threads))

    def _require_memory(self, precision: str, threads: tuple[str, int]) -> None:
        """Raise MemoryError if a factor in the given precision does not fit into the free memory."""
        planned = self._symbolic.memory_plan(dtype=precision, threads=threads)["factor_peak_bytes"]
        require_memory(UNPLANNED * planned, "a factored matrix")


def _rounding(factor: Factorisation, lower: sparse.csc_matrix) -> float:
    """Estimated effect of rounding on a factored matrix: the Frobenius norm of E (A + E)^-1, where A + E is the
    factored matrix and A is given by its lower triangle."""
    noise = np.random.default_rng(0).standard_normal(lower.shape[0])
    solution = factor.solve_roughly(noise)
    return float(np.linalg.norm(noise - symmetric_product(lower, solution)))


def symmetric_product(lower: sparse.csc_matrix, vector: np.ndarray) -> np.ndarray:
    """The product A x of a symmetric matrix and a vector.

    Parameters
    ----------
    lower : (n, n) csc_matrix
        Lower triangle of A.
    vector : (n,) ndarray
        The vector x.

    Returns
    -------
    (n,) ndarray
        The product A x.
    """
    return lower @ vector + lower.T @ vector - lower.diagonal() * vector


def sum_of_triangles(lower: sparse.csc_matrix, other: sparse.csr_array) -> sparse.csc_matrix:
    """The sum of two lower triangles of sparse matrices, which keeps stored zeros: incompressible solids have zeros on
    the diagonal.

    Parameters
    ----------
    lower : (n, n) csc_matrix
        First lower triangle.
    other : (n, n) csr_array
        Second lower triangle.

    Returns
    -------
    (n, n) csc_matrix
        Matrix with sorted indices.
    """
    triangles = lower.tocoo(), other.tocoo()
    values, rows, columns = (
        np.concatenate([getattr(triangle, name) for triangle in triangles]) for name in ("data", "row", "col")
    )
    total = sparse.csc_matrix((values, (rows, columns)), shape=lower.shape)
    total.sort_indices()
    return total


class _SuperLuFactorisation:
    def __init__(self, factor: SuperLU, lower: sparse.csc_matrix) -> None:
        self._factor, self._lower, self._precision = factor, lower, factor.U.dtype
        # Without row exchanges, signs of pivots are those of eigenvalues (Sylvester). SciPy keeps copies of both
        # triangles, as large as the factor; they are dropped.
        upper, unit = factor.U, factor.L
        self.negative_pivots = int(np.count_nonzero(upper.diagonal() < 0))
        for copied in (upper, unit):
            copied.data = copied.indices = np.zeros(0, dtype=np.int32)

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        solution, last = self.solve_roughly(rhs), math.inf
        for _ in range(REFINEMENTS):
            residual = rhs - symmetric_product(self._lower, solution)
            size = float(np.linalg.norm(residual))
            if not size < 0.5 * last:
                break
            solution, last = solution + self.solve_roughly(residual), size
        return solution

    def backward_error(self) -> float:
        """Relative size of the error of the factored matrix, estimated from one solution."""
        noise = np.random.default_rng(0).standard_normal(self._lower.shape[0])
        solution = self.solve_roughly(noise)
        residual = noise - symmetric_product(self._lower, solution)
        return float(np.linalg.norm(residual) / (sparse.linalg.norm(self._lower) * np.linalg.norm(solution)))

    def solve_roughly(self, rhs: np.ndarray) -> np.ndarray:
        return self._factor.solve(rhs.astype(self._precision)).astype(float)

    solve_many = solve_roughly


WITHOUT_EXCHANGES: dict[str, Any] = {
    "permc_spec": "MMD_AT_PLUS_A",
    "diag_pivot_thresh": 0.0,
    "options": {"SymmetricMode": True},
}


class SuperLu:
    """Linear solver that factors a matrix as L U by scipy, without exchanges of rows, so that it gives the inertia
    (numbers of positive and negative eigenvalues).

    Tangents of pads are quasidefinite: positive over displacements, negative over pressures. Such matrices need no
    pivoting, in any order (R. J. Vanderbei, SIAM J. Optim. 5, 1995), and fill in as little as positive definite
    matrices in minimum degree order. Diagonal entries that are too small, such as those of pressures in incompressible
    solids, are enlarged; iterative refinement removes the effect.
    """

    def factor(self, lower: sparse.csc_matrix) -> Factorisation:
        from scipy.sparse.linalg import splu

        require_memory(ANALYSIS_BYTES * lower.nnz, "the analysis of a matrix")
        full = sparse.csc_matrix(lower + sparse.tril(lower, k=-1).T)
        diagonal = full.diagonal()

        # Amount that the elimination of positive pivots subtracts from each diagonal entry, to first order.
        inverse = np.divide(1.0, diagonal, out=np.zeros_like(diagonal), where=diagonal > 0)
        eliminated = full.power(2) @ inverse
        for precision in (np.float32, np.float64):
            least = np.sqrt(np.finfo(precision).eps) * eliminated
            enlarged = np.where(np.abs(diagonal) < least, np.where(diagonal > 0, least, -least), diagonal)
            matrix = full + sparse.diags_array(enlarged - diagonal, dtype=float)
            with suppress(RuntimeError):  # singular in this precision
                factor = splu(sparse.csc_matrix(matrix, dtype=precision), **WITHOUT_EXCHANGES)
                if np.array_equal(factor.perm_r, factor.perm_c):  # no pivot was zero
                    factorisation = _SuperLuFactorisation(factor, lower)
                    if _rounding(factorisation, lower) < MOST_ROUNDING:
                        return factorisation
                    # Close to a singular matrix, no factor resolves the smallest eigenvalue.
                    if precision is np.float64 and factorisation.backward_error() < MOST_BACKWARD_ERROR:
                        return factorisation
        raise RuntimeError("the matrix is singular")


SOLVERS: dict[str, type] = {"rslab": Rslab, "superlu": SuperLu}


def available_solvers() -> list[str]:
    """Names of the installed solvers, the preferred one first.

    Returns
    -------
    list[str]
        Names, which are keys of `SOLVERS`.
    """
    import importlib.util

    return [name for name in SOLVERS if name == "superlu" or importlib.util.find_spec(name)]


def make_solver(name: str | None = None) -> Solver:
    """The solver called ``name``, by default the first of :func:`available_solvers`.

    Parameters
    ----------
    name : str, optional
        Name of the solver, a key of `SOLVERS`; by default the first of :func:`available_solvers`.

    Returns
    -------
    Solver
        Solver for matrices of one pattern.
    """
    return SOLVERS[name or available_solvers()[0]]()
