"""The factored tangent of a pad at a state of more symmetry, over the unknowns of states of less.

It is that under a normal force, for states that a tangential one changes little. Its blocks (see `tangent_blocks`) have
the size of the part between the mirrors of the normal force: for a square pad they are three with as many unknowns
together as the half that a force along x leaves, an eighth, an eighth and a quarter of the whole.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import scipy.sparse as sparse

from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.mechanics.elements.model import Model
from mitsuba_taxel.mechanics.elements.solvers import Factorisation
from mitsuba_taxel.mechanics.path.equilibrium import LoadedPad
from mitsuba_taxel.mechanics.path.tangent_blocks import TangentBlock, reflection


class _Share(NamedTuple):
    """States of a part that belong to a block: the part's unknowns from those of the block."""

    spread: sparse.csr_array
    collect: sparse.csr_array
    factor: Factorisation


class SplitTangent:
    """The tangent at a symmetric state, on the part of a ``pad`` that less symmetric states need.

    Parameters
    ----------
    blocks : Sequence[TangentBlock]
        Of the symmetric state.
    factor : Callable[[TangentBlock], Factorisation]
        Of the tangent of each.
    images : Mapping[Mirror, ndarray]
        Of the nodes.
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
                continue  # of two that a mirror maps to each other, states with a mirror of their own have one
            whole = every = block.expansion
            for mirror in group:
                every = 0.5 * (every + reflection(mirror, images[mirror], pad.whole.corner_count) @ every)
            kept = float(np.square(every.data).sum() / np.square(whole.data).sum())
            if not kept:  # none has the mirror
                continue
            seen.add(block.model)
            spread = _over_unknowns(pad, every)
            copies = kept * block.model.part.copies / pad.part.copies
            self._shares.append(_Share(spread, sparse.csr_array(spread.T / copies), factor(block)))

    def step(self, residual: np.ndarray, gap: np.ndarray | None = None) -> np.ndarray:
        """The change of the unknowns for a ``residual``, as of :class:`Linearised`, to the accuracy of the factors."""
        found = np.zeros_like(residual)
        for spread, collect, factor in self._shares:
            found += spread @ factor.solve_roughly(collect @ residual)
        return found


def _over_unknowns(pad: LoadedPad, fields: sparse.csr_array) -> sparse.csr_array:
    """Rows over the unknowns of a pad, from those over displacements and pressures of the whole."""
    numbering, nodes, source = pad.numbering, len(pad.whole.points), pad.part.nodes
    of_whole = [(3 * source[:, None] + np.arange(3)).ravel(), 3 * nodes + source[: pad.part.mesh.corner_count]]
    free = np.flatnonzero(numbering.unknown >= 0)
    one = np.empty(pad.unknowns, dtype=np.int64)
    one[numbering.unknown[free]] = free  # of each unknown, a displacement or pressure that it is
    rows = fields[np.concatenate(of_whole)[one]]
    return sparse.csr_array(sparse.diags_array(numbering.sign[one]) @ rows)
