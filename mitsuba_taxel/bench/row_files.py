"""Rows of tables that are kept in a file, so that a long run can be stopped and resumed."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, TypeVar

from mitsuba_taxel.base.atomic import replacing
from mitsuba_taxel.base.errors import InputError

Row = TypeVar("Row")


def read_rows(file: Path, kind: type[Row]) -> dict[str, Row]:
    """Rows of a file from :func:`write_rows`, by the name of their case; raises `InputError`."""
    types: dict[str, type] = {field.name: str if field.type == "str" else float for field in fields(kind)}  # type: ignore[arg-type]
    try:
        with file.open(newline="", encoding="utf-8") as stream:
            read = csv.DictReader(stream)
            return {row["case"]: kind(**{name: types[name](text) for name, text in row.items()}) for row in read}
    except (KeyError, OSError, TypeError, ValueError) as error:
        raise InputError(f"{file} is not allowed: a file of rows that this command wrote is needed.") from error


def write_rows(rows: Iterable[Any], file: Path) -> None:
    """Write rows of one kind with a heading, in full precision; missing numbers are ``nan``."""
    rows = list(rows)
    with replacing(file) as temporary, temporary.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, [field.name for field in fields(rows[0])])
        writer.writeheader()
        writer.writerows(map(asdict, rows))
