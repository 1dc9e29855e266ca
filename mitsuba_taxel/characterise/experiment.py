"""Experiments: changes of readings along one line of load, simulated or measured, as a sequence of runs."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.replicates import standard_error


class Tangents(NamedTuple):
    """Readings without noise at the points of one loading or unloading branch, and their slopes against the force, for
    cubic interpolation.

    ``value`` (points, channels), ``slope`` in W/N, and ``error``, one standard deviation of the slope.
    """

    value: np.ndarray
    slope: np.ndarray
    error: np.ndarray

    def part(self, points: slice | tuple[int, ...] | np.ndarray) -> Tangents:
        """The tangents at a selection of points."""
        return Tangents(*(column[points] for column in self))


@dataclass(frozen=True, eq=False)
class Branch:
    """A section of an experiment in which the force only grows or only falls.

    Parameters
    ----------
    force : (points,) ndarray
        Forces in N, in the order of loading.
    samples : (points, replicates, channels) ndarray
        Change of each channel's reading since the unloaded start in W or V. Replicates correspond between branches of
        the same experiment. With one replicate there are no errors.
    tangents : Tangents, optional
        Derivatives with respect to the force, if available.
    is_fitted : bool
        Whether slopes are those of the smooth curve through the readings, see :func:`fitted_slopes`.

    Raises
    ------
    InputError
        if the shapes do not match, a number is not finite, or the force is not strictly monotonic.
    """

    force: np.ndarray
    samples: np.ndarray
    tangents: Tangents | None = None
    is_fitted: bool = False

    def __post_init__(self) -> None:
        if self.force.ndim != 1 or self.samples.ndim != 3 or len(self.samples) != len(self.force):
            raise InputError(
                f"samples of shape {self.samples.shape} for forces of shape {self.force.shape} are not allowed: "
                "(points, replicates, channels) and (points,) are needed."
            )
        if not (np.isfinite(self.force).all() and np.isfinite(self.samples).all()):
            raise InputError("a branch contains numbers that are not finite: leave these points out.")
        steps = np.diff(self.force)
        if not ((steps > 0).all() or (steps < 0).all()):
            raise InputError(
                "the force of a branch must only rise or only fall: divide the branch where the force "
                "turns, and leave out points of equal force."
            )

    @property
    def value(self) -> np.ndarray:
        """Mean readings (points, channels) over the replicates."""
        return self.samples.mean(axis=1)

    @property
    def error(self) -> np.ndarray:
        """Standard error (points, channels) of the mean readings :attr:`value`; NaN with one replicate."""
        return standard_error(self.samples, axis=1)

    @property
    def loading(self) -> bool:
        """Whether the magnitude of the force grows."""
        return bool(abs(self.force[-1]) > abs(self.force[0]))

    @property
    def side(self) -> float:
        """Sign of the force where its magnitude is largest: 1 or -1."""
        return float(np.sign(self.force[np.abs(self.force).argmax()]))

    def part(self, points: slice | np.ndarray) -> Branch:
        """The branch with a selection of its points only."""
        tangents = self.tangents and self.tangents.part(points)
        return Branch(self.force[points], self.samples[points], tangents, self.is_fitted)

    def at(self, force: np.ndarray) -> np.ndarray:
        """Readings (forces, replicates, channels) at forces within the branch, linearly interpolated."""
        from scipy.interpolate import make_interp_spline

        order = np.argsort(self.force)
        return make_interp_spline(self.force[order], self.samples[order], k=1)(force)


@dataclass(frozen=True, eq=False)
class Experiment:
    """Readings of all taxels along one straight line of load, with all other parameters fixed.

    Parameters
    ----------
    force : str
        Name of the force of the runs, such as ``fx``, ``fz`` or ``0.707 fx + 0.707 fy``.
    direction : (3,) ndarray
        Unit vector of that force; zero if unknown.
    where : dict[str, Any]
        Values of the other varied parameters.
    unit : str
        ``W`` or ``V``.
    taxel : (channels,) ndarray
        Number of the taxel of each channel.
    runs : tuple[Branch, ...]
        Runs: sections from one turning point of the force to the next. A run may pass through zero.
    ordered : bool
        Whether the load passed through the forces in this order. If not, as for independent scenes, every branch
        counts as a branch of growing force.
    rest : (replicates, channels) ndarray, optional
        Readings at the unloaded start in ``unit``, if known.
    notes : tuple[str, ...]
        Remarks for readers of the figures.
    """

    force: str
    direction: np.ndarray
    where: dict[str, Any]
    unit: str
    taxel: np.ndarray
    runs: tuple[Branch, ...]
    ordered: bool = True
    rest: np.ndarray | None = None
    notes: tuple[str, ...] = ()

    def labelled(self, **where: Any) -> Experiment:
        """The same experiment with more parameters in ``where``."""
        return replace(self, where={**where, **self.where})

    def weighted(self, weights: np.ndarray) -> Experiment:
        """The same experiment with one channel: the sum of the readings of all taxels, each multiplied by its weight
        (channels,).
        """

        def sums(run: Branch) -> Branch:
            tangents = run.tangents and Tangents(
                run.tangents.value @ weights[:, None],
                run.tangents.slope @ weights[:, None],
                run.tangents.error @ np.abs(weights)[:, None],
            )
            return Branch(run.force, run.samples @ weights[:, None], tangents, run.is_fitted)

        rest = None if self.rest is None else self.rest @ weights[:, None]
        return replace(self, taxel=np.array([0]), runs=tuple(map(sums, self.runs)), rest=rest)

    @property
    def loading_runs(self) -> list[Branch]:
        """The runs in which the magnitude of the force grows, at least at their end."""
        return [run for run in self.runs if not self.ordered or any(branch.loading for branch in split_at_zero(run))]

    @property
    def branches(self) -> list[Branch]:
        """The runs in the order of loading, each split where its force passes through zero."""
        branches = [branch for run in self.runs for branch in split_at_zero(run)]
        return [branch if self.ordered or branch.loading else branch.part(slice(None, None, -1)) for branch in branches]

    @property
    def largest_change(self) -> np.ndarray:
        """Largest magnitude of the change in all runs (replicates, channels): v_max of equations 5 to 7."""
        samples = np.concatenate([run.samples for run in self.runs])
        values = samples.mean(axis=1)
        point = np.abs(values).argmax(axis=0)
        channels = np.arange(values.shape[1])
        return (samples[point, :, channels] * np.sign(values[point, channels])[:, None]).T


def split_at_zero(run: Branch) -> list[Branch]:
    """Split a run where its force passes through zero, and leave out parts of fewer than two points."""
    slices = parts_at_zero(run.force)
    return [run.part(points) for points in slices if len(run.force[points]) > 1]


def parts_at_zero(force: np.ndarray) -> list[slice]:
    """Slices of a run that is split where its force passes through zero. Both slices contain the point of least force.

    The run is not split if one side is shorter than a tenth of the other: a small offset of the reference sensor does
    not make a branch.
    """
    if not len(force) or force[0] * force[-1] >= 0:
        return [slice(None)]
    ends = np.abs(force[[0, -1]])
    least = int(np.abs(force).argmin())
    return [slice(None, least + 1), slice(least, None)] if ends.min() > 0.1 * ends.max() else [slice(None)]


def since(start: np.ndarray, runs: Iterable[Branch]) -> tuple[Branch, ...]:
    """Subtract a reading from all samples of runs.

    Parameters
    ----------
    start : (replicates, channels) ndarray
        The reading to subtract.
    runs : iterable of Branch
        Runs in the same unit.

    Returns
    -------
    tuple[Branch, ...]
        The changes since the reading, in the same order.
    """
    return tuple(replace(run, samples=run.samples - start) for run in runs)
