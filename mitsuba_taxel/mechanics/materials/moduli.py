"""Elastic moduli as sums of products of few tensors, so that element stiffness does not need 81 components at each
point."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from mitsuba_taxel.geometry.volume_mesh import NODES

_A, _B = np.tril_indices(NODES)
_I, _K = np.divmod(np.arange(9), 3)
PAIRS = (_A, _B)
"""Pairs (a, b) of an element's nodes with b <= a, one for each block of its symmetric stiffness."""


def _block_indices(row: np.ndarray, i: np.ndarray, column: np.ndarray, k: np.ndarray) -> np.ndarray:
    """Positions (pairs * 9,), in a flattened matrix (nodes * 3, nodes * 3), of the entries of the 3 x 3 blocks of all
    pairs of nodes.
    """
    return (3 * NODES * (3 * row[:, None] + i) + 3 * column[:, None] + k).ravel()


_BLOCK, _TRANSPOSED, _CROSSED = (
    _block_indices(_A, _I, _B, _K),
    _block_indices(_B, _K, _A, _I),
    _block_indices(_A, _K, _B, _I),
)


@dataclass
class Moduli:
    """The derivative A_ijkl = dP_ij/dF_kl of a stress at points (...), in MPa::

        A_ijkl = sum of L_ij R_kl + R_ij L_kl  +  sum of c T_il T_kj  +  delta_ik M_jl  +  N_ik delta_jl

    Attributes
    ----------
    pairs : list[tuple[ndarray, ndarray]]
        Tensors L and R, each (..., 3, 3).
    crossed : list[tuple[ndarray, ndarray]]
        Factors c (...) and tensors T (..., 3, 3).
    inner : ndarray
        Symmetric tensor M (..., 3, 3); a scalar (...) stands for a multiple of the identity.
    outer : ndarray or None
        Symmetric tensor N (..., 3, 3); None for zero.
    """

    pairs: list[tuple[np.ndarray, np.ndarray]]
    crossed: list[tuple[np.ndarray, np.ndarray]]
    inner: np.ndarray
    outer: np.ndarray | None = field(default=None)

    def dense(self) -> np.ndarray:
        """All 81 components of the moduli as an array (..., 3, 3, 3, 3)."""
        identity = np.eye(3)
        total = np.einsum("ik,...jl->...ijkl", identity, self._full_inner())
        if self.outer is not None:
            total = total + np.einsum("...ik,jl->...ijkl", self.outer, identity)
        for first, second in self.pairs:
            dyad = first[..., :, :, None, None] * second[..., None, None, :, :]
            total = total + dyad + np.moveaxis(dyad, (-4, -3), (-2, -1))
        for weight, tensor in self.crossed:
            total = total + np.einsum("...,...il,...kj->...ijkl", weight, tensor, tensor)
        return total

    def with_inner(self, tensor: np.ndarray) -> Moduli:
        """The same moduli with a tensor (..., 3, 3) added to the tensor M."""
        return replace(self, inner=self._full_inner() + tensor)

    def along(self, change: np.ndarray) -> np.ndarray:
        """Change A_ijkl H_kl (..., 3, 3) of the stress for a change H (..., 3, 3) of the deformation gradient."""
        total = change @ self._full_inner()
        if self.outer is not None:
            total += self.outer @ change
        for a, b in self.pairs:
            for first, second in ((a, b), (b, a)):
                total += first * (second * change).sum(axis=(-2, -1), keepdims=True)
        for weight, tensor in self.crossed:
            total += weight[..., None, None] * (tensor @ np.swapaxes(change, -1, -2) @ tensor)
        return total

    def stiffness(self, weight: np.ndarray, gradients: np.ndarray) -> np.ndarray:
        """Stiffness matrices of m elements with these moduli: the sum over q, j, l of w B_aj A_ijkl B_bl, for `PAIRS`
        of nodes a and b.

        Parameters
        ----------
        weight : (m, q) ndarray
            Volume w of each quadrature point, mm³.
        gradients : (m, q, 10, 3) ndarray
            Gradients B of the shape functions, 1/mm.

        Returns
        -------
        (m, pairs, 9) ndarray
            Blocks in N/mm.
        """
        count, points = weight.shape

        tensors = [*(tensor for pair in self.pairs for tensor in pair), *(tensor for _, tensor in self.crossed)]
        distinct = {id(tensor): tensor for tensor in tensors}  # the two invariants have some tensors in common
        stacked = np.stack([np.swapaxes(tensor, -1, -2) for tensor in distinct.values()], axis=-2)
        products = gradients @ stacked.reshape(count, points, 3, -1)
        blocks_of_tensors = [
            products[..., k : k + 3].reshape(count, points, 3 * NODES) for k in range(0, products.shape[-1], 3)
        ]
        products_of = dict(zip(distinct, blocks_of_tensors, strict=True))  # T_ij B_aj, (m, q, 30)

        volume = weight[..., None]
        pairs = _product([(products_of[id(first)], volume * products_of[id(second)]) for first, second in self.pairs])
        factors = [(volume * factor[..., None], products_of[id(tensor)]) for factor, tensor in self.crossed]
        crossed = _product([(tensor, factor * tensor) for factor, tensor in factors])
        blocks = pairs.take(_BLOCK, axis=1)
        blocks += pairs.take(_TRANSPOSED, axis=1)
        blocks += crossed.take(_CROSSED, axis=1)
        blocks = blocks.reshape(count, -1, 9)
        self._add_diagonal(blocks, weight, gradients)
        if self.outer is not None:
            products = gradients @ np.swapaxes(gradients, -1, -2)
            spread = np.swapaxes(products[:, :, _A, _B], 1, 2)
            blocks += spread @ (weight[..., None, None] * self.outer).reshape(count, points, 9)
        return blocks

    def _add_diagonal(self, blocks: np.ndarray, weight: np.ndarray, gradients: np.ndarray) -> None:
        """Add the term with the tensor M to element stiffness blocks: the sum over q, j, l of w B_aj M_jl B_bl, on the
        diagonals of the blocks."""
        if self.inner.ndim == weight.ndim:
            right = (weight * self.inner)[..., None, None] * gradients
        else:
            right = gradients @ (weight[..., None, None] * self.inner)
        rows, columns = (factor.transpose(0, 2, 1, 3).reshape(len(weight), NODES, -1) for factor in (gradients, right))
        blocks[:, :, ::4] += (rows @ np.swapaxes(columns, 1, 2))[:, _A, _B][..., None]

    def _full_inner(self) -> np.ndarray:
        tensors = self.pairs[0][0]
        return self.inner if self.inner.ndim == tensors.ndim else self.inner[..., None, None] * np.eye(3)


def _product(factors: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """Sum (m, 30 * 30) of products of element vectors: for each pair (left, right) of ``factors``, each (m, q, 30), the
    outer products at the q points are added up."""
    first, second = (side[0] if len(side) == 1 else np.concatenate(side, axis=1) for side in zip(*factors, strict=True))
    return (np.swapaxes(first, 1, 2) @ second).reshape(len(first), -1)
