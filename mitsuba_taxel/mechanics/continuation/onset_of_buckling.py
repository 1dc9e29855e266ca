"""Onset of buckling: the load at which a pad becomes unstable against displacements that break the symmetry of its
state.

At this load, a branch of equilibria without the symmetry begins. It leaves the symmetric branch along the null vector
of the tangent. The mirrored branch is equally likely. The sign of a moment of the displacement, which does not depend
on the elements, selects one of the two (W. T. Koiter, On the stability of elastic equilibrium, Delft, 1945).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.mechanics.continuation.load_segment import LoadSegment
from mitsuba_taxel.mechanics.continuation.path_nodes import Node
from mitsuba_taxel.mechanics.elements.model import Model
from mitsuba_taxel.mechanics.equilibrium.linearised import Linearised
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import LoadedPad
from mitsuba_taxel.mechanics.equilibrium.solution import UNSTABLE, Rejected
from mitsuba_taxel.mechanics.equilibrium.tangent_blocks import TangentBlock, least_mode, tangent_blocks

CLOSE = 1e-5
"""Tolerance of the load of the onset, relative to a tick, the shortest interval of the segment."""
CONVERGED = 1e-5
"""Change of a mode below which the iteration for the mode ends."""
MOST_TRIED = 20
"""Largest number of steps of the secant method."""
ALIKE = 1e-6
"""Difference of a mode from its mirror image, in mm, that counts as rounding."""


class Onset(NamedTuple):
    """The last stable state before a pad buckles, and the mode (shape of the deflection) in which it then buckles.

    Attributes
    ----------
    node : Node
        The state.
    mode : (3 N + corners,) ndarray
        Displacements in mm and pressures in MPa of the whole pad, with a largest displacement of 1 mm.
    """

    node: Node
    mode: np.ndarray


def find_onset(pad: LoadedPad, segment: LoadSegment) -> Onset | None:
    """Find the load at which the pad buckles, within one tick, the shortest interval, beyond the last solved state of a
    segment.

    In most cases the mode lacks the symmetry of the state. It may have the symmetry of the state if bodies, which the
    pad does not touch yet, have less symmetry than the state.

    Parameters
    ----------
    pad : LoadedPad
        Symmetric part of the pad on which the segment is solved.
    segment : LoadSegment
        A segment that has ended.

    Returns
    -------
    Onset or None
        None if the segment does not end by buckling.
    """
    if segment.mode.size or UNSTABLE not in segment.reason:
        return None
    onset: tuple[Node, np.ndarray] | None = None
    try:
        ahead = segment.beyond(pad, segment.nodes[-1].s + segment.tick)

        # The blocks in which the state ahead is unstable; one block of each pair of mirror images is sufficient.
        seen = set[Model]()
        for block in tangent_blocks(pad):
            if block.model in seen:
                continue
            seen.add(block.model)
            if _tangent(pad, segment, block, ahead).negative <= block.model.numbering.pressures:
                continue

            # The least eigenvalue falls to 0 between the last node and the state ahead. It is almost linear there, and
            # followed by the secant method.
            node, before = ahead, segment.nodes[-1]
            (last, _), (stiffness, mode) = (_least_mode(pad, segment, block, at) for at in (before, node))
            for _ in range(MOST_TRIED if last > 0 > stiffness else 0):
                slope = (last - stiffness) / (node.s - before.s)
                if abs(stiffness) <= CLOSE * slope * segment.tick:
                    break
                before, last = node, stiffness
                node = segment.beyond(pad, before.s + last / slope)
                stiffness, mode = _least_mode(pad, segment, block, node)
            else:
                return None

            # The pad buckles in the block whose eigenvalue vanishes first.
            if onset is None or node.s < onset[0].s:
                onset = node, block.expansion @ mode
    except (Rejected, ComputationError):  # no state ahead, or modes that are too close to separate
        return None
    if onset is None:
        return None

    # The sign of the mode: that of a moment over the pad's volume which no symmetry makes 0.
    node, mode = onset
    displacement = mode[: pad.whole.points.size].reshape(-1, 3)
    x, y = (pad.whole.points[:, :2] / np.abs(pad.whole.points[:, :2]).max()).T
    density = displacement[:, 0] * (1 + x + y) + 0.5 * displacement[:, 1] * (1 + x - y)
    corners = pad.whole.points[pad.whole.tets[:, :4]]
    volume = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6
    at_corners, at_middles = (density[pad.whole.tets[:, nodes]].sum(axis=1) for nodes in (slice(4), slice(4, None)))
    moment = float(volume @ (at_middles / 5 - at_corners / 20))
    return Onset(node, mode / np.copysign(np.abs(displacement).max(), moment))


def _least_mode(pad: LoadedPad, segment: LoadSegment, block: TangentBlock, node: Node) -> tuple[float, np.ndarray]:
    """Smallest eigenvalue of one symmetry block of the tangent matrix at a solved state of a segment, and its
    eigenvector."""
    return least_mode(block, _tangent(pad, segment, block, node), CONVERGED)


def _tangent(pad: LoadedPad, segment: LoadSegment, block: TangentBlock, node: Node) -> Linearised:
    """Factored tangent matrix of one symmetry block, at a solved state of a segment."""
    value = segment.value(node.s)
    on_part = block.model.part.restrict(*pad.split(node.unknowns))
    entries = block.model.evaluate(*on_part, value).entries
    assert entries is not None  # no element is inverted in balance
    return block.tangent(entries, on_part[0], value, pad.contacts)


def is_kept(mode: np.ndarray, mirror: Mirror, image: np.ndarray) -> bool:
    """Whether a buckling mode is its own mirror image; ``image`` gives the mirror image of each node."""
    displacement = mode[: 3 * len(image)].reshape(-1, 3)
    return bool(np.abs(mirror.image(displacement[image]) - displacement).max() <= ALIKE)
