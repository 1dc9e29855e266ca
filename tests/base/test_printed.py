"""What a command printed is read back; a file of somebody else is no result."""

from __future__ import annotations

import pytest

from mitsuba_taxel.base.files.printed import FILE, figures_table, read_printed, write_printed


def test_it_is_read_back(tmp_path):
    printed = [figures_table("By slope", ["force", "taxel"], [["fz", "1"], ["fz", "2"]]), "a line"]
    write_printed(printed, tmp_path)
    assert read_printed(tmp_path) == printed and printed[0].title == "By slope, fz:"


@pytest.mark.parametrize("text", [
    "", "3", "{}", '{"a": 1}', "[null]", "[1]", '[["a"]]', '[{"title": "a"}]',
    '[{"title": 1, "headings": [], "rows": []}]', '[{"title": "", "headings": [1], "rows": []}]',
    '[{"title": "", "headings": [], "rows": [[1]]}]', '[{"title": "", "headings": [], "rows": "ab"}]',
])  # fmt: skip
def test_anything_else_is_none(tmp_path, text):
    (tmp_path / FILE).write_text(text)
    assert read_printed(tmp_path) is None
