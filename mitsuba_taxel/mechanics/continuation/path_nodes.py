"""Solved states on a segment of a load path, and the cubic interpolation between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mitsuba_taxel.mechanics.equilibrium.solution import Solution


@dataclass(frozen=True)
class Node:
    """A solved state on a segment of a load path, at the distance ``s`` (N, mm or MPa) from its start.

    ``tangent`` is the derivative of the unknowns with respect to ``s``, and ``seconds`` the time that the solution
    took.
    """

    s: float
    unknowns: np.ndarray
    tangent: np.ndarray
    min_jacobian: float
    residual: float
    iterations: int
    stability_checked: bool
    seconds: float


@dataclass(frozen=True)
class Interpolated:
    """A state on a segment of a load path, either solved or interpolated between two solved states (nodes).

    It holds the residual, the smallest volume ratio, and the time in s that the solution of all nodes up to it took.
    ``iterations`` is 0 for an interpolated state. ``stability_checked`` states whether the stability was tested, for
    this state or for the nodes on both sides.
    """

    unknowns: np.ndarray
    min_jacobian: float
    residual: float
    iterations: int
    stability_checked: bool
    seconds: float

    @classmethod
    def of(cls, solution: Solution | Node, seconds: float) -> Interpolated:
        """Convert a solution of Newton's method, and the seconds that it took, to this class."""
        return cls(
            unknowns=solution.unknowns,
            min_jacobian=solution.min_jacobian,
            residual=solution.residual,
            iterations=solution.iterations,
            stability_checked=solution.stability_checked,
            seconds=seconds,
        )


def hermite(start: Node, end: Node, s: float) -> np.ndarray:
    """Cubic interpolation with the values and tangents of two nodes.

    Parameters
    ----------
    start : Node
        Node at the start of the interval.
    end : Node
        Node at the end of the interval.
    s : float
        Load as distance along the segment, in N, mm or MPa.

    Returns
    -------
    (unknowns,) ndarray
        The unknowns; at a node, exactly those of the node.
    """
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


def hermite_rate(start: Node, end: Node, s: float) -> np.ndarray:
    """Derivative of :func:`hermite` with respect to the distance ``s``.

    Parameters
    ----------
    start : Node
        Node at the start of the interval.
    end : Node
        Node at the end of the interval.
    s : float
        Load as distance along the segment, in N, mm or MPa.

    Returns
    -------
    (unknowns,) ndarray
        The derivative; at a node, exactly the tangent of the node.
    """
    if s == end.s:
        return end.tangent
    length = end.s - start.s
    t = (s - start.s) / length
    return (
        6 * t * (1 - t) / length * (end.unknowns - start.unknowns)
        + (1 - t) * (1 - 3 * t) * start.tangent
        + t * (3 * t - 2) * end.tangent
    )
