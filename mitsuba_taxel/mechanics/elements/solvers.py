"""Direct solvers for symmetric indefinite matrices, with a common interface.

`rslab` factors L D L^T and gives the inertia. Without it, PARDISO of Intel's MKL does so, by `pypardiso` (the extra
``pardiso``). SuperLU of scipy is always available, and gives none. They are preferred in this order.

Single precision is used where it suffices. Its rounding error E does not change the inertia of A if no matrix between A
and A + E is singular, for which it suffices that all eigenvalues of E (A + E)^-1 lie within the unit circle (R. A. Horn
and C. R. Johnson, Matrix Analysis, 2nd ed., 2013, section 5.6). Iterative refinement then converges too.
"""

from __future__ import annotations

from contextlib import suppress
from copy import copy
from functools import partial
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import scipy.sparse as sparse

from mitsuba_taxel.base.recent import Recent
from mitsuba_taxel.base.threads import thread_count
from mitsuba_taxel.mechanics.elements.memory import require_memory

if TYPE_CHECKING:
    from scipy.sparse.linalg import SuperLU

MOST_THREADS = 4
"""More threads bring no gain for matrices of pads."""

FEW_UNKNOWNS = 50_000
"""Smaller matrices are ordered by minimum fill, which is quicker than nested dissection; larger ones get less fill by
that."""

ANALYSIS_BYTES = 150
"""Memory per entry for the analysis of a pattern, as measured."""


MOST_LEFT_OUT = 0.05
"""Largest estimated norm of E (A + E)^-1 for which a single-precision factor is used; it is typically 1e-3."""
REFINEMENTS = 10
"""Maximum, for a solution in full precision."""


class Factorisation(Protocol):
    """A factored matrix."""

    negative_pivots: int | None
    """Number of negative eigenvalues, or None if the solver does not provide it."""

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """Solution for one right-hand side (n,)."""

    def solve_roughly(self, rhs: np.ndarray) -> np.ndarray:
        """The same to a few digits, for use within an iteration."""

    def solve_many(self, rhs: np.ndarray) -> np.ndarray:
        """The same for the columns of (n, k)."""


class Solver(Protocol):
    """Factors a sequence of matrices of one pattern, given by their lower triangles.

    It raises RuntimeError for a singular matrix, and MemoryError for lack of memory.
    """

    knows_inertia: bool

    def factor(self, lower: sparse.csc_matrix) -> Factorisation: ...


class _RslabFactorisation:
    def __init__(self, factor: Any) -> None:
        self._factor = factor
        self.negative_pivots: int | None = int(factor.inertia[1])

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        return self._factor.solve(rhs, refine=REFINEMENTS, target=np.finfo(float).eps)

    def solve_roughly(self, rhs: np.ndarray) -> np.ndarray:
        return self._factor.solve(rhs)

    def solve_many(self, rhs: np.ndarray) -> np.ndarray:
        return self._factor.solve_many(rhs)


KEPT_UNKNOWNS = 5_000
"""Largest matrices whose analyses are kept, some 5 MB each: studies solve pads that differ in their load, material or
shape alone, and an analysis, which the pattern determines, takes as long as a factorisation."""
_ANALYSED: Recent[Any] = Recent(32)


class Rslab:
    """L D L^T by `rslab`; the pattern is analysed once."""

    knows_inertia = True

    def __init__(self) -> None:
        self._symbolic: Any = None
        self._peak = 0.0

    def factor(self, lower: sparse.csc_matrix) -> Factorisation:
        import rslab

        threads = "auto", min(thread_count(), MOST_THREADS)
        if self._symbolic is None:
            require_memory(ANALYSIS_BYTES * lower.nnz, "the analysis of a matrix")
            ordering = "amf" if lower.shape[0] < FEW_UNKNOWNS else "metis"
            analyse = partial(rslab.analyze, lower, path="ldlt", ordering=ordering)
            pattern = lower.indptr, lower.indices
            self._symbolic = _ANALYSED.of(pattern, analyse) if lower.shape[0] <= KEPT_UNKNOWNS else analyse()
            self._peak = self._symbolic.memory_plan(threads=threads)["factor_peak_bytes"]
        require_memory(self._peak, "a factored matrix")
        try:
            factor = self._symbolic.factor(lower.data, threads=threads, factor_dtype="float32")
            if _left_out(factor, lower) < MOST_LEFT_OUT:
                return _RslabFactorisation(factor)
            del factor
        except RuntimeError:  # singular in single precision
            pass
        return _RslabFactorisation(self._symbolic.factor(lower.data, threads=threads))


def _left_out(factor: Any, lower: sparse.csc_matrix) -> float:
    """Estimate of the Frobenius norm of E (A + E)^-1, from the factored A + E and the lower triangle of A."""
    noise = np.random.default_rng(0).standard_normal(lower.shape[0])
    found = factor.solve(noise)
    return float(np.linalg.norm(noise - symmetric_product(lower, found)))


def symmetric_product(lower: sparse.csc_matrix, vector: np.ndarray) -> np.ndarray:
    """A x for a symmetric A given by its lower triangle."""
    return lower @ vector + lower.T @ vector - lower.diagonal() * vector


def sum_of_triangles(lower: sparse.csc_matrix, further: sparse.csr_array) -> sparse.csc_matrix:
    """The sum of two triangles; zeros of the first stay: without compressibility, pressures have such on the
    diagonal."""
    parts = lower.tocoo(), further.tocoo()
    values, rows, columns = (np.concatenate([getattr(part, name) for part in parts]) for name in ("data", "row", "col"))
    found = sparse.csc_matrix((values, (rows, columns)), shape=lower.shape)
    found.sort_indices()
    return found


