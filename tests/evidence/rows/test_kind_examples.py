"""Tables of evidence draw kinds from the registries: a new kind is judged without being listed, others stay."""

from __future__ import annotations

import pytest

from mitsuba_taxel.evidence.coverage.coverage_cases import coverage_cases
from mitsuba_taxel.evidence.coverage.drags import drag_cases
from mitsuba_taxel.evidence.coverage.light_cases import light_cases
from mitsuba_taxel.evidence.extremes.cases import stability_cases
from mitsuba_taxel.evidence.extremes.reading_cases import reading_cases
from mitsuba_taxel.evidence.rows.kind_examples import cell_parameters, indenter_of, law_of, pad_of
from mitsuba_taxel.mechanics.contact.indenter_shape import IndenterShape
from mitsuba_taxel.mechanics.contact.indenters.ellipsoid import Ellipsoid
from mitsuba_taxel.mechanics.materials.laws import Material
from mitsuba_taxel.mechanics.materials.laws.arruda_boyce import ArrudaBoyce
from mitsuba_taxel.pads.cells.cell_shape import CellShape
from mitsuba_taxel.pads.cells.frustum import Frustum

TABLES = (coverage_cases, light_cases, drag_cases, stability_cases)


@pytest.fixture
def new_kinds():
    """A cell, a law and an indenter under new names."""
    type("Bell", (Frustum,), {"__module__": __name__}, name="bell", rank=7)
    type("Chain", (ArrudaBoyce,), {"__module__": __name__}, name="chain", rank=9)
    type("Egg", (Ellipsoid,), {"__module__": __name__}, name="egg", rank=9)
    yield
    for family, name in ((CellShape, "bell"), (Material, "chain"), (IndenterShape, "egg")):
        del family._registry[name]


@pytest.fixture
def names_before():
    return {table: [case.name for case in table()] for table in TABLES}


def test_a_new_kind_is_in_every_table_and_changes_no_other_case(names_before, new_kinds):
    for table in TABLES:
        names = [case.name for case in table()]
        assert len(set(names)) == len(names) and any("bell" in name for name in names)
        if table in (coverage_cases, stability_cases):
            assert any("chain" in name for name in names) and any("egg" in name for name in names)
        if table is not coverage_cases:  # there, laws and indenters are on all cells in turn
            assert set(names_before[table]) <= set(names)
    assert any("egg" in case.name for case in drag_cases()) and any("bell" in case.name for case in reading_cases())


@pytest.mark.parametrize("cell", list(CellShape.kinds()))
def test_cells_have_the_parameters_that_they_need(cell):
    pad = pad_of(cell, rows=1, columns=1, wall=0.7)
    assert (pad.cell, pad.rows, pad.wall) == (cell, 1, 0.7)
    assert all(getattr(pad, name) == value for name, value in cell_parameters(cell).items())


def test_a_profile_is_a_hemisphere():
    pad, dome = pad_of("profile"), pad_of("hemispheric")
    assert pad.top_of_cell == pytest.approx(dome.top_of_cell) and pad.side_height == pytest.approx(dome.side_height)


def test_laws_and_indenters_have_the_parameters_that_they_need():
    assert all(law_of(name).name == name for name in Material.kinds())
    for name in IndenterShape.kinds():
        if name != "file":
            assert indenter_of(name, at=(0.5, 0.0)).shape == name
