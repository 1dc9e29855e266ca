"""Steps of a load path, or of any other sequence of scenes, from a CSV file."""

from __future__ import annotations

import csv
from pathlib import Path

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.text import read_text
from mitsuba_taxel.studies.plan.vary import MOST_JOBS


def read_steps(file: str | Path, what: str = "steps") -> list[dict[str, str]]:
    """The rows of a CSV file, as values by parameter of the scene, which its heading names; errors call it ``what``.

    Raises
    ------
    InputError
        if the file cannot be read, or is not a complete table with a heading.
    """
    given = f"{what} = {str(file)!r}"
    lines = [line for line in read_text(given, Path(file)).splitlines() if line.split("#")[0].strip()]
    try:
        names, *rows = [[word.strip() for word in row] for row in csv.reader(lines)] or [[]]
    except csv.Error as error:
        raise InputError(f"{given} is not a CSV file: {error}.") from error
    if not rows or not all(names) or len(set(names)) < len(names):
        raise InputError(f"{given} is not allowed: a heading of distinct parameters and at least one row are needed.")
    if len(rows) > MOST_JOBS:
        raise InputError(f"{given} holds {len(rows)} rows: at most {MOST_JOBS} are allowed.")
    for number, row in enumerate(rows, start=1):
        if len(row) != len(names) or not all(row):
            raise InputError(f"{given}: row {number} is not allowed: {len(names)} values are needed.")
    return [dict(zip(names, row, strict=True)) for row in rows]
