"""A deformed pad, and what is known of its error and of how it goes on along its path."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from mitsuba_taxel.base.display import Displayed
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.elements.loads import Load
from mitsuba_taxel.mechanics.materials.laws import Material
from mitsuba_taxel.mechanics.results.roof_error import RoofError


class Comparison(NamedTuple):
    """What a second mesh tells of a state, as in :class:`State`, and the seconds that its equilibria took to solve.

    ``deviate`` makes the deviations, which only readings need.
    """

    error: RoofError | None = None
    deviate: Callable[[], np.ndarray] | None = None
    force_error: float = math.nan
    seconds: float = 0.0


def _no_rate() -> None:
    """What is known of a state that is on no path."""


class PathRate(NamedTuple):
    """How a state goes on along its path, as in :class:`State`."""

    direction: np.ndarray
    displacement: np.ndarray


class Memory(NamedTuple):
    """What a state of a silicone with a memory is besides, as in :class:`State`.

    Attributes
    ----------
    time : float
        In s, since the pad was at rest.
    overstress : ndarray
        (m, q, 6) MPa, second Piola-Kirchhoff stress above that of the law at the quadrature points: xx, yy, zz, xy,
        yz, xz.
    deviation : (N, 3) ndarray
        mm, by which the displacement is estimated to be off for the steps of time.
    error : float
        That of the stress, relative to it, root mean square over the pad.
    """

    time: float
    overstress: np.ndarray
    deviation: np.ndarray
    error: float


@dataclass(frozen=True, eq=False)
class State(Displayed):
    """A deformed pad; what a second mesh tells of it is solved for when it is first asked for.

    Attributes
    ----------
    mesh : VolumeMesh
        Undeformed mesh.
    material : Material
        What it is made of; of a silicone with a memory, what that is at once.
    load : Load
        How it is loaded.
    value : (3,) ndarray
        N or mm, or (1,) MPa: of the load.
    displacement : (N, 3) ndarray
        Of each node, in mm.
    pressure : (corners,) ndarray
        In MPa, positive in tension.
    min_jacobian : float
        Least volume ratio J at the ends of the interval that the state lies in.
    residual : float
        Largest out-of-balance force there, relative to the load.
    newton_iterations : int
        Iterations of the last solve.
    stability_checked : bool
        Whether the solver gave the inertia that stability was judged by.
    solved_in : float
        Seconds that the equilibria on the way to it took to solve, whenever that was.
    second_mesh : Callable
        Solves the same load on a second mesh, and compares.
    path_rate : Callable
        Gives how the state goes on along its path, from the tangents of the states solved on it, at no cost: the
        ``direction`` of the load's value there, of length 1, and the derivative of the ``displacement`` (N, 3) by the
        way in it, mm per N, mm or MPa, right to about 1e-4. None at rest, where no direction is known, and for a
        silicone with a memory.
    memory : Memory or None
        Of a silicone with a memory: its time, its stress, and what they are off by.
    traction : ndarray
        (2 N, 3) MPa, of an indenter's friction at each node of the top, then of the outside; (0, 3) without.
    indenter_moved : (3,) ndarray or None
        In mm, how far an indenter is from where it starts; None where there is none.
    """

    mesh: VolumeMesh
    material: Material
    load: Load
    value: np.ndarray
    displacement: np.ndarray
    pressure: np.ndarray
    min_jacobian: float
    residual: float
    newton_iterations: int
    stability_checked: bool
    solved_in: float = 0.0
    second_mesh: Callable[[], Comparison] = field(default_factory=lambda: Comparison)
    path_rate: Callable[[], PathRate | None] = field(default_factory=lambda: _no_rate)
    memory: Memory | None = None
    traction: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    indenter_moved: np.ndarray | None = None

    @cached_property
    def _compared(self) -> Comparison:
        return self.second_mesh()

    @property
    def error(self) -> RoofError | None:
        """Estimated discretisation error at the roofs; None where it is not known, because no second mesh, coarser or
        finer, can be made or loaded so far, or memory does not suffice for it."""
        return self._compared.error

    @cached_property
    def deviations(self) -> np.ndarray | None:
        """(2, N, 3) mm, of the displacement on elements of twice the size from this one, extrapolated from those of the
        second mesh: what goes along the displacement, and what is left; None where that is not known."""
        return None if self._compared.deviate is None else self._compared.deviate()

    @property
    def force_error(self) -> float:
        """N, of the board's force on the pad where a plate or an indenter is moved, and 0 where a force is given; not a
        number where that is not known."""
        return self._compared.force_error if self.load.gives_displacement else 0.0

    @property
    def seconds(self) -> float:
        """That the equilibria on the way to it took to solve, on both meshes, and whenever that was."""
        return self.solved_in + self._compared.seconds
