"""Drawing members by a walk down a tree: the shares are kept, and places are found again."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_arrays import floats

from mitsuba_taxel.backend.packets import in_packets

pytestmark = pytest.mark.quick


def test_a_grid_is_drawn_as_its_density_says(llvm_mono):
    """Counts per cell against the density (chi-square, chance 1e-5), for three densities at once."""
    from scipy import stats

    from mitsuba_taxel.kernels.paths.emission_guiding import GuidedEmission

    mi, rng = llvm_mono, np.random.default_rng(1)
    density = 0.1 + rng.random((3, 32, 32)) ** 4
    density /= density.mean(axis=(1, 2), keepdims=True)
    count = 1 << 18
    tree = rng.integers(0, 3, count)
    sample = mi.Point2f(*(floats(mi, u) for u in rng.random((2, count))))
    point, found = GuidedEmission(density).sample(mi.UInt32(in_packets(tree, np.uint32)), sample)
    column, row = (np.array(point) * 32).astype(int)
    assert np.allclose(np.array(found), density[tree, row, column], rtol=1e-5)
    counts = np.zeros_like(density)
    np.add.at(counts, (tree, row, column), 1)
    expected = density / density.sum(axis=(1, 2), keepdims=True) * np.bincount(tree)[:, None, None]
    assert stats.chisquare(counts.ravel(), expected.ravel(), ddof=2).pvalue > 1e-5


@pytest.mark.parametrize("sizes", [(100, 37), (1, 64)])
def test_members_are_drawn_by_weight_and_their_places_are_known(llvm_mono, sizes):
    """Each part of the unit square is as large as its member's share, and leads there; without weight none does."""
    from mitsuba_taxel.kernels.paths.sample_warping import MemberTrees, descend

    mi, rng = llvm_mono, np.random.default_rng(2)
    tree = np.repeat([0, 1], sizes)
    weight = 0.1 + rng.random(len(tree))
    weight[-5:-1] = 0
    trees = MemberTrees(rng.random((len(tree), 2)), tree, 2)
    shares = trees.splits(weight)
    boxes = trees.boxes(shares)
    total = np.bincount(tree, weight)[tree]
    assert np.allclose(boxes[:, 2] * boxes[:, 3], weight / total, rtol=1e-4)
    middle = mi.Point2f(*(floats(mi, c) for c in (boxes[:, :2] + 0.5 * boxes[:, 2:]).T))
    leaf, rest = descend(floats(mi, shares), mi.UInt32(trees.depth), mi.UInt32(in_packets(tree, np.uint32)), middle)
    drawn = weight > 0
    assert np.array_equal(trees.leaves[tree, np.array(leaf)][drawn], np.flatnonzero(drawn))
    assert np.allclose(np.array(rest)[:, drawn], 0.5, atol=1e-3)
