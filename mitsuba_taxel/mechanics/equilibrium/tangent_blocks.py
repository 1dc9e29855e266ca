"""The tangent of a symmetric state in blocks, one for each symmetry type of displacements under its mirrors.

The response to a load or a change of shape has the same symmetry type, so that a matrix of the size of the part between
the mirrors suffices (J.-P. Serre, Linear Representations of Finite Groups, chapter 2). Displacements of the
two-dimensional representation of a square pad need the part between two mirrors, and one matrix for both: the mirror in
the diagonal maps one to the other.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np
import scipy.sparse as sparse

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.geometry.mirror import ACROSS_DIAGONAL, ACROSS_X, ACROSS_Y, MIRRORS, Mirror
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.contact.barriers.contacts import Contacts
from mitsuba_taxel.mechanics.elements.load_constraints import LoadConstraints
from mitsuba_taxel.mechanics.elements.loads import mirrored_value
from mitsuba_taxel.mechanics.elements.model import Model
from mitsuba_taxel.mechanics.elements.solvers import Factorisation, make_solver, sum_of_triangles
from mitsuba_taxel.mechanics.elements.symmetry import SymmetricPart, part_between
from mitsuba_taxel.mechanics.equilibrium.linearised import Linearised
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import LoadedPad
from mitsuba_taxel.mechanics.equilibrium.solution import Rejected

Signs = tuple[tuple[Mirror, int], ...]
"""Mirrors with the sign of a symmetry type: 1 for displacements that are symmetric under the mirror, -1 for
antisymmetric ones. Averaging under one mirror after the other, in this order, gives the average over the group."""


class TangentBlock:
    """A block of the tangent: its part for displacements of one symmetry type, such as antisymmetric in a mirror of the
    pad's state.

    Parameters
    ----------
    whole : VolumeMesh
        Mesh of the pad.
    model : Model
        Model of the part between the mirrors, over the unknowns of such displacements.
    signs : Signs
        Symmetry type.
    images : Mapping[Mirror, ndarray]
        Images of the nodes, from :func:`node_images`.
    turn : Mirror, optional
        Mirror that maps these displacements to those of the model.
    """

    def __init__(
        self,
        whole: VolumeMesh,
        model: Model,
        signs: Signs,
        images: Mapping[Mirror, np.ndarray],
        turn: Mirror | None = None,
    ) -> None:
        self._whole, self.model, self._signs, self._images, self._turn = whole, model, signs, images, turn
        self._solver = make_solver()

    def turned(self, mirror: Mirror) -> TangentBlock:
        """Block for the mirror images of the displacements of this block."""
        return TangentBlock(self._whole, self.model, self._signs, self._images, mirror)

    def of_value(self, value: np.ndarray) -> np.ndarray:
        """Component of the value of a load that has the symmetry type of this block. The value is a vector, a pressure,
        or a force and a moment.
        """
        value = mirrored_value(self._turn, value) if self._turn else value
        for mirror, sign in self._signs:
            value = 0.5 * (value + sign * mirrored_value(mirror, value))
        return value

    def of_field(self, field: np.ndarray) -> np.ndarray:
        """Component of a vector field (N, 3) on the whole pad that has the symmetry type of this block, at the n nodes
        of the part: (n, 3).
        """
        field = self._image(field)
        for mirror, sign in self._signs:
            field = 0.5 * (field + sign * mirror.image(field[self._images[mirror]]))
        return field[self.model.part.nodes]

    def forces(self, field: np.ndarray, displacement: np.ndarray | None = None) -> np.ndarray:
        """Component of nodal forces (N, 3) on the whole pad that has the symmetry type of this block, over the unknowns
        of the block.
        """
        return self.model.numbering.summed(self._shares[:, None] * self.of_field(field), displacement)

    def displacement(self, rate: np.ndarray, displacement: np.ndarray | None = None) -> np.ndarray:
        """Rate (N, 3) of the displacement of the whole pad, from the rate of the unknowns of this block.
        ``displacement`` (n, 3) is that of the part, as for :meth:`forces`."""
        symmetric_part = self.model.part
        of_part = self.model.numbering.split_rate(rate, displacement)
        return self._image(self._sign * symmetric_part.expand(*of_part)[0])

    @property
    def expansion(self) -> sparse.csr_array:
        """Matrix (3 N + corners, unknowns) from the unknowns to displacement and pressure of the whole pad."""
        symmetric_part, numbering = self.model.part, self.model.numbering
        nodes, corners = len(self._whole.points), self._whole.corner_count
        component, sign = symmetric_part.components
        columns = np.concatenate([component.ravel(), 3 * len(symmetric_part.nodes) + symmetric_part.source[:corners]])
        sign = np.concatenate([(self._sign * sign).ravel(), self._sign[:corners, 0]]) * numbering.sign[columns]
        unknown = numbering.unknown[columns]
        rows = np.flatnonzero(unknown >= 0)
        shape = (3 * nodes + corners, self.model.assembly.unknowns)
        expansion = sparse.csr_array((sign[rows], (rows, unknown[rows])), shape=shape)
        return reflection(self._turn, self._images[self._turn], corners) @ expansion if self._turn else expansion

    def factored(
        self, entries: np.ndarray, displacement: np.ndarray, value: np.ndarray, contacts: Contacts | None = None
    ) -> Linearised:
        """The factored tangent from its entries, at a ``displacement`` (n, 3) of the part under the ``value`` of a
        load.

        Parameters
        ----------
        contacts : Contacts, optional
            Barriers that act on the whole pad. As in a `SelfTouchingPad`, the negative stiffness of forces that turn
            about corners is left out.

        Raises
        ------
        Rejected
            if the state is unstable.
        """
        constraints, stable = self.model.constraints(displacement, value), self.model.numbering.pressures
        linearised = self.tangent(entries, displacement, value, contacts)
        if linearised.negative != stable:
            steady = contacts and self._linearised(
                entries, self._lower(entries, displacement, contacts, True), constraints
            )
            if not steady or steady.negative != stable:
                raise Rejected("the equilibrium is unstable")
        return linearised

    def tangent(
        self, entries: np.ndarray, displacement: np.ndarray, value: np.ndarray, contacts: Contacts | None = None
    ) -> Linearised:
        """The factored tangent, as from :meth:`factored`, of a state that may be unstable.

        Parameters
        ----------
        entries : ndarray
            Entries of the tangent, in the order of :class:`Sparsity`.
        displacement : (n, 3) ndarray
            Displacement of the part, mm.
        value : (c,) ndarray
            Value of the load, in N, mm or MPa.
        contacts : Contacts, optional
            Barriers of the whole pad.

        Returns
        -------
        Linearised
            The factored tangent.
        """
        lower = self._lower(entries, displacement, contacts)
        return self._linearised(entries, lower, self.model.constraints(displacement, value))

    def _lower(
        self, entries: np.ndarray, displacement: np.ndarray, contacts: Contacts | None, steady: bool = False
    ) -> sparse.csc_matrix:
        """Lower triangle of the tangent, including the contact stiffness."""
        lower, symmetric_part = self.model.assembly.matrix(entries), self.model.part
        if contacts is None:
            return lower
        stiffness = contacts.stiffness(
            symmetric_part.expand(displacement, np.zeros(symmetric_part.mesh.corner_count))[0], steady
        )
        if not stiffness.nnz:
            return lower
        moves = self.expansion[: stiffness.shape[0]]
        self._solver = make_solver()  # other contact pairs: the pattern must be analysed again
        return sum_of_triangles(lower, sparse.tril(moves.T @ stiffness @ moves / symmetric_part.copies))

    def _linearised(self, entries: np.ndarray, lower: sparse.csc_matrix, constraints: LoadConstraints) -> Linearised:
        return Linearised(entries, lower, self._factor, constraints, self.model.numbering.displacements)

    def _factor(self, lower: sparse.csc_matrix) -> Factorisation:
        try:
            return self._solver.factor(lower)
        except RuntimeError as failure:
            raise Rejected(f"the tangent is singular ({failure})") from failure

    def _image(self, field: np.ndarray) -> np.ndarray:
        return field if self._turn is None else self._turn.image(field[self._images[self._turn]])

    @cached_property
    def _shares(self) -> np.ndarray:
        """Fraction (n,) of each node that belongs to the part. It is below 1 on the planes of symmetry, whose nodes
        belong to several parts."""
        return np.bincount(self.model.part.source) / self.model.part.copies

    @cached_property
    def _sign(self) -> np.ndarray:
        """Sign (N, 1) of each node's displacement relative to that of its image in the part."""
        position, sign = self._whole.points, np.ones((len(self._whole.points), 1))
        for mirror, own in self._signs:
            beyond = (mirror.side(position) < 0)[:, None]
            position, sign = np.where(beyond, mirror.image(position), position), np.where(beyond, own * sign, sign)
        return sign


