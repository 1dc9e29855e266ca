"""The displacement of one symmetry type against which a pad is least stiff."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.mechanics.path.linearised import Linearised
from mitsuba_taxel.mechanics.path.tangent_blocks import TangentBlock

MOST_ITERATIONS = 200


def least_mode(block: TangentBlock, tangent: Linearised, converged: float) -> tuple[float, np.ndarray]:
    """The eigenvalue of a block's ``tangent`` nearest to 0, and its mode over the unknowns, by inverse iteration.

    In N/mm, for displacements with unit sum of squares. The iteration ends where a step changes these by less than
    ``converged``.

    Raises
    ------
    ComputationError
        if modes are too close to be told apart.
    """
    model = block.model
    moves = np.arange(model.assembly.unknowns) < model.numbering.displacements
    push = np.random.default_rng(0).normal(size=len(moves)) * moves
    push /= np.linalg.norm(push)
    for _ in range(MOST_ITERATIONS):
        mode = tangent.correction(push, None)
        before, push = push, mode * moves
        mode = mode / np.copysign(np.linalg.norm(push), before @ push)
        push = mode * moves
        if np.linalg.norm(push - before) < converged:
            break
    else:
        raise ComputationError(f"the least stiff mode of the pad was not found in {MOST_ITERATIONS} iterations.")
    return tangent.stiffness(mode), mode
