"""Maps of taxels under a tangential load, and their symmetric pairs (paper, Fig. 10)."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.replicates import standard_error
from mitsuba_taxel.characterise.characteristics import NOT_RESOLVED
from mitsuba_taxel.characterise.experiment import Experiment
from mitsuba_taxel.characterise.load_lines import experiments

if TYPE_CHECKING:
    import pandas

MIRRORS = {"across": -1, "along": 1}
"""``across`` mirrors at the line through the centre perpendicular to the load: the two taxels lie before and behind it.
``along`` mirrors at the line of the load: the two lie on either side of it."""


@dataclass(frozen=True, eq=False)
class TangentialMap:
    """Changes of the taxels' readings under a tangential load.

    ``experiment`` : its origin; ``direction`` (2,) : of the load in the board's plane; ``force`` : its component along
    that in N; ``shape`` : rows and columns; ``samples`` (replicates, taxels) : change since the start of the experiment
    in its unit. Taxels are numbered row by row from (-x, +y), so that a picture of rows and columns shows the board
    with x to the right and y upwards.
    """

    experiment: Experiment
    direction: np.ndarray
    force: float
    shape: tuple[int, int]
    samples: np.ndarray

    @property
    def change(self) -> np.ndarray:
        """Mean change (rows, columns)."""
        return self.samples.mean(axis=0).reshape(self.shape)

    @property
    def error(self) -> np.ndarray:
        """Standard error of :attr:`change` (rows, columns)."""
        return standard_error(self.samples).reshape(self.shape)


def tangential_maps(study: xr.Dataset | xr.DataTree) -> list[TangentialMap]:
    """A map for each line of tangential load of a study, at the largest of its forces.

    The numbers of rows and columns are the study's attributes ``rows`` and ``columns`` or the scene's parameters of
    these names; without them, the taxels are assumed to form a square.

    Raises
    ------
    InputError
        if the taxels do not fill rows and columns.
    """
    if isinstance(study, xr.DataTree):
        return [
            replace(one, experiment=one.experiment.labelled(scene=leaf.name))
            for leaf in study.leaves
            for one in tangential_maps(leaf.to_dataset())
        ]
    loads = [one for one in experiments(study) if one.direction[2] == 0 and one.direction.any()]
    return [tangential_map(one, *_grid(study)) for one in loads]


def tangential_map(experiment: Experiment, rows: int, columns: int) -> TangentialMap:
    """The map at the largest magnitude of force in the first run of an experiment.

    Raises
    ------
    InputError
        if the load is not tangential, or the taxels do not fill the rows and columns.
    """
    if experiment.direction[2] or not experiment.direction.any():
        raise InputError(f"the load {experiment.force} is not tangential: fx, fy or both are needed.")
    if rows * columns != len(experiment.taxel):
        raise InputError(f"{rows} rows and {columns} columns do not hold {len(experiment.taxel)} taxels.")
    run = next(run for run in experiment.runs if len(run.force))
    most = int(np.abs(run.force).argmax())
    return TangentialMap(
        experiment, experiment.direction[:2], float(run.force[most]), (rows, columns), run.samples[most]
    )


def symmetric_pairs(maps: Iterable[TangentialMap]) -> pandas.DataFrame:
    """Taxels that mirror each other, and the difference of their changes.

    There are two mirrors. Across the load, a symmetric and linear pad has opposite changes: along the secondary
    diagonal of a square of nine (the paper's Fig. 10), 3 and 7 differ most, 2 and 4 as well as 6 and 8 less. Along the
    load, such a pad has equal changes. There are no pairs if the grid is not symmetric, as for a diagonal load on
    different numbers of rows and columns; equal pitches are assumed.

    Parameters
    ----------
    maps : iterable of TangentialMap
        Of a study.

    Returns
    -------
    pandas.DataFrame
        One row per pair: ``force``; the other varied parameters; ``at_N``, the force; ``mirror``; ``taxel`` and
        ``other``; ``difference`` of their changes, and its ``error`` from the replicates' differences, in ``unit``;
        ``remark``, as in :func:`characteristics`.
    """
    import pandas

    rows = [
        {"force": one.experiment.force, **one.experiment.where, "at_N": one.force, "mirror": mirror, **pair}
        for one in maps
        for mirror, sign in MIRRORS.items()
        for pair in _pairs(one, sign)
    ]
    last = ("at_N", "mirror", "taxel", "other", "difference", "error", "unit", "remark")
    others = dict.fromkeys(name for row in rows for name in row if name not in ("force", *last))
    return pandas.DataFrame(rows, columns=["force", *others, *last])


def _pairs(taxels: TangentialMap, sign: int) -> Iterator[dict[str, Any]]:
    """The pairs of one mirror: at the load's line, or with ``sign`` -1 across it."""
    rows, columns = taxels.shape
    y, x = np.meshgrid((rows - 1) / 2 - np.arange(rows), np.arange(columns) - (columns - 1) / 2, indexing="ij")
    place = np.stack([x.ravel(), y.ravel()], axis=1)
    image = sign * (2 * np.outer(place @ taxels.direction, taxels.direction) - place)
    distance = np.linalg.norm(image[:, None] - place, axis=2)
    if (distance.min(axis=1) > 0.1).any():
        return
    for one, other in enumerate(distance.argmin(axis=1)):
        if one < other:
            difference = taxels.samples[:, one] - taxels.samples[:, other]
            value, error = float(difference.mean()), float(standard_error(difference))
            yield {
                "taxel": int(taxels.experiment.taxel[one]),
                "other": int(taxels.experiment.taxel[other]),
                "difference": value,
                "error": error,
                "unit": taxels.experiment.unit,
                "remark": NOT_RESOLVED if abs(value) <= error else "",
            }


def _grid(study: xr.Dataset) -> tuple[int, int]:
    """Rows and columns of the taxels."""
    count = study.sizes["taxel"]
    side = math.isqrt(count)
    given = {**json.loads(study.attrs.get("parameters", "{}")), **study.attrs}
    if "rows" in given and "columns" in given:
        return int(given["rows"]), int(given["columns"])
    if side * side != count:
        raise InputError(f"{count} taxels are no square: the study's attributes rows and columns are needed.")
    return side, side
