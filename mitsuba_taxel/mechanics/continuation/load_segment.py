"""A straight segment of a load path: equilibria under a load that grows from a value in a fixed direction.

The nodes of a segment depend on the segment alone, not on the requested states; between them the state is interpolated
by cubic Hermite polynomials with the tangents du/dF, from one back-solve each.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import fields, replace
from functools import partial
from typing import Any, ClassVar, Protocol

import numpy as np

from mitsuba_taxel.mechanics.contact.barriers.self_contact import Contact, ContactTest
from mitsuba_taxel.mechanics.continuation.path_nodes import Interpolated, Node, hermite, hermite_rate
from mitsuba_taxel.mechanics.elements.constraints import Numbering
from mitsuba_taxel.mechanics.elements.loads import Load
from mitsuba_taxel.mechanics.equilibrium.linearised import Linearised
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import LoadedPad
from mitsuba_taxel.mechanics.equilibrium.natural_step import TICKS
from mitsuba_taxel.mechanics.equilibrium.solution import Rejected, Solution

INTERPOLATION_TOLERANCE = 1e-5
"""Default for the root mean square error of interpolated displacements, relative to the largest displacement there. The
largest error is that of few nodes beside singular edges, and is larger on smaller elements."""
CONTACT_RESOLUTION = 1e-3 * TICKS
"""Tolerance of the load at the first contact, relative to the smallest fraction of a step."""


class Followed(Protocol):
    """Interface of a pad whose equilibria are computed along a segment of a load path, under growing values of a load
    or of another parameter.

    Methods are those of a `LoadedPad`. A solve also returns the linearised equations, which the segment passes
    unchanged to the next solve.
    """

    solves_between: ClassVar[bool]

    @property
    def numbering(self) -> Numbering: ...

    @property
    def load(self) -> Load: ...

    def split(self, unknowns: np.ndarray) -> tuple[np.ndarray, np.ndarray]: ...

    def towards(self, known: np.ndarray, guess: np.ndarray) -> np.ndarray: ...

    def ticks(self, response: np.ndarray) -> int: ...

    def solve_symmetric(self, start: np.ndarray, value: np.ndarray) -> tuple[Solution, Any]: ...

    def solve_linearised(self, start: np.ndarray, value: np.ndarray) -> tuple[Solution, Any]: ...

    def refuse_unstable(self, unknowns: np.ndarray, entries: np.ndarray, value: np.ndarray) -> None: ...

    def rate(self, linearised: Any, unknowns: np.ndarray, direction: np.ndarray, value: np.ndarray) -> np.ndarray: ...

    def correction(self, linearised: Any, unknowns: np.ndarray, value: np.ndarray) -> np.ndarray | None: ...


Solve = Callable[[np.ndarray, np.ndarray], tuple[Solution, Any]]


class LoadSegment:
    """A straight segment of a load path, with the solved states (nodes) found so far.

    Parameters
    ----------
    step : float
        Default distance between nodes.
    judged : bool
        Whether states must be stable against all displacements, not only those with the symmetry of the load.
    tolerance : float
        Tolerance of the interpolation; see :data:`INTERPOLATION_TOLERANCE`.

    Attributes
    ----------
    ticks : int
        Number of ticks, the shortest intervals between nodes, in a whole step; known after the first node is solved.
    limit, reason : float, str
        Distance beyond which there is no state, and the reason; infinite and empty if unknown.
    place : (3,) ndarray
        Point of contact at the limit, in mm; NaN without contact.
    mode : ndarray
        Mode of :class:`~mitsuba_taxel.mechanics.continuation.onset_of_buckling.Onset`, if the pad buckles at the limit;
        else empty.
    """

    def __init__(
        self,
        origin: np.ndarray,
        direction: np.ndarray,
        step: float,
        judged: bool,
        tolerance: float = INTERPOLATION_TOLERANCE,
    ) -> None:
        self.origin, self.direction, self.step, self.judged = origin, direction, step, judged
        self.tolerance = tolerance
        self.nodes: list[Node] = []
        self.ticks = TICKS
        self.limit, self.reason, self.place = math.inf, "", np.full(3, math.nan)
        self.mode = np.zeros(0)

    def value(self, s: float) -> np.ndarray:
        """Value of the load at distance ``s`` from the start of the segment."""
        return self.origin + s * self.direction

    def reaches(self, s: float) -> bool:
        """Whether the state at distance ``s`` lies between solved states, so that it needs no further solve."""
        return bool(self.nodes) and min(self.nodes[-1].s, self.limit) >= s

    def extend(
        self,
        pad: Followed,
        s: float,
        start: Callable[[], np.ndarray],
        contact: ContactTest,
        far_enough: Callable[[], bool],
    ) -> None:
        """Solve nodes up to the first at or beyond a distance, by a predictor and Newton's method as the corrector.

        The continuation of a segment depends on its nodes alone, so the nodes do not depend on the requested states (E.
        L. Allgower and K. Georg, Introduction to Numerical Continuation Methods, 2003, chapters 2 and 6). A segment
        ends at its `limit`: no stable state is found beyond it, or the pad touches itself or the board.

        Parameters
        ----------
        pad : Followed
        s : float
            Distance along the segment.
        start : Callable[[], ndarray]
            Computes the unknowns at the origin.
        contact : ContactTest
            Test for contacts of the deformed pad.
        far_enough : Callable[[], bool]
            Whether no more nodes are needed; called between intervals.
        """
        self.begin(pad, start)
        solve = pad.solve_symmetric if self.judged else pad.solve_linearised
        while not self.reaches(s) and math.isinf(self.limit) and not far_enough():
            # The step size is the largest step / 2^k of which the position of the last node is a multiple. If an
            # interval of twice the last length would not have been interpolated accurately, the last length is kept.
            last, tick = self.nodes[-1], self.tick
            position = round(last.s / tick)
            length = min(position & -position, self.ticks) or TICKS
            if len(self.nodes) > 2 and not pad.solves_between:
                start_node, middle, _ = self.nodes[-3:]
                if middle.s == 0.5 * (start_node.s + last.s):
                    difference = hermite(start_node, last, middle.s) - middle.unknowns
                    if not self._is_little(difference, middle.unknowns, pad):
                        length = min(length, round((last.s - middle.s) / tick))

            nodes: list[Node] = []
            while not nodes:
                target, shortest = (position + length) * tick, length == 1
                try:
                    # Predict, by the last interval's cubic up to its length, else linearly, and correct; then test
                    # whether a cubic between both nodes is accurate.
                    guess = last.unknowns + (target - last.s) * last.tangent
                    if len(self.nodes) > 1 and not pad.solves_between:
                        if target - last.s <= last.s - self.nodes[-2].s:
                            guess = hermite(self.nodes[-2], last, target)
                    end, linearised = self._node(pad, solve, target, pad.towards(last.unknowns, guess))
                    fits = shortest or self._interpolates(pad, last, end, linearised)
                    entries = linearised.entries
                    del linearised  # frees memory that large factorisations occupy

                    # The state must be stable against displacements without the symmetry of the load, too.
                    if self.judged:
                        began = time.perf_counter()
                        pad.refuse_unstable(end.unknowns, entries, self.value(target))
                        end = replace(end, seconds=end.seconds + time.perf_counter() - began)

                    # Where the cubic is not accurate, further nodes are solved midway.
                    nodes = self._between(pad, last, end, fits)
                except Rejected as rejection:
                    # A step without an acceptable state is halved; the segment ends where even the shortest step has
                    # none.
                    if shortest:
                        self.limit, self.reason = last.s, f"cannot be loaded further ({rejection})"
                        return
                    length //= 2

            # The first contact ends the segment.
            for node in nodes:
                self._add(node, pad, contact)
                if math.isfinite(self.limit):
                    break

    def begin(self, pad: Followed, start: Callable[[], np.ndarray]) -> None:
        """Solve the first state of the segment, unless it is known. The rate of change there determines the tick, the
        shortest interval between solved states.

        Parameters
        ----------
        pad : Followed
            The pad.
        start : Callable[[], ndarray]
            Computes the unknowns at the origin.
        """
        if self.nodes or math.isfinite(self.limit):
            return
        try:  # at rest, or between states of another segment
            first = self._node(pad, pad.solve_linearised, 0.0, start())[0]
        except Rejected as rejection:
            self.limit, self.reason = 0.0, f"cannot be loaded further ({rejection})"
            return
        self.nodes.append(first)
        self.ticks = pad.ticks(self.step * first.tangent)

    @property
    def tick(self) -> float:
        """Length of a tick, the shortest interval between two nodes, in N, mm or MPa."""
        return self.step / self.ticks

    def _between(self, pad: Followed, start: Node, end: Node, fits: bool) -> list[Node]:
        """Solved states (nodes) from ``start``, exclusive, to ``end``. Further states are solved between them until the
        cubic interpolation ``fits``."""
        if fits:
            return [end]
        s = 0.5 * (start.s + end.s)
        middle, linearised = self._node(pad, pad.solve_linearised, s, hermite(start, end, s))
        halves = (start, middle), (middle, end)
        finest = end.s - start.s < 2.5 * self.tick
        fit = [finest or self._interpolates(pad, *half, linearised) for half in halves]
        del linearised
        return [node for half, fits in zip(halves, fit, strict=True) for node in self._between(pad, *half, fits)]

    def _node(self, pad: Followed, solve: Solve, s: float, guess: np.ndarray) -> tuple[Node, Any]:
        began = time.perf_counter()
        solution, linearised = solve(guess, self.value(s))
        tangent = pad.rate(linearised, solution.unknowns, self.direction, self.value(s))
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
        return node, linearised

    def _interpolates(self, pad: Followed, start: Node, end: Node, linearised: Any) -> bool:
        """Whether the interpolated state halfway between two solved states is close to equilibrium: the displacement of
        one Newton step there must be within the tolerance."""
        if pad.solves_between:
            return True
        middle = 0.5 * (start.s + end.s)
        unknowns = hermite(start, end, middle)
        correction = pad.correction(linearised, unknowns, self.value(middle))
        if correction is None:
            return False
        return self._is_little(correction, unknowns, pad)

    def _is_little(self, correction: np.ndarray, unknowns: np.ndarray, pad: Followed) -> bool:
        """Whether a correction of the unknowns is within the tolerance of the interpolation. Only displacements, which
        come first among the unknowns, are compared."""
        displacements = pad.numbering.displacements
        error = math.sqrt(np.square(correction[:displacements]).mean())
        return bool(error <= self.tolerance * np.abs(unknowns[:displacements]).max())

    def _add(self, node: Node, pad: Followed, contact: ContactTest) -> None:
        """Append a solved state, and end the segment at a contact before it. If the test for contacts is interrupted,
        the segment stays as it was: a state that is not tested would be stored, and hide the first contact.
        """
        end = self.limit, self.reason, self.place
        try:
            self.limit = math.inf
            self.nodes.append(node)
            self._look_for_contact(pad, contact)
        except BaseException:
            self.nodes = [known for known in self.nodes if known is not node]
            self.limit, self.reason, self.place = end
            raise

    def _look_for_contact(self, pad: Followed, test: ContactTest) -> None:
        """If the pad is in contact at the last solved state, find the first contact after the previous solved state,
        and end the segment there.
        """
        if len(self.nodes) < 2 or math.isfinite(self.limit):
            return
        find = test.find_package if pad.load.self_contact else test.find
        first_contact = self.first_contact(pad, len(self.nodes) - 1, find)
        if first_contact:
            self.limit, contact = first_contact
            self.reason, self.place = f"touches {contact.what}", np.array(contact.place)

    def end_buckling(self, pad: Followed, contact: ContactTest, node: Node, mode: np.ndarray) -> None:
        """End the segment where the pad becomes unstable and buckles in a ``mode``.

        Parameters
        ----------
        node : Node
            Last stable state. It is not used if the pad touches something at a smaller load.
        """
        self._add(node, pad, contact)
        if math.isinf(self.limit):
            self.limit, self.mode = node.s, mode

    def first_contact(
        self, pad: Followed, index: int, find: Callable[[np.ndarray], Contact | None]
    ) -> tuple[float, Contact] | None:
        """First contact of the pad between the solved state ``index`` and the state before it. Returns the longest
        distance along the segment without contact, and the contact; None if there is none.

        Parameters
        ----------
        index : int
            Index of the node; the first has none before it.
        find : Callable[[ndarray], Contact | None]
            Finds a contact at a displacement (N, 3) of the pad, like :meth:`ContactTest.find`.
        """
        first_contact = find(pad.split(self.nodes[index].unknowns)[0])
        if first_contact is None:
            return None
        start, end = self.nodes[index - 1], self.nodes[index]
        free, touching = start.s, end.s
        while touching - free > CONTACT_RESOLUTION * self.tick:
            middle = 0.5 * (free + touching)
            contact = find(pad.split(hermite(start, end, middle))[0])
            free, touching, first_contact = (
                (middle, touching, first_contact) if contact is None else (free, middle, contact)
            )
        return free, first_contact

    def at(self, pad: LoadedPad, s: float) -> Interpolated:
        """The interpolated state at a distance along the segment, which must have been extended this far.

        Parameters
        ----------
        pad : LoadedPad
            Symmetric part of the pad on which the segment is solved.
        s : float
            Load as distance along the segment, in N, mm or MPa.

        Returns
        -------
        Interpolated
            The state, with its residual, smallest volume ratio and solution time.

        Raises
        ------
        Rejected
            if an element is inverted.
        """
        start, end = self.interval(s)
        if end.s == s:
            return Interpolated.of(end, self.seconds_to(s))
        checked = start.stability_checked and end.stability_checked
        return Interpolated.of(pad.figures_at(hermite(start, end, s), self.value(s), 0, checked), self.seconds_to(s))

    def unknowns_at(self, s: float) -> np.ndarray:
        """The unknowns at the distance ``s``; the segment must have been extended this far."""
        return hermite(*self.interval(s), s)

    def seconds_to(self, s: float) -> float:
        """Time, in s, of solving all states up to the first one at or beyond the distance ``s``."""
        return sum(node.seconds for node in self.nodes[: self._first_from(s) + 1])

    def solved(self, pad: LoadedPad, s: float, near: Callable[[Node], Linearised] | None = None) -> Node:
        """The equilibrium at a distance along the segment, which must have been extended this far.

        Parameters
        ----------
        pad : LoadedPad
            Symmetric part of the pad on which the segment is solved.
        s : float
            Load as distance along the segment, in N, mm or MPa.
        near : Callable[[Node], Linearised], optional
            Returns the pad linearised at a node. With it, a state between stable nodes is solved with the factor of
            the closer node, and its stability is not tested again.

        Returns
        -------
        Node
            The equilibrium.

        Raises
        ------
        Rejected
            if there is none.
        """
        start, end = self.interval(s)
        if end.s == s:
            return end
        guess = pad.towards(start.unknowns, hermite(start, end, s))
        solve: Solve = pad.solve_linearised
        if near is not None and start.stability_checked and end.stability_checked:
            closer = start if s - start.s < end.s - s else end
            solve = partial(pad.solve_between, near=partial(near, closer))
        try:
            return self._node(pad, solve, s, guess)[0]
        except Rejected:  # cubics are inaccurate in contact
            return self._node(pad, pad.solve_linearised, s, end.unknowns)[0]

    def rate(self, s: float) -> np.ndarray:
        """Derivative of the unknowns with respect to the distance at ``s``; the segment must have been extended this
        far."""
        return hermite_rate(*self.interval(s), s)

    def beyond(self, pad: LoadedPad, s: float) -> Node:
        """The equilibrium at a distance slightly larger than that of the last solved state.

        Parameters
        ----------
        pad : LoadedPad
            Symmetric part of the pad on which the segment is solved.
        s : float
            Load as distance along the segment, in N, mm or MPa.

        Returns
        -------
        Node
            The equilibrium, which may be unstable.

        Raises
        ------
        Rejected
            if there is none.
        """
        last = self.nodes[-1]
        return self._node(pad, pad.equilibrium_with_tangent, s, last.unknowns + (s - last.s) * last.tangent)[0]

    def _first_from(self, s: float) -> int:
        return next(index for index, node in enumerate(self.nodes) if node.s >= s)

    def interval(self, s: float) -> tuple[Node, Node]:
        """The two solved states on both sides of the distance ``s``; the segment must have been extended this far."""
        after = self._first_from(s)
        return self.nodes[max(after - 1, 0)], self.nodes[after]

    def arrays(self) -> dict[str, np.ndarray]:
        """The solved states and the limit of the segment as arrays by name, for the cache on disk."""
        nodes = {field.name: np.array([getattr(node, field.name) for node in self.nodes]) for field in fields(Node)}
        end = {"limit": np.array(self.limit), "reason": np.array(self.reason), "place": self.place, "mode": self.mode}
        return nodes | end | {"ticks": np.array(self.ticks)}

    def restore(self, arrays: dict[str, np.ndarray]) -> None:
        """Restore the solved states and the limit of the segment from :meth:`arrays`."""
        self.limit, self.reason, self.place = float(arrays["limit"]), str(arrays["reason"]), arrays["place"]
        self.mode, self.ticks = arrays["mode"], int(arrays["ticks"])
        names = [field.name for field in fields(Node)]
        columns = [arrays[name] if arrays[name].ndim == 2 else arrays[name].tolist() for name in names]
        self.nodes = [Node(**dict(zip(names, row, strict=True))) for row in zip(*columns, strict=True)]
