"""What 1.x keeps: no name that users rely on goes, and each new one is listed."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from public_names import all_names

import mitsuba_taxel

ROOT = Path(__file__).parents[2]


def is_kept(line: str, names: set[str]) -> bool:
    """Whether a listed line is there still; a function may have got further parameters, by name or at the end."""
    if line in names or not line.endswith(")"):
        return line in names
    function, parameters = line.removesuffix(")").split("(")
    now = next((name for name in names if name.startswith(function + "(")), None)
    if now is None:
        return False
    before, after = (text.split(", ") for text in (parameters, now.removesuffix(")").split("(")[1]))
    positional = before[: before.index("*")] if "*" in before else before
    return after[: len(positional)] == positional and set(before) - {"", "*"} <= set(after)


def test_no_public_name_is_gone_and_all_are_listed():
    listed = (ROOT / "docs" / "reference" / "public_names.txt").read_text().splitlines()
    names = all_names()
    gone = [line for line in listed if not is_kept(line, set(names))]
    assert gone == [], "1.x keeps these; see docs/reference/compatibility.md"
    assert listed == names, "write the list: python tests/helpers/public_names.py > docs/reference/public_names.txt"


@pytest.mark.parametrize(
    ("line", "kept"),
    [("f(a, b)", True), ("f(a, *, b)", True), ("f(b, a)", False), ("f(c)", False), ("g()", False), ("taxel x", False)],
)
def test_a_name_is_kept_with_its_parameters_in_their_order(line, kept):
    assert is_kept(line, {"f(a, b, *, c)", "taxel y"}) is kept


def test_release_files_name_one_version():
    version = mitsuba_taxel.__version__
    files = ("CHANGELOG.md", "CITATION.cff", "release/recipe.yaml")
    changes, citation, recipe = ((ROOT / file).read_text() for file in files)
    assert re.search(r"^version: (.*)$", citation, re.M)[1] == version
    assert re.search(r'^  version: "(.*)"$', recipe, re.M)[1] == version
    released = re.search(rf"^## {re.escape(version)} - (\d{{4}}-\d\d-\d\d)$", changes, re.M)[1]
    assert re.search(r'^date-released: "(.*)"$', citation, re.M)[1] == released


def test_a_release_is_described_in_120_lines():
    for release in re.split(r"^## ", (ROOT / "CHANGELOG.md").read_text(), flags=re.M)[1:]:
        assert len(release.splitlines()) <= 120, release.splitlines()[0]
