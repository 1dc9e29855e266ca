"""The table of domes: what a row compares, and the page."""

from __future__ import annotations

from pathlib import Path

import pytest

from mitsuba_taxel.bench import domes
from mitsuba_taxel.bench.sphere_light import DOMES


def test_a_row_compares_with_its_truth(llvm_mono, monkeypatch, tmp_path):
    """Of a truth that is taken half as large as it is, and uncertain by 1 %."""
    monkeypatch.setattr(domes, "POINTS", 256)
    truth = DOMES["hemispheric"].diffuse_power("lambertian", 18)
    row = domes._row("hemispheric", "lambertian", 1, 0.0, (truth / 2, 0.01 * truth / 2))
    assert 0.01 < row.noise < 0.02 and 0 < row.stated < 1e-2
    assert row.off == pytest.approx(1, abs=6 * row.noise)
    domes.write_page([row], tmp_path / "domes.md", "taxel bench domes --markdown domes.md")
    page = (tmp_path / "domes.md").read_text()
    assert "| hemispheric | lambertian | 1 x 1 | 0 | 0.0147775 |" in page and "`taxel bench domes --markdown" in page


def test_the_page_states_what_it_should():
    """Spheres are read within 0.03 %, and mirrors within 0.3 %; loaded domes within twice the stated error."""
    lines = (Path(__file__).parents[2] / "docs" / "domes.md").read_text().splitlines()
    rows = [line.strip("| ").split(" | ") for line in lines if line.startswith(("| hemispheric", "| spherical"))]
    assert len(rows) == 2 * len(domes.WALLS) * len(domes.CASES)
    for _, wall, _, load, _, *relative in rows:
        off, noise, stated = (float(text.rstrip("%")) for text in relative)
        allowed = 2 * stated if float(load) else 0.3 if "mirror" in wall else 0.03
        assert abs(off) < allowed + 3 * noise
