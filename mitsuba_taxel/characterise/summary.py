"""One channel to represent all taxels of an array, and the slopes of a study in few rows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import xarray as xr

from mitsuba_taxel.characterise.characteristics import characteristics
from mitsuba_taxel.characterise.experiment import Experiment
from mitsuba_taxel.characterise.load_lines import experiments
from mitsuba_taxel.characterise.shape_error import off_by_shape

if TYPE_CHECKING:
    import pandas


class Channel(NamedTuple):
    """Weights (taxels,) of the taxels, and a name for their sum; empty for a single taxel."""

    weights: np.ndarray
    words: str


def common_channel(compared: Sequence[Experiment]) -> Channel:
    """One channel for comparing experiments with equally many taxels along one force.

    It is the mean of the taxels under a normal force; under a tangential one, where taxels change in opposite
    directions, the taxel that changes most, on average over the experiments.
    """
    count = len(compared[0].taxel)
    if count == 1:
        return Channel(np.ones(1), "")
    if not compared[0].direction[:2].any():
        return Channel(np.full(count, 1 / count), f"mean of {count} taxels")
    return most_affected(compared)


def most_affected(compared: Sequence[Experiment]) -> Channel:
    """The taxel that changes most, on average over experiments with equally many taxels.

    Parameters
    ----------
    compared : sequence of Experiment
        At least one.

    Returns
    -------
    Channel
        Weights of the taxels, and words.
    """
    largest = np.mean([one.largest_change.mean(axis=0) for one in compared], axis=0)
    most = int(largest.argmax())
    words = f"taxel {compared[0].taxel[most]}" if len(largest) > 1 else ""
    return Channel(np.eye(len(largest))[most], words)


def slope_summary(study: xr.Dataset) -> tuple[str, pandas.DataFrame]:
    """Slopes along the first run of each line of load: a row per taxel for a single line.

    Several lines of one force have a row each, for the channel by which they are compared.

    Parameters
    ----------
    study : xr.Dataset
        Of one scene.

    Returns
    -------
    words : str
        Name of the channel; empty if the rows are of taxels.
    table : pandas.DataFrame
        As of :func:`characteristics`; it has no row if no force is varied.
    """
    found = experiments(study)
    off = {mode: [experiments(one) for one in both] for mode, both in off_by_shape(study).items()}
    words = ""
    if len(found) > 1 and len({one.force for one in found}) == 1:
        weights, words = common_channel(found)
    if words:
        found = [one.weighted(weights) for one in found]
        off = {mode: [[one.weighted(weights) for one in all_] for all_ in both] for mode, both in off.items()}
    table = characteristics(found, off)
    return words, table[table.loading == 1].drop(columns="taxel" if words else [])
