"""One path of a pad, which everybody shares: its mesh, its states, and how they go on."""

from __future__ import annotations

import math
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cached_property, partial

import numpy as np

from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.geometry.bezier_patches import Place
from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics import cache
from mitsuba_taxel.mechanics.contact.barriers.bodies import RigidBodies
from mitsuba_taxel.mechanics.contact.barriers.self_contact import Contact
from mitsuba_taxel.mechanics.contact.indentation import Indentation
from mitsuba_taxel.mechanics.contact.resolution import LARGEST, refuse_unresolved
from mitsuba_taxel.mechanics.continuation.buckled_branch import BuckledBranch
from mitsuba_taxel.mechanics.continuation.indenter_depth import depth_under, force_at, stiffness_at
from mitsuba_taxel.mechanics.continuation.load_path_ends import LoadPathEnds, Obstacles, end_of_path, refuse_at_rest
from mitsuba_taxel.mechanics.continuation.load_segment import INTERPOLATION_TOLERANCE, LoadSegment
from mitsuba_taxel.mechanics.continuation.path_nodes import Interpolated
from mitsuba_taxel.mechanics.continuation.path_problem import PathProblem
from mitsuba_taxel.mechanics.continuation.path_segments import PathSegments, nothing
from mitsuba_taxel.mechanics.continuation.solved_states import SolvedStates
from mitsuba_taxel.mechanics.continuation.state import PathRate, State
from mitsuba_taxel.mechanics.elements.loads import Load
from mitsuba_taxel.mechanics.elements.nodal_forces import glued_force
from mitsuba_taxel.mechanics.equilibrium.feet import where_linear
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import LoadedPad
from mitsuba_taxel.mechanics.equilibrium.natural_step import TICKS
from mitsuba_taxel.mechanics.equilibrium.solution import Rejected
from mitsuba_taxel.mechanics.local_mesh import Refinement
from mitsuba_taxel.mechanics.materials.laws import Material
from mitsuba_taxel.pads.pad_file import PadFile
from mitsuba_taxel.pads.parametric.pad import Pad


