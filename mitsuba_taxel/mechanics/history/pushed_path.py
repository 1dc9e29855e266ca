"""States under forces of an indenter that depend on earlier states: the indenter is moved until its force equals the
given force.

The indenter moves along z, and along the tangential components of its force and of the force of the row before. It is
guided in all other directions. Poses are found by Broyden's method (Math. Comput. 19, 1965), each from the state at the
row before.

On a viscoelastic silicone the force changes linearly between rows. The indenter moves at a constant rate within time
intervals, which are halved until its final position hardly changes.
"""

from __future__ import annotations

import math
import time as clock
from dataclasses import replace
from typing import Any

import numpy as np

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.mechanics.continuation.pad_path import pad_path
from mitsuba_taxel.mechanics.history.time_state import TimeState
from mitsuba_taxel.mechanics.history.timed_path import TimedPath
from mitsuba_taxel.mechanics.history.timed_rows import LoadHistory

FORCE_TOLERANCE = 1e-6
"""Relative tolerance of the force."""
POSE_TOLERANCE = 1e-3
"""Largest relative difference between the displacements of the indenter computed in one time interval and in its two
halves."""
MOST_HALVINGS = 40
"""Largest number of successive halvings of a time interval: a time at which the indenter jumps ends the path."""
MOST_POSES = 30
SLIPS = 0.02
"""Tangential stiffness, relative to a guess of the stiffness along z, below which the indenter slips."""
GIVES_WAY = 0.7
"""First guess of the tangential stiffness, relative to the stiffness along z."""
PARALLEL = 1e-6
"""Fraction of a tangential force perpendicular to another, below which the two count as parallel."""
_DOWN = np.array([0.0, 0.0, -1.0])


