"""States of a history-dependent pad with their errors, and the refusal of obstacles."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import cached_property, partial

import numpy as np

from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.base.convergence import ERROR_SHARE
from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.mechanics.contact.barriers.self_contact import ContactTest
from mitsuba_taxel.mechanics.contact.indentation import Indentation
from mitsuba_taxel.mechanics.continuation.load_path_ends import refuse_at_rest
from mitsuba_taxel.mechanics.continuation.pad_path import PadPath
from mitsuba_taxel.mechanics.continuation.state import NO_ERROR, State, StateComparison, ViscoelasticMemory
from mitsuba_taxel.mechanics.elements.internal_variables import expand_stress
from mitsuba_taxel.mechanics.elements.nodal_forces import glued_force
from mitsuba_taxel.mechanics.equilibrium.feet import where_linear
from mitsuba_taxel.mechanics.errors.roof_error import RoofComparison
from mitsuba_taxel.mechanics.errors.second_meshes import second_meshes, share_of
from mitsuba_taxel.mechanics.errors.shorter_reach import REMAINDER
from mitsuba_taxel.mechanics.history.step_state import PathEnded
from mitsuba_taxel.mechanics.history.time_state import (
    TimeState,
)
from mitsuba_taxel.mechanics.history.timed_rows import LoadHistory, rubs
from mitsuba_taxel.mechanics.history.timed_states import TimedStates
from mitsuba_taxel.mechanics.materials.viscoelastic import Viscoelastic


class TimedPath(TimedStates):
    """States of one history-dependent pad (viscoelastic or with friction) under one kind of load, cached on disk, a few
    in memory.

    Parameters are those of :class:`TimedStates`.
    """

    @classmethod
    @kept(4)
    def of(cls, path: PadPath, material: Viscoelastic) -> TimedPath:
        """The load path of a history-dependent pad and material; all callers with equal arguments share one object.

        Parameters
        ----------
        path : PadPath
            The path.
        material : Viscoelastic
            The silicone.

        Returns
        -------
        TimedPath
            The same path for the same arguments.
        """
        return cls(path, material)

    def state(self, rows: LoadHistory, obstacles: np.ndarray | None = None) -> State:
        """The deformed pad at the end of the given rows of the load.

        Parameters
        ----------
        rows : LoadHistory
            Rows of the load, from rest.
        obstacles : (K, 3, 3) ndarray, optional
            In mm, corners of the triangles of closed surfaces that the pad must not touch in any row.

        Returns
        -------
        State
            State with its memory; the second mesh for its error is solved when first needed.

        Raises
        ------
        InputError
            if the undeformed pad touches obstacles.
        ComputationError
            if the path ends before the last row, or the pad touches obstacles.
        """
        if obstacles is not None:
            self._refuse_contact(rows, obstacles)
        path = self._path
        if path.bodies is not None:
            refuse_at_rest(path.contact.at_rest)
        time, value = rows[-1]
        if path.load == self._moving:
            self._refuse_unresolved(None, np.array(value))
        at = self.reached(rows)
        self._refuse_unresolved(at.shape.displacement, at.load.value)
        memory = None
        if self._material.has_memory:
            overstress, when = partial(self._overstress, rows), time if self._material.prony else None
            memory = ViscoelasticMemory(when, overstress, at.shape.deviation, at.figures.stress_error)
        return State(
            mesh=path.mesh,
            material=path.material,
            load=path.load,
            value=np.array(value),
            displacement=at.shape.displacement,
            pressure=at.shape.pressure,
            min_jacobian=at.figures.min_jacobian,
            residual=at.figures.residual,
            newton_iterations=at.figures.iterations,
            stability_checked=at.figures.stability_checked,
            solved_in=at.figures.seconds,
            second_mesh=partial(self._comparison, rows),
            memory=memory,
            traction=at.traction,
            indenter_moved=None if self._moving.indenter is None else at.load.value,
            bodies=path.bodies,
        )

    def _refuse_unresolved(self, displacement: np.ndarray | None, moved: np.ndarray) -> None:
        if self._moving.indenter is not None:
            driven = self._path if self._path.load.driven is None else self._path.driven
            driven.refuse_unresolved(moved, displacement)

    def _refuse_contact(self, rows: LoadHistory, obstacles: np.ndarray) -> None:
        """Raise if a pad touches obstacles at the end of one of the rows; rows without contact are checked once."""
        key, clear = hashlib.sha256(obstacles.tobytes()).digest(), len(rows)
        while clear and (key, rows[:clear]) not in self._clear:
            clear -= 1
        test = None
        for count in range(clear + 1, len(rows) + 1):
            test = test or ContactTest(self._path.mesh, obstacles)
            contact = test.find_package(self._shape(rows[:count]).displacement)
            if contact:
                at, time = self.reached(rows[:count]).load.value, rows[count - 1][0]
                raise ComputationError(self._end(PathEnded(at, 0.0, f"touches {contact.what}"), time, 0.0))
            self._clear.add((key, rows[:count]))

    def _comparison(self, rows: LoadHistory) -> StateComparison:
        """Estimate the error of the state at the end of the rows from two other solutions: on another mesh (the first
        one on which the pad bears all loads), and with longer time steps.
        """
        with self._path.lock:
            here, mesh = self.reached(rows), self._path.mesh
            displacement = here.shape.displacement
            if not displacement.any():
                return StateComparison(NO_ERROR, partial(np.zeros, (2, *mesh.points.shape)), 0.0, 0.0)

            def compare(second: PadPath, comparison: RoofComparison) -> StateComparison:
                # The same rows on another mesh, in steps of twice the length, and with half the reach of contact.
                second_path = self.of(second, self._material)
                on_other, longer = second_path.reached(rows), self._longer.reached(rows)
                second_path._refuse_unresolved(on_other.shape.displacement, on_other.load.value)
                closer = self._closer.reached(rows)

                # Each comparison changes the force on a pad whose displacement is prescribed.
                deviations, force_error = comparison.deviations, 0.0
                if self._path.load.gives_displacement:
                    force = self._board_force(rows, here)
                    of_steps, of_reach = (
                        0.0 if state is here else float(np.linalg.norm(path._board_force(rows, state) - force))
                        for path, state in ((self, longer), (self._closer, closer))
                    )
                    of_mesh = comparison.force_error(force, second_path._board_force(rows, on_other))
                    force_error = of_mesh + of_steps + REMAINDER * of_reach
                    deviations = partial(deviations, of_force=share_of(of_mesh, force))
                return StateComparison(
                    comparison.error(displacement, on_other.shape.displacement),
                    partial(self._deviations, deviations, here, on_other, longer, closer),
                    force_error,
                    on_other.figures.seconds
                    + sum(state.figures.seconds for state in (longer, closer) if state is not here),
                )

            return second_meshes(self._path).first(compare) or StateComparison()

    @cached_property
    def _longer(self) -> TimedPath:
        """The same path with time steps of twice the length, for an estimate of the error: with friction or Mullins'
        effect, errors are proportional to the length of a step. Without these, this path.
        """
        by_steps = rubs(self._path.load) or self._material.softening is not None
        return type(self)(self._path, self._material, 2) if by_steps else self

    @cached_property
    def _closer(self) -> TimedPath:
        """The same path with half the distance at which contact forces begin, for an estimate of their error, if the
        load has ``self_contact``; otherwise this path.
        """
        return type(self)(self._path, self._material, 1, 0.5) if self._path.load.self_contact else self

    def _deviations(
        self,
        deviations: Callable[..., np.ndarray],
        here: TimeState,
        on_other: TimeState,
        longer: TimeState,
        closer: TimeState,
    ) -> np.ndarray:
        """Sum of the estimated errors (2, N, 3) of the displacement. Errors of elements have two components; those of
        time steps, of steps of the load and of the reach of contact forces are added to the second one.
        """
        displacement = here.shape.displacement
        result = deviations(displacement, on_other.shape.displacement)
        result[1] += (here.shape.deviation + displacement - longer.shape.displacement) / ERROR_SHARE
        result[1] += REMAINDER * (closer.shape.displacement - displacement) / ERROR_SHARE
        return result

    def _overstress(self, rows: LoadHistory, at: TimeState | None = None) -> np.ndarray:
        """Overstress (m, q, 6) in MPa, as in :class:`ViscoelasticMemory`."""
        at, pad = self.reached(rows) if at is None else at, self._pad_for(rows)
        softening, largest = self._material.softening, at.variables.largest_energy
        if softening is None or largest is None:
            stress = at.variables.overstress(self._material)
        else:
            displacement = at.shape.displacement
            damage = softening.damage_variable(pad.isochoric_energy(displacement), largest)
            stress = (damage - 1)[..., None] * pad.isochoric_stress(displacement)
        return expand_stress(stress, pad.part, self._path.mesh)

    def _board_force(self, rows: LoadHistory, at: TimeState) -> np.ndarray:
        """Force (3,) in N of the board on the pad."""
        # Because the board may support the pad beside the glued bottom, too.
        self_contact = self._path.load.self_contact
        if self_contact and self._moving.indenter is not None:
            body = Indentation(self._path.mesh, self._moving.indenter, self._path.material.youngs_modulus)
            return -body.contact_state(at.shape.displacement, at.load.value, traction=body.at_nodes(at.traction)).force
        overstress, path = self._overstress(rows, at) if self._material.has_memory else None, self._path
        solved = path.mesh, path.material, at.shape.displacement, at.shape.pressure, overstress
        if not self_contact:
            return glued_force(*solved)
        return -glued_force(*solved, region="top", linear=where_linear(path.mesh, path.load, self._fraction))