def reflection(mirror: Mirror, image: np.ndarray, corners: int) -> sparse.csr_array:
    """Matrix of the mirror image of a state: of the displacements of N nodes, and of the pressures at corner nodes.

    Parameters
    ----------
    mirror : Mirror
        A plane of symmetry.
    image : (N,) ndarray of int
        For each node, the number of the node that is its mirror image.
    corners : int
        Number of corner nodes of the mesh, each of which has a pressure. They are the first of the N nodes.

    Returns
    -------
    (3 N + corners, 3 N + corners) csr_array
        Matrix that multiplies the displacements (3 for each node) and then the pressures of a state, as one vector. The
        product is the vector of the mirror image of the state.
    """
    turned = mirror.image(np.eye(3))
    columns = np.concatenate(
        [(3 * image[:, None] + np.abs(turned).argmax(axis=1)).ravel(), 3 * len(image) + image[:corners]]
    )
    signs = np.concatenate([np.tile(turned.sum(axis=1), len(image)), np.ones(corners)])
    return sparse.csr_array((signs, (np.arange(len(columns)), columns)), shape=(len(columns), len(columns)))


def tangent_blocks(pad: LoadedPad) -> list[TangentBlock]:
    """The diagonal blocks of the pad's tangent, one for each symmetry type of displacements. The block of displacements
    with the symmetry of the pad's state is the first."""
    if len(pad.mirrors) < len(MIRRORS):
        mirrors = [mirror for mirror in MIRRORS if mirror in pad.mirrors]
        ways = [tuple(zip(mirrors, signs, strict=True)) for signs in product((1, -1), repeat=len(mirrors))]
        return [_block(pad, pad.part, signs) for signs in ways]
    ways = [
        ((ACROSS_X, straight), (ACROSS_Y, straight), (ACROSS_DIAGONAL, diagonal))
        for straight, diagonal in product((1, -1), repeat=2)
    ]
    quarter = part_between(pad.whole, pad.images, (ACROSS_X, ACROSS_Y))
    one_of_pair = _block(pad, quarter, ((ACROSS_X, -1), (ACROSS_Y, 1)))
    return [*(_block(pad, pad.part, signs) for signs in ways), one_of_pair, one_of_pair.turned(ACROSS_DIAGONAL)]


