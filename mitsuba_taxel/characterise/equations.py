"""Hysteresis, repeatability and nonlinearity of a taxel: equations 5 to 7 of the paper.

The paper compares voltage changes dv of two ranges of time and divides by the largest dv of the experiment. Here two
branches, linearly interpolated, are compared at equal force. The result is the largest difference over all common
forces, and the force where it occurs.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.characterise.experiment import Branch
from mitsuba_taxel.characterise.replicates import at_largest


class Deviation(NamedTuple):
    """Largest difference between two branches for each channel, in percent of the channel's largest change. A branch is
    a section of an experiment in which the force only grows or only falls.

    ``percent`` (channels,) is the difference. The maximum of noisy magnitudes would be biased upwards. Each half of the
    replicates is therefore evaluated at the force where the other half has its maximum, with the sign of that maximum;
    the result may be negative if the branches do not differ. ``error`` (channels,) is one standard deviation from the
    replicates; with one replicate it is NaN, and the bias remains. ``at`` (channels,) is the force in N of the maximum.
    """

    percent: np.ndarray
    error: np.ndarray
    at: np.ndarray


def hysteresis(increasing: Branch, decreasing: Branch, largest_change: np.ndarray) -> Deviation:
    """Equation 5: e_h = max |dv_incr - dv_decr| / v_max, over the forces common to both branches.

    Parameters
    ----------
    increasing, decreasing : Branch
        A branch of growing magnitude of the force, and a branch of falling magnitude.
    largest_change : ndarray
        v_max (replicates, channels), see :attr:`Experiment.largest_change`.

    Returns
    -------
    Deviation
        Hysteresis in percent of the largest change.

    Raises
    ------
    InputError
        if the branches do not have opposite directions or share no range of force.
    """
    if not increasing.loading or decreasing.loading:
        raise InputError("hysteresis needs a branch of growing force and a branch of falling force, in this order.")
    return _deviation(*_difference(increasing, decreasing), largest_change)


def repeatability(first: Branch, second: Branch, largest_change: np.ndarray) -> Deviation:
    """Equation 6: e_r = max |dv_a - dv_b| / v_max, over the forces common to both branches.

    Parameters
    ----------
    first, second : Branch
        Two branches of growing magnitude of the force, or two of falling magnitude.
    largest_change : ndarray
        v_max (replicates, channels).

    Returns
    -------
    Deviation
        Repeatability in percent of the largest change.

    Raises
    ------
    InputError
        if the branches have opposite directions or share no range of force.
    """
    if first.loading != second.loading:
        raise InputError("repeatability needs two branches of growing force, or two branches of falling force.")
    return _deviation(*_difference(first, second), largest_change)


def nonlinearity(branch: Branch, largest_change: np.ndarray) -> Deviation:
    """Equation 7: e_nl = max |dv_incr - dv_nom| / v_max.

    The paper does not define its "ideal linear case" dv_nom. Here it is the end-point line, from the first point of the
    branch to its last ("terminal-based" linearity).

    Parameters
    ----------
    branch : Branch
        Usually the first branch of growing force.
    largest_change : ndarray
        v_max (replicates, channels).

    Returns
    -------
    Deviation
        Nonlinearity in percent of the largest change.
    """
    return _deviation(branch.force, from_line(branch, branch), largest_change)


def from_line(branch: Branch, nominal: Branch) -> np.ndarray:
    """Readings of a branch minus the straight line between the ends of the same or another branch.

    Parameters
    ----------
    branch : Branch
        The branch with the samples.
    nominal : Branch
        The branch whose first and last points define the line.

    Returns
    -------
    (points, replicates, channels) ndarray
        Differences in the unit of the readings.
    """
    first, last = nominal.samples[0], nominal.samples[-1]
    fraction = (branch.force - nominal.force[0]) / (nominal.force[-1] - nominal.force[0])
    return branch.samples - (first + fraction[:, None, None] * (last - first))


def share_forces(first: Branch, second: Branch) -> bool:
    """Whether the ranges of force of two branches overlap."""
    low, high = _overlap(first, second)
    return bool(low < high)


def _overlap(first: Branch, second: Branch) -> tuple[float, float]:
    low = max(first.force.min(), second.force.min())
    high = min(first.force.max(), second.force.max())
    return low, high


def _difference(first: Branch, second: Branch) -> tuple[np.ndarray, np.ndarray]:
    """Difference of the readings of two branches, at all forces at which either branch has a point. Returns the forces
    (points,) and the differences, which are linear in between.
    """
    low, high = _overlap(first, second)
    if not low < high:
        raise InputError(
            "the forces of the two branches do not overlap: branches with a common range of force are needed."
        )
    force = np.unique(np.concatenate([first.force, second.force]))
    force = force[(force >= low) & (force <= high)]
    return force, first.at(force) - second.at(force)


def _deviation(force: np.ndarray, difference: np.ndarray, largest_change: np.ndarray) -> Deviation:
    """Largest difference of two branches divided by the largest change of the readings. It is a ratio of means over the
    replicates, with its error to first order."""
    maximum = at_largest(difference)
    largest = largest_change.mean(axis=0)
    normalizer = np.where(largest > 0, largest, np.nan)
    ratio = maximum.magnitude.mean(axis=0) / normalizer
    error = maximum.error_of(maximum.magnitude - ratio * largest_change) / normalizer
    return Deviation(100 * ratio, 100 * error, force[maximum.point])
