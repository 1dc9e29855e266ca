"""The tables of boxes with sharp and rounded edges: what their rows hold, and the page."""

from __future__ import annotations

import pytest

from mitsuba_taxel.evidence.domes import fillets
from mitsuba_taxel.evidence.domes.domes import dome_scene
from mitsuba_taxel.sensing import measure


def difference_of_readings(step=0.05):
    """Slope in µW/N of the same box along x, from two readings."""
    x, y, z = fillets.SLOPE_AT
    roof = {"scattering": "lambertian", "reflectance": 0.9}
    low, high = (
        measure(dome_scene("parallelepiped", roof, force=[x + shift, y, z], mesh_size=2.0)).power[0]
        for shift in (-step, step)
    )
    return 1e6 * (high - low) / (2 * step)


def test_rows_and_page(monkeypatch, tmp_path):
    """A box with sharp edges on coarse elements: the end of its path, and its slope."""
    monkeypatch.setattr(fillets, "EDGES", {"sharp": {}})
    monkeypatch.setattr(fillets, "SIZES", (2.0,))
    monkeypatch.setattr(fillets, "SLOPE_EDGES", ("sharp",))
    monkeypatch.setattr(fillets, "SLOPE_SIZES", (2.0,))
    (end,), (slope,) = fillets.ends(), fillets.edge_slopes()
    assert end.elements == slope.elements == 856 and end.end == pytest.approx(3.15, abs=0.01)
    assert end.reason == "touches itself" and end.said.startswith("On elements of ")
    assert slope.slope == pytest.approx(difference_of_readings(), rel=0.02) and 0 < slope.error < 10

    fillets.write_page([end], [slope], tmp_path / "page.md", "the command")
    page = (tmp_path / "page.md").read_text()
    assert page.count("| sharp |") == 2 and "`the command`" in page


def test_answer_names_the_spread_of_ends_and_slopes():
    ends = [fillets.EndRow("sharp", size, 1, end, "", "", 0) for size, end in ((2.0, 3.0), (1.25, 2.2), (0.8, 2.0))]
    slopes = [fillets.EdgeSlopeRow("sharp", 1.0, n, slope, 1.0, 0) for n, slope in ((10, -41.0), (30, -40.0))]
    words = fillets.answer(ends, slopes)
    assert "2.00 to 3.00 N on 3 meshes, and changes by 10% between the two finest" in words
    assert "of 10 elements differs by 2.5% from that of 30" in words
