"""Depth of an indenter under a force, along the path segment on which it is pushed down."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.mechanics import cache
from mitsuba_taxel.mechanics.continuation.load_segment import LoadSegment
from mitsuba_taxel.mechanics.continuation.path_nodes import Node
from mitsuba_taxel.mechanics.continuation.path_segments import PathSegments
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import LoadedPad
from mitsuba_taxel.mechanics.equilibrium.natural_step import TICKS

DEPTH_TOLERANCE = 1e-10
"""Relative tolerance of the depth."""
_TINY = 1e-300
DOWN = np.array([0.0, 0.0, -1.0])
"""Direction in which an indenter presses."""


def force_at(pad: LoadedPad, segment: LoadSegment, node: Node) -> float:
    """Downward force of the indenter on the whole pad at a node.

    Parameters
    ----------
    pad : LoadedPad
        The part of the pad that the segment needs.
    segment : LoadSegment
        The segment.
    node : Node
        A solved state of the segment.

    Returns
    -------
    float
        In N.
    """
    body = pad.model.indentation
    contact_state = body.contact_state(pad.numbering.split(node.unknowns)[0], segment.value(node.s))
    return -pad.part.copies * float(contact_state.force[2])


def stiffness_at(pad: LoadedPad, segment: LoadSegment, node: Node) -> float:
    """Derivative of the force with respect to the depth at a node.

    Parameters
    ----------
    pad : LoadedPad
        The part of the pad that the segment needs.
    segment : LoadSegment
        The segment.
    node : Node
        A solved state of the segment.

    Returns
    -------
    float
        In N/mm.
    """
    body = pad.model.indentation
    contact_state = body.contact_state(pad.numbering.split(node.unknowns)[0], segment.value(node.s))
    rate = body.force_rate(contact_state, DOWN, pad.numbering.split(node.tangent)[0])
    return -pad.part.copies * float(rate[2])


def depth_of(segments: PathSegments, value: np.ndarray, height: float, follow: Callable[[np.ndarray], object]) -> float:
    """Depth of an indenter under a force, from disk or by following the segment along z.

    Contact forces grow with the depth to a power of about 1.5, so that their power of 2/3 is nearly linear.

    Parameters
    ----------
    segments : PathSegments
        Segments of the path on which the indenter is moved.
    value : (3,) ndarray
        Force in N, along -z.
    height : float
        Height of the pad in mm, which is the largest depth.
    follow : Callable[[ndarray], object]
        Solves the path up to a displacement (3,) of the indenter in mm.

    Returns
    -------
    float
        In mm.

    Raises
    ------
    InputError
        if the indenter touches nothing.
    """
    from scipy.optimize import brentq  # imported here, because only indenters need it

    segment, pad = segments.towards(np.zeros(3), DOWN), segments.pad_for(np.zeros(3), DOWN)
    name, force = cache.key("depth", segments.name_of(segment), value.tolist()), -value[2]
    arrays = cache.load(name)
    if arrays is None:
        # Follow the segment in whole steps until a node carries the force.
        while not segment.nodes or force_at(pad, segment, segment.nodes[-1]) < force:
            solved_to = segment.nodes[-1].s if segment.nodes else 0.0
            if solved_to > height:
                raise InputError("the indenter touches nothing, so no force can act on it: place it over the pad.")
            follow((math.floor(solved_to / segment.step + 0.5 / TICKS) + 1) * segment.step * DOWN)

        # The depth between this node and the one before.
        after = next(k for k, node in enumerate(segment.nodes) if force_at(pad, segment, node) >= force)

        def excess(s: float) -> float:
            return force_at(pad, segment, segment.solved(pad, s)) ** (2 / 3) - force ** (2 / 3)

        ends = segment.nodes[after - 1].s, segment.nodes[after].s
        arrays = {"depth": np.array(brentq(excess, *ends, xtol=_TINY, rtol=DEPTH_TOLERANCE))}
        cache.store(name, arrays)
    return float(arrays["depth"])
