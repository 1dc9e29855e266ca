"""Stability of an equilibrium, also against displacements that break the symmetry of its state.

The tangent matrix of the whole pad decomposes into blocks, one for each irreducible representation of its planes of
symmetry. The pad is stable if each block is. Most states can be shown to be stable at less cost: the pad is cut along
planes of symmetry, and the pieces are checked alone. Each displacement of the whole pad is a displacement of the
pieces, and its energy is the sum of their energies; so the pad is stable if all pieces are stable. The pieces have more
freedom, and may be unstable although the pad is stable: then the blocks are checked.

The pieces lose little stiffness. The pressure of the pad acts in a cut, and follows the cut as it deforms: this does
not change the energy of the whole, as contributions of a piece and its mirror image cancel. Pressures at the nodes of a
cut, which two pieces would share, are left out, which never makes a piece stiffer.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.geometry.volume_mesh import TET_FACES, VolumeMesh
from mitsuba_taxel.mechanics.elements.internal_variables import Softening, StressUpdate
from mitsuba_taxel.mechanics.elements.load_constraints import LoadConstraints
from mitsuba_taxel.mechanics.elements.model import Model
from mitsuba_taxel.mechanics.elements.pressure import pressure_stiffness
from mitsuba_taxel.mechanics.elements.solvers import FEW_UNKNOWNS, Solver, make_solver
from mitsuba_taxel.mechanics.elements.symmetry import CUT, SymmetricPart, cut_blocks, part_between, unsymmetric_blocks


class Stability:
    """Stability check against the displacements that the factored tangent of the part between mirrors does not contain.

    These are the displacements without the symmetry of the state or, if pieces are tested, all displacements.

    Parameters
    ----------
    whole : VolumeMesh
        Mesh of the whole pad.
    mirrors : tuple[Mirror, ...]
        Symmetries of the state.
    images : Mapping[Mirror, ndarray]
        Images of the nodes, from :func:`node_images`.
    model : Model
        Model of the part between the mirrors.
    solver : str or None
        Name of a linear solver; None for the best available.

    Attributes
    ----------
    of_all : bool
        Whether displacements with the symmetry of the state are checked too.
    """

    def __init__(
        self,
        whole: VolumeMesh,
        mirrors: tuple[Mirror, ...],
        images: Mapping[Mirror, np.ndarray],
        model: Model,
        solver: str | None,
    ) -> None:
        self._whole, self._mirrors, self._images, self._model, self._solver = whole, mirrors, images, model, solver
        self.of_all = self._pieces_tell = len(cut_blocks(mirrors)) > 0

    def surplus(
        self,
        entries: np.ndarray,
        displacement: np.ndarray,
        pressure: np.ndarray,
        value: np.ndarray,
        stress_update: StressUpdate | Softening | None = None,
    ) -> int:
        """Number of negative eigenvalues of the tangent beyond those of the pressures: 0 if the pad is stable. The
        count is that of the first unstable block.

        Parameters
        ----------
        entries : ndarray
            Entries of the tangent of the part, from :meth:`Model.evaluate`.
        displacement, pressure : (N, 3) ndarray
            State of the whole pad, in mm and (corners,) MPa, which has the symmetry of the part.
        value : ndarray
            Value of the load.
        stress_update : StressUpdate, optional
            History of the part, if it is viscoelastic.

        Raises
        ------
        RuntimeError
            if the tangent of a block is singular.
        """
        if self._pieces_tell:
            if self.pieces.are_stable(entries, displacement, pressure):
                return 0
            self._pieces_tell = False  # nor under larger loads
            del self.pieces
        surpluses = self._of_blocks(entries, displacement, pressure, value, stress_update)
        return next((surplus for surplus in surpluses if surplus), 0)

    def _of_blocks(
        self,
        entries: np.ndarray,
        displacement: np.ndarray,
        pressure: np.ndarray,
        value: np.ndarray,
        stress_update: StressUpdate | Softening | None,
    ) -> Iterator[int]:
        for block in self._blocks:
            symmetric_part = block.model.part
            on_part = symmetric_part.restrict(displacement, pressure)
            of_block: np.ndarray | None = entries
            if symmetric_part is not self._model.part:
                of_block = block.model.evaluate(
                    *on_part, value, stress_update=stress_update and stress_update.on(symmetric_part, self._whole)
                ).entries
            assert of_block is not None  # guaranteed in equilibrium
            yield block.surplus(of_block, block.model.constraints(on_part[0], value))

    @cached_property
    def pieces(self) -> _Pieces:
        return _Pieces(self._model, cut_blocks(self._mirrors), self._solver)

    @cached_property
    def _blocks(self) -> list[_Block]:
        blocks = [_Block(self._model, make_solver(self._solver))] if self.of_all else []
        for mirrors, signs in unsymmetric_blocks(self._mirrors):
            same = len(mirrors) == len(self._mirrors)
            symmetric_part = self._model.part if same else part_between(self._whole, self._images, mirrors)
            blocks.append(_block(self._model, symmetric_part, signs, self._solver))
        return blocks


class _Pieces:
    """The pieces into which planes of symmetry cut a pad; used for a sufficient test of stability."""

    def __init__(self, model: Model, signs: Sequence[Mapping[Mirror, int]], solver: str | None) -> None:
        self._model, self._signs, self._solver = model, signs, solver
        self._kept = [self._block(of_block) for of_block in signs] if model.assembly.unknowns < FEW_UNKNOWNS else None
        self._cuts = np.concatenate([_faces_on(model.mesh, wall) for wall in model.part.walls if signs[0][wall] == CUT])

    def are_stable(self, entries: np.ndarray, displacement: np.ndarray, pressure: np.ndarray) -> bool:
        """Whether all pieces into which the planes of symmetry cut the pad are certainly stable.

        Parameters
        ----------
        entries : ndarray
            Entries of the tangent, in the order of :class:`Sparsity`.
        displacement : (N, 3) ndarray
            Displacement of the nodes, mm.
        pressure : (corners,) ndarray
            Pressure at each corner of the elements in MPa, positive in tension.

        Returns
        -------
        bool
            True if all pieces are stable; False if this is unknown.
        """
        entries = self.with_pressure(entries, displacement, pressure)
        try:
            return not any(block.surplus(entries) for block in self.blocks)
        except RuntimeError:  # singular
            return False

    @property
    def blocks(self) -> Iterable[_Block]:
        """The tangent block of each piece. For a large pad, blocks are created one after the other for each state,
        because their patterns and analyses take as much memory as a factored matrix, and less time.
        """
        return map(self._block, self._signs) if self._kept is None else self._kept

    def _block(self, signs: Mapping[Mirror, int]) -> _Block:
        return _block(self._model, self._model.part, signs, self._solver)

    def with_pressure(self, entries: np.ndarray, displacement: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """Entries of the tangent of a piece, with the contribution of the pressure in the planes of symmetry along
        which the pad is cut.
        """
        displacement, pressure = self._model.part.restrict(displacement, pressure)
        in_cuts = pressure[self._cuts[:, :3]].mean(axis=1)
        stiffness = in_cuts[:, None, None] * pressure_stiffness((self._model.mesh.points + displacement)[self._cuts])
        entries = entries.copy()
        self._model.assembly.sparsity.add_blocks(entries, self._cuts, stiffness)
        return entries


@dataclass(frozen=True, eq=False)
class _Block:
    """A block of the tangent matrix: that of the displacements of one symmetry type, such as antisymmetric in one
    plane."""

    model: Model
    solver: Solver

    def surplus(self, entries: np.ndarray, constraints: LoadConstraints | None = None) -> int:
        """Number of negative eigenvalues of this block of the tangent, without those that pressures and
        constraints cause in a stable pad as well.

        Parameters
        ----------
        entries : ndarray
            Entries of the tangent, in the order of :class:`Sparsity`.
        constraints : LoadConstraints, optional
            Constraints of the load.

        Returns
        -------
        int
            The number; 0 for a stable block.
        """
        factor = self.solver.factor(self.model.assembly.matrix(entries))
        surplus = factor.negative_pivots - self.model.numbering.pressures
        return surplus - constraints.negative(factor) if surplus and constraints else surplus


def _block(model: Model, part: SymmetricPart, signs: Mapping[Mirror, int], solver: str | None) -> _Block:
    """Create the block for displacements with the ``signs`` (symmetric or antisymmetric) at the planes that bound a
    part of the pad. A plate with a prescribed displacement is fixed."""
    fixed_plate, material = model.load.moves_plate, model.assembly.elements.material
    like = model if part is model.part else None
    of_block = Model(part, material, model.load, signs, fixed_plate, like, model.linear)
    return _Block(of_block, make_solver(solver))


def _faces_on(mesh: VolumeMesh, wall: Mirror) -> np.ndarray:
    """Nodes (F, 6) of the F element faces in a plane of symmetry that bounds the mesh, oriented outwards."""
    faces = mesh.tets[:, np.array(TET_FACES)].reshape(-1, 6)
    return faces[(wall.side(mesh.points)[faces[:, :3]] == 0).all(axis=1)]
