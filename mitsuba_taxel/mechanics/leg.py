"""A straight leg of a load path: equilibria at forces from one force onwards in a fixed direction.

The nodes of a leg are solved where the leg alone says, never where somebody asked for a state; between them the
state follows from cubic Hermite interpolation with the tangents du/dF, which one back-solve each gives.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from mitsuba_taxel.errors import ComputationError
from mitsuba_taxel.mechanics.equilibrium import LoadedPad, Rejected

INTERPOLATION_TOLERANCE = 1e-4
"""Largest error of an interpolated displacement, relative to the largest displacement there."""
TICKS = 64
"""A whole step is halved at most to this part."""


@dataclass(frozen=True)
class Node:
    """A solved state on a leg at distance ``s`` (N) from its start, with the tangent d(unknowns)/ds."""

    s: float
    unknowns: np.ndarray
    tangent: np.ndarray
    min_jacobian: float
    residual: float
    iterations: int
    stability_checked: bool


@dataclass(frozen=True)
class Interpolated:
    """Unknowns between two nodes, with the worse of their figures."""

    unknowns: np.ndarray
    min_jacobian: float
    residual: float
    iterations: int
    stability_checked: bool


class Leg:
    """The nodes of a leg solved so far; ``step`` is the distance in N between nodes where nothing asks for less."""

    def __init__(self, origin: np.ndarray, direction: np.ndarray, step: float) -> None:
        self.origin, self.direction, self.step = origin, direction, step
        self.nodes: list[Node] = []

    def force(self, s: float) -> np.ndarray:
        """(3,) force at distance ``s``."""
        return self.origin + s * self.direction

    def reaches(self, s: float) -> bool:
        """Whether a state at distance ``s`` needs no further solve."""
        return bool(self.nodes) and self.nodes[-1].s >= s

    def extend(self, pad: LoadedPad, s: float, start: np.ndarray) -> None:
        """Solve nodes up to the first at or beyond distance ``s``; ``start`` are the unknowns at the leg's origin.

        Each node is tried at the end of the longest interval of step / 2^k that begins at the last one and is
        aligned to its own length; an interval is halved where Newton's method finds no acceptable state, or the
        interpolation would not be accurate. Where a leg goes on thus depends on the last node alone.

        Raises
        ------
        ComputationError
            naming the force that the path does not get beyond.
        """
        if not self.nodes:
            self.nodes.append(self._node(pad, 0.0, start)[0])
        while not self.reaches(s):
            self._append(pad)

    def _append(self, pad: LoadedPad) -> None:
        last, tick = self.nodes[-1], self.step / TICKS
        position = round(last.s / tick)
        length = min(position & -position, TICKS) or TICKS
        while True:
            target = (position + length) * tick
            try:
                node, factor = self._node(pad, target, last.unknowns + (target - last.s) * last.tangent)
                if length == 1 or self._interpolates(pad, last, node, factor):
                    self.nodes.append(node)
                    return
            except Rejected as reason:
                if length == 1:
                    force = ", ".join(f"{component:.4g}" for component in self.force(last.s))
                    raise ComputationError(
                        f"the pad cannot be loaded beyond the force ({force}) N: {reason}."
                    ) from reason
            length //= 2

    def _node(self, pad: LoadedPad, s: float, guess: np.ndarray):
        solution, factor = pad.solve(guess, self.force(s))
        tangent = factor.solve(pad.load(self.direction))
        figures = (solution.min_jacobian, solution.residual, solution.iterations, solution.stability_checked)
        return Node(s, solution.unknowns, tangent, *figures), factor

    def _interpolates(self, pad: LoadedPad, start: Node, end: Node, factor) -> bool:
        """Whether the interpolated midpoint is near equilibrium: one step of Newton's method says how near."""
        middle = 0.5 * (start.s + end.s)
        unknowns = hermite(start, end, middle)
        residual = pad.residual(unknowns, self.force(middle))
        if not np.all(np.isfinite(residual)):
            return False
        displacements = len(pad.assembly.free)
        correction = factor.solve(residual)[:displacements]
        return bool(np.abs(correction).max() <= INTERPOLATION_TOLERANCE * np.abs(unknowns[:displacements]).max())

    def at(self, s: float) -> Interpolated:
        """The state at distance ``s``, which the leg must reach."""
        after = next(index for index, node in enumerate(self.nodes) if node.s >= s)
        end = self.nodes[after]
        start = self.nodes[max(after - 1, 0)]
        return Interpolated(
            hermite(start, end, s),
            min(start.min_jacobian, end.min_jacobian),
            max(start.residual, end.residual),
            end.iterations,
            start.stability_checked and end.stability_checked,
        )

    def arrays(self) -> dict[str, np.ndarray]:
        """The nodes as arrays by name, for the cache."""
        return {field.name: np.array([getattr(node, field.name) for node in self.nodes]) for field in fields(Node)}

    def restore(self, arrays: dict[str, np.ndarray]) -> None:
        """Take the nodes from :meth:`arrays`."""
        names = [field.name for field in fields(Node)]
        columns = [arrays[name] if arrays[name].ndim == 2 else arrays[name].tolist() for name in names]
        self.nodes = [Node(*row) for row in zip(*columns, strict=True)]


def hermite(start: Node, end: Node, s: float) -> np.ndarray:
    """Cubic with the values and tangents of two nodes; exactly the node's values at a node."""
    if s == end.s:
        return end.unknowns
    length = end.s - start.s
    t = (s - start.s) / length
    return (
        (1 + 2 * t) * (1 - t) ** 2 * start.unknowns
        + t * (1 - t) ** 2 * length * start.tangent
        + t**2 * (3 - 2 * t) * end.unknowns
        - t**2 * (1 - t) * length * end.tangent
    )
