"""The channel that represents all taxels of an array, and the slopes of a study in few rows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import xarray as xr

from mitsuba_taxel.characterise.characteristics import characteristics
from mitsuba_taxel.characterise.experiment import Experiment
from mitsuba_taxel.characterise.load_lines import experiments
from mitsuba_taxel.characterise.shape_error import changed_by_shape

if TYPE_CHECKING:
    import pandas


class Channel(NamedTuple):
    """A weighted sum of the taxels of an array: weights (taxels,), and a name, which is empty for a single taxel."""

    weights: np.ndarray
    words: str


def common_channel(compared: Sequence[Experiment]) -> Channel:
    """Choose the channel that represents all taxels when experiments along the same force are compared.

    Under a normal force it is the mean of the taxels. Under a tangential force, where taxels change in opposite
    directions, it is the taxel with the largest change on average over the experiments.
    """
    count = len(compared[0].taxel)
    if count == 1:
        return Channel(np.ones(1), "")
    if not compared[0].direction[:2].any():
        return Channel(np.full(count, 1 / count), f"mean of {count} taxels")
    return most_affected(compared)


def most_affected(compared: Sequence[Experiment]) -> Channel:
    """The taxel with the largest change on average over experiments with equally many taxels.

    Parameters
    ----------
    compared : sequence of Experiment
        At least one experiment.

    Returns
    -------
    Channel
        Weight 1 of that taxel, 0 of all others, and its name.
    """
    largest = np.mean([experiment.largest_change.mean(axis=0) for experiment in compared], axis=0)
    index = int(largest.argmax())
    words = f"taxel {compared[0].taxel[index]}" if len(largest) > 1 else ""
    return Channel(np.eye(len(largest))[index], words)


def slope_summary(study: xr.Dataset) -> tuple[str, pandas.DataFrame]:
    """Short table of the slopes of a study, along the first run of each line of load.

    For a single line of load the table has a row per taxel. For several lines along the same force it has a row per
    line, for the channel of :func:`common_channel`.

    Parameters
    ----------
    study : xr.Dataset
        Results of one scene.

    Returns
    -------
    words : str
        Name of the channel; empty if rows belong to taxels.
    table : pandas.DataFrame
        Result of :func:`characteristics`; empty if no force is varied.
    """
    lines = experiments(study)
    changed = {mode: [experiments(line) for line in pair] for mode, pair in changed_by_shape(study).items()}
    words = ""
    if len(lines) > 1 and len({line.force for line in lines}) == 1:
        weights, words = common_channel(lines)
    if words:
        lines = [line.weighted(weights) for line in lines]
        changed = {
            mode: [[line.weighted(weights) for line in changed_lines] for changed_lines in pair]
            for mode, pair in changed.items()
        }
    table = characteristics(lines, changed)
    return words, table[table.loading == 1].drop(columns="taxel" if words else [])
