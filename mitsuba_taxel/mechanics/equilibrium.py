"""Equilibrium of a pad under a force on its top: one Newton solve."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mitsuba_taxel.mechanics.assembly import Assembly, Material
from mitsuba_taxel.mechanics.solvers import Factorisation, Solver, make_solver
from mitsuba_taxel.pads.pad import REGIONS
from mitsuba_taxel.pads.volume_mesh import VolumeMesh

RESIDUAL_TOLERANCE = 1e-9
"""Largest out-of-balance force accepted, relative to the load."""
MOST_ITERATIONS = 12


@dataclass(frozen=True)
class Solution:
    """An accepted state: unknowns in balance with a force, a stable equilibrium without inverted elements."""

    unknowns: np.ndarray
    min_jacobian: float
    residual: float
    iterations: int
    stability_checked: bool


class Rejected(Exception):
    """A step that found no acceptable state; the message says why."""


def natural_step(material: Material, top_area: float) -> float:
    """Force in N whose mean stress on a top of ``top_area`` mm² is 2 % of Young's modulus: a step of a load path."""
    return 0.02 * material.youngs_modulus * top_area


class LoadedPad:
    """A meshed pad glued to the board, with a force spread over its undeformed top."""

    def __init__(self, mesh: VolumeMesh, material: Material, solver: Solver | None = None) -> None:
        fixed = np.zeros(len(mesh.points), dtype=bool)
        fixed[mesh.faces[mesh.face_region == REGIONS["bottom"]]] = True
        self.mesh = mesh
        self.assembly = Assembly(mesh, material, fixed)
        self.solver = solver or make_solver()
        self._share = _top_load(mesh)
        top_area = float(np.prod(np.ptp(mesh.points, axis=0)[:2]))
        self._small_load = np.linalg.norm(self.load(np.array([0.0, 0.0, natural_step(material, top_area)])))

    def load(self, force: np.ndarray) -> np.ndarray:
        """Load vector over the unknowns for a total force (3,) in N."""
        nodal = (self._share[:, None] * force).ravel()[self.assembly.free]
        return np.concatenate([nodal, np.zeros(self.assembly.pressures)])

    def residual(self, unknowns: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Out-of-balance forces [N] and volumes [mm³] at a state."""
        return self.assembly.evaluate(*self.assembly.split(unknowns), with_tangent=False).residual - self.load(force)

    def solve(self, start: np.ndarray, force: np.ndarray) -> tuple[Solution, Factorisation]:
        """Newton's method from ``start``.

        Returns the solution and the factored tangent there.

        Raises
        ------
        Rejected
            if it does not converge, inverts an element, or ends in an unstable equilibrium.
        """
        unknowns, load = start.copy(), self.load(force)
        scale = max(np.linalg.norm(load), self._small_load)
        volume = float(self.assembly.weight.sum())
        displacements = len(self.assembly.free)
        first = 0.0
        for iteration in range(MOST_ITERATIONS):
            state = self.assembly.evaluate(*self.assembly.split(unknowns))
            if state.tangent is None:
                raise Rejected(f"an element would be turned inside out (J = {state.min_jacobian:.2g})")
            residual = state.residual - load
            force_error = float(np.linalg.norm(residual[:displacements]) / scale)
            volume_error = float(np.linalg.norm(residual[displacements:]) / volume)
            error = max(force_error, volume_error)
            first = first or error
            if not error < 1e6 * max(first, 1.0):
                raise Rejected("Newton's method diverges")
            try:
                factor = self.solver.factor(state.tangent)
            except RuntimeError as failure:
                raise Rejected(f"the tangent is singular ({failure})") from failure
            if error < RESIDUAL_TOLERANCE:
                self._check_stability(factor)
                checked = factor.negative_pivots is not None
                return Solution(unknowns, state.min_jacobian, error, iteration, checked), factor
            unknowns -= factor.solve(residual)
        raise Rejected(f"Newton's method does not converge in {MOST_ITERATIONS} iterations")

    def _check_stability(self, factor: Factorisation) -> None:
        """A stable state has as many negative pivots as there are pressures."""
        if factor.negative_pivots not in (None, self.assembly.pressures):
            surplus = factor.negative_pivots - self.assembly.pressures
            raise Rejected(f"the equilibrium is unstable ({surplus:+d} negative pivots)")


def _top_load(mesh: VolumeMesh) -> np.ndarray:
    """(N,) share of a total force on the top that each node carries; they sum to 1.

    The consistent load of a flat six-node triangle lies on its mid-edge nodes, a third of the area each.
    """
    top = mesh.faces[mesh.face_region == REGIONS["top"]]
    a, b, c = (mesh.points[top[:, k]] for k in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    share = np.bincount(top[:, 3:].ravel(), weights=np.repeat(area / 3, 3), minlength=len(mesh.points))
    return share / share.sum()
