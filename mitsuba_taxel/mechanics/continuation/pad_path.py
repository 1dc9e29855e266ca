"""The load path of a pad: its mesh, its states, and their rates."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cached_property, partial

import numpy as np

from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.contact.barriers.bodies import RigidBodies
from mitsuba_taxel.mechanics.contact.indentation import Indentation
from mitsuba_taxel.mechanics.contact.resolution import LARGEST, refuse_unresolved
from mitsuba_taxel.mechanics.continuation.load_path_ends import Obstacles, refuse_at_rest
from mitsuba_taxel.mechanics.continuation.load_segment import INTERPOLATION_TOLERANCE
from mitsuba_taxel.mechanics.continuation.path_states import PathStates
from mitsuba_taxel.mechanics.continuation.state import State
from mitsuba_taxel.mechanics.elements.loads import Load
from mitsuba_taxel.mechanics.elements.nodal_forces import board_force, glued_force
from mitsuba_taxel.mechanics.equilibrium.feet import where_linear
from mitsuba_taxel.mechanics.local_mesh import Refinement
from mitsuba_taxel.mechanics.materials.laws import Material
from mitsuba_taxel.pads.any_pad import AnyPad


class PadPath(PathStates):
    """The states of one pad of one material under one kind of load, cached on disk and in memory.

    Parameters
    ----------
    pad, material, load, mesh_size, bodies, step_tolerance, refinement
        See :class:`PathProblem`.
    judged : bool
        Whether the stability of states against all displacements is tested. It is not tested on reference paths, where
        an instability does not affect the comparison.
    judged_on : float or None
        Element size, in mm, of another path on which stability is tested instead. Up to the end of that path, states of
        this path count as stable; beyond it, they are tested themselves.
    """

    def __init__(
        self,
        pad: AnyPad,
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
        settings = bodies, step_tolerance, refinement
        super().__init__(pad, material, load, mesh_size, judged, *settings, by_tangent=judged_on is not None)
        self.judge = None if judged_on is None else self._like(judged_on)

    @cached_property
    def mesh(self) -> VolumeMesh:
        """Finite-element mesh of the undeformed pad."""
        return super().mesh if self.load.driven is None else self.driven.mesh

    @cached_property
    def driven(self) -> PadPath:
        """The load path of the same pad when the displacement of the indenter is prescribed. A state under a given
        force of the indenter is found on this path, by a search for the depth.
        """
        assert self.load.driven is not None
        arguments = self.pad, self.material, self.load.driven, self.mesh_size, self.judged
        return pad_path(*arguments, None, self.bodies, self.step_tolerance, self._refinement)

    def state(self, value: np.ndarray, obstacles: np.ndarray | None = None) -> State:
        """The deformed pad under a value of the load.

        Parameters
        ----------
        value : (3,) or (1,) ndarray
            Value of the load, in N, mm or MPa.
        obstacles : (K, 3, 3) ndarray, optional
            In mm, corners of the triangles of closed surfaces that the pad must not touch on the path.

        Returns
        -------
        State
            State without its estimated error.

        Raises
        ------
        InputError
            if the load cannot have the value, or the undeformed pad touches itself or an obstacle.
        LoadPathEnds
            if the path does not lead there.
        """
        bearing = self.bearing(value)
        if bearing is not self:
            return bearing.state(value, obstacles)
        if self.bodies is not None:
            refuse_at_rest(self.contact.at_rest)
        self.load.check(value)
        value = np.array(value)
        turned, used = self.turned(value)
        in_the_way = None
        if obstacles is not None:
            refuse_at_rest(self.own_contact_at_rest)
            in_the_way = _in_the_way(self, np.asarray(obstacles, dtype=float).tobytes(), tuple(used))
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
        """The load path on which the state under a value of the load is solved. It is this path, unless the pad becomes
        unstable on the coarser elements of ``judged_on``: then it is the same path with stability tested on its own
        elements.
        """
        if self.judge is None:
            return self
        _ = self.judge.mesh  # first, because the mesher makes one mesh at a time
        with ThreadPoolExecutor(1) as pool:  # meanwhile the pad is meshed for this path
            meshed = pool.submit(getattr, self, "mesh")
            bears = self.judge.bears(value)
        meshed.result()
        return self if bears else self._like(self.mesh_size)

    def like(self, load: Load | None = None, refinement: Refinement | None = None) -> PadPath:
        """The load path of the same pad under another load, or with a mesh that is refined differently under the
        indenter.

        Parameters
        ----------
        load : Load, optional
            The other load.
        refinement : Refinement, optional
            The other refinement.

        Returns
        -------
        PadPath
            The path; callers with equal arguments share one object.
        """
        judged_on = None if self.judge is None else self.judge.mesh_size
        judged, settings = self.judged or self.judge is not None, (self.bodies, self.step_tolerance)
        which, where = load or self.load, refinement or self._refinement
        return pad_path(self.pad, self.material, which, self.mesh_size, judged, judged_on, *settings, where)

    def on_elements(self, mesh_size: float, judged: bool = False) -> PadPath:
        """The load path of the same pad and load on elements of another size, also under an indenter.

        Parameters
        ----------
        mesh_size : float
            Size of the elements in mm.
        judged : bool
            Whether the stability of its states against all displacements is tested.

        Returns
        -------
        PadPath
            The path; callers with equal arguments share one object.
        """
        if self.load.indenter is None:
            return self._like(mesh_size, judged)
        relative_size = self.refinement.relative_size * mesh_size / self.mesh_size
        return self._like(mesh_size, judged, replace(self.refinement, relative_size=relative_size))

    def _like(self, mesh_size: float, judged: bool = True, refinement: Refinement | None = None) -> PadPath:
        settings = None, self.bodies, self.step_tolerance, refinement or self._refinement
        return pad_path(self.pad, self.material, self.load, mesh_size, judged, *settings)

    def bears(self, value: np.ndarray) -> bool:
        """Whether the pad reaches the load ``value`` without buckling."""
        try:
            return self.state(value).buckled_at is None
        except ComputationError:
            return False

    def force(
        self, value: np.ndarray, displacement: np.ndarray, pressure: np.ndarray, fraction: float = 1
    ) -> np.ndarray:
        """Force of the pad in a solved state: on the plate or indenter if its displacement is prescribed, otherwise on
        the board.

        Parameters
        ----------
        value : (c,) ndarray
            Value of the load, in N, mm or MPa.
        displacement : (N, 3) ndarray
            Displacement of the nodes, mm.
        pressure : (corners,) ndarray
            Pressure at each corner of the elements in MPa, positive in tension.
        fraction : float
            Reach of the barriers, relative to the default. See :class:`SelfTouchingPad`.

        Returns
        -------
        (3,) ndarray
            Force in N.
        """
        if not self.load.self_contact:
            return board_force(self.mesh, self.material, displacement, pressure)
        if self.load.moved_indenter is not None:
            body = Indentation(self.mesh, self.load.moved_indenter, self.material.youngs_modulus)
            return body.contact_state(displacement, value).force
        linear = where_linear(self.mesh, self.load, fraction)
        return glued_force(self.mesh, self.material, displacement, pressure, region="top", linear=linear)

    def refuse_unresolved(self, value: np.ndarray, displacement: np.ndarray | None, largest: float = LARGEST) -> None:
        """Refuse elements that are too large for the contact with an indenter in a solved state.

        Parameters
        ----------
        value : (3,) ndarray
            Value of the load.
        displacement : (N, 3) ndarray or None
            Displacement in mm; None before the state is solved, when only the size of the elements is tested.
        largest : float
            Allowed size of faces, relative to half the width of the contact.

        Raises
        ------
        ComputationError
            if elements are too large.
        """
        size = min(self.mesh_size, self.pad.default_mesh_size)  # larger elements are refined to this size under a body
        if self.load.indenter is None or (self.load.driven is not None and displacement is None):
            return
        indenter_moved = value if self.load.driven is None else self.driven_to(value, None)
        refuse_unresolved(self.mesh, self.load.indenter, displacement, indenter_moved, size, largest)


def pad_path(
    pad: AnyPad,
    material: Material,
    load: Load,
    mesh_size: float,
    judged: bool = True,
    judged_on: float | None = None,
    bodies: RigidBodies | None = None,
    step_tolerance: float = INTERPOLATION_TOLERANCE,
    refinement: Refinement | None = None,
) -> PadPath:
    """The load path of a pad under a kind of load. All callers with equal arguments get the same object.

    Parameters
    ----------
    pad : AnyPad
        The pad, with lengths in mm.
    material : Material
        Elastic law of the silicone.
    load : Load
        Kind of load.
    mesh_size : float
        Length of the edges of elements, mm.
    judged : bool
        Whether the stability of states against all displacements is tested.
    judged_on : float, optional
        Length of the edges of elements on which stability is tested, mm.
    bodies : RigidBodies, optional
        Rigid bodies that the pad must not penetrate.
    step_tolerance : float
        Allowed root mean square error of interpolated displacements of an elastic pad, relative to the largest
        displacement of the state. See :func:`load_path`.
    refinement : Refinement, optional
        Region under an indenter where elements are smaller.

    Returns
    -------
    PadPath
        Path, which contains the states that have been solved.
    """
    return shared(pad, material, load, mesh_size, judged, judged_on, bodies, step_tolerance, refinement)


shared = kept(16)(PadPath)
"""Cache of the latest paths, by all arguments."""


@kept(8)
def _in_the_way(path: PadPath, triangles: bytes, mirrors: tuple[Mirror, ...]) -> Obstacles:
    return Obstacles(path.mesh, np.frombuffer(triangles).reshape(-1, 3, 3), mirrors)
