"""How a deformed pad answers small changes of its load and its material.

In balance R(u; value, theta) = 0, so that the unknowns change by du = -K^-1 (dR/dvalue dvalue + dR/dtheta dtheta) with
the tangent K = dR/du: one back-solve with a factor that is there. K is symmetric, so that one more gives the
derivatives of any scalar L of the displacement by all of them: with K a = dL/du, dL/dtheta = -a . dR/dtheta (the
adjoint method; D. A. Tortorelli and P. Michaleris, Inverse Problems in Engineering 1, 1994).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mitsuba_taxel.base.arguments import require
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.mechanics.elements.loads import PlateDisplacement
from mitsuba_taxel.mechanics.elements.memory import memory_for
from mitsuba_taxel.mechanics.materials.laws import Material
from mitsuba_taxel.mechanics.path.equilibrium import Linearised, LoadedPad, Rejected
from mitsuba_taxel.mechanics.path.load_path import State

RELATIVE_STEP = 1e-3
"""Change of a parameter of the material that differences of fourth order are taken with: they are right to 1e-11."""
SMALL_STEP = 1e-5
"""Where the law does not allow that: differences of second order, right to about 1e-9."""


@dataclass(frozen=True, eq=False)
class Gradient:
    """Derivatives of a scalar L of a pad's displacement.

    Attributes
    ----------
    value : (3,) ndarray
        Per N or mm, or (1,) per MPa: dL by each component of the load's value.
    material : dict[str, float]
        DL by each parameter of the material, by name.
    """

    value: np.ndarray
    material: dict[str, float]


def linearise(state: State) -> LinearisedState:
    """Bring a state to balance and factor its tangent, for the whole pad: changes need not keep its symmetry.

    A state between two nodes of its path is interpolated, and takes an iteration or two of Newton's method; its
    derivatives are those of the state in balance, not of the interpolation.

    Raises
    ------
    InputError
        if it is no `State`.
    ComputationError
        if there is no stable state of balance near by: some paths end where there is none; or if memory does not
        suffice.
    """
    require("state", state, State, "a State, as load_path returns it,")
    try:
        with memory_for("the whole pad"):
            pad = LoadedPad(state.mesh, state.material, state.load)
            solution, linearised = pad.solve(pad.gather(state.displacement, state.pressure), state.value)
    except Rejected as rejection:
        shown = ", ".join(f"{component:.4g}" for component in state.value)
        where = f"{state.load.quantity} = ({shown}) {state.load.unit}"
        raise ComputationError(f"no state of balance was found at {where}: {rejection}.") from rejection
    return LinearisedState(pad, solution.unknowns, linearised)


class LinearisedState:
    """A deformed pad in balance, with the factor of its tangent; from :func:`linearise`.

    Attributes
    ----------
    displacement : (N, 3) ndarray
        mm of each node, in balance to the solver's tolerance.
    pressure : (corners,) ndarray
        MPa.
    """

    def __init__(self, pad: LoadedPad, unknowns: np.ndarray, linearised: Linearised) -> None:
        self._pad, self._unknowns, self._linearised = pad, unknowns, linearised
        self.displacement, self.pressure = pad.split(unknowns)
        self._residual_rates: dict[str, np.ndarray] = {}

    def by_value(self, direction: Sequence[float] | np.ndarray) -> np.ndarray:
        """(N, 3) derivative of the displacement by the load's value along ``direction``, by one back-solve.

        Parameters
        ----------
        direction : Sequence[float] or ndarray
            (3,) or (1,), as the load's value is; a unit vector gives mm per N, mm or MPa.

        Raises
        ------
        InputError
            if it is not that many finite numbers.
        """
        direction = _checked("direction", direction, (self._pad.load.components,))
        return self._displacement(self._pad.rate(self._linearised, self._unknowns, direction))

    def by_material(self, name: str) -> np.ndarray:
        """(N, 3) derivative of the displacement by a parameter of the material, by one back-solve.

        In mm per unit of the parameter, the others staying as they are; ``material.parameters`` lists the names.

        Raises
        ------
        InputError
            if the material has no such parameter.
        """
        if name not in self._pad.material.parameters:
            names = ", ".join(self._pad.material.parameters)
            raise InputError(f"parameter = {name!r} is not allowed: one of {names} is needed.")
        return self._displacement(-self._linearised.correction(self._residual_rate(name), self._no_gap))

    def pull_back(self, gradient: np.ndarray) -> Gradient:
        """The vector-Jacobian product: derivatives of a scalar L by load and material, all by one back-solve.

        Parameters
        ----------
        gradient : (N, 3) ndarray
            DL/d(displacement) of each node, per mm; what it has on nodes of the board does not matter.

        Raises
        ------
        InputError
            if it is not of that shape or not finite.
        """
        forces = self._pad.numbering.summed(_checked("gradient", gradient, self.displacement.shape))
        adjoint = self._linearised.correction(forces, self._no_gap)
        material = {name: -float(adjoint @ self._residual_rate(name)) for name in self._pad.material.parameters}
        value = self._plate_rates @ forces if self._driven else self._unit_loads @ adjoint
        return Gradient(value, material)

    def _displacement(self, unknowns: np.ndarray) -> np.ndarray:
        return self._pad.split(unknowns)[0]

    @property
    def _driven(self) -> bool:
        return isinstance(self._pad.load, PlateDisplacement)

    @property
    def _no_gap(self) -> np.ndarray:
        """What says that a driven plate stays where it is."""
        return np.zeros(len(self._pad.numbering.plate_unknowns) if self._driven else 0)

    @cached_property
    def _unit_loads(self) -> np.ndarray:
        """(components, unknowns) forces of a unit of each component of the load."""
        units = np.eye(self._pad.load.components)
        return np.stack([self._pad.model.load_vector(self.displacement, unit) for unit in units])

    @cached_property
    def _plate_rates(self) -> np.ndarray:
        """(components, unknowns) derivatives of the unknowns by each component of a driven plate's displacement."""
        units = np.eye(self._pad.load.components)
        return np.stack([self._pad.rate(self._linearised, self._unknowns, unit) for unit in units])

    def _residual_rate(self, name: str) -> np.ndarray:
        """(unknowns,) derivative of the residual by a parameter of the material; loads do not depend on it."""
        if name not in self._residual_rates:
            self._residual_rates[name] = self._difference(name)
        return self._residual_rates[name]

    def _difference(self, name: str) -> np.ndarray:
        """Central difference of fourth order, or one of second order where the law does not allow larger changes."""
        material, value = self._pad.material, getattr(self._pad.material, name)
        scale = abs(value) or _scale(material, name)

        def inside(change: float) -> np.ndarray:
            return self._inside(_with(material, name, value + change))

        step = RELATIVE_STEP * scale
        if _allows(material, name, value + 2 * step) and _allows(material, name, value - 2 * step):
            wide, narrow = (inside(k * step) - inside(-k * step) for k in (2, 1))
            return (8 * narrow - wide) / (12 * step)
        step = SMALL_STEP * scale
        upwards, downwards = (_allows(material, name, value + change) for change in (step, -step))
        if upwards and downwards:
            return (inside(step) - inside(-step)) / (2 * step)
        if not upwards:
            step = -step
        return (4 * inside(step) - 3 * inside(0.0) - inside(2 * step)) / (2 * step)

    def _inside(self, material: Material) -> np.ndarray:
        """(unknowns,) forces and volumes that the pad puts up in its present shape, were it of ``material``."""
        assembly = self._pad.model.assembly.of(material)
        return assembly.evaluate(self.displacement, self.pressure, with_tangent=False).residual


def _with(material: Material, name: str, value: float) -> Material:
    return material.changed(**{name: value})


def _allows(material: Material, name: str, value: float) -> bool:
    try:
        _with(material, name, value)
    except InputError:
        return False
    return True


def _scale(material: Material, name: str) -> float:
    """What a parameter that is 0 is measured by; apart from Poisson's ratio it is a modulus."""
    return 1.0 if name == "poisson_ratio" else material.shear_modulus


def _checked(name: str, numbers: Sequence[float] | np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    try:
        array = np.asarray(numbers, dtype=float)
    except (TypeError, ValueError, OverflowError):
        array = np.empty(0)
    if array.shape != shape or not np.all(np.isfinite(array)):
        shown = f"{array.shape}" if len(shape) > 1 else f"{np.asarray(numbers, dtype=object).tolist()}"
        raise InputError(f"{name} = {shown} is not allowed: an array {shape} of finite numbers is needed.")
    return array
