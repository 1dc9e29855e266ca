"""Direct solvers for symmetric indefinite matrices, behind one small interface.

`rslab` factors L D L^T and knows the inertia; SuperLU of scipy is always there.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
import scipy.sparse as sparse

from mitsuba_taxel.base.threads import thread_count
from mitsuba_taxel.mechanics.elements.memory import require_memory

MOST_THREADS = 4
"""More do not pay for matrices of pads."""

FEW_UNKNOWNS = 12_000
"""Fewer are ordered by minimum fill, in half the time of nested dissection, which makes less of it for more."""

ANALYSIS_BYTES = 150
"""Per entry, that the analysis of a pattern takes, as measured."""


class Factorisation(Protocol):
    """A factored matrix."""

    negative_pivots: int | None
    """How many eigenvalues are negative, or None if the solver does not know."""

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """Solution for one right-hand side (n,)."""


class Solver(Protocol):
    """Factors a sequence of matrices of one pattern, given by their lower triangles.

    It raises RuntimeError where a matrix is singular, and MemoryError where memory does not suffice.
    """

    knows_inertia: bool

    def factor(self, lower: sparse.csc_matrix) -> Factorisation: ...


class _RslabFactorisation:
    def __init__(self, factor: Any) -> None:
        self._factor = factor
        self.negative_pivots: int | None = int(factor.inertia[1])

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        return self._factor.solve(rhs, refine=1)


class Rslab:
    """L D L^T by `rslab`; the analysis of the pattern is made once."""

    knows_inertia = True

    def __init__(self) -> None:
        self._symbolic: Any = None

    def factor(self, lower: sparse.csc_matrix) -> Factorisation:
        import rslab

        if self._symbolic is None:
            require_memory(ANALYSIS_BYTES * lower.nnz, "the analysis of a matrix")
            ordering = "amf" if lower.shape[0] < FEW_UNKNOWNS else "metis"
            self._symbolic = rslab.analyze(lower, path="ldlt", ordering=ordering)
        threads = "auto", min(thread_count(), MOST_THREADS)
        require_memory(self._symbolic.memory_plan(threads=threads)["factor_peak_bytes"], "a factored matrix")
        return _RslabFactorisation(self._symbolic.factor(lower.data, threads=threads))


class _SuperLuFactorisation:
    negative_pivots: int | None = None

    def __init__(self, factor: Any) -> None:
        self._factor = factor

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        return self._factor.solve(rhs)


class SuperLu:
    """L U by scipy; slower, and without the inertia."""

    knows_inertia = False

    def factor(self, lower: sparse.csc_matrix) -> Factorisation:
        from scipy.sparse.linalg import splu

        full = lower + sparse.tril(lower, k=-1).T
        return _SuperLuFactorisation(splu(full.tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}))


SOLVERS: dict[str, type] = {"rslab": Rslab, "superlu": SuperLu}


def available_solvers() -> list[str]:
    """Names of the solvers that are installed, the preferred one first."""
    import importlib.util

    return [name for name in SOLVERS if name == "superlu" or importlib.util.find_spec(name)]


def make_solver(name: str | None = None) -> Solver:
    """The solver called ``name``, by default the first of :func:`available_solvers`."""
    return SOLVERS[name or available_solvers()[0]]()
