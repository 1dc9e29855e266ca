"""The equations of a pad under a load, on the symmetric part of its mesh: residual, tangent, error and rates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import ClassVar

import numpy as np
import scipy.sparse as sparse

from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.contact.barriers.contacts import Contacts
from mitsuba_taxel.mechanics.contact.barriers.self_contact import ContactTest
from mitsuba_taxel.mechanics.elements.loads import SPREAD_FORCE, Load, normal_part
from mitsuba_taxel.mechanics.elements.model import Configuration, Model
from mitsuba_taxel.mechanics.elements.solvers import Factorisation, Solver, make_solver
from mitsuba_taxel.mechanics.elements.symmetry import part_between
from mitsuba_taxel.mechanics.equilibrium.linearised import Linearised, Steps
from mitsuba_taxel.mechanics.equilibrium.natural_step import NATURAL_STRAIN, TICKS, natural_step, ticks_of
from mitsuba_taxel.mechanics.equilibrium.solution import (
    NO_HISTORY,
    History,
    singular,
)
from mitsuba_taxel.mechanics.materials.laws import Material


class MeshedPad:
    """A meshed pad glued to the board, under a load: its residual, tangent, and rates.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of the whole pad.
    material : Material
        Elastic law of the silicone.
    load : Load
        Load on the whole pad.
    mirrors : sequence of Mirror
        All common planes of symmetry of pad and load; only the part between them is solved for.
    images : Mapping[Mirror, ndarray], optional
        Images of the nodes, from :func:`node_images`; needed with mirrors.
    solver : str, optional
        Name of a linear solver; None for the best available.
    ticks : int
        Number of ticks (shortest intervals between solved states) in a step, from :func:`ticks_of`. With more ticks,
        residuals are compared with smaller loads.
    """

    solves_between: ClassVar[bool] = False
    """Whether states between the nodes of a path are solved for rather than interpolated."""

    def __init__(
        self,
        mesh: VolumeMesh,
        material: Material,
        load: Load = SPREAD_FORCE,
        mirrors: Sequence[Mirror] = (),
        images: Mapping[Mirror, np.ndarray] | None = None,
        solver: str | None = None,
        ticks: int = TICKS,
    ) -> None:
        self.whole, self.material, self.load = mesh, material, load
        self.mirrors, self.images, self._solver_name = tuple(mirrors), images or {}, solver
        self.part = part_between(mesh, self.images, mirrors)
        self.model = Model(self.part, material, self.load, dict.fromkeys(self.part.walls, 1), linear=self._linear())
        self.numbering = self.model.numbering
        self._solver = make_solver(solver)
        self._volume = float(self.model.assembly.elements.weight.sum())
        self.height = float(np.ptp(mesh.points[:, 2]))
        self.step = natural_step(mesh, material, self.load)
        self._ticks = ticks

    @property
    def contacts(self) -> Contacts | None:
        """The barriers that keep the walls of the pad apart; None if its load has no ``self_contact``."""
        return None

    def _linear(self) -> np.ndarray | None:
        """Mask (M, q): whether the law is linear at the quadrature points of the whole pad; None if it is linear
        nowhere."""
        return None

    @property
    def unknowns(self) -> int:
        """Number of unknowns."""
        return self.model.assembly.unknowns

    def split(self, unknowns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Displacement (N, 3) in mm and pressure (corners,) in MPa of the whole pad, from the vector of unknowns."""
        return self.part.expand(*self.numbering.split(unknowns))

    def split_rate(self, rate: np.ndarray, unknowns: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Rates of displacement (N, 3) and pressure (corners,) of the whole pad, from the rates of the unknowns.

        Parameters
        ----------
        rate : (unknowns,) ndarray
            Rate of the unknowns.
        unknowns : (unknowns,) ndarray, optional
            The state, on which the rates depend if a plate rotates; by default at rest.

        Returns
        -------
        displacement : (N, 3) ndarray
            Rate of the displacement.
        pressure : (corners,) ndarray
            Rate of the pressure.
        """
        displacement = None if unknowns is None else self.numbering.split(unknowns)[0]
        return self.part.expand(*self.numbering.split_rate(rate, displacement))

    def gather(self, displacement: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """Convert a state of the whole pad, which must have the symmetry of the load, to the vector of unknowns."""
        return self.numbering.gather(*self.part.restrict(displacement, pressure))

    def towards(self, known: np.ndarray, guess: np.ndarray) -> np.ndarray:
        """Start of a Newton iteration: the ``guess``, or a point between the ``known`` state and the guess if the
        length of a step is limited, for example by contact.

        Parameters
        ----------
        known : (unknowns,) ndarray
            Unknowns of a solved state.
        guess : (unknowns,) ndarray
            Requested start of the solution.

        Returns
        -------
        (unknowns,) ndarray
            The guess, or a point on the line to it.
        """
        return guess

    def ticks(self, response: np.ndarray) -> int:
        """Number of ticks into which a step of the load path is divided, from the first-order change of the unknowns in
        a step.
        """
        return max(self._ticks, ticks_of(self.model.assembly.elements, self.numbering.split_rate(response, None)[0]))

    def isochoric_stress(self, displacement: np.ndarray) -> np.ndarray:
        """Isochoric second Piola-Kirchhoff stress (m, q, 6) in MPa in the solved part of the pad, at a displacement of
        the whole pad.
        """
        return self.model.assembly.elements.isochoric_stress(displacement[self.part.nodes])

    def isochoric_energy(self, displacement: np.ndarray) -> np.ndarray:
        """Isochoric energy density (m, q) in MPa in the solved part of the pad, at a displacement (N, 3) in mm of the
        whole pad."""
        return self.model.assembly.elements.isochoric_energy(displacement[self.part.nodes])

    def isochoric_rate(self, displacement: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Rate of the isochoric second Piola-Kirchhoff stress in the solved part of the pad.

        Parameters
        ----------
        displacement : (N, 3) ndarray
            Displacement of the nodes, mm.
        velocity : (N, 3) ndarray
            Velocity of the nodes of the whole pad, mm/s.

        Returns
        -------
        (m, q, 6) ndarray
            Rate of the stress in MPa/s.
        """
        return self.model.assembly.elements.isochoric_rate(displacement[self.part.nodes], velocity[self.part.nodes])

    def size_of(self, stress: np.ndarray) -> float:
        """Root mean square in MPa, over the pad, of a stress (m, q, 6) that is given at the quadrature points."""
        weight = self.model.assembly.elements.weight
        squares = np.square(stress) @ np.array([1.0, 1, 1, 2, 2, 2])
        return float(np.sqrt((weight * squares).sum() / weight.sum()))

    def tangent_at(
        self, unknowns: np.ndarray, value: np.ndarray, near: Linearised | None, history: History = NO_HISTORY
    ) -> Linearised:
        """Factored tangent matrix of the pad at an equilibrium.

        Parameters
        ----------
        unknowns : (unknowns,) ndarray
            Unknowns of the pad.
        value : (c,) ndarray
            Value of the load, in N, mm or MPa.
        near : Linearised or None
            Factored tangent of the pad at a nearby state; it is reused.
        history : History
            Earlier states that the equilibrium depends on.

        Returns
        -------
        Linearised
            Linearised pad at the equilibrium.
        """
        entries = self._evaluate(unknowns, value, history=history).entries
        assert entries is not None  # no element is inverted
        return self._linearised(entries, unknowns, value, near)

    def rate_in_time(
        self, linearised: Linearised, unknowns: np.ndarray, rate: np.ndarray, value: np.ndarray, stress: np.ndarray
    ) -> np.ndarray:
        """Rate of the unknowns of a pad in equilibrium, from the rate of its load and the rate of an additional stress.

        Parameters
        ----------
        linearised : Linearised
            Factored tangent of the pad at the state, or at a nearby one.
        unknowns : (unknowns,) ndarray
            Unknowns of the pad.
        rate : (c,) ndarray
            Rate of the load's value, per s.
        value : (c,) ndarray
            Value of the load, in N, mm or MPa.
        stress : (m, q, 6) ndarray
            Rate of an additional second Piola-Kirchhoff stress, MPa/s.

        Returns
        -------
        (unknowns,) ndarray
            Rate of the unknowns per s.
        """
        load_force = self.model.load_rate(self.numbering.split(unknowns)[0], rate, value)
        force = load_force - self._stress_forces(unknowns, stress)
        return linearised.correction(force, self.numbering.plate_values(rate) if self._driven else None)

    @cached_property
    def contact(self) -> ContactTest:
        """Test for contact of the whole pad, whose states follow from those of the symmetric part."""
        return ContactTest(self.whole, nodes=self.part.nodes)

    def correction(
        self, linearised: Steps, unknowns: np.ndarray, value: np.ndarray, history: History = NO_HISTORY
    ) -> np.ndarray | None:
        """Correction of the unknowns by one step of Newton's method with a known tangent; it is subtracted from the
        unknowns.

        Parameters
        ----------
        linearised : Steps
            The factored tangent, or an approximation.
        unknowns : (unknowns,) ndarray
            Unknowns of the pad.
        value : (c,) ndarray
            Value of the load, in N, mm or MPa.
        history : History
            Earlier states that the equilibrium depends on.

        Returns
        -------
        (unknowns,) ndarray or None
            The correction; None if an element is inverted.
        """
        residual = self._free_residual(self._evaluate(unknowns, value, with_tangent=False, history=history))
        if not np.all(np.isfinite(residual)):
            return None
        return linearised.step(residual, self._plate_gap(unknowns, value))

    def response(self, linearised: Linearised, unknowns: np.ndarray, stress: np.ndarray) -> np.ndarray:
        """First-order change of the unknowns if a second Piola-Kirchhoff stress is added.

        Parameters
        ----------
        linearised : Linearised
            Factored tangent of the pad at the state, or at a nearby one.
        unknowns : (unknowns,) ndarray
            Unknowns of the pad.
        stress : (m, q, 6) ndarray
            Second Piola-Kirchhoff stress at the quadrature points, MPa.

        Returns
        -------
        (unknowns,) ndarray
            Change of the unknowns.
        """
        return -linearised.step(self._stress_forces(unknowns, stress))

    def _stress_forces(self, unknowns: np.ndarray, stress: np.ndarray) -> np.ndarray:
        """Forces over the unknowns of an additional second Piola-Kirchhoff stress (m, q, 6)."""
        forces = self.model.assembly.elements.pulled(self.numbering.split(unknowns)[0], stress)
        return self.model.assembly.over_unknowns(forces, np.zeros((len(forces), 4)))

    def plate_force(self, unknowns: np.ndarray) -> np.ndarray:
        """Force (3,) in N on the bonded plate of the whole pad in equilibrium."""
        residual = self._evaluate(unknowns, np.zeros(3), with_tangent=False).residual
        return self.part.copies * self.numbering.of_plate(residual)

    def _evaluate(
        self, unknowns: np.ndarray, value: np.ndarray, with_tangent: bool = True, history: History = NO_HISTORY
    ) -> Configuration:
        return self.model.evaluate(*self.numbering.split(unknowns), value, with_tangent, history.stress_update)

    def _free_residual(self, state: Configuration) -> np.ndarray:
        """Out-of-balance forces over the unknowns, without the reaction of a plate whose displacement is prescribed:
        this reaction is no error.
        """
        residual = state.residual.copy()
        residual[self._plate_unknowns] = 0.0
        return residual

    def _error(self, state: Configuration, unknowns: np.ndarray, value: np.ndarray) -> float:
        """Relative error of equilibrium: the largest of the errors of forces, of volumes, and of the displacement of a
        plate."""
        forces, volumes = np.split(state.residual, [self.numbering.displacements])
        load = float(np.linalg.norm(state.load))
        if self._driven:
            load = float(np.linalg.norm(forces[self._plate_unknowns]))
            forces = np.delete(forces, self._plate_unknowns)
        scale = max(load, self._small_load)
        missed = self._plate_gap(unknowns, value)
        gap = 0.0 if missed is None else float(np.abs(missed).max())
        forces_off, volumes_off = float(np.linalg.norm(forces)), float(np.linalg.norm(volumes))
        return max(forces_off / scale, volumes_off * self._ticks / TICKS / self._volume, gap / self.height)

    @cached_property
    def _small_load(self) -> float:
        """Lower bound, in N, of the load by which residuals are divided: the norm of the load for a natural step or, if
        it is smaller, for :data:`TICKS` ticks.
        """
        zero = np.zeros((len(self.part.mesh.points), 3))
        value = normal_part(np.full(self.load.components, self.step))
        if self._driven:
            return NATURAL_STRAIN * self.material.youngs_modulus * self.load.loaded_area(self.whole) / self.part.copies
        return TICKS / self._ticks * float(np.linalg.norm(self.model.load_vector(zero, value)))

    @property
    def _driven(self) -> bool:
        return self.load.moves_plate

    @cached_property
    def _plate_unknowns(self) -> np.ndarray:
        """Unknowns of the plate if the load moves it, else none."""
        return self.numbering.plate_unknowns if self._driven else np.zeros(0, dtype=np.int64)

    def _plate_gap(self, unknowns: np.ndarray, value: np.ndarray) -> np.ndarray | None:
        """Deviation in mm of each component of a plate's displacement from its prescribed value; None without such a
        plate."""
        return unknowns[self._plate_unknowns] - self.numbering.plate_values(value) if self._driven else None

    def _linearised(
        self, entries: np.ndarray, unknowns: np.ndarray, value: np.ndarray, near: Linearised | None = None
    ) -> Linearised:
        """Tangent matrix of the pad from its entries at a state; with ``near``, it uses the factor of that state."""
        lower = self.model.assembly.matrix(entries)
        constraints = self.model.constraints(self.numbering.split(unknowns)[0], value)
        return Linearised(entries, lower, self._factored, constraints, self.numbering.displacements, near)

    def _factored(self, lower: sparse.csc_matrix, solver: Solver | None = None) -> Factorisation:
        try:
            return (solver or self._solver).factor(lower)
        except RuntimeError as failure:
            raise singular(failure) from failure

    def rate(
        self, linearised: Linearised, unknowns: np.ndarray, direction: np.ndarray, value: np.ndarray | None = None
    ) -> np.ndarray:
        """Derivative of the unknowns in equilibrium with respect to the load's value along a direction.

        Parameters
        ----------
        linearised : Linearised
            Factored tangent of the pad at the state, or at a nearby one.
        unknowns : (unknowns,) ndarray
            Unknowns of the pad.
        direction : (c,) ndarray
            Direction of the change of the load's value.
        value : (c,) ndarray, optional
            Value of the load; needed if the load is not linear in it.

        Returns
        -------
        (unknowns,) ndarray
            Derivative of the unknowns per N, mm or MPa.
        """
        force = self.model.load_rate(self.numbering.split(unknowns)[0], direction, value)
        return linearised.correction(force, self.numbering.plate_values(direction) if self._driven else None)
