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
"""``across`` mirrors at the line through the centre perpendicular to the load; ``along`` at the line of the load."""


@dataclass(frozen=True, eq=False)
class TangentialMap:
    """Changes of the taxels' readings under a tangential load.

    Taxels are numbered row by row from (-x, +y), so that a picture of rows and columns shows the board with x to the
    right and y upwards.

    Attributes
    ----------
    experiment : Experiment
        The experiment from which the map is taken.
    direction : (2,) ndarray
        Direction of the load in the plane of the board.
    force : float
        Component of the load in that direction, N.
    shape : tuple[int, int]
        Rows and columns.
    samples : (replicates, taxels) ndarray
        Change since the start of the experiment, in its unit.
    """

    experiment: Experiment
    direction: np.ndarray
    force: float
    shape: tuple[int, int]
    samples: np.ndarray

    @property
    def change(self) -> np.ndarray:
        """Mean change of the reading of each taxel (rows, columns), in the unit of the experiment."""
        return self.samples.mean(axis=0).reshape(self.shape)

    @property
    def error(self) -> np.ndarray:
        """Standard error of the mean :attr:`change` of each taxel (rows, columns)."""
        return standard_error(self.samples).reshape(self.shape)


def tangential_maps(study: xr.Dataset | xr.DataTree) -> list[TangentialMap]:
    """Maps of the changes of all taxels, one for each line of tangential load of a study, at its largest force.

    The numbers of rows and columns are the study's attributes ``rows`` and ``columns`` or the scene's parameters of
    these names; without them, the taxels are assumed to form a square.

    Raises
    ------
    InputError
        if the taxels do not fill rows and columns.
    """
    if isinstance(study, xr.DataTree):
        return [
            replace(line, experiment=line.experiment.labelled(scene=leaf.name))
            for leaf in study.leaves
            for line in tangential_maps(leaf.to_dataset())
        ]
    loads = [line for line in experiments(study) if line.direction[2] == 0 and line.direction.any()]
    return [tangential_map(line, *_grid(study)) for line in loads]


def tangential_map(experiment: Experiment, rows: int, columns: int) -> TangentialMap:
    """Map of the changes of all taxels at the largest force in the first run of an experiment.

    Parameters
    ----------
    experiment : Experiment
        Experiment along a tangential load.
    rows, columns : int
        Numbers of rows and columns of the taxels.

    Returns
    -------
    TangentialMap
        Changes of all taxels.

    Raises
    ------
    InputError
        if the load is not tangential, or the taxels do not fill the rows and columns.
    """
    if experiment.direction[2] or not experiment.direction.any():
        raise InputError(f"the load {experiment.force} is not tangential: fx, fy or both are needed.")
    if rows * columns != len(experiment.taxel):
        raise InputError(
            f"{rows} rows and {columns} columns are not allowed for {len(experiment.taxel)} taxels: their product must "
            "be the number of taxels."
        )
    run = next(run for run in experiment.runs if len(run.force))
    largest = int(np.abs(run.force).argmax())
    return TangentialMap(
        experiment, experiment.direction[:2], float(run.force[largest]), (rows, columns), run.samples[largest]
    )


def symmetric_pairs(maps: Iterable[TangentialMap]) -> pandas.DataFrame:
    """Pairs of taxels at mirrored positions, and the difference of their changes.

    Taxels are mirrored in two planes. In the plane perpendicular to the load (``across``), mirrored taxels of a
    symmetric and linear pad change by opposite amounts: under a load along the secondary diagonal of a square of nine
    (the paper's Fig. 10), taxels 3 and 7 differ most, 2 and 4 as well as 6 and 8 less. In the plane that contains the
    load (``along``), mirrored taxels change by equal amounts. There are no pairs if the grid is not symmetric, as for a
    diagonal load on different numbers of rows and columns. Equal pitches in x and y are assumed.

    Parameters
    ----------
    maps : iterable of TangentialMap
        Maps of a study.

    Returns
    -------
    pandas.DataFrame
        One row per pair: ``force``; the other varied parameters; ``at_N``, the force; ``mirror``; ``taxel`` and
        ``other``; ``difference`` of their changes, and its ``error`` from the replicates' differences, in ``unit``;
        ``remark``, as in :func:`characteristics`.
    """
    import pandas

    rows = [
        {"force": taxels.experiment.force, **taxels.experiment.where, "at_N": taxels.force, "mirror": mirror, **pair}
        for taxels in maps
        for mirror, sign in MIRRORS.items()
        for pair in _pairs(taxels, sign)
    ]
    columns = ("at_N", "mirror", "taxel", "other", "difference", "error", "unit", "remark")
    varied = dict.fromkeys(name for row in rows for name in row if name not in ("force", *columns))
    return pandas.DataFrame(rows, columns=["force", *varied, *columns])


def _pairs(taxels: TangentialMap, sign: int) -> Iterator[dict[str, Any]]:
    """Pairs of taxels that are mirror images of each other: in the line of the load (``sign`` 1), or in the line across
    it (``sign`` -1)."""
    rows, columns = taxels.shape
    y, x = np.meshgrid((rows - 1) / 2 - np.arange(rows), np.arange(columns) - (columns - 1) / 2, indexing="ij")
    position = np.stack([x.ravel(), y.ravel()], axis=1)
    image = sign * (2 * np.outer(position @ taxels.direction, taxels.direction) - position)
    distance = np.linalg.norm(image[:, None] - position, axis=2)
    if (distance.min(axis=1) > 0.1).any():
        return
    for first, second in enumerate(distance.argmin(axis=1)):
        if first < second:
            difference = taxels.samples[:, first] - taxels.samples[:, second]
            value, error = float(difference.mean()), float(standard_error(difference))
            yield {
                "taxel": int(taxels.experiment.taxel[first]),
                "other": int(taxels.experiment.taxel[second]),
                "difference": value,
                "error": error,
                "unit": taxels.experiment.unit,
                "remark": NOT_RESOLVED if abs(value) <= error else "",
            }


def _grid(study: xr.Dataset) -> tuple[int, int]:
    """Numbers of rows and columns of the taxels of a study."""
    count = study.sizes["taxel"]
    side = math.isqrt(count)
    attributes = {**json.loads(study.attrs.get("parameters", "{}")), **study.attrs}
    if "rows" in attributes and "columns" in attributes:
        return int(attributes["rows"]), int(attributes["columns"])
    if side * side != count:
        raise InputError(
            f"{count} taxels do not form a square: the attributes rows and columns of the study are needed."
        )
    return side, side