def _block(pad: LoadedPad, part: SymmetricPart, signs: Signs) -> TangentBlock:
    model = pad.model
    if part is not pad.part or any(sign < 0 for _, sign in signs):
        like = pad.model if part is pad.part else None
        at_walls = {mirror: sign for mirror, sign in signs if mirror in part.walls}
        model = Model(part, pad.material, pad.load, at_walls, like=like, linear=pad.model.linear)
    return TangentBlock(pad.whole, model, signs, pad.images)


class _Share(NamedTuple):
    """Relation between a symmetry block and a larger part of the pad: matrices that convert the unknowns of one to
    those of the other, and the factored tangent of the block.
    """

    spread: sparse.csr_array
    collect: sparse.csr_array
    factor: Factorisation


class SplitTangent:
    """Tangent matrix at a symmetric state, assembled from its symmetry blocks, on a larger part of the pad on which
    less symmetric states are solved.

    Parameters
    ----------
    blocks : Sequence[TangentBlock]
        Blocks of the tangent of the symmetric state.
    factor : Callable[[TangentBlock], Factorisation]
        Returns the factorisation of a block's tangent.
    images : Mapping[Mirror, ndarray]
        Images of the nodes.
    """

    def __init__(
        self,
        pad: LoadedPad,
        blocks: Sequence[TangentBlock],
        factor: Callable[[TangentBlock], Factorisation],
        images: Mapping[Mirror, np.ndarray],
    ) -> None:
        self._shares: list[_Share] = []
        group, seen = pad.part.group, set[Model]()
        for block in blocks:
            if group and block.model in seen:
                continue  # a mirror maps two blocks to each other: symmetric states need only one of them
            expansion = averaged = block.expansion
            for mirror in group:
                averaged = 0.5 * (averaged + reflection(mirror, images[mirror], pad.whole.corner_count) @ averaged)
            kept = float(np.square(averaged.data).sum() / np.square(expansion.data).sum())
            if not kept:  # no block has the mirror
                continue
            seen.add(block.model)
            spread = _over_unknowns(pad, averaged)
            copies = kept * block.model.part.copies / pad.part.copies
            self._shares.append(_Share(spread, sparse.csr_array(spread.T / copies), factor(block)))

    def step(self, residual: np.ndarray, gap: np.ndarray | None = None) -> np.ndarray:
        """Change of the unknowns for a ``residual``, like :meth:`Linearised.step`, to the accuracy of the factors."""
        step = np.zeros_like(residual)
        for spread, collect, factor in self._shares:
            step += spread @ factor.solve_roughly(collect @ residual)
        return step


