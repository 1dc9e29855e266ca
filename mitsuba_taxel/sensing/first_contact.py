"""The load at which a pad first touches itself, the board or a package, and its derivatives.

The path is followed to its end. There the walls that touch move with the load and with each parameter, to first order,
and the load changes such that they still just touch: the derivative of an implicit function, of a test that only tells
whether there is contact.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import mitsuba as mi
import numpy as np

from mitsuba_taxel.backend import in_turn
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.mechanics.contact.contact_ahead import ContactAhead
from mitsuba_taxel.mechanics.contact.self_contact import PACKAGE, Contact
from mitsuba_taxel.mechanics.path.load_path_ends import LoadPathEnds
from mitsuba_taxel.sensing.clearance import packages
from mitsuba_taxel.sensing.linearised_pad import LinearisedPad, Nodal
from mitsuba_taxel.sensing.scene import Scene
from mitsuba_taxel.sensing.scene_pads import deformed_pads
from mitsuba_taxel.sensing.scene_rates import rates

BEFORE = 1e-9
"""How far before the end of the path the walls are looked at, relative to the way there."""
BESIDE = 1e-6
"""Distance of the end of a path from the line of loads that is due to rounding, relative to the load."""
MOVED = 1e-4
"""Largest movement of a node for a difference, relative to the height of the pad."""


@dataclass(frozen=True, eq=False)
class FirstContact:
    """A first contact.

    Attributes
    ----------
    value : float
        Of the parameter that changes with the load; if there is no contact, the furthest one asked for.
    rates : (P,) ndarray
        Its derivatives by other parameters; 0 if there is no contact.
    """

    value: float
    rates: np.ndarray


@in_turn
def first_contact(
    at: Callable[[float], Scene], along: str, last: float, furthest: float, names: Sequence[str] = ()
) -> FirstContact:
    """The first contact of the pad of a scene, ``at`` some value of its parameter ``along``.

    Parameters
    ----------
    last, furthest : float
        A value that the pad bears, and that up to which its path is followed.
    names : Sequence[str]
        Parameters by which derivatives are wanted; see :func:`rates`.

    Raises
    ------
    InputError
        if ``along`` does not load a pad, or not along one path, or there is no derivative.
    ComputationError
        if the path ends without contact, or the contact is not found again.
    """
    live, change = at(last).load(), rates(at(last), along)
    if not change.load.any():
        raise InputError(f"first contact along {along} cannot be told: it is no load of a pad.")
    (pad,) = deformed_pads(live)
    value = np.array(pad.value)
    try:
        pad.state_under((value + (furthest - last) * change.load).tolist(), _in_the_way(live))
    except LoadPathEnds as end:
        if end.contact is None or end.value is None:
            raise
        further = float((end.value - value) @ change.load / (change.load @ change.load))
        beside = end.value - value - further * change.load
        if end.load != pad.load or np.linalg.norm(beside) > BESIDE * np.linalg.norm(end.value):
            raise InputError(f"first contact along {along} cannot be told: its values are not one load path.") from None
        contact, ends = end.contact, at(last + (1 - BEFORE) * further)
    else:
        return FirstContact(furthest, np.zeros(len(names)))
    found = _Touching(ends, along, furthest > last, contact)
    return FirstContact(found.value, np.array([found.rate(name) for name in names]))


class _Touching:
    """The pad of a scene that is about to touch something, as ``along`` rises or falls."""

    def __init__(self, scene: Scene, along: str, rises: bool, contact: Contact) -> None:
        self._scene, self._way = scene, 1.0 if rises else -1.0
        live, change = scene.load(), rates(scene, along)
        (pad,) = deformed_pads(live)
        self._of_package = contact.what == PACKAGE
        self._packages = _in_the_way(live) if self._of_package else None
        self._linear = LinearisedPad(pad, pad.state)
        onwards = self._way * self._linear.nodal(change).displacement
        self._ahead = ContactAhead(pad.state.mesh, pad.state.displacement, onwards, contact.place)
        self.value = change.value + self._shift(0.0, self._linear.nodal(change), self._packages)

    def rate(self, name: str) -> float:
        """The derivative of the value by a parameter."""
        change = rates(self._scene, name)
        nodal = self._linear.nodal(change)
        others = change.scenes() if self._of_package else []
        total = sum(weight * self._shift(0.0, nodal, _in_the_way(live)) for weight, live in others)
        largest = float(np.linalg.norm(nodal.displacement + nodal.velocity, axis=1).max())
        if largest:
            step = MOVED * self._ahead.height / largest
            ahead, behind = (self._shift(sign * step, nodal, self._packages) for sign in (1, -1))
            total += (ahead - behind) / (2 * step)
        return float(total)

    def _shift(self, step: float, nodal: Nodal, bodies: np.ndarray | None) -> float:
        """Of the value, if nodes move on by a step between bodies."""
        further = self._ahead.after(step * nodal.velocity, step * nodal.displacement, bodies)
        if not np.isfinite(further):
            raise ComputationError("the first contact cannot be told: what touches was not found again.")
        return self._way * further


def _in_the_way(live: mi.Scene) -> np.ndarray | None:
    """(K, 3, 3) triangles of all packages."""
    bodies = packages(live)
    return np.concatenate(bodies) if bodies else None
