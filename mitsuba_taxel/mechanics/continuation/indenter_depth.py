"""Depth of an indenter under a force, along the path segment on which it is pushed down."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.mechanics import cache
from mitsuba_taxel.mechanics.continuation.load_segment import LoadSegment
from mitsuba_taxel.mechanics.continuation.path_nodes import Node, hermite
from mitsuba_taxel.mechanics.continuation.path_segments import PathSegments
from mitsuba_taxel.mechanics.equilibrium.indented_pad import IndentedPad
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import LoadedPad
from mitsuba_taxel.mechanics.equilibrium.natural_step import TICKS
from mitsuba_taxel.mechanics.equilibrium.solution import Rejected

DEPTH_TOLERANCE = 1e-10
"""Relative tolerance of the depth."""
ROUNDING = 1e-7
"""Relative change of the depth below which the depth is also accepted, if the change no longer falls to half: forces
are only as accurate as the equilibrium of states."""
HERTZ = 2 / 3
"""Exponent p of Hertz's contact of a sphere and a half-space, where the depth is proportional to force^p."""
MOST_SOLVES = 30
DOWN = np.array([0.0, 0.0, -1.0])
"""Direction in which an indenter presses."""


def force_at(pad: LoadedPad, segment: LoadSegment, node: Node) -> float:
    """Downward force of the indenter on the whole pad in one of the solved states (nodes) of a load path.

    Parameters
    ----------
    pad : LoadedPad
        Symmetric part of the pad on which the segment is solved.
    segment : LoadSegment
        The segment.
    node : Node
        A solved state of the segment.

    Returns
    -------
    float
        Force in N.
    """
    body = pad.model.indentation
    contact_state = body.contact_state(pad.numbering.split(node.unknowns)[0], segment.value(node.s))
    return -pad.part.copies * float(contact_state.force[2])


def stiffness_at(pad: LoadedPad, segment: LoadSegment, node: Node) -> float:
    """Derivative of the indenter's downward force with respect to its depth, in one of the solved states of a load
    path.

    Parameters
    ----------
    pad : LoadedPad
        Symmetric part of the pad on which the segment is solved.
    segment : LoadSegment
        The segment.
    node : Node
        A solved state of the segment.

    Returns
    -------
    float
        Stiffness in N/mm.
    """
    return _force_and_stiffness(pad, segment.value(node.s), node.unknowns, node.tangent)[1]


def _force_and_stiffness(
    pad: LoadedPad, moved: np.ndarray, unknowns: np.ndarray, tangent: np.ndarray
) -> tuple[float, float]:
    """Downward force in N of the indenter on the whole pad at a displacement (3,), and its derivative in N/mm."""
    body = pad.model.indentation
    contact_state = body.contact_state(pad.numbering.split(unknowns)[0], moved)
    rate = body.force_rate(contact_state, DOWN, pad.numbering.split(tangent)[0])
    return -pad.part.copies * float(contact_state.force[2]), -pad.part.copies * float(rate[2])


def depth_of(
    segments: PathSegments,
    value: np.ndarray,
    height: float,
    follow: Callable[[np.ndarray], object],
    keep: Callable[[LoadSegment, Node], None],
) -> float:
    """Depth of an indenter under a given force. It is read from disk if it is cached there; otherwise the indenter is
    pushed down along z until it exerts this force.

    Parameters
    ----------
    segments : PathSegments
        Segments of the path on which the indenter is moved.
    value : (3,) ndarray
        Force in N, along -z.
    height : float
        Height of the pad in mm, which is the largest depth.
    follow : Callable[[ndarray], object]
        Function that solves the path up to a displacement (3,) of the indenter in mm.
    keep : Callable[[LoadSegment, Node], None]
        Stores the state at the found depth.

    Returns
    -------
    float
        Depth in mm.

    Raises
    ------
    InputError
        if the indenter touches nothing.
    """
    segment, pad = segments.towards(np.zeros(3), DOWN), segments.pad_for(np.zeros(3), DOWN)
    name, force = depth_name(segments, value), -value[2]
    arrays = cache.load(name)
    if arrays is None:
        # Follow the segment in whole steps until a node carries the force.
        while not segment.nodes or force_at(pad, segment, segment.nodes[-1]) < force:
            solved_to = segment.nodes[-1].s if segment.nodes else 0.0
            if solved_to > height:
                raise InputError("the indenter touches nothing, so no force can act on it: place it over the pad.")
            follow((math.floor(solved_to / segment.step + 0.5 / TICKS) + 1) * segment.step * DOWN)

        # The depth lies between this node and the previous node. The first guess is linear in the force to the power of
        # 2/3.
        after = next(k for k, node in enumerate(segment.nodes) if force_at(pad, segment, node) >= force)
        start, end = segment.nodes[after - 1 : after + 1]
        powers = [max(force_at(pad, segment, node) / force, 0.0) ** HERTZ - 1 for node in (start, end)]
        s = start.s - powers[0] / (powers[1] - powers[0]) * (end.s - start.s)
        node = end
        if s < end.s:
            assert isinstance(pad, IndentedPad)  # loads by an indenter
            guess = pad.towards(start.unknowns, hermite(start, end, s))
            node = under_force(pad, force, s, guess, (start.s, end.s), end.unknowns)
        keep(segment, node)
        arrays = {"depth": np.array(node.s)}
        cache.store(name, arrays)
    return float(arrays["depth"])


