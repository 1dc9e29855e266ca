"""Balance of forces on a deformed pad: the reaction of the board and the applied load, computed independently of the
solver.

Internal forces of the elements are assembled without constraints. In equilibrium they equal the forces of the load at
the nodes of its surface, those of the board at the nodes glued to it, those of contact, and zero elsewhere.
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
    """Forces of the board and of the load on a pad, with their moments about the origin.

    Forces of packages, which stand on the board, are included in that of the board.

    Attributes
    ----------
    force : (3,) ndarray
        Force of the board on the pad, in N.
    moment : (3,) ndarray
        Moment, in N mm, of the board's forces on the deformed pad. With ``self_contact``, silicone at the lower corners
        of the pad's walls follows a linear law, which resists large rotations; the moment by this is included.
    applied_force : (3,) ndarray
        Force of the load, in N; for a prescribed displacement, that of the plate or the indenter.
    applied_moment : (3,) ndarray
        Moment, in N mm, of the load on the deformed pad, including the moment on a bonded plate or the moment that
        prevents it from rotating.
    size : float
        Largest distance from the origin in the undeformed pad, in mm.
    kept : float
        Second reference force for the balance, in N: the sum of the magnitudes of the board's nodal forces, because a
        viscoelastic silicone may have residual stress without a load. 0 for other silicones.
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
        """Discretisation error of `force` in N; NaN if unknown.

        For a prescribed displacement, it follows from a second mesh, which is solved when this is first read.
        """
        return self.state.force_error

    @property
    def centre_of_pressure(self) -> np.ndarray:
        """Point (2,) in mm where the line of action of the applied force meets the plane of the undeformed top.

        The moment about the normal of the plane is ignored; NaN without a force normal to the plane.
        """
        fx, fy, fz = self.applied_force
        if fz == 0:
            return np.full(2, np.nan)
        height = float(self.state.mesh.points[:, 2].max())
        return np.array([height * fx - self.applied_moment[1], height * fy + self.applied_moment[0]]) / fz

    @property
    def imbalance(self) -> float:
        """Magnitude of the sum of all forces, or of all moments divided by `size`, relative to the forces; 0 without
        load.

        It is NaN where elements are inverted.
        """
        force = float(np.linalg.norm(self.force + self.applied_force))
        moment = float(np.linalg.norm(self.moment + self.applied_moment)) / self.size
        remainder = max(force, moment)
        largest = max(self.kept, *(float(np.linalg.norm(f)) for f in (self.force, self.applied_force)))
        if self.state.load.tilts:  # a moment without a force
            largest = max(largest, float(np.linalg.norm(self.applied_moment)) / self.size)
        return remainder / largest if remainder else 0.0


def reactions(state: State) -> Reactions:
    """Forces and moments on a deformed pad: of the board, and of the load.

    At the nodes of a load path they balance to the solver's tolerance. States in between are interpolated, with
    displacements accurate to :data:`~mitsuba_taxel.mechanics.continuation.load_segment.INTERPOLATION_TOLERANCE`, and
    the imbalance is that of the interpolation; :func:`~mitsuba_taxel.mechanics.derivatives.sensitivities.linearise`
    gives the nearby state in equilibrium.

    Parameters
    ----------
    state : State
        The deformed pad.

    Returns
    -------
    Reactions
        Forces in N and moments in N mm.
    """
    mesh, positions = state.mesh, state.mesh.points + state.displacement
    overstress = None if state.memory is None else state.memory.overstress
    linear = where_linear(mesh, state.load)
    internal = internal_forces(mesh, state.material, state.displacement, state.pressure, overstress, linear)
    applied = _applied_forces(state, positions, internal)
    bottom = nodes_of(mesh, "bottom")
    board = np.zeros_like(positions)
    board[bottom] = (internal - applied)[bottom]
    if state.load.self_contact:
        own, touched = Contacts(mesh, state.material.youngs_modulus, state.bodies).forces(state.displacement)
        board[bottom] -= own[bottom] + touched[bottom]
        board += touched
    moment = np.cross(positions, board).sum(axis=0)
    if linear is not None:
        moment -= couple_held(mesh, state.material, linear, state.displacement, state.pressure, overstress)
    return Reactions(
        board.sum(axis=0),
        moment,
        applied.sum(axis=0),
        np.cross(positions, applied).sum(axis=0),
        float(np.linalg.norm(mesh.points, axis=1).max()),
        float(np.linalg.norm(board[bottom], axis=1).sum()) if state.memory else 0.0,
        state,
    )


def _applied_forces(state: State, positions: np.ndarray, internal: np.ndarray) -> np.ndarray:
    """Force (N, 3) in N of the load at each node, including nodes on the rim of the board."""
    mesh, load = state.mesh, state.load
    if load.dead:
        nodal_area = load.nodal(mesh)
        return nodal_area[:, None] / nodal_area.sum() * state.value
    if load.indenter is not None:
        return indentation_of(state)[1].nodal_forces
    forces = np.zeros_like(positions)
    if load.follows_surface:
        wet = mesh.faces[np.isin(mesh.face_region, (REGIONS["top"], REGIONS["outer"]))]
        np.add.at(forces, wet, state.value[0] * pressure_forces(positions[wet]))
        return forces
    # The distribution of a plate's force is a reaction: only the sum can be out of balance.
    top = nodes_of(mesh, "top")
    forces[top] = internal[top]
    if not load.gives_displacement:
        forces[top] += (state.value[:3] - internal[top].sum(axis=0)) / len(top)
    return forces
