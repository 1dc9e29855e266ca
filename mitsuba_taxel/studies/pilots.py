"""How many points the scenes of a batch need, from pilot runs of some of them."""

from __future__ import annotations

import gc
from collections.abc import Iterator

import numpy as np

from mitsuba_taxel.errors import ComputationError, InputError
from mitsuba_taxel.optics import points_for
from mitsuba_taxel.studies.batch import Batch
from mitsuba_taxel.studies.job import describe
from mitsuba_taxel.studies.vary import combinations, curve_dimension

MOST_PILOT_CURVES = 8
"""Curves of a study, spread evenly over it, whose scenes say how many points it takes."""


def piloted_points(batch: Batch, target_error: float) -> int:
    """Points that reach the target at the first, middle and last scene of some of the curves.

    Raises
    ------
    InputError, ComputationError
        that of the first scene, if none of them can be read.
    """
    points, failed = [], []
    for values in _pilot_scenes(batch):
        try:
            points.append(points_for(batch.scene(values), target_error, batch.seed))
        except (InputError, ComputationError) as error:
            failed.append(type(error)(f"{describe(values)}: {error}"))
        gc.collect()
    if not points:
        raise failed[0]
    return max(points)


def _pilot_scenes(batch: Batch) -> Iterator[dict[str, str]]:
    dims = [axis.dim for axis in batch.axes]
    curve = dims.index(curve_dimension(batch.axes))
    count = batch.axes[curve].size
    ends = sorted({0, count // 2, count - 1})
    starts = [index for index, _ in combinations(batch.axes) if index[curve] == 0]
    chosen = np.unique(np.linspace(0, len(starts) - 1, MOST_PILOT_CURVES).round().astype(int))
    for start in (starts[i] for i in chosen):
        for end in ends:
            index = (*start[:curve], end, *start[curve + 1 :])
            places = zip(batch.axes, index, strict=True)
            yield {name: words[i] for axis, i in places for name, words in axis.values.items()}
