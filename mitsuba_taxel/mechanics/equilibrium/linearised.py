"""The tangent matrix of a pad at a state, its factor, and solutions with iterative refinement."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property
from typing import Protocol

import numpy as np
import scipy.sparse as sparse

from mitsuba_taxel.mechanics.elements.load_constraints import LoadConstraints
from mitsuba_taxel.mechanics.elements.solvers import Factorisation, symmetric_product

REFINED = 1e-9
"""Relative last change at which iterative refinement has converged."""
SLOW_REFINEMENT = 0.3
"""A factor of a nearby state is used while each refinement is less than this fraction of the one before."""
MOST_REFINEMENTS = 20


class Steps(Protocol):
    """Interface of a tangent matrix that solves for a step of Newton's method, with its own factor or with the factors
    of another state.
    """

    def step(self, residual: np.ndarray, gap: np.ndarray | None = None) -> np.ndarray:
        """Change of the unknowns for a residual, only as accurate as the factors: a step of an iteration.

        Parameters
        ----------
        residual : (unknowns,) ndarray
            Out-of-balance forces and volumes.
        gap : (k,) ndarray, optional
            Change of the constrained combinations; 0 by default.

        Returns
        -------
        (unknowns,) ndarray
            Change of the unknowns.
        """


class Linearised:
    """Tangent matrix of a pad at a state. It is solved with its own factor, or with that of a nearby state.

    Parameters
    ----------
    lower : sparse.csc_matrix
        Lower triangle of the tangent.
    factored : Callable[[sparse.csc_matrix], Factorisation]
        Factors a matrix, given by its lower triangle.
    constraints : LoadConstraints
        Constraints of the load.
    displacements : int
        Number of displacements among the unknowns; they come first.
    """

    def __init__(
        self,
        entries: np.ndarray,
        lower: sparse.csc_matrix,
        factored: Callable[[sparse.csc_matrix], Factorisation],
        constraints: LoadConstraints,
        displacements: int,
        near: Linearised | None = None,
    ) -> None:
        self.entries, self._lower, self._factored, self.constraints = entries, lower, factored, constraints
        self._displacements, self._own = slice(displacements), near is None
        self.factor: Factorisation = near.factor if near else factored(lower)

    @cached_property
    def _flexibility(self) -> np.ndarray:
        """Response (k, k) of the k constrained combinations of unknowns to unit Lagrange multipliers."""
        return self.constraints.flexibility(self.factor)

    def step(self, residual: np.ndarray, gap: np.ndarray | None = None) -> np.ndarray:
        """Change of the unknowns as from :meth:`correction`, but only to the accuracy of the factor: a step of an
        iteration.

        Parameters
        ----------
        residual : (unknowns,) ndarray
            Out-of-balance forces and volumes.
        gap : (k,) ndarray, optional
            Change of the constrained combinations; 0 by default.

        Returns
        -------
        (unknowns,) ndarray
            Change of the unknowns.
        """
        return self._answer(residual, gap)[0]

    def _answer(self, residual: np.ndarray, gap: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        """Change of the unknowns for a residual, only as accurate as the factor, and the Lagrange multipliers of the
        constraints.
        """
        free = self.factor.solve_roughly(residual)
        if not len(self.constraints.slack):
            return free, np.zeros(0)
        short = -(self.constraints.rows @ free) if gap is None else gap - self.constraints.rows @ free
        multipliers = np.linalg.solve(self._flexibility, short)
        return free + self.factor.solve_roughly(self.constraints.rows.T @ multipliers), multipliers

    def correction(self, residual: np.ndarray, gap: np.ndarray | None = None) -> np.ndarray:
        """Change of the unknowns for a residual, by iterative refinement.

        Parameters
        ----------
        residual : (unknowns,) ndarray
            Out-of-balance forces and volumes.
        gap : (k,) ndarray, optional
            Change of the constrained combinations; 0 by default.

        Returns
        -------
        (unknowns,) ndarray
            The change. If the factor of a nearby state does not converge, the tangent is factored.
        """
        rows, slack, last = self.constraints.rows, self.constraints.slack, math.inf
        gap = np.zeros(len(slack)) if gap is None else gap
        solution, multipliers = self._answer(residual, gap)
        for _ in range(MOST_REFINEMENTS):
            remainder = residual + rows.T @ multipliers - symmetric_product(self._lower, solution)
            change, more = self._answer(remainder, gap - rows @ solution - slack * multipliers)
            size = float(np.abs(change[self._displacements]).max())
            if not size < last and not self._own:
                self.factor, self._own = self._factored(self._lower), True
                self.__dict__.pop("_flexibility", None)
                return self.correction(residual, gap)
            solution, multipliers, last = solution + change, multipliers + more, SLOW_REFINEMENT * size
            if size <= REFINED * np.abs(solution[self._displacements]).max():
                break
        return solution

    def corrections(self, residuals: np.ndarray) -> np.ndarray:
        """Changes of the unknowns for several residuals at once, as from :meth:`correction` for each, without
        constraints. Products and solutions of several columns take a fraction of the time of one after the other.

        Parameters
        ----------
        residuals : (unknowns, k) ndarray
            Out-of-balance forces and volumes.

        Returns
        -------
        (unknowns, k) ndarray
            The changes.
        """
        diagonal = self._lower.diagonal()[:, None]
        solution, last = self.factor.solve_many(residuals), np.full(residuals.shape[1], math.inf)
        for _ in range(MOST_REFINEMENTS):
            product = self._lower @ solution + self._lower.T @ solution - diagonal * solution
            change = self.factor.solve_many(residuals - product)
            size = np.abs(change[self._displacements]).max(axis=0)
            if not (size < last).all() and not self._own:
                return np.stack([self.correction(residual) for residual in residuals.T], axis=1)
            solution, last = solution + change, SLOW_REFINEMENT * size
            if (size <= REFINED * np.abs(solution[self._displacements]).max(axis=0)).all():
                break
        return solution

    def stiffness(self, mode: np.ndarray) -> float:
        """Stiffness in N/mm of a mode, which is a vector over the unknowns: the product of the tangent with the mode on
        both sides."""
        return float(mode @ symmetric_product(self._lower, mode))

    @cached_property
    def negative(self) -> int:
        """Number of negative eigenvalues of the tangent under the constraints of the load (Haynsworth, 1968)."""
        return self.factor.negative_pivots - int(np.count_nonzero(np.linalg.eigvalsh(self._flexibility) < 0))