class PadPath(PathProblem):
    """The states of one pad of one material under one kind of load, kept on disk and in memory.

    One that another is compared with is not ``judged``: it may be unstable where it does not show in that. One that is
    ``judged_on`` elements of another size in mm is stable as far as the pad of those bears the load; beyond, it is
    judged itself. Where a load goes on, ``bodies`` may stand in the way, which the states of the path touch. Other
    parameters are those of a :class:`PathProblem`.
    """

    def __init__(
        self,
        pad: Pad | PadFile,
        material: Material,
        load: Load,
        mesh_size: float,
        judged: bool,
        judged_on: float | None,
        bodies: RigidBodies | None,
        step_tolerance: float,
        refinement: Refinement | None,
    ) -> None:
        judged = judged and judged_on is None
        super().__init__(pad, material, load, mesh_size, judged, bodies, step_tolerance, refinement)
        self.judge = None if judged_on is None else self._like(judged_on)
        self.segments = PathSegments(self)
        self.solved = SolvedStates(self, self.segments, self._state_under_normal_force if self.judge else None)

    @cached_property
    def mesh(self) -> VolumeMesh:
        """Of the undeformed pad."""
        return super().mesh if self.load.driven is None else self.driven.mesh

    @cached_property
    def driven(self) -> PadPath:
        """The path on which the body is moved that presses with a force."""
        assert self.load.driven is not None
        arguments = self.pad, self.material, self.load.driven, self.mesh_size, self.judged
        return pad_path(*arguments, None, self.bodies, self.step_tolerance, self._refinement)

    def driven_to(self, value: np.ndarray, obstacles: Obstacles | None) -> np.ndarray:
        """How far the body moves under a force (3,)."""
        if not value.any():
            return np.zeros(3)
        driven, down = self.driven, np.array([0.0, 0.0, -1.0])
        segment, pad = driven.segments.towards(np.zeros(3), down), driven.segments.pad_for(np.zeros(3), down)
        name = cache.key("depth", driven.segments.name_of(segment), value.tolist())
        arrays = cache.load(name)
        if arrays is None:
            while not segment.nodes or force_at(pad, segment, segment.nodes[-1]) < -value[2]:
                reached = segment.nodes[-1].s if segment.nodes else 0.0
                if reached > float(np.ptp(self.mesh.points[:, 2])):
                    raise InputError("an indenter that touches nothing cannot press: place it over the pad.")
                next_depth = (math.floor(reached / segment.step + 0.5 / TICKS) + 1) * segment.step
                self._canonical_driven(next_depth * down, [], obstacles)
            depth = depth_under(pad, segment, -value[2])
            arrays = {"depth": np.array(depth)}
            cache.store(name, arrays)
        return float(arrays["depth"]) * down

    def _canonical_driven(
        self, moved: np.ndarray, mirrors: list[Mirror], obstacles: Obstacles | None
    ) -> tuple[np.ndarray, np.ndarray, Interpolated]:
        """As `canonical` of the driven path, whose end is told with the largest force that was carried as well."""
        driven, down = self.driven, np.array([0.0, 0.0, -1.0])
        try:
            return driven.canonical(moved, mirrors, obstacles)
        except LoadPathEnds as end:
            segment, pad = driven.segments.towards(np.zeros(3), down), driven.segments.pad_for(np.zeros(3), down)
            if end.value is None or not segment.nodes:
                raise
            last = min(-float(end.value[2]), segment.nodes[-1].s)
            nodes = [node for node in segment.nodes if node.s < last] + [segment.solved(pad, last)]
            carried = max(force_at(pad, segment, node) for node in nodes)
            raise end.under(self.load, np.array([0.0, 0.0, -carried])) from end

    def _obstacles(self, triangles: np.ndarray, mirrors: list[Mirror]) -> Obstacles:
        """What is known of obstacles, which ``mirrors`` take where the segments are; of the last few."""
        refuse_at_rest(self.own_contact_at_rest)
        return _in_the_way(self, np.asarray(triangles, dtype=float).tobytes(), tuple(mirrors))

    def state(self, value: np.ndarray, obstacles: np.ndarray | None = None) -> State:
        """The deformed pad under ``value``, on the way to which it must not touch ``obstacles``."""
        bearing = self.bearing(value)
        if bearing is not self:
            return bearing.state(value, obstacles)
        if self.bodies is not None:
            refuse_at_rest(self.contact.at_rest)
        self.load.check(value)
        value = np.array(value)
        turned, used = self.turned(value)
        in_the_way = None if obstacles is None else self._obstacles(obstacles, used)
        displacement, pressure, at = self.canonical(turned, used, in_the_way)
        rate = partial(self._rate, turned, used)
        displacement, pressure = self.mirrored(displacement, pressure, reversed(used))
        buckled_at = self.segments.buckled_at(turned, used)
        indenter_moved = None if self.load.moved_indenter is None else value
        if self.load.driven is not None:
            indenter_moved = self.driven_to(value, in_the_way)
        return State(
            mesh=self.mesh,
            material=self.material,
            load=self.load,
            value=value,
            displacement=displacement,
            pressure=pressure,
            min_jacobian=at.min_jacobian,
            residual=at.residual,
            newton_iterations=at.iterations,
            stability_checked=at.stability_checked,
            solved_in=at.seconds,
            path_rate=rate,
            indenter_moved=indenter_moved,
            bodies=self.bodies,
            buckled_at=buckled_at,
        )

    def bearing(self, value: np.ndarray) -> PadPath:
        """The path that leads to a value: this one, or one that is judged itself, where that of its judge does not."""
        return self._like(self.mesh_size) if self.judge and not self._bears(self.judge, value) else self

    def turned(self, value: np.ndarray) -> tuple[np.ndarray, list[Mirror]]:
        """A value on the kept side of all mirrors of the pad, and those that take it there."""
        used: list[Mirror] = []
        self.segments.follow_normal(value)
        for mirror in self.segments.mirrors_at(value):
            if len(value) == 3 and mirror.side(value) < 0:
                value = mirror.image(value)
                used.append(mirror)
        return value, used

    def mirrored(
        self, displacement: np.ndarray, pressure: np.ndarray, mirrors: Iterable[Mirror]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Displacement (N, 3) and pressure (corners,) after some mirrors of the pad in turn."""
        for mirror in mirrors:
            image = self.images[mirror]
            displacement, pressure = mirror.image(displacement[image]), pressure[image[: len(pressure)]]
        return displacement, pressure

    def like(self, load: Load | None = None, refinement: Refinement | None = None) -> PadPath:
        """The path under another load, or on elements that are refined otherwise under the indenter."""
        judged_on = None if self.judge is None else self.judge.mesh_size
        judged, settings = self.judged or self.judge is not None, (self.bodies, self.step_tolerance)
        which, where = load or self.load, refinement or self._refinement
        return pad_path(self.pad, self.material, which, self.mesh_size, judged, judged_on, *settings, where)

    def on_elements(self, mesh_size: float, judged: bool = False) -> PadPath:
        """The same path on elements of another size, also under an indenter."""
        if self.load.indenter is None:
            return self._like(mesh_size, judged)
        relative_size = self.refinement.relative_size * mesh_size / self.mesh_size
        return self._like(mesh_size, judged, replace(self.refinement, relative_size=relative_size))

    def _like(self, mesh_size: float, judged: bool = True, refinement: Refinement | None = None) -> PadPath:
        settings = None, self.bodies, self.step_tolerance, refinement or self._refinement
        return pad_path(self.pad, self.material, self.load, mesh_size, judged, *settings)

    def _bears(self, judge: PadPath, value: np.ndarray) -> bool:
        """Whether the judge's path leads as far as ``value``; meanwhile another thread meshes the pad for this one."""
        _ = judge.mesh  # first, as the mesher makes one at a time
        with ThreadPoolExecutor(1) as pool:
            meshed = pool.submit(getattr, self, "mesh")
            bears = judge.bears(value)
        meshed.result()
        return bears

    def bears(self, value: np.ndarray) -> bool:
        """Whether its path leads as far as ``value`` without buckling."""
        try:
            return self.state(value).buckled_at is None
        except ComputationError:
            return False

    def _rate(self, value: np.ndarray, mirrors: list[Mirror]) -> PathRate | None:
        """How a canonical state that ``mirrors`` took there goes on."""
        if not value.any():
            return None
        if self.load.driven is not None:
            return self._rate_of_force(value)
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
            displacement = pad.split(rate)[0]
        for mirror in reversed(mirrors):
            direction, displacement = mirror.image(direction), mirror.image(displacement[self.images[mirror]])
        return PathRate(direction, displacement)

    def _rate_of_force(self, value: np.ndarray) -> PathRate:
        with self.lock:
            rate, stiffness = self.rate_by_depth(value)
        return PathRate(value / np.linalg.norm(value), rate / stiffness)

    def rate_by_depth(self, value: np.ndarray) -> tuple[np.ndarray, float]:
        """Change (N, 3) of the displacement under a force (3,) with the depth of the body, and the stiffness [N/mm]."""
        driven = self.driven
        ((segment, s),) = driven.segments.to(self.driven_to(value, None))
        pad = driven.segments.pad_for(segment.origin, segment.direction)
        node = driven.solved.at(segment, s, pad)
        return pad.split(node.tangent)[0], stiffness_at(pad, segment, node)

    def force(self, value: np.ndarray, displacement: np.ndarray, pressure: np.ndarray, share: float = 1) -> np.ndarray:
        """(3,) N, that by which a canonical state presses on what moves it by ``value``, or on the board; ``share`` is
        that of a :class:`SelfTouchingPad`."""
        if not self.load.self_contact:
            return glued_force(self.mesh, self.material, displacement, pressure)
        if self.load.moved_indenter is not None:
            body = Indentation(self.mesh, self.load.moved_indenter, self.material.youngs_modulus)
            return body.contact_state(displacement, value).force
        linear = where_linear(self.mesh, self.load, share)
        return glued_force(self.mesh, self.material, displacement, pressure, region="top", linear=linear)

    def refuse_unresolved(self, value: np.ndarray, displacement: np.ndarray | None, largest: float = LARGEST) -> None:
        """Raise `ComputationError` if elements are too large for the contact with an indenter in a canonical state.

        Before it is solved, without its ``displacement``, that of one that is moved is judged by their size alone,
        relative to half the width of the contact at most ``largest``.
        """
        size = min(self.mesh_size, self.pad.default_mesh_size)  # of which larger ones are no larger under a body
        if self.load.indenter is None or (self.load.driven is not None and displacement is None):
            return
        indenter_moved = value if self.load.driven is None else self.driven_to(value, None)
        refuse_unresolved(self.mesh, self.load.indenter, displacement, indenter_moved, size, largest)

    def canonical(
        self, value: np.ndarray, mirrors: list[Mirror], obstacles: Obstacles | None
    ) -> tuple[np.ndarray, np.ndarray, Interpolated]:
        """Displacement, pressure and figures under a value on the kept side of all mirrors of the pad.

        Parameters
        ----------
        value : (c,) ndarray
            Of the load.
        mirrors : list[Mirror]
            Those that took it there, and the obstacles too.
        obstacles : Obstacles or None
            What the pad must not touch on the way.

        Returns
        -------
        tuple[ndarray, ndarray, Interpolated]
            (N, 3) mm, (corners,) MPa, and figures.

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
            # Small tangential forces: by the tangent of the normal one, if that leads there.
            pad = self.segments.pad_for(segment.origin, segment.direction)
            nodal_forces = self.solved.beside(segment, s, pad)
            if nodal_forces and not (obstacles and obstacles.touch(pad.split(nodal_forces.unknowns)[0])):
                return *pad.split(nodal_forces.unknowns), replace(nodal_forces, seconds=seconds + nodal_forces.seconds)

            # Follow the segment, unless it is known as far.
            touch = obstacles.first if obstacles else nothing
            if not segment.reaches(s):
                self.segments.extend(segment, pad, s, start, touch)
            self._refuse_touch(segment, touch(segment, pad), s, mirrors)

            # Where the pad buckles before, follow the branch beyond.
            if segment.mode.size and not segment.reaches(s):
                branch = self.segments.extended_branch(segment, s, touch)
                touched = touch(branch.curve, branch.buckled)
                self._refuse_touch(branch, touched and (branch.load_at(touched[0]), touched[1]), s, mirrors)
                seconds += branch.seconds_before(s)

            # The state there, from which the next segment sets out.
            curve, distance, pad = self.segments.part_to(segment, s)
            if not curve.reaches(distance):
                raise self._end(curve.value(curve.limit), curve.reason, curve.place, mirrors, self._folded(curve, pad))
            try:
                at = self.solved.state(curve, distance, pad)
            except Rejected as rejection:
                reason, nowhere = f"cannot be loaded further ({rejection})", np.full(3, np.nan)
                raise self._end(segment.value(s), reason, nowhere, mirrors) from rejection
            seconds += at.seconds
            fields = pad.split(at.unknowns)
            start = partial(_in_balance, pad, at.unknowns, segment.value(s))
        return *fields, replace(at, seconds=seconds)

    def _state_under_normal_force(self, value: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Displacement and pressure under a force (3,) along z."""
        displacement, pressure, _ = self.canonical(value, [], None)
        return displacement, pressure

    def _refuse_touch(
        self,
        segment: LoadSegment | BuckledBranch,
        touched: tuple[float, Contact] | None,
        s: float,
        mirrors: list[Mirror],
    ) -> None:
        """Raise LoadPathEnds if a segment touches something before it leads to ``s``."""
        if touched and touched[0] < min(s, segment.limit):
            free, contact = touched
            raise self._end(segment.value(free), f"touches {contact.what}", np.array(contact.place), mirrors)

    @cached_property
    def small_responses(self) -> list[np.ndarray]:
        """(N, 3) each: change of the displacement from rest with a normal load, and with a tangential one."""
        size = self.load.components
        directions = [np.eye(size)[-1], np.eye(size)[0]][: 1 if size == 1 else 2]
        return [self._rest_rate(direction) for direction in directions]

    def _rest_rate(self, direction: np.ndarray) -> np.ndarray:
        pad = self.segments.pad_for(np.zeros_like(direction), direction)
        at_rest, linearised = pad.solve(np.zeros(pad.unknowns), np.zeros_like(direction))
        return pad.split(pad.rate(linearised, at_rest.unknowns, direction, np.zeros_like(direction)))[0]

    def _folded(self, part: LoadSegment | BuckledBranch, pad: LoadedPad) -> Place | None:
        """Where the pad has entered itself at the end of a segment, if that is no contact."""
        if (
            self.load.self_contact
            or np.isfinite(part.place).all()
            or not (isinstance(part, LoadSegment) and part.nodes)
        ):
            return None
        return self.contact.find_fold(pad.split(part.unknowns_at(part.limit))[0])

    def _end(
        self,
        value: np.ndarray,
        reason: str,
        place: np.ndarray,
        mirrors: list[Mirror],
        folded_at: Place | None = None,
    ) -> LoadPathEnds:
        """The end of a segment that ends too early, for the load that ``mirrors`` turned into the segment's."""
        buckled_at = self.segments.buckled_at(value, mirrors)
        for mirror in reversed(mirrors):
            value, place = mirror.image(value), mirror.image(place)
            folded_at = folded_at and tuple(mirror.image(np.array(folded_at)).tolist())
        return end_of_path(self.mesh, self.load, value, reason, place, buckled_at, folded_at)


def _at_rest(state: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    return state


def _in_balance(pad: LoadedPad, near: np.ndarray, value: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Displacement and pressure in balance near the unknowns of an interpolated state."""
    return pad.split(pad.equilibrium(near, value))


def pad_path(
    pad: Pad | PadFile,
    material: Material,
    load: Load,
    mesh_size: float,
    judged: bool = True,
    judged_on: float | None = None,
    bodies: RigidBodies | None = None,
    step_tolerance: float = INTERPOLATION_TOLERANCE,
    refinement: Refinement | None = None,
) -> PadPath:
    """The shared path, the same whichever arguments are left out.

    Parameters
    ----------
    pad : Pad or PadFile
        In mm.
    material : Material
        Elastic law of the silicone.
    load : Load
        Of which states have values.
    mesh_size : float
        Length of the edges of elements, mm.
    judged : bool
        Whether the stability of states is judged.
    judged_on : float, optional
        Length of the edges of elements on which it is, mm.
    bodies : RigidBodies, optional
        That keep the pad off.
    step_tolerance : float
        As of :func:`load_path`.
    refinement : Refinement, optional
        Where elements are smaller.

    Returns
    -------
    PadPath
        Which holds what has been solved.
    """
    return shared(pad, material, load, mesh_size, judged, judged_on, bodies, step_tolerance, refinement)


shared = kept(16)(PadPath)
"""The latest paths, by all arguments."""


@kept(8)
def _in_the_way(path: PadPath, triangles: bytes, mirrors: tuple[Mirror, ...]) -> Obstacles:
    return Obstacles(path.mesh, np.frombuffer(triangles).reshape(-1, 3, 3), mirrors)
