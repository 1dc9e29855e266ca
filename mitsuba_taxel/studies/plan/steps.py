"""Steps of a load path, or of any other sequence of scenes, from a CSV file."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.table import as_parameter, read_table
from mitsuba_taxel.studies.plan.vary import MOST_JOBS


def read_steps(file: str | Path, what: str = "steps", known: Collection[str] = ()) -> list[dict[str, str]]:
    """The rows of a CSV file, as values by parameter of the scene, which its heading names; errors call it ``what``.

    Values with a unit in their heading, such as ``fz_mN`` or ``height [cm]``, become those in mm, N, MPa, s and
    degrees, unless the heading is one of the ``known`` parameters as it stands.

    Parameters
    ----------
    file : str or Path
        The CSV file.
    what : str
        What it is, for messages.
    known : collection of str
        Parameters of the scene.

    Returns
    -------
    list[dict[str, str]]
        A row each.

    Raises
    ------
    InputError
        if the file cannot be read, or is not a complete table with a heading.
    """
    given = f"{what} = {str(file)!r}"
    table = read_table(given, Path(file), known)
    names, columns = zip(*map(as_parameter, table.columns), strict=True) if table.columns else ((), ())
    rows = list(zip(*columns, strict=True))
    if not rows or not all(names) or len(set(names)) < len(names):
        raise InputError(f"{given} is not allowed: a heading of distinct parameters and at least one row are needed.")
    if len(rows) > MOST_JOBS:
        raise InputError(f"{given} holds {len(rows)} rows: at most {MOST_JOBS} are allowed.")
    for number, row in enumerate(rows, start=1):
        if not all(row):
            raise InputError(f"{given}: row {number} is not allowed: {len(names)} values are needed.")
    return [dict(zip(names, row, strict=True)) for row in rows]
