"""A deformed pad, its estimated error, and its derivative with respect to the load."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from mitsuba_taxel.base.convergence import ERROR_SHARE
from mitsuba_taxel.base.display import Displayed
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.contact.barriers.bodies import RigidBodies
from mitsuba_taxel.mechanics.elements.loads import Load
from mitsuba_taxel.mechanics.materials.laws import Material


@dataclass(frozen=True)
class RoofError:
    """Estimated discretisation error of a deformed pad, at the roofs of its cells.

    Attributes
    ----------
    displacement : float
        Root mean square error of the displacement over the roofs in mm, extrapolated with the convergence order of
        averages.
    largest : float
        Largest error of the displacement in mm, extrapolated with the convergence order of maxima.
    relative : float
        ``largest``, relative to the largest displacement of any node.
    slope : float
        Root mean square error of the direction of the surface normal in degrees, extrapolated with the convergence
        order of maxima.
    """

    displacement: float
    largest: float
    relative: float
    slope: float


NO_ERROR = RoofError(0.0, 0.0, 0.0, 0.0)


class StateComparison(NamedTuple):
    """Estimated errors of a state, from a second solution on another mesh.

    The fields have the names and units of :class:`State`; the time of the second solution is in s. The function
    ``deviate`` computes :attr:`State.deviations`, which are needed only for the errors of readings.
    """

    error: RoofError | None = None
    deviate: Callable[[], np.ndarray] | None = None
    force_error: float = math.nan
    seconds: float = 0.0


def _no_rate() -> None:
    """Return None: the derivative with respect to the load of a state that is not on a load path."""


class PathRate(NamedTuple):
    """Direction of the load, and the derivative of the displacement along it; see ``path_rate`` of :class:`State`."""

    direction: np.ndarray
    displacement: np.ndarray


@dataclass(frozen=True, eq=False)
class ViscoelasticMemory:
    """Additional data of a state of a silicone that is viscoelastic or has Mullins' effect, as in :class:`State`.

    Attributes
    ----------
    time : float or None
        Time since the pad was at rest, s; None if the silicone is not viscoelastic.
    stress : Callable
        Function without arguments that computes the overstress.
    overstress : ndarray
        Second Piola-Kirchhoff stress (elements, quadrature points, 6) in MPa, in addition to the stress of the law:
        xx, yy, zz, xy, yz, xz.
    deviation : (N, 3) ndarray
        Estimated error of the displacement due to time steps, mm.
    error : float
        Relative error of the overstress, root mean square over the pad.
    """

    time: float | None
    stress: Callable[[], np.ndarray]
    deviation: np.ndarray
    error: float

    @cached_property
    def overstress(self) -> np.ndarray:
        return self.stress()


@dataclass(frozen=True, eq=False)
class State(Displayed):
    """A deformed pad; the second mesh for its error is solved when first needed.

    Attributes
    ----------
    mesh : VolumeMesh
        Undeformed mesh.
    material : Material
        Law of the silicone; if it is viscoelastic, the instantaneous law; with Mullins' effect, that of the first
        loading.
    load : Load
        Kind of load.
    value : (3,) or (1,) ndarray
        Value of the load: a force in N, a displacement in mm, or a pressure in MPa.
    displacement : (N, 3) ndarray
        Displacement of each node, in mm.
    pressure : (corners,) ndarray
        Pressure at each corner of the elements in MPa, positive in tension.
    min_jacobian : float
        Smallest volume ratio J at the quadrature points of the elements, and at nodes of the cells' walls.
    residual : float
        Norm of the out-of-balance forces, relative to that of the load, or to that of a load that strains the pad by
        2 %, if this is larger. For a state that is interpolated between solved states, it is that of the interpolation.
    newton_iterations : int
        Number of iterations of its solution; 0 if it is interpolated between solved states.
    stability_checked : bool
        Whether the solver counted the negative eigenvalues of the tangent, for the test of stability: for this state,
        or for the solved states on both sides.
    solved_in : float
        Time, in s, of the solution of all equilibria on the path to this state, even if they were cached.
    second_mesh : Callable
        Solves the same load on a second mesh, and compares the solutions.
    path_rate : Callable
        Returns the rate along the path: the unit vector ``direction`` of the load's value, and the derivative of the
        ``displacement`` (N, 3) along it, in mm per N, mm or MPa, accurate to about 1e-4. It costs nothing if the
        tangents of the solved states determine it. It is None at rest, where no direction is known, for a viscoelastic
        silicone, and where its iteration does not converge.
    memory : ViscoelasticMemory or None
        Memory of a silicone that is viscoelastic or has Mullins' effect: its time, stress, and their errors.
    traction : (2 N, 3) ndarray
        Traction by an indenter's friction, in MPa. Rows 0 to N - 1 are the nodes as nodes of the top, rows N to 2 N - 1
        the same nodes as those of the outside (top and lateral faces); 0 at nodes that are not on that surface. (0, 3)
        without friction.
    indenter_moved : (3,) ndarray or None
        Displacement of an indenter from its start, in mm; None without an indenter.
    bodies : RigidBodies or None
        Bodies that the pad may touch, on a path that continues after contact.
    buckled_at : ndarray or None
        Value of the load at which the pad has buckled earlier on the path; None if it has not. The state is then one of
        several shapes that are equally likely by symmetry.
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
    second_mesh: Callable[[], StateComparison] = field(default_factory=lambda: StateComparison)
    path_rate: Callable[[], PathRate | None] = field(default_factory=lambda: _no_rate)
    memory: ViscoelasticMemory | None = None
    traction: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    indenter_moved: np.ndarray | None = None
    bodies: RigidBodies | None = None
    buckled_at: np.ndarray | None = None

    @cached_property
    def _compared(self) -> StateComparison:
        return self.second_mesh()

    @property
    def error(self) -> RoofError | None:
        """Estimated discretisation error at the roofs; None if unknown, because no second mesh, coarser or finer, can
        be generated or can bear this load, or memory does not suffice."""
        return self._compared.error

    @cached_property
    def deviations(self) -> np.ndarray | None:
        """Estimated error that the displacement would have on elements of twice the size, in mm: two arrays (2, N, 3),
        whose sum is the error. The first is the component along the displacement, the second is the rest. None if
        unknown.
        """
        return None if self._compared.deviate is None else self._compared.deviate()

    @property
    def probed_share(self) -> float:
        """Fraction of :attr:`deviations` by which the pad is displaced in order to compute the error of a reading.

        The change of a reading is usually proportional to this fraction. It is not if the pad may touch bodies; then
        the fraction is that of the estimated error itself.
        """
        return 1.0 if self.bodies is None else ERROR_SHARE

    @property
    def force_error(self) -> float:
        """Error in N of the board's force on the pad. It is 0 under a prescribed force, and NaN if unknown."""
        return self._compared.force_error if self.load.gives_displacement else 0.0

    @property
    def seconds(self) -> float:
        """Time in s to solve all equilibria of the load path up to this state, on both meshes. Cached states count with
        the time that they once took.
        """
        return self.solved_in + self._compared.seconds
