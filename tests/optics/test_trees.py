"""Drawing members by a walk down a tree: the shares are kept, and places are found again."""

from __future__ import annotations

import numpy as np


def test_a_grid_is_drawn_as_its_density_says(llvm_mono):
    """Counts per cell against the density (chi-square, chance 1e-5), for three densities at once."""
    from scipy import stats

    from mitsuba_taxel.optics.aim import Aim

    mi, rng = llvm_mono, np.random.default_rng(1)
    density = 0.1 + rng.random((3, 32, 32)) ** 4
    density /= density.mean(axis=(1, 2), keepdims=True)
    count = 1 << 18
    tree = rng.integers(0, 3, count)
    sample = mi.Point2f(*(mi.Float(u.astype(np.float32)) for u in rng.random((2, count))))
    point, found = Aim(density).sample(mi.UInt32(tree), sample)
    column, row = (np.array(point) * 32).astype(int)
    assert np.allclose(np.array(found), density[tree, row, column], rtol=1e-5)
    counts = np.zeros_like(density)
    np.add.at(counts, (tree, row, column), 1)
    expected = density / density.sum(axis=(1, 2), keepdims=True) * np.bincount(tree)[:, None, None]
    assert stats.chisquare(counts.ravel(), expected.ravel(), ddof=2).pvalue > 1e-5


def test_members_are_drawn_by_weight_and_their_places_are_known(llvm_mono):
    """Each part of the unit square is as large as its member's share, and leads there."""
    from mitsuba_taxel.optics.trees import descend, shares_of_members

    mi, rng = llvm_mono, np.random.default_rng(2)
    tree = np.repeat([0, 1], [100, 37])
    weight = 0.1 + rng.random(len(tree))
    shares, leaves, boxes = shares_of_members(rng.random((len(tree), 2)), weight, tree, 2)
    total = np.bincount(tree, weight)[tree]
    assert np.allclose(boxes[:, 2] * boxes[:, 3], weight / total, rtol=1e-4)
    depth = leaves.shape[1].bit_length() - 1
    middle = mi.Point2f(*(mi.Float(c.astype(np.float32)) for c in (boxes[:, :2] + 0.5 * boxes[:, 2:]).T))
    leaf, rest = descend(mi.Float(shares.ravel()), depth, mi.UInt32(tree), middle)
    assert np.array_equal(leaves[tree, np.array(leaf)], np.arange(len(tree)))
    assert np.allclose(np.array(rest), 0.5, atol=1e-3)
