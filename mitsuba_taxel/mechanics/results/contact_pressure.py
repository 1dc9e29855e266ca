"""What an indenter presses with, over the surface of a deformed pad."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.mechanics.contact.indentation import Indentation, Pressing
from mitsuba_taxel.mechanics.contact.smooth_pressure import smooth_pressure
from mitsuba_taxel.mechanics.continuation.state import State


def contact_pressure(state: State) -> np.ndarray:
    """Pressure of an indenter on each node of a deformed pad.

    A smooth field with the integral of the pressures that hold the indenter, which scatter from node to node. It is
    linear between the nodes of faces that are cut into four; where top and outside meet, it is the larger one.

    Parameters
    ----------
    state : State
        The deformed pad.

    Returns
    -------
    (N,) ndarray
        In MPa, 0 where nothing touches the node.
    """
    found = np.zeros(len(state.mesh.points))
    if state.load.indenter is not None:
        body, pressing = indentation_of(state)
        np.maximum.at(found, body.node, smooth_pressure(body, pressing.pressure))
    return found


def indentation_of(state: State) -> tuple[Indentation, Pressing]:
    """The indenter of a state, and how it presses.

    Parameters
    ----------
    state : State
        Under an indenter.

    Returns
    -------
    body : Indentation
        The indenter above the mesh.
    pressing : Pressing
        Gaps, pressures and tractions.
    """
    assert state.load.indenter is not None and state.indenter_moved is not None
    body = Indentation(state.mesh, state.load.indenter, state.material.youngs_modulus)
    return body, body.pressing(state.displacement, state.indenter_moved, traction=body.at_nodes(state.traction))