class PushedPath(TimedPath):
    """States under forces on an indenter that depend on earlier states: on a viscoelastic silicone, or with friction.
    """

    def _next(self, before: TimeState, rows: LoadHistory) -> TimeState:
        began, at = clock.perf_counter(), self._pushed(before, rows)
        if rows[-1][0] > before.time:
            travel = max(np.linalg.norm(at.load.value), np.linalg.norm(before.load.value))
            at = self._halved(before, rows, at, POSE_TOLERANCE * float(travel), MOST_HALVINGS)
        seconds = before.figures.seconds + clock.perf_counter() - began
        return replace(at, figures=replace(at.figures, seconds=seconds))

    def _halved(self, before: TimeState, rows: LoadHistory, whole: TimeState, allowed: float, left: int) -> TimeState:
        """State of the pad at the end of the last row. The movement of the indenter since the previous row is divided
        into time intervals, which are halved until the final position of the indenter changes by less than ``allowed``
        in mm.
        """
        (time, force), last = rows[-1], rows[-2][1] if len(rows) > 1 else (0.0, 0.0, 0.0)
        middle = 0.5 * (before.time + time), tuple(0.5 * (a + b) for a, b in zip(last, force, strict=True))
        before_last = tuple(rows[:-1])
        halves = LoadHistory((*before_last, middle)), LoadHistory((*before_last, middle, rows[-1]))
        first = self._pushed(before, halves[0])
        second = self._pushed(first, halves[1])
        if np.linalg.norm(second.load.value - whole.load.value) <= allowed:
            # The error of the halves, if errors are proportional to the square of the duration.
            missed = (second.shape.displacement - whole.shape.displacement) / 3
            return replace(second, shape=replace(second.shape, deviation=second.shape.deviation + missed))
        if not left:
            raise ComputationError(
                f"the indenter does not settle between {before.time:.4g} and {time:.4g} s: the load path ends there. "
                "Smaller steps of the force may help."
            )
        first = self._halved(before, halves[0], first, allowed, left - 1)
        return self._halved(first, halves[1], self._pushed(first, halves[1]), allowed, left - 1)

    def _pushed(self, before: TimeState, rows: LoadHistory) -> TimeState:
        """State of the pad at the end of the last row, if the indenter has moved at a constant rate since the previous
        row; raises `ComputationError` if the indenter slips.

        The position of the indenter under the prescribed forces is found by Broyden's method (Math. Comput. 19, 577,
        1965). The matrix that this method updates is the stiffness of the pad along the directions of the forces.
        """
        time, force = rows[-1][0], np.array(rows[-1][1])
        duration = time - before.time
        if not force.any():
            return self._moved(before, rows, np.zeros(3), duration)

        # The indenter may move down, and along the tangential components of both forces. The first guess of the
        # stiffness is that of contact without friction, where the force is proportional to the depth to a power of 1.5.
        directions = np.array([_DOWN, *_sideways(force, np.array(rows[-2][1] if len(rows) > 1 else np.zeros(3)))])
        pad, free = self._pad_for(rows), self._without_friction(force)
        stiffness = 1.5 * abs(force[2] / free[2])
        slope = stiffness * np.diag([1.0, GIVES_WAY, GIVES_WAY][: len(directions)])

        # The first change of the pose: from rest to the position of the indenter without friction.
        state, imbalance, count, change = before, directions @ force, 0, -free[2:]
        if before.load.value.any():
            imbalance = directions @ (force - self._pressed(rows[:-1], before))
            change = np.linalg.solve(slope, imbalance)
        change = np.append(change, np.zeros(len(directions) - len(change)))
        for iteration in range(MOST_POSES):
            # Each pose is reached anew from the row before, in at least as many steps as earlier poses: due to friction
            # the state depends on the path.
            if before.load.value.any() and change.any():
                change = change * min(1.0, pad.step / np.linalg.norm(change))
            pose = state.load.value + change @ directions
            count = max(count, 2 * math.ceil(np.linalg.norm(pose - before.load.value) / pad.step))
            state, last_imbalance = self._moved(before, rows, pose, duration, count), imbalance
            imbalance = directions @ (force - self._pressed(rows, state))
            if np.linalg.norm(imbalance) < FORCE_TOLERANCE * np.linalg.norm(force):
                return state

            # Update of the stiffness, unless the force has also changed with time. An indenter that moves tangentially
            # and hardly gains force slips.
            if change.any() and (iteration or not duration):
                gain, sideways = last_imbalance - imbalance, change[1:]
                mostly = np.linalg.norm(sideways) > abs(change[0])
                slips = gain[1:] @ sideways < SLIPS * stiffness * (sideways @ sideways)
                if mostly and imbalance[1:] @ sideways > 0 and slips:
                    break
                slope = slope + np.outer(gain - slope @ change, change) / (change @ change)
            change = np.linalg.solve(slope, imbalance)
        reached = ", ".join(f"{component:.4g}" for component in np.round(self._pressed(rows, state), 12) + 0.0)
        raise ComputationError(
            f"the indenter slips: the load path ends at force = ({reached}) N. Less tangential force or more "
            "friction is "
            "needed."
        )

    def _without_friction(self, force: np.ndarray) -> np.ndarray:
        """Displacement (3,) in mm of an indenter without friction under the normal component of a force: a first guess.
        """
        path = self._path
        load: Any = path.load
        load = replace(load, indenter=replace(load.indenter, friction=0.0))
        free = pad_path(
            path.pad, path.material, load, path.mesh_size, judged=False, bodies=path.bodies, refinement=path.refinement
        )
        return free.driven_to(-force[2] * _DOWN, None)

    def _pressed(self, rows: LoadHistory, at: TimeState) -> np.ndarray:
        """Force (3,) of the indenter on the pad in N, at a position of the indenter."""
        return -self._board_force(rows, at)


def _sideways(force: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Orthonormal directions (n, 3) of the tangential components of two forces (3,); at most two."""
    _, sizes, ways = np.linalg.svd(np.stack([force, before]) * [1.0, 1.0, 0.0])
    return ways[:2][sizes > PARALLEL * sizes[0]]
