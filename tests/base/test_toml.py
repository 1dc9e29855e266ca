"""TOML files that are read, and those that are refused in one line."""

from __future__ import annotations

import pytest

from mitsuba_taxel import InputError
from mitsuba_taxel.base.files.toml import CHAIN, loads, read_toml

pytestmark = pytest.mark.quick


@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"], ids=["plain", "byte order mark"])
def test_a_file_is_read(tmp_path, mark):
    (tmp_path / "a.toml").write_bytes(mark + "scene = 'µ.xml'\n[define]\nfz = -1".encode())
    assert read_toml("study", tmp_path / "a.toml") == {"scene": "µ.xml", "define": {"fz": -1}}


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "cannot be read: No such file or directory."),
        (b"scene = ", "is not valid TOML: Invalid value"),
        (b"scene = '\xff'", "is not valid TOML: 'utf-8' codec"),
        (b"a = " + 10_000 * b"[", "is not allowed: it is nested too deeply; nest fewer tables."),
        (".".join(65 * ["a"]).encode() + b" = 1", "is not allowed: it is nested too deeply; nest fewer tables."),
    ],
    ids=["missing", "broken", "no text", "brackets", "dots"],
)
def test_others_are_refused(tmp_path, content, words):
    if content is not None:
        (tmp_path / "a.toml").write_bytes(content)
    with pytest.raises(InputError) as refused:
        read_toml("part 'a'", tmp_path / "a.toml")
    assert str(refused.value).startswith(f"part 'a' {words}") and "\n" not in str(refused.value)


def test_keys_of_a_few_words_and_numbers_are_no_chain():
    text = f"scene.define.fz = 1.5\ntimes = [{', '.join(200 * ['0.25'])}]"
    assert not CHAIN.search(text) and loads(text)["scene"]["define"]["fz"] == 1.5
