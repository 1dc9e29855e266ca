"""State of the solved part of a pad at the end of a time step, and exceptions for time steps that fail."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mitsuba_taxel.mechanics.contact.barriers.self_contact import Contact
from mitsuba_taxel.mechanics.contact.friction import FrictionState
from mitsuba_taxel.mechanics.elements.internal_variables import InternalVariables
from mitsuba_taxel.mechanics.equilibrium.solution import Solution
from mitsuba_taxel.mechanics.materials.creep import Growth


class PathEnded(Exception):
    """Raised where a load path ends. It carries the ``reason``, the last ``value`` of the load, the ``fraction`` of the
    interval between two rows that was solved, and the ``contact`` there.
    """

    def __init__(self, value: np.ndarray, fraction: float, reason: str, contact: Contact | None = None) -> None:
        super().__init__(reason)
        self.value, self.fraction, self.reason, self.contact = value, fraction, reason, contact


class StepTooLong(Exception):
    """Raised if a time step across several rows of the load is not accurate enough. The step should be repeated with
    ``factor`` times its length.
    """

    def __init__(self, factor: float) -> None:
        super().__init__(factor)
        self.factor = factor


@dataclass(frozen=True, eq=False)
class StepError:
    """The estimated error of a state due to time steps.

    Attributes
    ----------
    deviation : (unknowns,) ndarray
        Deviation of the unknowns of the part.
    uncertainty : float
        Sum over all steps of the largest displacement that the error of each step causes, reduced by the relaxation
        since then, mm.
    """

    deviation: np.ndarray
    uncertainty: float


@dataclass(frozen=True, eq=False)
class PartMidStep:
    """State of the solved part of the pad at the middle of a time step, as a correction to the interpolated unknowns.

    ``growth`` is the measure of time of the step. ``remainder`` is the error that is left after the correction, a
    vector of displacements, and ``error`` is its relative size.
    """

    growth: Growth
    start_velocity: np.ndarray
    correction: np.ndarray
    remainder: np.ndarray
    error: float
    cubic_stress: np.ndarray


@dataclass(frozen=True, eq=False)
class StepState:
    """The state of the solved part of a pad between two rows of the load, at a ``fraction`` of the time interval.

    Attributes
    ----------
    solution : Solution
        The equilibrium.
    variables : InternalVariables
        Internal variables of the part.
    velocity : (unknowns,) ndarray or None
        Rate of the unknowns per s; None if unknown, or where the load jumps.
    unchecked : float
        Largest displacement in mm since displacements without the symmetry of the load were last checked.
    friction_state : FrictionState or None
        State of the indenter's friction; None without friction.
    load_memory : ndarray or None
        Memory of the load, as :class:`CreepResponse` computes it.
    error : StepError or None
        Error due to time steps; None where steps are linear in time.
    mid_step : PartMidStep or None
        Middle of the step that leads to this state.
    next_length : float
        Length in s of the next step, which may span several rows.
    """

    fraction: float
    solution: Solution
    variables: InternalVariables
    velocity: np.ndarray | None
    unchecked: float
    friction_state: FrictionState | None = None
    load_memory: np.ndarray | None = None
    error: StepError | None = None
    mid_step: PartMidStep | None = None
    next_length: float = 0.0

    @property
    def unknowns(self) -> np.ndarray:
        """Unknowns of the solved part of the pad."""
        return self.solution.unknowns
