"""Every tutorial, and the start page, does what it says when its reader does what it says."""

from __future__ import annotations

from pathlib import Path

import pytest
from forked_script import run_script

DOCS = Path(__file__).parents[2] / "docs"
RUNNER = Path(__file__).with_name("run_tutorial.py")
TUTORIALS = sorted(page for page in (DOCS / "tutorials").glob("*.md") if page.stem != "index")
PAGES = [DOCS / "start.md", DOCS / "howto" / "python.md", *TUTORIALS]


@pytest.fixture(scope="module")
def solutions(tmp_path_factory):
    """Where the pages keep their solutions, away from the user's: some press the same pad."""
    return str(tmp_path_factory.mktemp("solutions"))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_tutorial(page, tmp_path, solutions):
    done = run_script(RUNNER, tmp_path, page, MITSUBA_TAXEL_CACHE=solutions, PYTHONWARNINGS="")
    assert done.returncode == 0, done.stdout[-6000:]


def test_all_are_there():
    assert len(PAGES) == 17


@pytest.mark.parametrize(
    "text, culprit",
    [
        ("```sh\ntrue\nfalse\ntrue\n```\n", "returned non-zero"),
        ("```python\nimport os\n```\n\n```python\nassert os.sep == ''\n```\n", "line 6"),
        ("```sh\ntouch here\n```\n<!-- makes: here there -->\n", "there"),
        ("words alone\n", "without steps"),
        ("```python\nprint('P = 2.02 W')\n```\n\n```text\nP = 2.00 W\n```\n", "P = 2.02 W"),
        ("```sh\necho a; echo b; echo c\n```\n\n```text\na\nc\n```\n", "printed:\na\nb\nc"),
    ],
    ids=["sh", "python", "files", "nothing", "number", "lines"],
)
def test_a_tutorial_that_does_not_work_is_found(text, culprit, tmp_path):
    page = tmp_path / "page.md"
    page.write_text(text)
    done = run_script(RUNNER, tmp_path, page)
    assert done.returncode != 0 and culprit in done.stdout


def test_listings_may_differ_in_their_last_digits_and_in_times(tmp_path):
    page = tmp_path / "page.md"
    steps = "```sh\necho 'P  = 1.001e-03 W'; echo 'Seconds: 3.2'\n```\n"
    page.write_text(f"{steps}\n```text\nP = 1.0e-03 W\nSeconds: 1.0\n```\n")
    assert run_script(RUNNER, tmp_path, page).returncode == 0


def test_shown_files_are_written(tmp_path):
    page = tmp_path / "page.md"
    shown = "```{code-block} python\n:caption: part.py\n\nX = 3\n```\n"
    page.write_text(f"{shown}\n```python\nimport part\n\nassert part.X == 3\n```\n")
    assert run_script(RUNNER, tmp_path, page).returncode == 0 and (tmp_path / "part.py").read_text() == "X = 3\n"
