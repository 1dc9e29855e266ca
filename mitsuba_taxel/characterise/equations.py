"""Hysteresis, repeatability and nonlinearity of a taxel: equations 5 to 7 of the paper.

The paper compares voltage changes dv of two ranges of time and divides by the largest dv of the experiment. Here two
branches, linearly interpolated, are compared at equal force; the largest difference over all common forces counts, and
is given with the force where it occurs.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.characterise.experiment import Branch
from mitsuba_taxel.characterise.replicates import at_largest


class Deviation(NamedTuple):
    """A deviation in percent of the largest change, one per channel.

    ``percent`` is free of the bias of a maximum of noisy magnitudes (each half of the replicates is evaluated at the
    place, and with the sign, of the other half's maximum), so it may be negative if there is no deviation. ``error`` is
    1 sigma from the replicates; NaN with only one, in which case the bias remains. ``at`` is the force in N.
    """

    percent: np.ndarray
    error: np.ndarray
    at: np.ndarray


def hysteresis(increasing: Branch, decreasing: Branch, largest_change: np.ndarray) -> Deviation:
    """Equation 5: e_h = max |dv_incr - dv_decr| / v_max, over the forces common to both branches.

    Parameters
    ----------
    increasing, decreasing : Branch
        A branch with the force's magnitude growing, and one with it falling.
    largest_change : ndarray
        v_max (replicates, channels), see :attr:`Experiment.largest_change`.

    Raises
    ------
    InputError
        if the branches do not have opposite directions or share no range of force.
    """
    if not increasing.loading or decreasing.loading:
        raise InputError("hysteresis compares a branch of growing force with one of falling force.")
    return _deviation(*_difference(increasing, decreasing), largest_change)


def repeatability(one: Branch, other: Branch, largest_change: np.ndarray) -> Deviation:
    """Equation 6: e_r = max |dv_a - dv_b| / v_max, over the forces common to both branches.

    Parameters
    ----------
    one, other : Branch
        Two branches with the force's magnitude growing, or two with it falling.
    largest_change : ndarray
        v_max (replicates, channels).

    Raises
    ------
    InputError
        if the branches have opposite directions or share no range of force.
    """
    if one.loading != other.loading:
        raise InputError("repeatability compares two branches of growing force, or two of falling force.")
    return _deviation(*_difference(one, other), largest_change)


def nonlinearity(branch: Branch, largest_change: np.ndarray) -> Deviation:
    """Equation 7: e_nl = max |dv_incr - dv_nom| / v_max.

    The paper does not define its "ideal linear case" dv_nom. Here it is the end-point line, from the first point of the
    branch to its last ("terminal-based" linearity).

    Parameters
    ----------
    branch : Branch
        Usually the first one of growing force.
    largest_change : ndarray
        v_max (replicates, channels).
    """
    return _deviation(branch.force, from_line(branch, branch), largest_change)


def from_line(branch: Branch, nominal: Branch) -> np.ndarray:
    """Samples of a branch minus the end-point line of another one.

    Parameters
    ----------
    branch : Branch
        Whose samples count.
    nominal : Branch
        Whose ends the line joins.

    Returns
    -------
    (points, replicates, channels) ndarray
        In the unit of the readings.
    """
    first, last = nominal.samples[0], nominal.samples[-1]
    share = (branch.force - nominal.force[0]) / (nominal.force[-1] - nominal.force[0])
    return branch.samples - (first + share[:, None, None] * (last - first))


def share_forces(one: Branch, other: Branch) -> bool:
    """Whether two branches have a range of force in common."""
    low, high = _overlap(one, other)
    return bool(low < high)


def _overlap(one: Branch, other: Branch) -> tuple[float, float]:
    low = max(one.force.min(), other.force.min())
    high = min(one.force.max(), other.force.max())
    return low, high


def _difference(one: Branch, other: Branch) -> tuple[np.ndarray, np.ndarray]:
    """Forces (points,) and the difference of the branches there, which is linear in between."""
    low, high = _overlap(one, other)
    if not low < high:
        raise InputError("the two branches share no range of force: nothing can be compared.")
    force = np.unique(np.concatenate([one.force, other.force]))
    force = force[(force >= low) & (force <= high)]
    return force, one.at(force) - other.at(force)


def _deviation(force: np.ndarray, difference: np.ndarray, largest_change: np.ndarray) -> Deviation:
    """The largest difference over the largest change: a ratio of means, with its error to first order."""
    most = at_largest(difference)
    largest = largest_change.mean(axis=0)
    known = np.where(largest > 0, largest, np.nan)
    share = most.magnitude.mean(axis=0) / known
    error = most.error_of(most.magnitude - share * largest_change) / known
    return Deviation(100 * share, 100 * error, force[most.place])
