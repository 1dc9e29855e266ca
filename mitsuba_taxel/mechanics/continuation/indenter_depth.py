"""Depth of an indenter under a force, along the path segment on which it is pushed down."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.mechanics.continuation.load_segment import LoadSegment
from mitsuba_taxel.mechanics.continuation.path_nodes import Node
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import LoadedPad

DEPTH_TOLERANCE = 1e-10
"""Relative tolerance of the depth."""
_TINY = 1e-300
_DOWN = np.array([0.0, 0.0, -1.0])


def force_at(pad: LoadedPad, segment: LoadSegment, node: Node) -> float:
    """Downward force of the indenter on the whole pad in N."""
    body = pad.model.indentation
    contact_state = body.contact_state(pad.numbering.split(node.unknowns)[0], segment.value(node.s))
    return -pad.part.copies * float(contact_state.force[2])


def stiffness_at(pad: LoadedPad, segment: LoadSegment, node: Node) -> float:
    """Derivative of that force by the depth in N/mm."""
    body = pad.model.indentation
    contact_state = body.contact_state(pad.numbering.split(node.unknowns)[0], segment.value(node.s))
    rate = body.force_rate(contact_state, _DOWN, pad.numbering.split(node.tangent)[0])
    return -pad.part.copies * float(rate[2])


def depth_under(pad: LoadedPad, segment: LoadSegment, force: float) -> float:
    """The depth in mm at which the indenter exerts a force in N, which it reaches by the last node.

    Contact forces grow with the depth to a power of about 1.5, so that their power of 2/3 is nearly linear.
    """
    from scipy.optimize import brentq  # here, as only indenters need it

    after = next(k for k, node in enumerate(segment.nodes) if force_at(pad, segment, node) >= force)

    def off(s: float) -> float:
        return force_at(pad, segment, segment.solved(pad, s)) ** (2 / 3) - force ** (2 / 3)

    ends = segment.nodes[after - 1].s, segment.nodes[after].s
    return float(brentq(off, *ends, xtol=_TINY, rtol=DEPTH_TOLERANCE))
