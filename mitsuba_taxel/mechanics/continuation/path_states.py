"""States of a load path at requested loads.

A state is interpolated on a segment or branch of the path. Under a force on an indenter it is found at the depth where
the indenter exerts this force. Of loads that are mirror images of each other, only one is solved.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import partial

import numpy as np

from mitsuba_taxel.geometry.bezier_patches import Place
from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.mechanics.contact.barriers.bodies import RigidBodies
from mitsuba_taxel.mechanics.contact.barriers.self_contact import Contact
from mitsuba_taxel.mechanics.continuation.buckled_branch import BuckledBranch
from mitsuba_taxel.mechanics.continuation.indenter_depth import DOWN, depth_of, force_at, stiffness_at
from mitsuba_taxel.mechanics.continuation.load_path_ends import LoadPathEnds, Obstacles, end_of_path
from mitsuba_taxel.mechanics.continuation.load_segment import LoadSegment
from mitsuba_taxel.mechanics.continuation.path_nodes import Interpolated
from mitsuba_taxel.mechanics.continuation.path_problem import PathProblem
from mitsuba_taxel.mechanics.continuation.path_segments import PathSegments, nothing
from mitsuba_taxel.mechanics.continuation.solved_states import SolvedStates, release_factor
from mitsuba_taxel.mechanics.continuation.state import PathRate
from mitsuba_taxel.mechanics.elements.loads import Load, mirrored_value
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import LoadedPad
from mitsuba_taxel.mechanics.equilibrium.solution import Rejected
from mitsuba_taxel.mechanics.local_mesh import Refinement
from mitsuba_taxel.mechanics.materials.laws import Material
from mitsuba_taxel.pads.any_pad import AnyPad


class PathStates(PathProblem):
    """States of one pad under one kind of load.

    Loads that are mirror images of each other in a plane of symmetry of the pad have mirrored states, so only one of
    them is solved: the load on the kept side of all planes, which is called canonical.

    Parameters
    ----------
    pad, material, load, mesh_size, judged, bodies, step_tolerance, refinement
        See :class:`PathProblem`.
    by_tangent : bool
        Whether states under small tangential forces are solved with the tangent under the normal force, if this
        converges.
    """

    def __init__(
        self,
        pad: AnyPad,
        material: Material,
        load: Load,
        mesh_size: float,
        judged: bool,
        bodies: RigidBodies | None,
        step_tolerance: float,
        refinement: Refinement | None,
        by_tangent: bool,
    ) -> None:
        super().__init__(pad, material, load, mesh_size, judged, bodies, step_tolerance, refinement)
        self.segments = PathSegments(self)
        self.solved = SolvedStates(self, self.segments, self._fields_under if by_tangent else None)

    @property
    def driven(self) -> PathStates:
        """The load path of the same pad when the displacement of the indenter is prescribed; states under a given force
        are found on it.
        """
        raise NotImplementedError(f"{self.load} drives no other load")

    def driven_to(self, value: np.ndarray, obstacles: Obstacles | None) -> np.ndarray:
        """Displacement of an indenter at which it presses with a given force.

        Parameters
        ----------
        value : (3,) ndarray
            Force in N.
        obstacles : Obstacles or None
            Obstacles that the pad must not touch.

        Returns
        -------
        (3,) ndarray
            Displacement of the body, mm.
        """
        if not value.any():
            return np.zeros(3)
        driven, height = self.driven, float(np.ptp(self.mesh.points[:, 2]))

        def follow(moved: np.ndarray) -> object:
            return self._canonical_driven(moved, [], obstacles)

        return depth_of(driven.segments, value, height, follow, driven.solved.keep) * DOWN

    def _canonical_driven(
        self, moved: np.ndarray, mirrors: list[Mirror], obstacles: Obstacles | None
    ) -> tuple[np.ndarray, np.ndarray, Interpolated]:
        """State of the pad under a prescribed displacement of the indenter, as :meth:`canonical` computes it. If the
        load path ends before, the error states the largest force.
        """
        driven = self.driven
        try:
            return driven.canonical(moved, mirrors, obstacles)
        except LoadPathEnds as end:
            segment, pad = driven.segments.towards(np.zeros(3), DOWN), driven.segments.pad_for(np.zeros(3), DOWN)
            if end.value is None or not segment.nodes:
                raise
            last = min(-float(end.value[2]), segment.nodes[-1].s)
            nodes = [node for node in segment.nodes if node.s < last] + [segment.solved(pad, last)]
            carried = max(force_at(pad, segment, node) for node in nodes)
            raise end.under(self.load, np.array([0.0, 0.0, -carried])) from end

    def turned(self, value: np.ndarray) -> tuple[np.ndarray, list[Mirror]]:
        """Reflect a load to its canonical mirror image, the one that is solved. Returns this load, and the planes
        (mirrors) in which the load was reflected.
        """
        used: list[Mirror] = []
        self.segments.follow_normal(value)
        for mirror in self.segments.mirrors_at(value):
            if len(value) > 1 and mirror.side(value) < 0:
                value = mirrored_value(mirror, value)
                used.append(mirror)
        return value, used

    def mirrored(
        self, displacement: np.ndarray, pressure: np.ndarray, mirrors: Iterable[Mirror]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Reflect a state in several planes of symmetry of the pad, one after the other.

        Parameters
        ----------
        displacement : (N, 3) ndarray
            Displacement of the nodes, mm.
        pressure : (corners,) ndarray
            Pressure at each corner of the elements in MPa, positive in tension.
        mirrors : Iterable[Mirror]
            The mirrors.

        Returns
        -------
        displacement : (N, 3) ndarray
            Displacements of the nodes in mm.
        pressure : (corners,) ndarray
            Pressures in MPa.
        """
        for mirror in mirrors:
            image = self.images[mirror]
            displacement, pressure = mirror.image(displacement[image]), pressure[image[: len(pressure)]]
        return displacement, pressure

    def _rate(self, value: np.ndarray, mirrors: list[Mirror]) -> PathRate | None:
        """Derivative of a state with respect to the distance along its load path; None if it is not known.

        It is computed for the canonical load, the mirror image that is solved, and reflected back in the ``mirrors``.
        """
        if not value.any():
            return None
        if self.load.driven is not None:
            with self.lock:
                rate, stiffness = self.rate_by_depth(value)
            return PathRate(value / np.linalg.norm(value), rate / stiffness)
        with self.lock:
            segment, s = self.segments.to(value)[-1]
            direction = segment.direction
            curve, distance, pad = self.segments.part_to(segment, s)
            nodal_forces = self.solved.beside(segment, s, pad)
            if nodal_forces:
                try:
                    rate = self.solved.rate_beside(segment, s, pad, nodal_forces.unknowns)
                except Rejected:
                    return None
            elif pad.solves_between and isinstance(curve, LoadSegment):
                rate = self.solved.at(curve, distance, pad).tangent
            else:
                rate = curve.rate(distance)
            at = self.solved.state(curve, distance, pad).unknowns if self.load.tilts else None
            length = float(np.linalg.norm(direction)) if self.load.tilts else 1.0  # forces and moments
            direction, displacement = direction / length, pad.split_rate(rate / length, at)[0]
        for mirror in reversed(mirrors):
            direction = mirrored_value(mirror, direction)
            displacement = mirror.image(displacement[self.images[mirror]])
        return PathRate(direction, displacement)

    def rate_by_depth(self, value: np.ndarray) -> tuple[np.ndarray, float]:
        """Derivative (N, 3) of the displacement with respect to the depth of the body under a force (3,), and the
        stiffness in N/mm."""
        driven = self.driven
        ((segment, s),) = driven.segments.to(self.driven_to(value, None))
        pad = driven.segments.pad_for(segment.origin, segment.direction)
        node = driven.solved.at(segment, s, pad)
        return pad.split(node.tangent)[0], stiffness_at(pad, segment, node)

    def canonical(
        self, value: np.ndarray, mirrors: list[Mirror], obstacles: Obstacles | None
    ) -> tuple[np.ndarray, np.ndarray, Interpolated]:
        """Displacement, pressure and quality of the solution under a canonical load: of all mirror images of a load,
        the one that is solved.

        Parameters
        ----------
        value : (c,) ndarray
            Value of the load.
        mirrors : list[Mirror]
            Mirrors that have mapped the value and the obstacles to the kept side.
        obstacles : Obstacles or None
            Obstacles that the pad must not touch on its path.

        Returns
        -------
        tuple[ndarray, ndarray, Interpolated]
            Displacement (N, 3) in mm, pressure (corners,) in MPa, and the figures of the solution.

        Raises
        ------
        LoadPathEnds
            if the path does not lead there.
        """
        fields = np.zeros_like(self.mesh.points), np.zeros(self.mesh.corner_count)
        if not value.any():
            at_rest = Interpolated(
                unknowns=np.zeros(0),
                min_jacobian=1.0,
                residual=0.0,
                iterations=0,
                stability_checked=True,
                seconds=0.0,
            )
            return *fields, at_rest
        if self.load.driven is not None:
            return self._canonical_driven(self.driven_to(value, obstacles), mirrors, obstacles)
        start, seconds = partial(_at_rest, fields), 0.0
        for segment, s in self.segments.to(value):
            # States under small tangential forces are solved with the tangent under the normal force, if this
            # converges.
            pad = self.segments.pad_for(segment.origin, segment.direction)
            nodal_forces = self.solved.beside(segment, s, pad)
            if nodal_forces and not (obstacles and obstacles.touch(pad.split(nodal_forces.unknowns)[0])):
                return *pad.split(nodal_forces.unknowns), replace(nodal_forces, seconds=seconds + nodal_forces.seconds)

            # Follow the segment, unless it has been solved as far.
            touch = obstacles.first if obstacles else nothing
            if not segment.reaches(s):
                release_factor()
                self.segments.extend(segment, pad, s, start, touch)
            self._refuse_touch(segment, touch(segment, pad), s, mirrors)

            # Where the pad buckles before, follow the branch beyond.
            if segment.mode.size and not segment.reaches(s):
                branch = self.segments.extended_branch(segment, s, touch)
                touched = touch(branch.curve, branch.buckled)
                self._refuse_touch(branch, touched and (branch.load_at(touched[0]), touched[1]), s, mirrors)
                seconds += branch.seconds_before(s)

            # The state there, from which the next segment starts.
            curve, distance, pad = self.segments.part_to(segment, s)
            if not curve.reaches(distance):
                folded_at = None
                touches_nothing = not self.load.self_contact and not np.isfinite(curve.place).all()
                if touches_nothing and isinstance(curve, LoadSegment) and curve.nodes:
                    folded_at = self.contact.find_fold(pad.split(curve.unknowns_at(curve.limit))[0])
                raise self._end(curve.value(curve.limit), curve.reason, curve.place, mirrors, folded_at)
            try:
                at = self.solved.state(curve, distance, pad)
            except Rejected as rejection:
                reason, nowhere = f"cannot be loaded further ({rejection})", np.full(3, np.nan)
                raise self._end(segment.value(s), reason, nowhere, mirrors) from rejection
            seconds += at.seconds
            fields = pad.split(at.unknowns)
            start = partial(_in_balance, pad, at.unknowns, segment.value(s))
        return *fields, replace(at, seconds=seconds)

    def _fields_under(self, value: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Displacement (N, 3) in mm and pressure (corners,) in MPa under a force (3,) in N along z."""
        displacement, pressure, _ = self.canonical(value, [], None)
        return displacement, pressure

    def _refuse_touch(
        self,
        segment: LoadSegment | BuckledBranch,
        touched: tuple[float, Contact] | None,
        s: float,
        mirrors: list[Mirror],
    ) -> None:
        """Raise LoadPathEnds if the pad touches itself or an obstacle along a segment before the distance ``s``."""
        if touched and touched[0] < min(s, segment.limit):
            free, contact = touched
            raise self._end(segment.value(free), f"touches {contact.what}", np.array(contact.place), mirrors)

    def _end(
        self,
        value: np.ndarray,
        reason: str,
        place: np.ndarray,
        mirrors: list[Mirror],
        folded_at: Place | None = None,
    ) -> LoadPathEnds:
        """Create the error that the load path ends before the requested load. The message names the requested load,
        which is found by reflection of ``value`` in the ``mirrors``.
        """
        buckled_at = self.segments.buckled_at(value, mirrors)
        for mirror in reversed(mirrors):
            value, place = mirrored_value(mirror, value), mirror.image(place)
            folded_at = folded_at and tuple(mirror.image(np.array(folded_at)).tolist())
        return end_of_path(self.mesh, self.load, value, reason, place, buckled_at, folded_at)


def _at_rest(state: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    return state


def _in_balance(pad: LoadedPad, near: np.ndarray, value: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Displacement and pressure in equilibrium under a load, by Newton's method from the state ``near``, which is
    interpolated.
    """
    return pad.split(pad.equilibrium(near, value))
