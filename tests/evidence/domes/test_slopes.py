"""The table of derivatives: what a row compares, and the page."""

from __future__ import annotations

from mitsuba_taxel.evidence.domes import slopes


def test_rows_and_page(monkeypatch, tmp_path):
    monkeypatch.setattr(slopes, "CELL_SHAPES", ("cylindrical",))
    monkeypatch.setattr(slopes, "FORCES", ((0.0, 0.0, -0.5),))
    monkeypatch.setattr(slopes, "PARAMETERS", ("fz", "spacing"))
    monkeypatch.setattr(slopes, "FINE", 0.9)
    rows = list(slopes.slopes())
    assert [row.parameter for row in rows] == ["fz", "spacing"]
    for row in rows:
        assert abs(row.value - row.truth) < 3 * row.stated
    slopes.write_page(rows, tmp_path / "page.md", "the command")
    page = (tmp_path / "page.md").read_text()
    assert page.count("| cylindrical") == 2 and "of 2 derivatives" in page
