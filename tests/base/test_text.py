"""Text files that are read, and those that are refused in one line."""

from __future__ import annotations

from pathlib import Path

import pytest

from mitsuba_taxel import InputError
from mitsuba_taxel.base.files.text import read_text


@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"], ids=["plain", "byte order mark"])
def test_a_file_is_read(tmp_path, mark):
    (tmp_path / "a.csv").write_bytes(mark + "fz,µ\n-1,2\n".encode())
    assert read_text("steps", tmp_path / "a.csv") == "fz,µ\n-1,2\n"


def test_others_are_refused(tmp_path):
    (tmp_path / "a.csv").write_bytes(b"fz\n\xff")
    for file, words in (
        (tmp_path / "b.csv", "steps cannot be read (No such file or directory): a CSV file is needed."),
        (tmp_path, "steps cannot be read (Is a directory): a CSV file is needed."),
        (tmp_path / "a.csv", "steps is not text: a CSV file is needed."),
    ):
        with pytest.raises(InputError) as refused:
            read_text("steps", file)
        assert str(refused.value) == words
    # In Python's words, which differ between versions.
    with pytest.raises(InputError, match=r"^steps cannot be read \([^()]*embedded null [^()]*\): a CSV file is"):
        read_text("steps", Path("a\0"))
