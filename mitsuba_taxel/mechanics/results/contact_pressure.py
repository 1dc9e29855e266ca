"""Pressure of an indenter over the surface of a deformed pad.

The contact pressures of the solution scatter from node to node. Patch recovery smooths them: the value at a node is
that of the parabola that fits best around it, on the faces that share a node with its own (O. C. Zienkiewicz and J. Z.
Zhu, Int. J. Numer. Methods Eng. 33, 1992).
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse

from mitsuba_taxel.mechanics.contact.indentation import ContactState, Indentation
from mitsuba_taxel.mechanics.continuation.state import State

TINY = np.finfo(float).tiny


def contact_pressure(state: State) -> np.ndarray:
    """Pressure of an indenter on each node of a deformed pad.

    The result is a smooth field with the same integral as the contact pressures of the solution. It is linear between
    the nodes of faces that are cut into four. Where top and outside meet, it is the larger of both pressures.

    Parameters
    ----------
    state : State
        The deformed pad.

    Returns
    -------
    (N,) ndarray
        Pressures in MPa; 0 at nodes that the indenter does not touch.
    """
    pressure = np.zeros(len(state.mesh.points))
    if state.load.indenter is not None:
        body, contact_state = indentation_of(state)
        np.maximum.at(pressure, body.node, smooth_pressure(body, contact_state.pressure))
    return pressure


def indentation_of(state: State) -> tuple[Indentation, ContactState]:
    """The contact of an indenter with the pad in a state: the indenter, and the gaps, pressures and forces.

    Parameters
    ----------
    state : State
        State under an indenter.

    Returns
    -------
    body : Indentation
        The indenter above the mesh.
    contact_state : ContactState
        Gaps, pressures and tractions.
    """
    assert state.load.indenter is not None and state.indenter_moved is not None
    body = Indentation(state.mesh, state.load.indenter, state.material.youngs_modulus)
    return body, body.contact_state(state.displacement, state.indenter_moved, traction=body.at_nodes(state.traction))


def smooth_pressure(body: Indentation, pressure: np.ndarray) -> np.ndarray:
    """Smooth contact pressures by patch recovery.

    Parameters
    ----------
    body : Indentation
        The indenter above the mesh.
    pressure : (m,) ndarray
        Pressures at the m contact nodes of ``body``, MPa.

    Returns
    -------
    (m,) ndarray
        Smoothed pressures in MPa. They are not negative, 0 where ``pressure`` is 0, and have the same integral over the
        undeformed faces.
    """
    # Two nodes are neighbours if they are on the same face, or on two faces that share a node.
    faces, nodes = np.repeat(np.arange(len(body.faces)), 6), body.numbers.ravel()
    of_faces = sparse.coo_array((np.ones(len(nodes)), (faces, nodes)), shape=(len(body.faces), len(body.node))).tocsr()
    same_face = of_faces.T @ of_faces
    active = np.flatnonzero(pressure > 0)
    neighbours = sparse.csr_array(same_face @ same_face)[active][:, active]

    # Fit a parabola around each node, along the two axes over which its neighbours spread most.
    smoothed = np.zeros(len(pressure))
    for node, start, end in zip(active, neighbours.indptr[:-1], neighbours.indptr[1:], strict=True):
        patch = active[neighbours.indices[start:end]]
        offsets = body.points[patch] - body.points[node]
        axes = np.linalg.svd(offsets - offsets.mean(axis=0))[2][:2]
        x, y = axes @ offsets.T / max(np.abs(offsets).max(), TINY)
        terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1)
        weight = np.sqrt(body.area[patch])
        value = np.linalg.lstsq(terms * weight[:, None], weight * pressure[patch], rcond=None)[0][0]
        smoothed[node] = max(value, 0.0)
    return smoothed * (body.area @ pressure / max(body.area @ smoothed, TINY))
