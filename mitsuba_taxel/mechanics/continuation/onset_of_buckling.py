"""Where a pad buckles: the load at which it becomes unstable against displacements without the symmetry of its state.

There another branch of equilibria begins, without that symmetry, and leaves the symmetric one in the direction of the
null vector of the tangent. The mirrored branch is as likely: one is chosen by a moment of the displacement that does
not depend on the elements (W. T. Koiter, On the stability of elastic equilibrium, Delft, 1945).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.continuation.load_segment import LoadSegment
from mitsuba_taxel.mechanics.continuation.path_nodes import Node
from mitsuba_taxel.mechanics.elements.model import Model
from mitsuba_taxel.mechanics.equilibrium.linearised import Linearised
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import LoadedPad
from mitsuba_taxel.mechanics.equilibrium.solution import UNSTABLE, Rejected
from mitsuba_taxel.mechanics.equilibrium.tangent_blocks import TangentBlock, least_mode, tangent_blocks

CLOSE = 1e-5
"""Of the load of the onset, relative to a tick."""
TOLD = 1e-5
"""Change of a mode that ends the iteration for it."""
MOST_TRIED = 20
ALIKE = 1e-6
"""Difference of a mode from its mirror image, in mm, that is due to rounding."""


class Onset(NamedTuple):
    """The last stable state of a segment, and the ``mode`` (3 N + corners,) in which the pad then buckles: mm, and MPa,
    of the whole pad, with a largest displacement of 1 mm."""

    node: Node
    mode: np.ndarray


def find_onset(pad: LoadedPad, segment: LoadSegment) -> Onset | None:
    """Where a pad buckles within a tick beyond the last node of a segment; None if it does not end so.

    By symmetry in most cases, the mode lacks that of the state. Bodies that nothing touches yet may leave the pad less
    symmetry than its state has, so that the mode has it.
    """
    if segment.mode.size or UNSTABLE not in segment.reason:
        return None
    last = segment.nodes[-1]
    try:
        ahead = segment.beyond(pad, last.s + segment.tick)
        crossings = [_Crossing(pad, segment, block, ahead) for block in _unstable(pad, segment, ahead)]
        first = min(crossings, key=lambda crossing: crossing.node.s, default=None)
    except (Rejected, ComputationError):  # there is no state beyond, or modes cannot be told apart
        return None
    if first is None:
        return None
    mode = first.block.expansion @ first.mode
    displacement = mode[: pad.whole.points.size].reshape(-1, 3)
    return Onset(first.node, mode / np.copysign(np.abs(displacement).max(), _moment(pad.whole, displacement)))


def _unstable(pad: LoadedPad, segment: LoadSegment, node: Node) -> Iterator[TangentBlock]:
    """The blocks in which a state is unstable, one of two that mirrors map on each other."""
    seen = set[Model]()
    for block in tangent_blocks(pad):
        if block.model not in seen:
            seen.add(block.model)
            if _tangent(pad, segment, block, node).negative > block.model.numbering.pressures:
                yield block


class _Crossing:
    """Where the least eigenvalue of a block falls to 0, between the last node of a segment and one ``ahead``.

    It is followed by the secant method, as it is almost linear there.
    """

    def __init__(self, pad: LoadedPad, segment: LoadSegment, block: TangentBlock, ahead: Node) -> None:
        self.block, before, self.node = block, segment.nodes[-1], ahead
        (was, _), (stiffness, self.mode) = (self._least(pad, segment, node) for node in (before, ahead))
        for _ in range(MOST_TRIED if was > 0 > stiffness else 0):
            slope = (was - stiffness) / (self.node.s - before.s)
            if abs(stiffness) <= CLOSE * slope * segment.tick:
                return
            before, was = self.node, stiffness
            self.node = segment.beyond(pad, before.s + was / slope)
            stiffness, self.mode = self._least(pad, segment, self.node)
        raise Rejected("its least stiff mode is not found")

    def _least(self, pad: LoadedPad, segment: LoadSegment, node: Node) -> tuple[float, np.ndarray]:
        return least_mode(self.block, _tangent(pad, segment, self.block, node), TOLD)


def _tangent(pad: LoadedPad, segment: LoadSegment, block: TangentBlock, node: Node) -> Linearised:
    """The factored tangent of a block at a node."""
    value = segment.value(node.s)
    on_part = block.model.part.restrict(*pad.split(node.unknowns))
    entries = block.model.evaluate(*on_part, value).entries
    assert entries is not None  # no element is inverted in balance
    return block.tangent(entries, on_part[0], value, pad.contacts)


def is_kept(mode: np.ndarray, mirror: Mirror, image: np.ndarray) -> bool:
    """Whether a mode of an `Onset` is its own mirror image; ``image`` is that of the nodes."""
    displacement = mode[: 3 * len(image)].reshape(-1, 3)
    return bool(np.abs(mirror.image(displacement[image]) - displacement).max() <= ALIKE)


def _moment(mesh: VolumeMesh, displacement: np.ndarray) -> float:
    """mm⁴, a moment over the pad's volume that has a sign for displacements (N, 3) of each symmetry."""
    x, y = (mesh.points[:, :2] / np.abs(mesh.points[:, :2]).max()).T
    density = displacement[:, 0] * (1 + x + y) + 0.5 * displacement[:, 1] * (1 + x - y)
    corners = mesh.points[mesh.tets[:, :4]]
    volume = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6
    at_corners, at_middles = (density[mesh.tets[:, nodes]].sum(axis=1) for nodes in (slice(4), slice(4, None)))
    return float(volume @ (at_middles / 5 - at_corners / 20))
