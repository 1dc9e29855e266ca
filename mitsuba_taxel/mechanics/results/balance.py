"""Balance of the board's reaction and the applied load: a check of a state that is independent of the solver.

Internal forces of the elements are assembled without constraints. In equilibrium they equal those of the load at the
nodes of its surface, those of the board at the nodes glued to it, those of contact, and zero elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mitsuba_taxel.mechanics.contact.barriers.contacts import Contacts
from mitsuba_taxel.mechanics.continuation.state import State
from mitsuba_taxel.mechanics.elements.nodal_forces import internal_forces, nodes_of
from mitsuba_taxel.mechanics.elements.pressure import pressure_forces
from mitsuba_taxel.mechanics.equilibrium.feet import couple_held, where_linear
from mitsuba_taxel.mechanics.results.contact_pressure import indentation_of
from mitsuba_taxel.pads.regions import REGIONS


@dataclass(frozen=True, eq=False)
class Reactions:
    """The board's force on a pad and the load's, with their moments about the origin.

    Of a pad that is held by packages, which stand on the board, their force is part of the board's.

    Attributes
    ----------
    force : (3,) ndarray
        In N, of the board on the pad.
    moment : (3,) ndarray
        N mm, of the board's forces on the deformed pad, and what holds its feet against large rotations where their law
        is linear.
    applied_force : (3,) ndarray
        In N; for the displacement of a plate or an indenter, its force.
    applied_moment : (3,) ndarray
        N mm, on the deformed pad; including that which keeps a bonded plate from rotating.
    size : float
        Largest distance from the origin in the undeformed pad, in mm.
    kept : float
        In N, sum of the magnitudes of the board's nodal forces, for a viscoelastic silicone, which may have residual
        stress without a load; else 0.
    state : State
        The deformed pad.
    """

    force: np.ndarray
    moment: np.ndarray
    applied_force: np.ndarray
    applied_moment: np.ndarray
    size: float
    kept: float
    state: State

    @property
    def force_error(self) -> float:
        """In N, discretisation error of `force`; NaN if unknown.

        Of a moved plate or indenter, from a second mesh, which is solved when this is first read.
        """
        return self.state.force_error

    @property
    def imbalance(self) -> float:
        """Sum of the forces, or of the moments divided by `size`, relative to the forces; 0 without load.

        NaN where elements are inverted.
        """
        force = float(np.linalg.norm(self.force + self.applied_force))
        moment = float(np.linalg.norm(self.moment + self.applied_moment)) / self.size
        left = max(force, moment)
        largest = max(self.kept, *(float(np.linalg.norm(f)) for f in (self.force, self.applied_force)))
        return left / largest if left else 0.0


def reactions(state: State) -> Reactions:
    """Force and moment of the board on a deformed pad, and those applied to it.

    At the nodes of a load path they balance to the solver's tolerance. States in between are interpolated, with
    displacements accurate to :data:`~mitsuba_taxel.mechanics.continuation.load_segment.INTERPOLATION_TOLERANCE`, and
    the imbalance is that of the interpolation;
    :func:`~mitsuba_taxel.mechanics.derivatives.sensitivities.linearise` gives the nearby state in equilibrium.

    Parameters
    ----------
    state : State
        The deformed pad.

    Returns
    -------
    Reactions
        Forces in N and moments in N mm.
    """
    mesh, places = state.mesh, state.mesh.points + state.displacement
    overstress = None if state.memory is None else state.memory.overstress
    linear = where_linear(mesh, state.load)
    internal = internal_forces(mesh, state.material, state.displacement, state.pressure, overstress, linear)
    applied = _applied_forces(state, places, internal)
    bottom = nodes_of(mesh, "bottom")
    board = np.zeros_like(places)
    board[bottom] = (internal - applied)[bottom]
    if state.load.self_contact:
        own, touched = Contacts(mesh, state.material.youngs_modulus, state.bodies).forces(state.displacement)
        board[bottom] -= own[bottom] + touched[bottom]
        board += touched
    moment = np.cross(places, board).sum(axis=0)
    if linear is not None:
        moment -= couple_held(mesh, state.material, linear, state.displacement, state.pressure, overstress)
    return Reactions(
        board.sum(axis=0),
        moment,
        applied.sum(axis=0),
        np.cross(places, applied).sum(axis=0),
        float(np.linalg.norm(mesh.points, axis=1).max()),
        float(np.linalg.norm(board[bottom], axis=1).sum()) if state.memory else 0.0,
        state,
    )


def _applied_forces(state: State, places: np.ndarray, internal: np.ndarray) -> np.ndarray:
    """(N, 3) N, force of the load at each node, including those of the board's rim."""
    mesh, load = state.mesh, state.load
    if load.dead:
        share = load.nodal(mesh)
        return share[:, None] / share.sum() * state.value
    if load.indenter is not None:
        return indentation_of(state)[1].nodal_forces
    forces = np.zeros_like(places)
    if load.follows_surface:
        wet = mesh.faces[np.isin(mesh.face_region, (REGIONS["top"], REGIONS["outer"]))]
        np.add.at(forces, wet, state.value[0] * pressure_forces(places[wet]))
        return forces
    # The distribution of a plate's force is a reaction: only the sum can be out of balance.
    top = nodes_of(mesh, "top")
    forces[top] = internal[top]
    if not load.gives_displacement:
        forces[top] += (state.value - internal[top].sum(axis=0)) / len(top)
    return forces
