"""Equations 5 to 7 against closed forms, and their errors over many noisy experiments."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel import InputError
from mitsuba_taxel.characterise import Branch, Experiment, hysteresis, nonlinearity, repeatability
from mitsuba_taxel.characterise.equations import share_forces

pytestmark = pytest.mark.quick

UP = np.linspace(0, 10, 51)


def experiment(*runs: Branch, ordered: bool = True) -> Experiment:
    taxels = np.arange(1, runs[0].samples.shape[2] + 1)
    return Experiment("fz", np.array([0, 0, 1.0]), {}, "V", taxels, runs, ordered)


@pytest.mark.parametrize("sign", [1, -1], ids=["rising", "falling reading"])
@pytest.mark.parametrize("end", [4.0, -20.0])
def test_nonlinearity_of_a_cubic(branch, end, sign):
    """a f + b f³ deviates from its end-point line by 2 b F³ / (3 sqrt 3), at F / sqrt 3."""
    a, b, forces = 3e-5, 2e-6 / end**2, end * np.append(np.linspace(0, 1, 11), 1 / np.sqrt(3))
    run = branch(lambda f: sign * (a * f + b * f**3), sorted(forces, key=abs), replicates=4)
    found = nonlinearity(run, experiment(run).largest_change)
    expected = 100 * 2 * b * abs(end) ** 3 / (3 * np.sqrt(3)) / (a * abs(end) + b * abs(end) ** 3)
    assert found.percent[0] == pytest.approx(expected, rel=1e-9) and found.error[0] < 1e-12
    assert found.at[0] == pytest.approx(end / np.sqrt(3))


def test_nonlinearity_of_two_straight_pieces(branch):
    run = branch(lambda f: np.minimum(2 * f, 6 + 0.5 * (f - 3)), UP, replicates=4)
    found = nonlinearity(run, experiment(run).largest_change)
    assert found.percent[0] == pytest.approx(100 * (6 - 0.95 * 3) / 9.5) and found.at[0] == pytest.approx(3)


@pytest.mark.parametrize("down", [UP[::-1], np.array([10, 8.6, 6, 5, 3.2, 1, 0]), np.linspace(10, 2, 23)])
def test_branches_are_compared_at_equal_force(branch, down):
    """Down, the reading is larger by 0.4 triangle(f), 1 at 5 N; the forces of the branches need not be the same."""
    up = branch(lambda f: 2 * f, UP, replicates=4)
    back = branch(lambda f: 2 * f + 0.4 * (1 - np.abs(f - 5) / 5), down, replicates=4)
    largest = experiment(up, back).largest_change
    found = hysteresis(up, back, largest)
    between = np.linspace(down[-1], 10, 100001)  # the branch is straight lines between its points
    apart = np.interp(between, down[::-1], back.value[::-1, 0]) - 2 * between
    assert found.percent[0] == pytest.approx(100 * apart.max() / 20, rel=1e-4)
    assert found.at[0] == pytest.approx(between[apart.argmax()], abs=1e-3)
    again = branch(lambda f: 1.9 * f, UP[:41], replicates=4)
    found = repeatability(up, again, largest)
    assert found.percent[0] == pytest.approx(100 * 0.8 / 20) and found.at[0] == pytest.approx(8)


def test_the_largest_change_is_that_of_all_runs_and_has_the_sign_of_none(branch):
    up, back = branch(lambda f: -2 * f, UP), branch(lambda f: -2 * f - 3 * (f < 1), UP[::-1])
    np.testing.assert_allclose(experiment(up, back).largest_change, 20)
    np.testing.assert_allclose(experiment(branch(lambda f: -f, [0, 1]), branch(np.sin, [1, 0])).largest_change, 1)


def test_what_cannot_be_compared_is_refused(branch):
    up, back, one = branch(np.square, UP), branch(np.square, UP[::-1]), np.ones((32, 1))
    with pytest.raises(InputError, match="falling"):
        hysteresis(up, up, one)
    with pytest.raises(InputError, match="two branches of growing"):
        repeatability(up, back, one)
    beyond = branch(np.square, [10, 11, 12])
    assert share_forces(up, back) and not share_forces(up, beyond)
    with pytest.raises(InputError, match="do not overlap"):
        repeatability(up, beyond, one)


@pytest.mark.parametrize(
    "force, samples",
    [
        ([0, 1, 1], np.zeros((3, 2, 1))),
        ([0, 2, 1], np.zeros((3, 2, 1))),
        ([0, np.nan, 1], np.zeros((3, 2, 1))),
        ([0, 1], np.full((2, 2, 1), np.nan)),
        ([0, 1], np.zeros((3, 2, 1))),
        ([0, 1], np.zeros((2, 1))),
    ],
)
def test_a_branch_is_a_function_of_force(force, samples):
    with pytest.raises(InputError):
        Branch(np.array(force, dtype=float), samples)


def test_a_reading_that_does_not_change_has_no_percentages(branch):
    run = branch(np.zeros_like, UP)
    assert np.isnan(nonlinearity(run, experiment(run).largest_change)).any()


def test_one_replicate_has_no_error(branch):
    run = branch(np.square, UP, replicates=1)
    found = nonlinearity(run, experiment(run).largest_change)
    assert found.percent[0] == pytest.approx(25) and np.isnan(found.error[0])


def test_a_run_through_zero_has_two_branches_unless_zero_is_just_off(branch):
    both = experiment(branch(np.square, np.arange(-4.0, 5)))
    assert [run.loading for run in both.branches] == [False, True] and len(both.loading_runs) == 1
    parts = experiment(branch(np.square, np.arange(-4.0, 5)), ordered=False).branches
    assert [part.loading for part in parts] == [True, True] and [part.side for part in parts] == [-1, 1]
    assert len(experiment(branch(np.square, [-0.2, 0.1, 5, 10])).branches) == 1


@pytest.mark.parametrize("replicates", [8, 32])
@pytest.mark.parametrize("noise", [0.003, 0.03])
def test_intervals_hold_the_truth(branch, covered, noise, replicates):
    """A bend of 15 % and a loop of 10 %, noise of 0.1 and 1 % of what is read at most."""
    up = branch(lambda f: f / 10 * 3 - 1.8 * f / 10 * (1 - f / 10), UP, noise, replicates, 500, seed=1)
    back = branch(lambda f: f / 10 * 3 - 0.6 * f / 10 * (1 - f / 10), UP[::-1], noise, replicates, 500, seed=2)
    largest = experiment(up, back).largest_change
    for found, truth in ((nonlinearity(up, largest), 15), (hysteresis(up, back, largest), 10)):
        covered(found.percent, found.error, truth, replicates, at_least=0.89)
        assert abs(np.mean(found.percent) - truth) < 0.6 * np.mean(found.error)


def test_no_deviation_is_found_where_there_is_none(branch, covered):
    """The largest of 51 differences of noise alone would be 3 errors; here it is zero on average."""
    one, other = (branch(lambda f: 0.3 * f, UP, 0.03, 32, 500, seed=seed) for seed in (1, 2))
    found = repeatability(one, other, experiment(one, other).largest_change)
    assert abs(np.mean(found.percent / found.error)) < 5 / np.sqrt(500)
    covered(found.percent, found.error, 0, 32, at_least=0.93)


def test_noise_that_points_share_does_not_enter(branch):
    shared = np.random.default_rng(1).normal(size=(1, 32, 3))
    run = Branch(UP, UP[:, None, None] ** 2 + shared - shared[0])
    found = nonlinearity(run, experiment(run).largest_change)
    np.testing.assert_allclose(found.percent, 25)
    assert found.error.max() < 1e-12