def depth_name(segments: PathSegments, value: np.ndarray) -> str:
    """File name under which the depth of the indenter under a force (3,) is cached on disk."""
    return cache.key("depth", segments.name_of(segments.towards(np.zeros(3), DOWN)), value.tolist())


def under_force(
    pad: IndentedPad,
    force: float,
    s: float,
    guess: np.ndarray,
    ends: tuple[float, float],
    other_guess: np.ndarray | None = None,
) -> Node:
    """State in which an indenter presses with a given force, solved from a state at a similar depth.

    The depth is found by Newton's method. Contact forces grow with the depth to a power of about 1.5, so the force to
    the power of 2/3 is nearly linear in the depth. Each solve starts from the previous state, extrapolated along its
    tangent, and uses the factored matrix of that state again.

    Parameters
    ----------
    pad : IndentedPad
        The part of the pad that the segment along z needs.
    force : float
        Downward force in N.
    s : float
        Depth at which the first state is solved, mm.
    guess : (unknowns,) ndarray
        Approximate unknowns of the first state.
    ends : (float, float)
        Two depths in mm, with a lower and with a higher force.
    other_guess : (unknowns,) ndarray, optional
        Unknowns from which the first state is solved if ``guess`` fails.

    Returns
    -------
    Node
        The state at the depth, with its tangent.

    Raises
    ------
    Rejected
        if no acceptable state or no depth is found.
    """
    (low, high), last_change, nearby = ends, math.inf, None
    for _ in range(MOST_SOLVES):
        # The state at this depth, and its rate.
        began, moved = time.perf_counter(), s * DOWN
        try:
            solution, nearby = pad.solve_nearby(guess, moved, nearby)
        except Rejected:
            if other_guess is None:
                raise
            solution, nearby = pad.solve_nearby(other_guess, moved)
        other_guess = None
        tangent = pad.rate(nearby.linearised, solution.unknowns, DOWN, moved)
        node = Node(
            s=s,
            unknowns=solution.unknowns,
            tangent=tangent,
            min_jacobian=solution.min_jacobian,
            residual=solution.residual,
            iterations=solution.iterations,
            stability_checked=solution.stability_checked,
            seconds=time.perf_counter() - began,
        )

        # The next depth, by the slope of the force to the power of 2/3.
        pressed, stiffness = _force_and_stiffness(pad, moved, solution.unknowns, tangent)
        low, high = (s, high) if pressed < force else (low, s)
        middle = 0.5 * (low + high) if math.isfinite(high) else 2 * s
        change = middle - s
        if pressed > 0 and stiffness > 0:
            change = ((force / pressed) ** HERTZ - 1) / HERTZ * pressed / stiffness
        size = abs(change)
        if size <= DEPTH_TOLERANCE * s or (size <= ROUNDING * s and size > 0.5 * last_change):
            return node
        if not low < s + change < high:
            change = middle - s
        guess = pad.towards(solution.unknowns, solution.unknowns + change * tangent)
        s, last_change = s + change, size
    raise Rejected(f"no depth under the force is found in {MOST_SOLVES} solves")