class _PardisoFactorisation:
    def __init__(self, handle: Any, upper: sparse.csr_matrix) -> None:
        self._handle, self._upper = handle, upper
        handle.set_phase(22)
        _call_pardiso(handle, upper, np.zeros(upper.shape[0]))
        self.negative_pivots: int | None = int(handle.get_iparm(23))
        perturbed = bool(handle.get_iparm(14))
        handle.set_phase(33)
        if perturbed and self._unconverged() > MOST_UNCONVERGED:
            raise RuntimeError("the matrix is singular")

    def __del__(self) -> None:
        with suppress(Exception):  # its memory is not numpy's
            self._handle.free_memory(everything=True)

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        self._handle.set_iparm(8, REFINEMENTS)
        return _call_pardiso(self._handle, self._upper, np.asfortranarray(rhs, dtype=float))

    def solve_roughly(self, rhs: np.ndarray) -> np.ndarray:
        self._handle.set_iparm(8, 0)
        return _call_pardiso(self._handle, self._upper, np.asfortranarray(rhs, dtype=float))

    solve_many = solve

    def _unconverged(self) -> float:
        """Residual of a random right-hand side, as a share of it, after refinement."""
        noise = np.random.default_rng(0).standard_normal(self._upper.shape[0])
        residual = noise - symmetric_product(self._upper.T, self.solve(noise))
        return float(np.linalg.norm(residual) / np.linalg.norm(noise))


class Pardiso:
    """L D L^T by PARDISO of Intel's MKL, through `pypardiso`.

    Rows are matched and scaled first, as PARDISO's manual advises for saddle points (O. Schenk and K. Gärtner,
    Electron. Trans. Numer. Anal. 23, 2006). Where it perturbs pivots, the inertia counts only if refinement converges.
    """

    knows_inertia = True

    def factor(self, lower: sparse.csc_matrix) -> Factorisation:
        import pypardiso

        # PARDISO wants rows of the upper triangle, each with its diagonal entry, zero or not.
        count = lower.shape[0]
        if (lower.indices == np.repeat(np.arange(count), np.diff(lower.indptr))).sum() < count:
            lower = sum_of_triangles(lower, sparse.csr_array(sparse.coo_array((np.zeros(count), (range(count),) * 2))))
        upper = sparse.csr_matrix((lower.data.copy(), lower.indices, lower.indptr), shape=lower.shape)

        # A handle of its own, as factors of one pattern are used side by side; the search for MKL's library is not
        # repeated.
        handle = copy(pypardiso.ps)
        handle.pt, handle.iparm = np.zeros_like(handle.pt), np.zeros_like(handle.iparm)
        handle.set_matrix_type(-2)
        for index, value in PARDISO_SETTINGS.items():
            handle.set_iparm(index, value)
        handle.libmkl.MKL_Set_Num_Threads(min(thread_count(), MOST_THREADS))
        require_memory(ANALYSIS_BYTES * lower.nnz, "the analysis of a matrix")
        handle.set_phase(11)
        _call_pardiso(handle, upper, np.zeros(count))
        peak = max(handle.get_iparm(15), handle.get_iparm(16) + handle.get_iparm(17))
        require_memory(1024.0 * peak, "a factored matrix")
        return _PardisoFactorisation(handle, upper)


PARDISO_SETTINGS = {1: 1, 2: 2, 10: 13, 11: 1, 13: 1, 21: 1}
"""Nested dissection; pivots below 1e-13 are perturbed; scaling, matching, and pivots of one or two rows."""
MOST_UNCONVERGED = 1e-8
"""Largest residual, as a share, of a refinement that converges."""


def _call_pardiso(handle: Any, upper: sparse.csr_matrix, rhs: np.ndarray) -> np.ndarray:
    """What a handle's phase does. Its own ``solve`` would compare the matrix with the factored one each time."""
    import pypardiso

    try:
        return handle._call_pardiso(upper, rhs)
    except pypardiso.PyPardisoError as error:
        if error.value == -2:
            raise MemoryError("not enough memory for PARDISO") from error
        raise RuntimeError(f"PARDISO ends with error {error.value}") from error


class _SuperLuFactorisation:
    negative_pivots: int | None = None

    def __init__(self, factor: SuperLU) -> None:
        self._factor = factor

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        return self._factor.solve(rhs)

    solve_roughly = solve_many = solve


class SuperLu:
    """L U by scipy: slower, and without inertia.

    Columns are ordered by approximate minimum degree (T. A. Davis et al., ACM Trans. Math. Softw. 30, 2004). The
    symmetric mode suits tangents of pads less, whose pressures have next to no diagonal: 3 x 3 domes take four times as
    long by that.
    """

    knows_inertia = False

    def factor(self, lower: sparse.csc_matrix) -> Factorisation:
        from scipy.sparse.linalg import splu

        full = lower + sparse.tril(lower, k=-1).T
        return _SuperLuFactorisation(splu(full.tocsc(), permc_spec="COLAMD"))


SOLVERS: dict[str, type] = {"rslab": Rslab, "pypardiso": Pardiso, "superlu": SuperLu}


def available_solvers() -> list[str]:
    """Names of the installed solvers, the preferred one first."""
    import importlib.util

    return [name for name in SOLVERS if name == "superlu" or importlib.util.find_spec(name)]


def make_solver(name: str | None = None) -> Solver:
    """The solver called ``name``, by default the first of :func:`available_solvers`."""
    return SOLVERS[name or available_solvers()[0]]()
