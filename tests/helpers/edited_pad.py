"""`pad.xml` with pieces of its text replaced: with two cells, say, which take less time than nine."""

from __future__ import annotations

from pathlib import Path

from mitsuba_taxel.sensing import find_scene

ROWS_AND_COLUMNS = '<integer name="rows" value="{}"/>\n        <integer name="columns" value="{}"/>'
TWO_CELLS = (
    (ROWS_AND_COLUMNS.format(3, 3), ROWS_AND_COLUMNS.format(1, 2)),
    ('<shape type="deformable_pad">', '<shape type="deformable_pad">\n        ' + ROWS_AND_COLUMNS.format(1, 2)),
)
"""Replacements for a pad and photo-reflectors of one row and two columns."""


def edited(folder: Path, name: str, *replacements: tuple[str, str]) -> Path:
    """A copy with replacements (old, new)."""
    text = find_scene("pad.xml").read_text()
    for old, new in replacements:
        assert old in text
        text = text.replace(old, new)
    path = folder / name
    path.write_text(text)
    return path
