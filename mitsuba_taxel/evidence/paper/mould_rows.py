"""Figures of merit of pads with printed moulds, stored in a CSV file, from which the page can be rewritten."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from mitsuba_taxel.evidence.paper.mould import MouldFigures, MouldWalls
from mitsuba_taxel.evidence.rows.row_files import read_rows, write_rows


@dataclass(frozen=True)
class MouldRow:
    """A row of the CSV file: a pad and its figures of merit. Meanings and units are those of `MouldWalls` and
    `MouldFigures`."""

    case: str
    cell: str
    layer: float
    direction: str
    roof: str
    side: float
    change: str
    pad: str
    least: float
    least_error: float
    most: float
    most_error: float
    nonlinearity: float
    nonlinearity_error: float
    along_x: float
    along_x_error: float
    along_y: float
    along_y_error: float
    taxel: float


def write_mould_rows(figures: Mapping[MouldWalls, MouldFigures], file: Path) -> None:
    """Write figures of merit to a CSV file in full precision.

    Parameters
    ----------
    figures : Mapping[MouldWalls, MouldFigures]
        Figures of merit by pad.
    file : Path
        CSV file, which is replaced.
    """
    rows = []
    for wall, row in figures.items():
        numbers: dict[str, Any] = {}
        for name, (value, error) in row.numbers().items():
            numbers |= {name: value, f"{name}_error": error}
        rows.append(MouldRow(**{"case": wall.folder, **asdict(wall), **numbers, "taxel": row.taxel}))
    write_rows(rows, file)


def read_mould_rows(file: Path) -> dict[MouldWalls, MouldFigures]:
    """Read a CSV file that :func:`write_mould_rows` wrote.

    Parameters
    ----------
    file : Path
        CSV file.

    Returns
    -------
    dict[MouldWalls, MouldFigures]
        Figures of merit by pad.

    Raises
    ------
    InputError
        if the file cannot be read, or does not contain such rows.
    """
    return {
        MouldWalls(row.cell, row.layer, row.direction, row.roof, row.side, row.change, row.pad): MouldFigures(
            (row.least, row.least_error),
            (row.most, row.most_error),
            (row.nonlinearity, row.nonlinearity_error),
            (row.along_x, row.along_x_error),
            (row.along_y, row.along_y_error),
            int(row.taxel),
        )
        for row in read_rows(file, MouldRow).values()
    }
