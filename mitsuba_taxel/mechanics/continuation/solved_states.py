"""States of a load path that are solved at the requested loads, instead of interpolated between the solved states
(nodes) of the path."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from mitsuba_taxel.base.caches import clear_caches, kept
from mitsuba_taxel.mechanics import cache
from mitsuba_taxel.mechanics.continuation.buckled_branch import BuckledBranch
from mitsuba_taxel.mechanics.continuation.load_segment import LoadSegment
from mitsuba_taxel.mechanics.continuation.path_nodes import Interpolated, Node
from mitsuba_taxel.mechanics.continuation.path_problem import PathProblem
from mitsuba_taxel.mechanics.continuation.path_segments import PathSegments
from mitsuba_taxel.mechanics.continuation.pushed_states import PushedStates
from mitsuba_taxel.mechanics.equilibrium.linearised import Linearised
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import LoadedPad
from mitsuba_taxel.mechanics.equilibrium.solution import Rejected

FURTHEST_BESIDE = 1.25
"""Tangential distance from a normal force, in steps of the path, up to which the tangent under the normal force is
tried. For one of the paper's domes the iteration converges up to this distance, for none up to 1.5."""


class SolvedStates:
    """States of a load path that were solved at requested loads, in memory and on disk.

    States under purely normal forces that are not on the path are kept too.

    Parameters
    ----------
    path : PathProblem
        The pad, its material and its load.
    segments : PathSegments
        Segments of the load path that have been followed.
    state_under : Callable[[ndarray], tuple[ndarray, ndarray]] or None
        Displacement and pressure under a force (3,) along z; None where all segments are followed.
    """

    def __init__(
        self,
        path: PathProblem,
        segments: PathSegments,
        state_under: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]] | None,
    ) -> None:
        self._path, self._segments, self._state_under = path, segments, state_under
        self._at: dict[LoadSegment, dict[float, Node]] = {}
        self._beside: dict[LoadSegment, dict[float, Interpolated | None]] = {}
        self._rates_beside: dict[LoadSegment, dict[float, np.ndarray]] = {}

    def at(self, segment: LoadSegment, s: float, pad: LoadedPad) -> Node:
        """The equilibrium at a distance along a segment of the load path. It is solved, because cubic interpolation is
        inaccurate in contact.

        Parameters
        ----------
        segment : LoadSegment
            The segment.
        s : float
            Load as distance along the segment, in N, mm or MPa.
        pad : LoadedPad
            Symmetric part of the pad on which the segment is solved.

        Returns
        -------
        Node
            The equilibrium.
        """
        solved = self._at.setdefault(segment, {})
        if s not in solved:
            name = cache.key("state", self._segments.name_of(segment), s)
            with cache.alone(name):
                arrays = cache.load(name)
                if arrays is None:
                    solved[s] = segment.solved(pad, s, partial(self._tangent_at, segment, pad))
                    cache.store(name, cache.arrays_of(solved[s]))
                else:
                    solved[s] = Node(**cache.values_of(arrays))
        return solved[s]

    def _tangent_at(self, segment: LoadSegment, pad: LoadedPad, node: Node) -> Linearised:
        """Tangent matrix of the pad at a solved state (node) of the load path. It depends on the node alone, so states
        that are solved with it do not depend on the order of requests.
        """
        return _linearised_at(pad, node.unknowns.tobytes(), segment.value(node.s).tobytes())

    def keep(self, segment: LoadSegment, node: Node) -> None:
        """Keep a solved state of a segment, so that :meth:`at` returns it.

        Parameters
        ----------
        segment : LoadSegment
            The segment.
        node : Node
            An equilibrium at a distance that the segment reaches.
        """
        solved = self._at.setdefault(segment, {})
        if node.s not in solved:
            solved[node.s] = node
            cache.store(cache.key("state", self._segments.name_of(segment), node.s), cache.arrays_of(node))

    def state(self, part: LoadSegment | BuckledBranch, s: float, pad: LoadedPad) -> Interpolated:
        """The state at a distance along a solved segment, or along the branch after buckling: solved, or interpolated
        within the tolerance.

        Parameters
        ----------
        part : LoadSegment or BuckledBranch
            The curve.
        s : float
            Load as distance along the segment, in N, mm or MPa.
        pad : LoadedPad
            Symmetric part of the pad on which the segment is solved.

        Returns
        -------
        Interpolated
            The state, with its residual, smallest volume ratio and solution time.

        Raises
        ------
        Rejected
            if there is none.
        """
        if pad.solves_between and isinstance(part, LoadSegment):
            return Interpolated.of(self.at(part, s, pad), part.seconds_to(s))
        return part.at(pad, s)

    def beside(self, segment: LoadSegment, s: float, pad: LoadedPad) -> Interpolated | None:
        """State under a normal and a small tangential force, solved with the tangent stiffness under the normal force
        alone.

        Returns None if this iteration does not converge, or if the pad then touches itself or the board.

        Parameters
        ----------
        segment : LoadSegment
            The segment.
        s : float
            Load as distance along the segment, in N, mm or MPa.
        pad : LoadedPad
            Symmetric part of the pad on which the segment is solved.

        Returns
        -------
        Interpolated or None
            None if the segment must be followed.
        """
        small, load = segment.direction[:-1].any() and s <= FURTHEST_BESIDE * segment.step, self._path.load
        if self._state_under is None or not small or load.self_contact or load.gives_displacement or load.tilts:
            return None
        solved = self._beside.setdefault(segment, {})
        if s not in solved:
            name = cache.key("pushed", self._segments.name_of(segment), s)
            with cache.alone(name):
                arrays = cache.load(name)
                if arrays is None:
                    solved[s] = self._solved_beside(segment, s, pad)
                    cache.store(name, cache.arrays_of(solved[s]) if solved[s] else {})
                else:
                    solved[s] = Interpolated(**cache.values_of(arrays)) if arrays else None
        return solved[s]

    def _solved_beside(self, segment: LoadSegment, s: float, pad: LoadedPad) -> Interpolated | None:
        try:
            state = _pushed_from(self, tuple(segment.origin)).state(pad, segment, s)
        except Rejected:
            return None
        return None if self._path.contact.find(pad.split(state.unknowns)[0]) else state

    def rate_beside(self, segment: LoadSegment, s: float, pad: LoadedPad, unknowns: np.ndarray) -> np.ndarray:
        """Derivative of the unknowns of a state from :meth:`beside` with respect to the tangential force, which is the
        distance along the segment.

        Parameters
        ----------
        segment : LoadSegment
            The segment.
        s : float
            Load as distance along the segment, in N, mm or MPa.
        pad : LoadedPad
            Symmetric part of the pad on which the segment is solved.
        unknowns : (unknowns,) ndarray
            Unknowns of the pad.

        Returns
        -------
        (unknowns,) ndarray
            Derivative per N.
        """
        rates = self._rates_beside.setdefault(segment, {})
        if s not in rates:
            name = cache.key("pushed rate", self._segments.name_of(segment), s)
            with cache.alone(name):
                arrays = cache.load(name)
                if arrays is None:
                    rates[s] = _pushed_from(self, tuple(segment.origin)).rate(pad, segment, s, unknowns)
                    cache.store(name, {"rate": rates[s]})
                else:
                    rates[s] = arrays["rate"]
        return rates[s]

    def pushed_from(self, normal: np.ndarray) -> PushedStates:
        """Solver for states under a given normal force (3,) in N and an additional small tangential force."""
        assert self._state_under is not None
        displacement, pressure = self._state_under(normal)
        pad = self._segments.pad_for(np.zeros(3), normal if normal.any() else np.array([0.0, 0.0, -1.0]))
        return PushedStates(pad, pad.gather(displacement, pressure), normal)


@kept(1)  # factors take memory
def _linearised_at(pad: LoadedPad, unknowns: bytes, value: bytes) -> Linearised:
    return pad.tangent_at(np.frombuffer(unknowns), np.frombuffer(value), None)


def release_factor() -> None:
    """Free the memory of the factored tangent matrix that was used last."""
    clear_caches(_linearised_at)


@kept(1)  # factors take memory
def _pushed_from(states: SolvedStates, normal: tuple[float, ...]) -> PushedStates:
    return states.pushed_from(np.array(normal))
