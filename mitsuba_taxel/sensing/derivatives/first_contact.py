"""The load at which a pad first touches itself, the board or a package, and its derivatives.

The path is followed to its end. There the walls that touch move with the load and with each parameter, to first order,
and the load changes such that they still just touch: the derivative of an implicit function, of a test that only tells
whether there is contact.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import mitsuba as mi
import numpy as np

from mitsuba_taxel.backend import activate_variant, in_turn
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.mechanics.contact.contact_ahead import ContactAhead
from mitsuba_taxel.mechanics.contact.self_contact import PACKAGE, Contact
from mitsuba_taxel.mechanics.continuation.load_path_ends import LoadPathEnds
from mitsuba_taxel.mechanics.elements.loads import Load
from mitsuba_taxel.sensing.derivatives.instability import Instability
from mitsuba_taxel.sensing.derivatives.linearised_pad import LinearisedPad, Nodal
from mitsuba_taxel.sensing.derivatives.scene_rates import rates
from mitsuba_taxel.sensing.reading.contact_value import FirstContact
from mitsuba_taxel.sensing.scene.clearance import packages
from mitsuba_taxel.sensing.scene.description import Scene, parser_config
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads
from mitsuba_taxel.specification.deformable_pad import DeformablePad

BEFORE = 1e-9
"""How far before the end of the path the walls are looked at, relative to the way there."""
NEAR_END = 1e-3
"""The same, where the path ends otherwise."""
PARALLEL = 1e-9
"""Sine of the angle between two loads below which it is due to rounding."""
MOVED = 1e-4
"""Largest movement of a node for a difference, relative to the height of the pad."""


@in_turn
def why_no_contact(scene: Scene, along: str) -> str | None:
    """Why no first contact can be told along a parameter of a scene, in words; None if it can."""
    try:
        change = rates(scene, along).load
    except InputError as reason:
        return str(reason)
    if not change.any():
        return f"first contact along {along} cannot be told: it is no load of a pad."
    config = parser_config(activate_variant())
    with scene.files_beside_it():
        nodes = [node.props for node in scene.parsed(config).nodes]
    (pad,) = (DeformablePad.read(props) for props in nodes if props.plugin_name() == DeformablePad.plugin)
    if why := Load.named(pad.load).why_no_first_contact(change):
        return f"first contact along {along} cannot be told: {why}."
    if not _on_one_path(np.array(pad.load_value), change):
        return f"first contact along {along} cannot be told: its values are not one load path."
    return None


def _on_one_path(value: np.ndarray, change: np.ndarray) -> bool:
    """Whether a load that changes stays on one path: the normal component comes first, then the tangential ones."""
    if len(value) == 1:
        return True
    aside, turned = value[:2], change[:2]
    across = abs(aside[0] * turned[1] - aside[1] * turned[0])
    parallel = across <= PARALLEL * np.linalg.norm(aside) * np.linalg.norm(turned)
    return bool(parallel if not change[2] else not aside.any() and not turned.any())


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
        if there is none, as :func:`why_no_contact` says, or no derivative.
    ComputationError
        if the pad does not bear the last value, or the contact is not found again.
    """
    refused = why_no_contact(at(last), along)
    if refused is not None:
        raise InputError(refused)
    live, change = at(last).load(), rates(at(last), along)
    (pad,) = deformed_pads(live)
    value = np.array(pad.value)
    try:
        pad.state_under((value + (furthest - last) * change.load).tolist(), _in_the_way(live))
    except LoadPathEnds as end:
        assert end.value is not None
        further = float((end.value - value) @ change.load / (change.load @ change.load))
        if end.contact is None:
            return replace(_before_it_gives_way(at, along, last, further, names), ended=str(end))
        contact, ends = end.contact, at(last + (1 - BEFORE) * further)
    else:
        return FirstContact(furthest, np.zeros(len(names)), "")
    found = _Touching(ends, along, furthest > last, contact)
    return FirstContact(found.value, np.array([found.rate(name) for name in names]), contact.what)


def _before_it_gives_way(
    at: Callable[[float], Scene], along: str, last: float, further: float, names: Sequence[str]
) -> FirstContact:
    """Where a path ends as the pad becomes unstable, as from a state before; if that does not tell the end, the last
    load of which there is a state, with unknown derivatives."""
    try:
        found = Instability(at(last + (1 - NEAR_END) * further), along)
        if abs(found.value - last - further) <= 2 * NEAR_END * abs(further):
            return FirstContact(found.value, np.array([found.rate(name) for name in names]), "")
    except ComputationError:
        pass
    return FirstContact(last + further, np.full(len(names), np.nan), "")


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
