"""The glossary of developers: each word has one meaning, and is where it says."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parents[2]
LINES = (ROOT / "docs" / "develop" / "glossary.md").read_text(encoding="utf-8").splitlines()
ROWS = [[cell.strip() for cell in line.strip("|").split("|")] for line in LINES if line.startswith("| ")]
WORDS = [row for row in ROWS if row[0] != "word" and not row[0].startswith(":")]


def test_each_word_has_one_meaning():
    assert len(WORDS) > 100 and all(len(row) == 4 and row[1] and row[2] for row in WORDS)
    names = Counter(name.strip("` ") for word, *_ in WORDS for name in word.split(","))
    assert max(names.values()) == 1, names.most_common(3)
    meanings = Counter(meaning for _, meaning, *_ in WORDS)
    assert max(meanings.values()) == 1, meanings.most_common(3)


def test_each_word_is_where_it_says():
    for word, _, where, _ in WORDS:
        (place,) = re.findall("`([^`]+)`", where)
        assert (ROOT / (place if place.startswith("plugins") else f"mitsuba_taxel/{place}")).exists(), (word, place)
