"""Steps of a load path, or of any other sequence of scenes, from a CSV file."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.files.table import as_parameter, read_table
from mitsuba_taxel.studies.plan.vary import MOST_JOBS


def read_steps(file: str | Path, what: str = "steps", known: Collection[str] = ()) -> list[dict[str, str]]:
    """Read a CSV file of load steps, whose headings are parameters of a scene, one step per row.

    Values with a unit in their heading, such as ``fz_mN`` or ``height [cm]``, are converted to mm, N, MPa, s and
    degrees, unless the whole heading is the name of a parameter.

    Parameters
    ----------
    file : str or Path
        CSV file with a heading.
    what : str
        Name of the file in error messages.
    known : Collection[str]
        Names of the scene's parameters.

    Returns
    -------
    list[dict[str, str]]
        For each row, the values as text by parameter.

    Raises
    ------
    InputError
        if the file cannot be read, or is not a complete table with a heading.
    """
    label = f"{what} = {str(file)!r}"
    table = read_table(label, Path(file), known)
    names, columns = zip(*map(as_parameter, table.columns), strict=True) if table.columns else ((), ())
    rows = list(zip(*columns, strict=True))
    if not rows or not all(names) or len(set(names)) < len(names):
        raise InputError(f"{label} is not allowed: a heading of distinct parameters and at least one row are needed.")
    if len(rows) > MOST_JOBS:
        raise InputError(f"{label} holds {len(rows)} rows: at most {MOST_JOBS} are allowed.")
    for number, row in enumerate(rows, start=1):
        if not all(row):
            raise InputError(f"{label}: row {number} is not allowed: {len(names)} values are needed.")
    return [dict(zip(names, row, strict=True)) for row in rows]
