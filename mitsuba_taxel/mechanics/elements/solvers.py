"""Direct solvers for symmetric indefinite matrices, with a common interface.

`rslab` factors L D L^T and gives the inertia; SuperLU of scipy is always available.

Single precision is used where it suffices. Its rounding error E does not change the inertia of A if no matrix between A
and A + E is singular, for which it suffices that all eigenvalues of E (A + E)^-1 lie within the unit circle (R. A. Horn
and C. R. Johnson, Matrix Analysis, 2nd ed., 2013, section 5.6). Iterative refinement then converges too.
"""

from __future__ import annotations

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


SOLVERS: dict[str, type] = {"rslab": Rslab, "superlu": SuperLu}


def available_solvers() -> list[str]:
    """Names of the installed solvers, the preferred one first."""
    import importlib.util

    return [name for name in SOLVERS if name == "superlu" or importlib.util.find_spec(name)]


def make_solver(name: str | None = None) -> Solver:
    """The solver called ``name``, by default the first of :func:`available_solvers`."""
    return SOLVERS[name or available_solvers()[0]]()
