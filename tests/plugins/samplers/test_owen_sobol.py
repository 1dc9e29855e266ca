"""The sampler: Sobol' points, scrambled without losing their structure, independent between sequences."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.kernels.paths.sobol import DIMENSIONS, sobol_points

pytestmark = pytest.mark.quick


def test_points_are_those_of_scipy():
    from scipy.stats import qmc

    theirs = qmc.Sobol(DIMENSIONS, scramble=False, bits=32).random_base2(10)
    ours = sobol_points(1024).T / 2.0**32
    order = lambda points: points[np.lexsort(points.T)]  # noqa: E731  (scipy walks them in Gray-code order)
    assert np.array_equal(order(ours), order(theirs))


def sequences(mi, count, replicates, dimensions, seed=1):
    """(replicates, count, dimensions) samples."""
    sampler = mi.load_dict({"type": "owen_sobol", "sample_count": count})
    sampler.seed(seed, count * replicates)
    return np.stack([sampler.next_1d().numpy() for _ in range(dimensions)], axis=-1).reshape(replicates, count, -1)


def test_a_clone_goes_on_by_itself(llvm_mono):
    """Whichever is asked first, and before seeding, too."""
    sampler = llvm_mono.load_dict({"type": "owen_sobol", "sample_count": 16})
    sampler.clone()
    sampler.seed(3, 32)
    sampler.next_1d()
    one, other = sampler.clone(), sampler.clone()
    expected = [sampler.next_1d().numpy() for _ in range(2)]
    for twin in (one, other):
        assert np.array_equal([twin.next_1d().numpy() for _ in range(2)], expected)


@pytest.mark.parametrize("pair", [(0, 1), (2, 3), (4, 5)])
@pytest.mark.parametrize("seed", [0, 1, 4294967295])
def test_scrambling_keeps_the_net(llvm_mono, pair, seed):
    """The quality parameter t of a pair of dimensions is that of the unscrambled points, and 0 for the first pair."""
    from_sampler = sequences(llvm_mono, 256, 4, 6, seed)
    plain = sobol_points(256).T / 2.0**32
    for replicate in from_sampler:
        assert np.array_equal(elementary_counts(replicate[:, pair]), elementary_counts(plain[:, pair]))
    if pair == (0, 1):
        assert np.all(elementary_counts(from_sampler[0][:, pair]) == 1)


def elementary_counts(points):
    """Sorted numbers of points in the elementary intervals of volume 1/256, for every shape of interval."""
    counts = []
    for bits in range(9):
        cells = np.floor(points * [2**bits, 2 ** (8 - bits)]).astype(int)
        counts.append(np.sort(np.bincount(cells[:, 0] * 2 ** (8 - bits) + cells[:, 1], minlength=256)))
    return np.array(counts)


def test_each_point_is_uniform_and_sequences_are_independent(llvm_mono):
    from scipy import stats

    samples = sequences(llvm_mono, 16, 4096, 2 * DIMENSIONS + 3)
    p_values = [
        stats.kstest(samples[:, point, dimension], "uniform").pvalue
        for point in (0, 1, 15)
        for dimension in (0, 1, 7, DIMENSIONS, 2 * DIMENSIONS + 2)
    ]
    assert min(p_values) > 1e-5  # fifteen tests: fails by chance once in 7000 runs
    first = samples[:, 0, 0] - 0.5
    lag = np.mean(first[1:] * first[:-1]) / np.var(first)
    assert abs(lag) < 4.5 / np.sqrt(len(first))


def test_error_falls_faster_than_independent_samples(llvm_mono):
    """A smooth integral in six dimensions: the error at 4096 points is far below that of Monte Carlo."""

    def error(count):
        samples = sequences(llvm_mono, count, 32, 6)
        return np.std(np.prod(1 + 0.5 * (samples - 0.5), axis=-1).mean(axis=1), ddof=1)

    assert error(4096) < 0.02 * np.sqrt((1 + 1 / 48) ** 6 - 1) / np.sqrt(4096)


@pytest.mark.parametrize("count, rounded", [(1, 1), (2, 2), (3, 4), (1000, 1024), (1024, 1024)])
def test_sample_count_is_rounded_up(llvm_mono, count, rounded):
    assert llvm_mono.load_dict({"type": "owen_sobol", "sample_count": count}).sample_count() == rounded


def test_seed_decides(llvm_mono):
    assert np.array_equal(sequences(llvm_mono, 64, 2, 3, seed=5), sequences(llvm_mono, 64, 2, 3, seed=5))
    assert not np.array_equal(sequences(llvm_mono, 64, 2, 3, seed=5), sequences(llvm_mono, 64, 2, 3, seed=6))


@pytest.mark.parametrize("start", [256, 2048])
def test_a_run_goes_on_where_it_has_stopped(llvm_mono, start):
    """Points 0 to n and n to 2 n, drawn apart, are those of one run of 2 n, beyond the 24 dimensions as well."""
    dimensions = 2 * DIMENSIONS + 1
    whole = sequences(llvm_mono, 2 * start, 3, dimensions)
    assert np.array_equal(sequences(llvm_mono, start, 3, dimensions), whole[:, :start])
    sampler = llvm_mono.load_dict({"type": "owen_sobol", "sample_count": start})
    sampler.place(start, 1)
    sampler.seed(1, 2 * start)
    rest = np.stack([sampler.next_1d().numpy() for _ in range(dimensions)], axis=-1).reshape(2, start, -1)
    assert np.array_equal(rest, whole[1:, start:])


def test_dimensions_beyond_the_first_set_are_independent_of_it(llvm_mono):
    """A dimension and its re-use are not correlated, over replicates (Student, chance 1e-5), nor the same by halves."""
    from scipy import stats

    samples = sequences(llvm_mono, 1024, 256, DIMENSIONS + 1)[:, :, [0, DIMENSIONS]] - 0.5
    for product in (samples.prod(axis=2), np.sign(samples).prod(axis=2)):
        per_replicate = product.mean(axis=1)
        assert stats.ttest_1samp(per_replicate, 0).pvalue > 1e-5
        assert per_replicate.std() < 4 / np.sqrt(1024)


@pytest.mark.parametrize("first, count", [(3, 2), (1 << 20, 1)])
def test_bad_places_are_refused(llvm_mono, first, count):
    from mitsuba_taxel import InputError

    sampler = llvm_mono.load_dict({"type": "owen_sobol", "sample_count": count})
    with pytest.raises(InputError, match="first_point|at most 1048576"):
        sampler.place(first, 0)