def _over_unknowns(pad: LoadedPad, fields: sparse.csr_array) -> sparse.csr_array:
    """Convert linear combinations of displacements and pressures of the whole pad to linear combinations of the
    unknowns of ``pad``."""
    numbering, nodes, source = pad.numbering, len(pad.whole.points), pad.part.nodes
    of_whole = [(3 * source[:, None] + np.arange(3)).ravel(), 3 * nodes + source[: pad.part.mesh.corner_count]]
    free = np.flatnonzero(numbering.unknown >= 0)
    representative = np.empty(pad.unknowns, dtype=np.int64)
    representative[numbering.unknown[free]] = free  # index of a displacement or pressure that equals each unknown
    rows = fields[np.concatenate(of_whole)[representative]]
    return sparse.csr_array(sparse.diags_array(numbering.sign[representative]) @ rows)


MOST_ITERATIONS = 200


def least_mode(block: TangentBlock, tangent: Linearised, converged: float) -> tuple[float, np.ndarray]:
    """The eigenvalue of a block's tangent nearest to 0, by inverse iteration.

    Parameters
    ----------
    block : TangentBlock
        Displacements of one symmetry type.
    tangent : Linearised
        Factored tangent of the block.
    converged : float
        Change of the mode at which the iteration ends.

    Returns
    -------
    stiffness : float
        The eigenvalue in N/mm, for displacements with unit sum of squares.
    mode : (unknowns,) ndarray
        Mode of the eigenvalue.

    Raises
    ------
    ComputationError
        if modes are too close to be separated.
    """
    model = block.model
    moves = np.arange(model.assembly.unknowns) < model.numbering.displacements
    push = np.random.default_rng(0).normal(size=len(moves)) * moves
    push /= np.linalg.norm(push)
    for _ in range(MOST_ITERATIONS):
        mode = tangent.correction(push, None)
        before, push = push, mode * moves
        mode = mode / np.copysign(np.linalg.norm(push), before @ push)
        push = mode * moves
        if np.linalg.norm(push - before) < converged:
            break
    else:
        raise ComputationError(
            f"the least stiff mode of the pad was not found in {MOST_ITERATIONS} iterations, because the smallest "
            "eigenvalues are too close to each other: a slightly different load or mesh_size may separate them."
        )
    return tangent.stiffness(mode), mode
