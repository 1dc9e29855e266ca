"""Whether the page of a folder holds what a command printed of it."""

from __future__ import annotations

import re
from html import unescape

from mitsuba_taxel.report.page import write_report


def assert_on_its_page(done, folder):
    """Each line that the command printed is on the page: as words, or cell by cell."""
    assert done.returncode == 0, done.stderr
    write_report(folder, folder / "page.html")
    page = unescape(re.sub(r"<style>.*?</style>", "", (folder / "page.html").read_text(), flags=re.DOTALL))
    text = " ".join(re.sub(r"<[^>]+>", " ", page).split())
    for line in done.stdout.splitlines():
        if not line.startswith("Results: "):
            assert all(cell.rstrip(":") in text for cell in re.split(r"  +", line.strip())), line
