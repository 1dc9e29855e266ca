"""Sensitivities of a deformed pad to its load, material and shape.

In equilibrium R(u; value, theta) = 0, so that the unknowns change by du = -K^-1 (dR/dvalue dvalue + dR/dtheta dtheta)
with the tangent K = dR/du: one back-solve with an existing factor. K is symmetric, so that one more back-solve gives
the derivatives of any scalar L of the displacement with respect to all parameters: with K a = dL/du, dL/dtheta = -a .
dR/dtheta (the adjoint method; D. A. Tortorelli and P. Michaleris, Inverse Problems in Engineering 1, 1994).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from mitsuba_taxel.base.arguments import array_of, refusal
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.mechanics.contact.indentation import ContactState, Indentation
from mitsuba_taxel.mechanics.derivatives.material_rates import material_rate
from mitsuba_taxel.mechanics.elements.element_rates import StrainedElements
from mitsuba_taxel.mechanics.elements.elements import Elements
from mitsuba_taxel.mechanics.elements.load_rates import load_rate
from mitsuba_taxel.mechanics.elements.loads import Load
from mitsuba_taxel.mechanics.elements.memory import memory_for
from mitsuba_taxel.mechanics.equilibrium.linearised import Linearised
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import LoadedPad
from mitsuba_taxel.mechanics.equilibrium.solution import Rejected
from mitsuba_taxel.mechanics.equilibrium.tangent_blocks import TangentBlock
from mitsuba_taxel.mechanics.materials.laws import Material

NO_PART = 1e-12
"""Component of a velocity in a block, relative to the largest velocity, that counts as zero."""


Push = Mapping[TangentBlock, np.ndarray]
"""Forces over the unknowns of each block, per unit of a changed parameter."""


@dataclass(frozen=True, eq=False)
class Gradient:
    """Derivatives of a scalar L of a pad's displacement.

    Attributes
    ----------
    value : (3,) ndarray
        Derivatives of L with respect to each component of the load's value, per N or mm; (1,) per MPa for a pressure.
    material : dict[str, float]
        Derivatives of L with respect to each parameter of the material, by name.
    shape : dict[str, float]
        Derivatives of L with respect to each requested change of shape, by name: through the displacement alone.
    """

    value: np.ndarray
    material: dict[str, float]
    shape: dict[str, float] = field(default_factory=dict)


class LinearisedState:
    """A deformed pad in equilibrium, with its factored tangent; from :func:`linearise`.

    Methods raise `ComputationError` if the state is unstable against the requested changes.

    Attributes
    ----------
    displacement : (N, 3) ndarray
        Displacement of each node, in mm, in equilibrium to the solver's tolerance.
    pressure : (corners,) ndarray
        Pressure at each corner, MPa.
    """

    def __init__(
        self,
        pad: LoadedPad,
        blocks: Sequence[TangentBlock],
        unknowns: np.ndarray,
        value: np.ndarray,
        linearised: Linearised,
    ) -> None:
        self._pad, self._blocks, self._value = pad, blocks, value
        self._tangents = {blocks[0].model: linearised}
        self._at_state: dict[Elements, StrainedElements] = {}
        self.displacement, self.pressure = pad.split(unknowns)

    def by_value(self, direction: Sequence[float] | np.ndarray) -> np.ndarray:
        """Derivative (N, 3) of the displacement with respect to the load's value along ``direction``, by one
        back-solve.

        Parameters
        ----------
        direction : Sequence[float] or ndarray
            (3,) or (1,), like the load's value; a unit vector gives mm per N, mm or MPa.

        Returns
        -------
        (N, 3) ndarray
            Derivative at each node.

        Raises
        ------
        InputError
            if its shape differs, or it is not finite.
        """
        direction = array_of("direction", direction, (self._pad.load.components,))
        if not self._pad.load.moves_plate:
            return self._response(self._push_of_value(direction))
        components = ((block, block.of_value(direction)) for block in self._blocks)
        gaps = {
            block: block.model.numbering.plate_values(component) for block, component in components if component.any()
        }
        return self._response({block: np.zeros(block.model.assembly.unknowns) for block in gaps}, gaps)

    def by_material(self, name: str) -> np.ndarray:
        """Derivative (N, 3) of the displacement with respect to a parameter of the material, by one back-solve.

        Parameters
        ----------
        name : str
            Name of the parameter, one of ``material.parameters``; the others are constant.

        Returns
        -------
        (N, 3) ndarray
            Derivative at each node, in mm per unit of the parameter.

        Raises
        ------
        InputError
            if the material has no such parameter.
        """
        if name not in self._pad.material.parameters:
            names = ", ".join(self._pad.material.parameters)
            raise InputError(f"parameter = {name!r} is not allowed: one of {names} is needed.")
        return self._response(self._push_of_material(name))

    def by_shape(self, velocity: np.ndarray) -> np.ndarray:
        """Derivative (N, 3) of the displacement with respect to a movement of the undeformed nodes, by one back-solve.

        The load does not change: a spread force keeps its total, a patch its position in space, a plate its
        displacement; a pressure follows the surface. The position of a node changes by ``velocity`` plus this
        derivative.

        Parameters
        ----------
        velocity : (N, 3) ndarray
            Velocity of the nodes, in mm per unit of the change: from `mesh_velocity`, or any other.

        Returns
        -------
        (N, 3) ndarray
            Derivative at each node, in mm per unit of the change.

        Raises
        ------
        InputError
            if its shape differs, it is not finite, or the load is a plate that tilts.
        """
        return self._response(self._push_of_shape(array_of("velocity", velocity, self.displacement.shape)))

    def by_place(self, direction: Sequence[float] | np.ndarray) -> np.ndarray:
        """Derivative (N, 3) of the displacement with respect to the position of a patch or an indenter on the
        undeformed pad.

        Parameters
        ----------
        direction : Sequence[float] or ndarray
            (2,) along x and y; a unit vector gives mm per mm. Plates and other loads have no place: they give zeros.

        Returns
        -------
        (N, 3) ndarray
            Derivative at each node.

        Raises
        ------
        InputError
            if its shape differs, it is not finite, or the plate tilts.
        """
        pad, direction = self._pad, array_of("direction", direction, (2,))
        if pad.load.tilts:
            raise InputError(
                "derivatives by the point of the force on a tilting plate are not available: vary it in a sweep."
            )
        if not pad.load.has_position:
            return np.zeros_like(self.displacement)
        if pad.load.moved_indenter is not None:
            return self.by_value([*direction, 0.0])
        velocity = np.zeros_like(self.displacement)
        velocity[:, :2] = -direction  # the pad moves below the patch, which is at rest
        loads = load_rate(pad.whole, pad.material, pad.load, self.displacement, self._value, velocity)
        forces = {block: block.forces(loads) for block in self._blocks}
        largest = max(np.abs(force).max() for force in forces.values())
        return self._response(
            {block: force for block, force in forces.items() if np.abs(force).max() > NO_PART * largest}
        )

    def by_forces(self, forces: np.ndarray) -> np.ndarray:
        """Displacement (N, 3) of the nodes in mm due to small additional forces on them, to first order, by one
        back-solve.

        The load keeps its value: a plate or an indenter whose displacement is prescribed does not move.

        Parameters
        ----------
        forces : (N, 3) ndarray
            Force on each node in N; those on nodes of the board have no effect.

        Returns
        -------
        (N, 3) ndarray
            Displacement of each node, in mm.

        Raises
        ------
        InputError
            if the shape of the array differs, or it is not finite.
        """
        forces = array_of("forces", forces, self.displacement.shape)
        push = {block: block.forces(forces, self._on(block)[0]) for block in self._blocks}
        largest = max(np.abs(part).max() for part in push.values())
        return self._response({block: part for block, part in push.items() if np.abs(part).max() > NO_PART * largest})

    def by_many_forces(self, forces: np.ndarray) -> np.ndarray:
        """Displacements of the nodes due to k small sets of forces on them, as from :meth:`by_forces` for each, in a
        fraction of the time.

        Parameters
        ----------
        forces : (k, N, 3) ndarray
            Force on each node in N, of each set.

        Returns
        -------
        (k, N, 3) ndarray
            Displacement of each node in mm.

        Raises
        ------
        InputError
            if the shape of the array differs, or it is not finite.
        """
        forces = array_of("forces", forces, (len(forces), *self.displacement.shape))
        if len(self._tangent(self._blocks[0]).constraints.slack):
            return np.stack([self.by_forces(own) for own in forces])
        pushes = [np.stack([block.forces(own, self._on(block)[0]) for own in forces], axis=1) for block in self._blocks]
        largest = np.max([np.abs(push).max(axis=0) for push in pushes], axis=0)
        total = np.zeros_like(forces)
        for block, push in zip(self._blocks, pushes, strict=True):
            has_part = np.flatnonzero(np.abs(push).max(axis=0) > NO_PART * largest)
            if not len(has_part):
                continue
            with rejections_named(self._pad.load, self._value):
                rates = self._tangent(block).corrections(push[:, has_part])
            for number, rate in zip(has_part, rates.T, strict=True):
                total[number] += block.displacement(rate, self._on(block)[0])
        return total

    def pull_back(self, gradient: np.ndarray, shapes: Mapping[str, np.ndarray] | None = None) -> Gradient:
        """The vector-Jacobian product: derivatives of a scalar L with respect to load, material and shape, all by one
        back-solve.

        Parameters
        ----------
        gradient : (N, 3) ndarray
            Derivative of L with respect to the displacement of each node, per mm; values on nodes of the board are
            ignored.
        shapes : Mapping[str, ndarray], optional
            Velocities (N, 3) as for :meth:`by_shape`, by arbitrary names. If L depends on the positions of nodes, add
            the sum of ``gradient * velocity``: the undeformed nodes move too.

        Returns
        -------
        Gradient
            Derivatives of L.

        Raises
        ------
        InputError
            if the shape of an array differs, or it is not finite.
        """
        gradient = array_of("gradient", gradient, self.displacement.shape)
        pushes = {
            name: self._push_of_shape(array_of(f"shapes[{name!r}]", velocity, gradient.shape))
            for name, velocity in (shapes or {}).items()
        }
        adjoints: dict[TangentBlock, np.ndarray] = {}

        def along(push: Push) -> float:
            """Derivative of the scalar L with respect to a parameter. ``push`` contains the nodal forces that one unit
            of the parameter causes.
            """
            total = 0.0
            for block, forces in push.items():
                if block not in adjoints:
                    adjoints[block] = self._solved(block, block.forces(gradient, self._on(block)[0]))
                total += block.model.part.copies * float(adjoints[block] @ forces)
            return total

        if self._pad.load.moves_plate:
            value = np.array([np.vdot(gradient, rate) for rate in self._plate_rates])
        else:
            value = np.array([along(push) for push in self._pushes_of_units])
        material = {name: along(push) for name, push in self._pushes_of_material.items()}
        return Gradient(value, material, {name: along(push) for name, push in pushes.items()})

    def _response(self, push: Push, gaps: Push | None = None) -> np.ndarray:
        """Derivative (N, 3) of the displacement with respect to a parameter. ``push`` contains the nodal forces that
        one unit of the parameter causes, ``gaps`` the displacement of a plate that it prescribes; without ``gaps`` the
        plate is fixed.
        """
        total = np.zeros_like(self.displacement)
        for block, forces in push.items():
            rate = self._solved(block, forces, gaps[block] if gaps else None)
            total += block.displacement(rate, self._on(block)[0])
        return total

    def _solved(self, block: TangentBlock, forces: np.ndarray, gap: np.ndarray | None = None) -> np.ndarray:
        with rejections_named(self._pad.load, self._value):
            return self._tangent(block).correction(forces, gap)

    def _tangent(self, block: TangentBlock) -> Linearised:
        model, own = block.model, self._blocks[0].model
        if model not in self._tangents:
            entries: Any = self._tangents[own].entries
            if model.part is not own.part:
                entries = model.evaluate(*self._on(block), self._value).entries
            self._tangents[model] = block.factored(entries, self._on(block)[0], self._value, self._pad.contacts)
        return self._tangents[model]

    def _on(self, block: TangentBlock) -> tuple[np.ndarray, np.ndarray]:
        """Displacement and pressure on the part of the pad to which one block of the tangent matrix belongs."""
        return block.model.part.restrict(self.displacement, self.pressure)

    def _strained_elements(self, block: TangentBlock) -> StrainedElements:
        elements = block.model.assembly.elements
        if elements not in self._at_state:
            self._at_state[elements] = StrainedElements(elements, *self._on(block))
        return self._at_state[elements]

    def _push_of_value(self, direction: np.ndarray) -> Push:
        components = ((block, block.of_value(direction)) for block in self._blocks)
        return {
            block: block.model.load_rate(self._on(block)[0], component, self._value)
            for block, component in components
            if component.any()
        }

    def _push_of_material(self, name: str) -> Push:
        block = self._blocks[0]  # of displacements with the symmetry of the state
        strained, assembly = self._strained_elements(block), block.model.assembly
        barrier_forces = block.forces(self._barrier_forces / self._pad.material.youngs_modulus)

        def residual_of(material: Material) -> np.ndarray:
            load_forces = block.model.penalty_forces(material, self._on(block)[0], self._value)
            internal_forces = assembly.over_unknowns(*strained.of(material), self._on(block)[0])
            return internal_forces - load_forces - material.youngs_modulus * barrier_forces

        return {block: -material_rate(residual_of, self._pad.material, name)}

    def _push_of_shape(self, velocity: np.ndarray) -> Push:
        pad, push = self._pad, {}
        if pad.load.tilts:
            raise InputError(
                f"derivatives with respect to shapes are not available with load = {pad.load.name!r}: vary the "
                "parameter in a sweep, or use a load without moments."
            )
        loads = load_rate(pad.whole, pad.material, pad.load, self.displacement, self._value, velocity)
        if pad.contacts:
            loads = loads + pad.contacts.shape_rate(self.displacement, velocity)
        for block in self._blocks:
            component = block.of_field(velocity)
            if np.abs(component).max() > NO_PART * np.abs(velocity).max():
                inside = self._strained_elements(block).rates(component)
                push[block] = block.forces(loads) - block.model.assembly.over_unknowns(*inside)
        return push

    @cached_property
    def _barrier_forces(self) -> np.ndarray:
        """Contact forces (N, 3) in N on the nodes, by the pad's own walls, the board and rigid bodies."""
        contacts = self._pad.contacts
        return contacts.all_forces(self.displacement) if contacts else np.zeros_like(self.displacement)

    @cached_property
    def _pushes_of_units(self) -> list[Push]:
        return [self._push_of_value(unit) for unit in np.eye(self._pad.load.components)]

    @cached_property
    def _pushes_of_material(self) -> dict[str, Push]:
        return {name: self._push_of_material(name) for name in self._pad.material.parameters}

    @cached_property
    def _plate_rates(self) -> list[np.ndarray]:
        """Derivatives (N, 3) of the displacement with respect to each component of the prescribed displacement of the
        plate."""
        return [self.by_value(unit) for unit in np.eye(self._pad.load.components)]


