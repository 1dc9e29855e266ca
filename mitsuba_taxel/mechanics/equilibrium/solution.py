"""Result of a solve for equilibrium, and the reasons for which it is rejected."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mitsuba_taxel.mechanics.contact.friction import FrictionState
from mitsuba_taxel.mechanics.elements.internal_variables import Softening, StressUpdate
from mitsuba_taxel.mechanics.elements.model import Configuration
from mitsuba_taxel.mechanics.equilibrium.linearised import Linearised


@dataclass(frozen=True, eq=False)
class History:
    """Earlier states that an equilibrium depends on.

    Attributes
    ----------
    stress_update : StressUpdate or Softening or None
        Stress of a viscoelastic pad, or of one with Mullins' effect, as a function of that of the law; None if it is
        elastic.
    friction_state : FrictionState or None
        State of an indenter's friction at the end of the previous step; None if the indenter has not touched the pad.
    """

    stress_update: StressUpdate | Softening | None = None
    friction_state: FrictionState | None = None


NO_HISTORY = History()
"""History of an elastic pad without earlier friction."""

UNSTABLE = "the equilibrium is unstable"


@dataclass(frozen=True)
class Solution:
    """An accepted state: a stable equilibrium without inverted elements.

    Attributes
    ----------
    min_jacobian : float
        Smallest volume ratio J at any quadrature point of the elements, corners among them, and of
        :func:`~mitsuba_taxel.mechanics.contact.barriers.singular_edges.judged_nodes`.
    residual : float
        Largest out-of-balance force, relative to the load.
    stability_checked : bool
        Whether the solver provided the inertia for the check of stability.
    """

    unknowns: np.ndarray
    min_jacobian: float
    residual: float
    iterations: int
    stability_checked: bool


class Rejected(Exception):
    """A step leads to no acceptable state of the pad; the message states why."""


@dataclass(frozen=True)
class Balanced:
    """Result of Newton's method: unknowns, residual and tangent of the pad, remaining error, and number of iterations.

    ``linearised`` is the last factored tangent, if any; its state is at a ``distance`` in mm from the result.
    """

    unknowns: np.ndarray
    state: Configuration
    error: float
    iterations: int
    linearised: Linearised | None = None
    distance: float = 0.0


def singular(failure: RuntimeError) -> Rejected:
    """Create the exception for a step whose tangent matrix is singular and cannot be factored."""
    return Rejected(f"the tangent is singular ({failure})")


def refuse_surplus(surplus: int) -> None:
    """Raise Rejected if the tangent has more negative pivots than a stable equilibrium."""
    if surplus:
        raise Rejected(f"{UNSTABLE} ({surplus:+d} negative pivots)")
