"""Residual and tangent of a loaded pad, or of its symmetric part."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sparse

from mitsuba_taxel.geometry.element_maps import map_determinants
from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.mechanics.contact.indentation import ContactState, Indentation
from mitsuba_taxel.mechanics.elements.assembly import Assembly
from mitsuba_taxel.mechanics.elements.constraints import number_unknowns
from mitsuba_taxel.mechanics.elements.internal_variables import Softening, StressUpdate
from mitsuba_taxel.mechanics.elements.load_constraints import LoadConstraints
from mitsuba_taxel.mechanics.elements.loads import Load
from mitsuba_taxel.mechanics.elements.pressure import pressure_forces, pressure_stiffness, wet_faces
from mitsuba_taxel.mechanics.elements.symmetry import SymmetricPart
from mitsuba_taxel.mechanics.materials.laws import Material
from mitsuba_taxel.pads.regions import REGIONS


@dataclass(frozen=True)
class Configuration:
    """Residual and tangent of a pad at a state that need not be in equilibrium.

    Attributes
    ----------
    residual : ndarray
        Out-of-balance forces [N] and volumes [mm³] over the unknowns.
    load : ndarray
        Contribution of the load to the residual, over the unknowns: it is subtracted from the internal forces.
    entries : ndarray or None
        Entries of the derivative of the residual, for `Assembly.matrix`; None if not requested, or an element is
        inverted.
    min_jacobian : float
        Smallest volume ratio J at any quadrature point.
    contact_state : ContactState or None
        State of contact with an indenter, if that is the load.
    """

    residual: np.ndarray
    load: np.ndarray
    entries: np.ndarray | None
    min_jacobian: float
    contact_state: ContactState | None = None


class Model:
    """A part of a pad glued to the board, under a load.

    Parameters
    ----------
    part : SymmetricPart
        The part, between mirrors of the pad.
    material : Material
        Elastic law of the silicone.
    load : Load
        Load on the whole pad.
    signs : Mapping[Mirror, int]
        Signs at the walls of the part: 1 for symmetric states, -1 for antisymmetric ones, 0 for any states without
        pressure there.
    fixed_plate : bool
        Whether a bonded plate is fixed, rather than an additional unknown.
    like : Model, optional
        Another model of the same part, material and load, whose elements it shares.
    linear : (M, q) ndarray, optional
        Quadrature points of the whole pad where the law is linear.
    """

    def __init__(
        self,
        part: SymmetricPart,
        material: Material,
        load: Load,
        signs: Mapping[Mirror, int],
        fixed_plate: bool = False,
        like: Model | None = None,
        linear: np.ndarray | None = None,
    ) -> None:
        self.part, self.mesh, self.load, self.linear = part, part.mesh, load, linear
        fixed = np.zeros(len(self.mesh.points), dtype=bool)
        fixed[self._faces("bottom")] = True
        plate = None
        if load.bonded_plate:
            top = np.unique(self._faces("top"))
            fixed[top] |= fixed_plate
            plate = None if fixed_plate else top
        self.numbering = number_unknowns(self.mesh, fixed, signs, plate, load.pivot(self.mesh) if load.tilts else None)
        self.assembly: Assembly = Assembly(
            self.mesh,
            material,
            self.numbering,
            like.assembly if like else None,
            None if linear is None else linear[part.elements],
        )

    def evaluate(
        self,
        displacement: np.ndarray,
        pressure: np.ndarray,
        value: np.ndarray,
        with_tangent: bool = True,
        stress_update: StressUpdate | Softening | None = None,
        contact_forces: tuple[np.ndarray, np.ndarray | None] | tuple[()] = (),
    ) -> Configuration:
        """Residual and tangent of the part at a state.

        Parameters
        ----------
        displacement : (n, 3) ndarray
            Displacement of the nodes of the part, mm.
        pressure : (corners,) ndarray
            Pressure at each corner of the elements in MPa, positive in tension.
        value : ndarray
            Value of the load on the whole pad.
        with_tangent : bool
            Whether the tangent is needed.
        stress_update : StressUpdate or Softening, optional
            Isochoric stress of a viscoelastic solid, or of one with Mullins' effect.
        contact_forces : tuple of ndarray, optional
            Pressures (m,) and tractions (m, 3) or None of an indenter, in MPa; by default the pressures of the gaps.
            The tangent treats them as constant; their changes are in :meth:`constraints`.

        Returns
        -------
        Configuration
            Residual over the unknowns, and entries of the tangent.
        """
        internal, contact_state = self.assembly.evaluate(displacement, pressure, with_tangent, stress_update), None
        entries = internal.entries
        if self.load.moved_indenter is not None:
            # Pressures of contact, whose directions follow the normals of the indenter.
            contact_state = self.indentation.contact_state(displacement, value, *contact_forces)
            load = self.numbering.summed(contact_state.nodal_forces)
            if entries is not None and contact_state.pressure.any():
                self.assembly.sparsity.add_blocks(entries, *self.indentation.stiffness(contact_state))
        else:
            # The load itself; a pressure follows the surface.
            load = self.load_vector(displacement, value)
            if entries is not None and self.load.follows_surface:
                positions = (self.mesh.points + displacement)[self._wet_faces]
                self.assembly.sparsity.add_blocks(entries, self._wet_faces, -value[0] * pressure_stiffness(positions))
        return Configuration(internal.residual - load, load, entries, internal.min_jacobian, contact_state)

    def constraints(self, displacement: np.ndarray, value: np.ndarray) -> LoadConstraints:
        """Constraint rows of the load at a state.

        Parameters
        ----------
        displacement : (n, 3) ndarray
            Displacement of the part, mm.
        value : (c,) ndarray
            Value of the load, in N, mm or MPa.

        Returns
        -------
        LoadConstraints
            Constraints of the displacement of the plate, or of the gaps of contact with an indenter.
        """
        if self.load.moved_indenter is not None:
            contact_state = self.indentation.contact_state(displacement, value)
            pressed = self.pressed(contact_state)
            return LoadConstraints(self.over_unknowns(contact_state.rate[pressed]), self.indentation.slack[pressed])
        driven = self.load.moves_plate and self.numbering.plate is not None
        driven_unknowns = self.numbering.plate_unknowns if driven else np.zeros(0, int)
        rows = sparse.csr_array(
            (np.ones(len(driven_unknowns)), (np.arange(len(driven_unknowns)), driven_unknowns)),
            shape=(len(driven_unknowns), self.assembly.unknowns),
        )
        return LoadConstraints(rows, np.zeros(len(driven_unknowns)))

    def pressed(self, contact_state: ContactState) -> np.ndarray:
        """Numbers of the nodes at which the indenter exerts a positive pressure, counted among the nodes of
        :attr:`may_press`.
        """
        return np.flatnonzero((contact_state.pressure > 0) & self.may_press)

    @cached_property
    def may_press(self) -> np.ndarray:
        """Mask (m,) of the nodes at which the indenter may exert a pressure: those that can move along z. In
        antisymmetric states, nodes on the mirror plane cannot.
        """
        return self.numbering.unknown[3 * self.indentation.node + 2] >= 0

    def over_unknowns(self, rows: sparse.csr_array) -> sparse.csr_array:
        """Express linear combinations of displacements as linear combinations of unknowns: coefficients (k, 3 n) of n
        nodes become coefficients (k, unknowns).
        """
        return rows @ self._displacements_of_unknowns

    @cached_property
    def _displacements_of_unknowns(self) -> sparse.csr_array:
        """Matrix (3 n, unknowns) from the unknowns to the displacements of the n nodes."""
        degrees = 3 * len(self.mesh.points)
        free = np.flatnonzero(self.numbering.unknown[:degrees] >= 0)
        entries = self.numbering.sign[free], (free, self.numbering.unknown[free])
        return sparse.csr_array(entries, shape=(degrees, self.assembly.unknowns))

    def least_nodal_jacobian(self, displacement: np.ndarray, nodes: np.ndarray) -> float:
        """Smallest volume ratio J of elements at selected nodes, which may be far below that at quadrature points.

        Parameters
        ----------
        displacement : (n, 3) ndarray
            Displacement of the part, mm.
        nodes : (n,) ndarray of bool
            Selected nodes.

        Returns
        -------
        float
            The volume ratio; 1 if no node is selected.
        """
        deformed = map_determinants(self.mesh.points + displacement, self.mesh.tets)
        return float((deformed / self._determinants)[nodes[self.mesh.tets]].min(initial=1.0))

    def load_vector(self, displacement: np.ndarray, value: np.ndarray) -> np.ndarray:
        """Forces of the load over the unknowns.

        Parameters
        ----------
        displacement : (n, 3) ndarray
            Displacement of the part, mm.
        value : (c,) ndarray
            Value of the load, in N, mm or MPa.

        Returns
        -------
        (unknowns,) ndarray
            Forces, which are linear in the value; zero for a prescribed displacement.
        """
        if self.load.follows_surface:
            nodal = np.zeros_like(displacement)
            np.add.at(nodal, self._wet_faces, pressure_forces((self.mesh.points + displacement)[self._wet_faces]))
            return value[0] * self.numbering.summed(nodal)
        if self.load.moves_plate:
            return np.zeros(self.assembly.unknowns)
        if self.load.bonded_plate:
            return self.numbering.on_plate(np.asarray(value) / self.part.copies)
        return self.numbering.summed(self._nodal_fractions[:, None] * value)

    def load_rate(self, displacement: np.ndarray, direction: np.ndarray, value: np.ndarray | None) -> np.ndarray:
        """Derivative of the forces of the load with respect to its value along a direction.

        Parameters
        ----------
        displacement : (n, 3) ndarray
            Displacement of the part, mm.
        direction : (c,) ndarray
            Direction of the change of the load's value.
        value : (3,) ndarray or None
            Value of the load; needed for an indenter.

        Returns
        -------
        (unknowns,) ndarray
            Derivative per N, mm or MPa.
        """
        if self.load.moved_indenter is not None:
            assert value is not None
            contact_state = self.indentation.contact_state(displacement, value)
            return self.numbering.summed(self.indentation.rate(contact_state, direction, self.pressed(contact_state)))
        return self.load_vector(displacement, direction)

    def penalty_forces(self, material: Material, displacement: np.ndarray, value: np.ndarray) -> np.ndarray | float:
        """Penalty forces of an indenter over the unknowns, with the contact stiffness of another material.

        Parameters
        ----------
        material : Material
            Elastic law of the silicone.
        displacement : (n, 3) ndarray
            Displacement of the part, mm.
        value : (c,) ndarray
            Value of the load, in N, mm or MPa.

        Returns
        -------
        (unknowns,) ndarray or float
            The forces; 0 without an indenter.
        """
        if self.load.moved_indenter is None:
            return 0.0
        own_material = self.assembly.elements.material
        forces = self.numbering.summed(self.indentation.contact_state(displacement, value).nodal_forces)
        return material.youngs_modulus / own_material.youngs_modulus * forces

    def _faces(self, region: str) -> np.ndarray:
        return self.mesh.faces[self.mesh.face_region == REGIONS[region]]

    @cached_property
    def _determinants(self) -> np.ndarray:
        """Jacobian determinants (m, 10) in mm³ of the isoparametric maps of the m undeformed elements, at their ten
        nodes."""
        return map_determinants(self.mesh.points, self.mesh.tets)

    @cached_property
    def _nodal_fractions(self) -> np.ndarray:
        """Fraction (n,) of the force of the whole pad that acts on each node of the part."""
        nodal = self.load.nodal(self.mesh)
        return nodal / (self.part.copies * nodal.sum())

    @cached_property
    def _wet_faces(self) -> np.ndarray:
        return wet_faces(self.mesh)

    @cached_property
    def indentation(self) -> Indentation:
        """Contact with the indenter of the load."""
        assert self.load.moved_indenter is not None
        return Indentation(self.mesh, self.load.moved_indenter, self.assembly.elements.material.youngs_modulus)