class PressedState(LinearisedState):
    """A linearised pad under a force along z on an indenter. When material or shape change, the indenter moves such
    that the force stays constant.

    The load of the linearised pad is the displacement of the indenter.
    """

    def by_value(self, direction: Sequence[float] | np.ndarray) -> np.ndarray:
        direction = array_of("direction", direction, (3,))
        if direction[:2].any():
            raise refusal("direction", direction.tolist(), "without friction an indenter only pushes, along z")
        return direction[2] / self._stiffness * self._by_height

    def by_material(self, name: str) -> np.ndarray:
        return self._under_force(super().by_material(name), self._gain_by_material(name))

    def by_shape(self, velocity: np.ndarray) -> np.ndarray:
        rate = super().by_shape(velocity)
        return self._under_force(rate, self._gain_by_shape(np.asarray(velocity, dtype=float)))

    def by_place(self, direction: Sequence[float] | np.ndarray) -> np.ndarray:
        shift = np.append(array_of("direction", direction, (2,)), 0.0)
        if not self._pad.load.has_position:
            return np.zeros_like(self.displacement)
        rate = super().by_value(shift)
        return self._under_force(rate, float(self._body.force_rate(self._contact_state, shift, np.zeros_like(rate))[2]))

    def by_forces(self, forces: np.ndarray) -> np.ndarray:
        raise InputError("forces beside that of an indenter are not available: prescribe its displacement.")

    def by_many_forces(self, forces: np.ndarray) -> np.ndarray:
        return np.stack([self.by_forces(own) for own in forces])

    def pull_back(self, gradient: np.ndarray, shapes: Mapping[str, np.ndarray] | None = None) -> Gradient:
        """Derivatives of a scalar L with respect to force, material and shape, from its derivatives ``gradient`` (N, 3)
        with respect to the displacements of the nodes; see :meth:`LinearisedState.pull_back`. Of the derivatives with
        respect to the force, only the one along z exists; the others are NaN.
        """
        gradient = array_of("gradient", gradient, self.displacement.shape)
        by_force = float(np.vdot(gradient, self._by_height)) / self._stiffness
        at_depth = super().pull_back(gradient - by_force * self._body.force_gradient(self._contact_state), shapes)
        material = {name: along - by_force * self._gain_by_material(name) for name, along in at_depth.material.items()}
        shape = {
            name: along - by_force * self._gain_by_shape(np.asarray((shapes or {})[name], dtype=float))
            for name, along in at_depth.shape.items()
        }
        return Gradient(np.array([np.nan, np.nan, by_force]), material, shape)

    def _under_force(self, rate: np.ndarray, gain: float) -> np.ndarray:
        """Derivative (N, 3) of the nodes' displacements with respect to a parameter, at a constant force of the
        indenter. It follows from the derivative ``rate`` at a constant depth, and from the derivative ``gain`` of the
        force at constant displacements.
        """
        gain += float(self._body.force_rate(self._contact_state, np.zeros(3), rate)[2])
        return rate - gain / self._stiffness * self._by_height

    def _gain_by_material(self, name: str) -> float:
        """Change of the force on the indenter in N per unit of a material parameter, at constant displacements."""
        material = self._pad.material
        modulus = material_rate(lambda other: np.array(other.youngs_modulus), material, name)
        return float(modulus) / material.youngs_modulus * float(self._contact_state.force[2])

    def _gain_by_shape(self, velocity: np.ndarray) -> float:
        return float(self._body.shape_rate(self.displacement, self._value, velocity).sum(axis=0)[2])

    @cached_property
    def _body(self) -> Indentation:
        assert self._pad.load.moved_indenter is not None
        return Indentation(self._pad.whole, self._pad.load.moved_indenter, self._pad.material.youngs_modulus)

    @cached_property
    def _contact_state(self) -> ContactState:
        return self._body.contact_state(self.displacement, self._value)

    @cached_property
    def _by_height(self) -> np.ndarray:
        """Derivative (N, 3) of the displacement with respect to the height of the indenter."""
        return super().by_value((0.0, 0.0, 1.0))

    @cached_property
    def _stiffness(self) -> float:
        """Derivative of the force with respect to the height of the indenter, N/mm."""
        return float(self._body.force_rate(self._contact_state, np.array([0.0, 0.0, 1.0]), self._by_height)[2])


@contextmanager
def rejections_named(load: Load, value: np.ndarray) -> Iterator[None]:
    """Convert a failed solution, or a lack of memory, within the block to a `ComputationError` that names the load."""
    try:
        with memory_for("the tangent of the pad"):
            yield
    except Rejected as rejection:
        shown = ", ".join(f"{component:.4g}" for component in value)
        where = f"{load.quantity} = ({shown}) {load.unit}"
        raise ComputationError(f"no equilibrium was found at {where}: {rejection}.") from rejection
