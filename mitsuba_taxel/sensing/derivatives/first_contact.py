"""The load at which a pad first touches itself, the board or a package, and its derivatives.

The load path is followed to its end. The walls in contact move with the load and with each parameter, to first order.
By the implicit function theorem, the derivative of the contact load is the change of load that keeps the walls just in
contact.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import mitsuba as mi
import numpy as np

from mitsuba_taxel.backend import activate_variant, in_turn
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.mechanics.contact.barriers.contact_ahead import ContactAhead
from mitsuba_taxel.mechanics.contact.barriers.self_contact import PACKAGE, Contact
from mitsuba_taxel.mechanics.continuation.load_path_ends import LoadPathEnds
from mitsuba_taxel.mechanics.elements.loads import Load
from mitsuba_taxel.sensing.derivatives.instability import Instability
from mitsuba_taxel.sensing.derivatives.linearised_pad import LinearisedPad, Nodal
from mitsuba_taxel.sensing.derivatives.scene_rates import rates
from mitsuba_taxel.sensing.reading.contact_value import FirstContact
from mitsuba_taxel.sensing.scene.clearance import packages
from mitsuba_taxel.sensing.scene.description import Scene
from mitsuba_taxel.sensing.scene.parsing import parser_config
from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads
from mitsuba_taxel.specification.deformable_pad import DeformablePad

BEFORE = 1e-9
"""The state just before the contact is linearised: its distance from the contact, as a fraction of the change of the
load up to the contact."""
NEAR_END = 1e-3
"""The same fraction for a load path that ends by an instability."""
PARALLEL = 1e-9
"""Largest sine of the angle between two loads that count as parallel."""
MOVED = 1e-4
"""Largest movement of a node for a finite difference, relative to the height of the pad."""


@in_turn
def why_no_contact(scene: Scene, along: str) -> str | None:
    """Reason why the first contact of a pad cannot be computed for an increase of a parameter; None if it can.

    Parameters
    ----------
    scene : Scene
        Description of the scene; it need not be loaded.
    along : str
        Name of the parameter of the scene that increases the load.

    Returns
    -------
    str or None
        A sentence that names the parameter and the reason.
    """
    try:
        change = rates(scene, along).load
    except InputError as reason:
        return str(reason)
    if not change.any():
        return f"first contact along {along} cannot be computed: it does not change the load of a pad."
    config = parser_config(activate_variant())
    with scene.files_beside_it():
        nodes = [node.props for node in scene.parsed(config).nodes]
    (pad,) = (DeformablePad.read(props) for props in nodes if props.plugin_name() == DeformablePad.plugin)
    if why := Load.named(pad.load).why_no_first_contact(change):
        return f"first contact along {along} cannot be computed: {why}."
    if not _on_one_path(np.array(pad.load_value), change):
        return (
            f"first contact along {along} cannot be computed: its values do not lie on one load path (a normal load "
            "without tangential components, or tangential components along a fixed direction)."
        )
    return None


def _on_one_path(value: np.ndarray, change: np.ndarray) -> bool:
    """Whether all values of a changing load lie on one load path. A load path applies the normal component first, then
    the tangential components."""
    if len(value) == 1:
        return True
    tangential, tangential_change = np.delete(value, 2), np.delete(change, 2)
    cross = np.outer(tangential, tangential_change) - np.outer(tangential_change, tangential)
    parallel = np.abs(cross).max() <= PARALLEL * np.linalg.norm(tangential) * np.linalg.norm(tangential_change)
    return bool(parallel if not change[2] else not tangential.any() and not tangential_change.any())


@in_turn
def first_contact(
    at: Callable[[float], Scene], along: str, last: float, furthest: float, names: Sequence[str] = ()
) -> FirstContact:
    """Compute the load at which a pad first touches itself, the board or a package, and its derivatives.

    Parameters
    ----------
    at : Callable[[float], Scene]
        Returns the scene for a value of the parameter ``along``.
    along : str
        Name of the increasing parameter: a component of the load, or a parameter that changes the load.
    last, furthest : float
        Values of ``along``: one under which the pad has an equilibrium, and the value up to which the load path is
        followed.
    names : Sequence[str]
        Parameters with respect to which the contact load is differentiated; see :func:`rates`.

    Returns
    -------
    FirstContact
        The value of ``along`` at the contact, its derivatives, and the object that the pad touches. Without contact up
        to ``furthest``, the value is ``furthest`` and no object is named.

    Raises
    ------
    InputError
        if the first contact cannot be computed for this parameter (see :func:`why_no_contact`), or has no derivative
        with respect to one of ``names``.
    ComputationError
        if the pad has no equilibrium at ``last``, or the contact is not found again shortly before the end of the path.
    """
    refused = why_no_contact(at(last), along)
    if refused is not None:
        raise InputError(refused)
    live, change = at(last).load(), rates(at(last), along)
    (pad,) = deformed_pads(live)
    value = np.array(pad.value)
    try:
        pad.state_under((value + (furthest - last) * change.load).tolist(), _package_triangles(live))
    except LoadPathEnds as end:
        assert end.value is not None
        increase = float((end.value - value) @ change.load / (change.load @ change.load))
        if end.contact is None:
            # The message alone: its comparison with a second mesh would double the time of every design.
            return replace(_end_by_instability(at, along, last, increase, names), ended=str(end.args[0]))
        contact, scene = end.contact, at(last + (1 - BEFORE) * increase)
    else:
        return FirstContact(furthest, np.zeros(len(names)), "")
    touching = _Touching(scene, along, furthest > last, contact)
    return FirstContact(touching.value, np.array([touching.rate(name) for name in names]), contact.what)


def _end_by_instability(
    at: Callable[[float], Scene], along: str, last: float, increase: float, names: Sequence[str]
) -> FirstContact:
    """The load at which the pad becomes unstable, extrapolated from an earlier state. If the extrapolated load differs
    from the end of the load path, the result is the end of the path, with unknown derivatives (NaN)."""
    try:
        instability = Instability(at(last + (1 - NEAR_END) * increase), along)
        if abs(instability.value - last - increase) <= 2 * NEAR_END * abs(increase):
            return FirstContact(instability.value, np.array([instability.rate(name) for name in names]), "")
    except (ComputationError, InputError):  # under a tilting plate the mode of an instability is not modelled
        pass
    return FirstContact(last + increase, np.full(len(names), np.nan), "")


class _Touching:
    """The pad of a scene just before a contact, as the parameter ``along`` rises or falls."""

    def __init__(self, scene: Scene, along: str, rises: bool, contact: Contact) -> None:
        self._scene, self._sign = scene, 1.0 if rises else -1.0
        live, change = scene.load(), rates(scene, along)
        (pad,) = deformed_pads(live)
        self._of_package = contact.what == PACKAGE
        self._packages = _package_triangles(live) if self._of_package else None
        self._linear = LinearisedPad(pad, pad.state)
        velocity = self._sign * self._linear.nodal(change).displacement
        self._ahead = ContactAhead(pad.state.mesh, pad.state.displacement, velocity, contact.place)
        self.value = change.value + self._distance(0.0, self._linear.nodal(change), self._packages)

    def rate(self, name: str) -> float:
        """Derivative, with respect to the parameter ``name``, of the load at which the pad first touches something."""
        change = rates(self._scene, name)
        nodal = self._linear.nodal(change)
        scenes = change.scenes() if self._of_package else []
        total = sum(weight * self._distance(0.0, nodal, _package_triangles(live)) for weight, live in scenes)
        largest = float(np.linalg.norm(nodal.displacement + nodal.velocity, axis=1).max())
        if largest:
            step = MOVED * self._ahead.height / largest
            ahead, behind = (self._distance(offset, nodal, self._packages) for offset in (step, -step))
            total += (ahead - behind) / (2 * step)
        return float(total)

    def _distance(self, step: float, nodal: Nodal, bodies: np.ndarray | None) -> float:
        """Change of ``along`` from the present state to the contact, after the nodes have moved by ``step`` with
        another parameter."""
        distance = self._ahead.after(step * nodal.velocity, step * nodal.displacement, bodies)
        if not np.isfinite(distance):
            raise ComputationError(
                "the first contact cannot be computed: the faces that touch first were not found; "
                "try another mesh_size."
            )
        return self._sign * distance


def _package_triangles(live: mi.Scene) -> np.ndarray | None:
    """Corners (K, 3, 3) of the K triangles of all packages of a scene, in mm; None without packages."""
    bodies = packages(live)
    return np.concatenate(bodies) if bodies else None
