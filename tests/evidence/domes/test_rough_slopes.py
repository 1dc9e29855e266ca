"""The table of slopes with rough walls: what a row holds, and the page."""

from __future__ import annotations

from mitsuba_taxel.evidence.domes import rough_slopes


def test_rows_and_page(monkeypatch, tmp_path):
    coarse = {"finish": "layer_steps", "layer_height": 0.2, "mesh_size": 2.5}
    monkeypatch.setattr(rough_slopes, "LOADS", (0.0, -0.2, -0.6, -0.8))
    case = rough_slopes.RoughCase("spherical", rough_slopes.LAMBERTIAN, 256, coarse)
    monkeypatch.setattr(rough_slopes, "CASES", {"a cell": case})
    (row,) = rough_slopes.rough_slopes()
    assert row.points == 256 and 0 < row.reading < 0.02
    assert 3 * row.light < row.plain and row.light < row.largest < 1
    rough_slopes.write_page([row], tmp_path / "page.md", "the command")
    page = (tmp_path / "page.md").read_text()
    assert page.count("| a cell |") == 1 and "`the command`" in page
