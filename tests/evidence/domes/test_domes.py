"""The table of domes: what a row compares, and the page."""

from __future__ import annotations

from pathlib import Path

import pytest

from mitsuba_taxel.backend.plugin_objects import make_plugin
from mitsuba_taxel.evidence.domes import domes
from mitsuba_taxel.evidence.domes.domes import dome_scene as scene
from mitsuba_taxel.evidence.domes.sphere_light import DOMES
from mitsuba_taxel.kernels.dome_elements import size_for_light
from mitsuba_taxel.mechanics import SpreadForce
from mitsuba_taxel.pads import Pad
from mitsuba_taxel.pads.cells.cell_shape import CellShape


def test_a_row_compares_with_its_truth(llvm_mono, monkeypatch, tmp_path):
    """Of a truth that is taken half as large as it is, and uncertain by 1 %."""
    monkeypatch.setattr(domes, "POINTS", 256)
    truth = DOMES["hemispheric"].diffuse_power("lambertian", 18)
    row = domes._row("hemispheric", "lambertian", 1, (0.0, 0.0, 0.0), (truth / 2, 0.01 * truth / 2))
    assert row.noise == pytest.approx(0.01) and 0 < row.stated < 1e-2
    assert row.deviation == pytest.approx(1, abs=1e-3)
    domes.write_page([row], [], tmp_path / "domes.md", "taxel bench domes --markdown domes.md")
    page = (tmp_path / "domes.md").read_text()
    assert "**0 of 1 readings are within" in page and "beyond: hemispheric, lambertian, 1 x 1, 0 N." in page
    assert "| hemispheric | lambertian | 1 x 1 | 0 | 0.0147775 |" in page and "`taxel bench domes --markdown" in page


def test_a_flat_roof_compares_with_its_quadrature(llvm_mono):
    """A frustum, whose reading does not depend on its elements; the quadrature has neither elements nor patches."""
    row = domes._row("frustum", "lambertian", 1, (0.0, 0.0, 0.0), domes._on_exact_roof("frustum", "lambertian"))
    assert 0 < row.stated < 3e-4 and abs(row.deviation) < 2 * row.stated and row.noise < 1e-5


def test_every_shape_of_cells_has_rows(monkeypatch):
    monkeypatch.setattr(domes, "_row", lambda *row: row)
    monkeypatch.setattr(domes, "_on_exact_roof", lambda *row: None)
    monkeypatch.setattr(domes, "_on_small_elements", lambda *row: (1.0, 0.0))
    cells = [cell for cell, *_ in domes.domes()]
    assert set(cells) == set(CellShape.kinds())
    assert cells.count("frustum") == cells.count("cylindrical") == len(domes.WALLS) * len(domes.OTHER_CASES)


def test_only_known_roofs_have_an_exact_reference(monkeypatch):
    """The profile has that of the hemisphere; a square section has none."""
    monkeypatch.setattr(domes, "RAYS", 1 << 4)
    hemisphere, profile = (domes._on_exact_roof(cell, "lambertian") for cell in ("hemispheric", "profile"))
    assert profile == hemisphere and domes._on_exact_roof("parallelepiped", "lambertian") is None


def test_a_row_of_another_pad(llvm_mono, monkeypatch):
    """Compared with its own elements, by other random numbers: what is left is the noise."""
    for name, value in (("POINTS", 128), ("LARGER", 1.2), ("SMALLEST", 1.2), ("PADS", ((-0.5, {"wall": 1.2}),))):
        monkeypatch.setattr(domes, name, value)
    monkeypatch.setattr(domes, "dome_scene", lambda *given, **pad: scene(*given, **{**pad, "mesh_size": 1.2}))
    (row,) = domes.mirrors_of_pads()
    assert 0.6 < row.truth < 0.9 and 0 < row.noise < 0.05 and 0 < row.stated < 0.1
    assert abs(row.deviation) < 5 * row.noise and row.deviation_larger == 0
    assert domes.pad_cells(row)[:2] == ["wall = 1.2", "-0.5"]


def test_the_page_states_what_it_should():
    """Domes are read within 0.03 %, and mirrors within 0.3 %, also under load."""
    lines = (Path(__file__).parents[3] / "docs" / "domes.md").read_text().splitlines()
    rows = [line.strip("| ").split(" | ") for line in lines if line.startswith(("| hemispheric", "| spherical"))]
    pads = [
        line.strip("| ").split(" | ")
        for line in lines
        if line.startswith(("| default", "| cell_size", "| wall", "| youngs"))
    ]
    assert len(rows) == 2 * len(domes.WALLS) * len(domes.CASES)
    for _, wall, _, _, _, *relative in rows:
        off, noise, _ = (float(text.rstrip("%")) for text in relative)
        allowed = 0.3 if "mirror" in wall else 0.03
        assert abs(off) < allowed + 3 * noise
    assert len(pads) == len(domes.PADS)
    for relative in pads:
        off, noise, stated, _ = (float(text.rstrip("%")) for text in relative[3:])
        assert abs(off) < min(0.3, 2 * stated) + 3 * noise


def test_default_elements_are_others_for_a_while(llvm_mono):
    """Also where what lasts meanwhile fails; another cell keeps its own."""
    walls = [make_plugin("wall", scattering=law) for law in ("mirror", "lambertian")]

    def sizes(cell):
        return [size_for_light(Pad(cell, 3, 3), SpreadForce(), [wall]) for wall in walls]

    usual = {cell: sizes(cell) for cell in DOMES}
    with pytest.raises(ZeroDivisionError), domes._default_elements("spherical", 0.4):
        assert sizes("spherical") == pytest.approx([0.4, 0.4]) and sizes("hemispheric") == usual["hemispheric"]
        raise ZeroDivisionError
    assert {cell: sizes(cell) for cell in DOMES} == usual
