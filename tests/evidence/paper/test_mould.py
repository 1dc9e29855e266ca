"""Pads of the experiments with printed moulds: scenes, figures of merit, and the page."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mitsuba_taxel import check_scene
from mitsuba_taxel.evidence.paper import paper
from mitsuba_taxel.evidence.paper.mould import (
    CELL,
    CHANGES,
    LAYERS,
    MORE_ROOFS,
    PAD,
    PADS,
    ROOFS,
    SIDES,
    MouldFigures,
    MouldWalls,
    design,
    mould_figures,
    moulds,
    rest,
)
from mitsuba_taxel.evidence.paper.mould_rows import read_mould_rows, write_mould_rows
from mitsuba_taxel.evidence.paper.page.mould import _effects_of_steps, judgement, misfit, page_of
from mitsuba_taxel.evidence.paper.page.page import write_pages
from mitsuba_taxel.evidence.paper.paper_studies import MissingStudy, PaperStudies

SLOPE, BEND, NOISE = 20e-6, 4e-6, 1e-8
"""Of taxel 1 in W/N; of the parabola that is added to its readings, in W; of the light, in W."""
SHARES = np.linspace(1, 0.5, 6)
DOCS = Path(__file__).parents[3] / "docs"


@pytest.fixture(scope="module")
def studies(make_study):
    """Taxel k has a share of the slope of taxel 1, whose tangential slopes are a half and a quarter of that."""
    normal, tangential = np.array([0.0, -2.5, -5, -7.5, -10]), np.array([0.0, 1, 2.5, 4])
    bend = BEND * (1 - (normal / 5 + 1) ** 2)
    made = {"fz": make_study({"fz": normal}, 1e-3 + (bend - SLOPE * normal)[:, None] * SHARES, NOISE, 1)}
    for seed, (force, part) in enumerate({"fx": 0.5, "fy": 0.25}.items()):
        power = 1e-3 + part * SLOPE * tangential[:, None] * SHARES[:1]
        made[force] = make_study({force: tangential}, power, NOISE, 2 + seed)
    return made


def test_figures_are_those_of_the_curves(studies):
    """The mean slope is that of the line between the ends; a parabola is off by BEND of 200 µW."""
    figures = mould_figures(studies)
    assert figures.taxel == 1
    for value, expected in (
        (figures.most, SLOPE), (figures.least, SLOPE / 2), (figures.along_x, SLOPE / 2), (figures.along_y, SLOPE / 4),
        (figures.nonlinearity, 100 * BEND / (10 * SLOPE)),
    ):  # fmt: skip
        assert abs(value[0] - expected) < 4 * value[1] + 0.01 * expected
    assert math.isnan(mould_figures({"fz": studies["fz"]}).along_x[0])


def test_slopes_of_one_cell_are_per_newton_on_twelve(studies):
    whole, cell = mould_figures(studies), mould_figures(studies, MouldWalls("spherical", pad=CELL).share)
    assert cell.most == pytest.approx(np.array(whole.most) / 12) and cell.nonlinearity == whole.nonlinearity
    assert MouldWalls("spherical").share == 1 and math.prod(PADS[PAD]) == 12


@pytest.mark.parametrize(
    "wall",
    [
        MouldWalls("spherical"),
        MouldWalls("spherical", 0.2, "x", pad=CELL),
        MouldWalls("spherical", change="flange in contact", pad=CELL),
    ],
)
def test_scenes_are_right(llvm_mono, tmp_path, wall):
    scene, (rows, columns) = tmp_path / "pad.xml", PADS[wall.pad]
    scene.write_text(wall.scene(range((rows + 1) // 2), range(columns)))
    assert not [f for f in check_scene(scene, cell=wall.cell) if f.severity != "note"]


@pytest.mark.parametrize(
    ("rows", "columns", "cells", "centre"),
    [
        (range(3), range(2), "1, 2, 3, 4, 5, 6", "0, 5.325, 0"),
        (range(1, 2), range(1, 2), "4", "1.775, 5.325, 0"),
        (range(2, 3), range(1), "5", "-1.775, 1.775, 0"),
        (range(4, 6), range(2), "9, 10, 11, 12", "0, -7.1, 0"),
    ],
)
def test_packages_lie_in_the_cells_that_are_read(rows, columns, cells, centre):
    """Taxels are numbered row by row from +y, and cells are 3.55 mm apart about the centre of the pad."""
    text = MouldWalls("spherical").scene(rows, columns)
    assert f'"read_cells" value="{cells}"' in text and f'<translate value="{centre}"/>' in text
    assert '<translate value="0, 0, 0"/>' in MouldWalls("spherical", pad=CELL).scene(range(1), range(1))
    shifted = MouldWalls("spherical", change="packages 0.2 mm off along x").scene(rows, columns)
    x, _, rest_of_it = centre.partition(",")
    assert f'<translate value="{float(x) + 0.2:g},{rest_of_it}"/>' in shifted


def test_design_and_rest_are_all_combinations_and_the_other_explanations():
    designed, others = list(design()), list(rest())
    pads = [wall for wall in (*designed, *others) if wall.pad == PAD]
    combinations = {wall for wall in pads if wall.roof in ROOFS and not wall.change}
    assert len({wall.folder for wall in (*designed, *others)}) == len(designed) + len(others)
    assert len(combinations) == 3 * 7 * 3 * 3
    assert {wall.change for wall in designed} == set(CHANGES) and {wall.roof for wall in designed} == set(MORE_ROOFS)
    assert {wall.layer for wall in designed} == set(LAYERS) and {wall.side for wall in designed} == set(SIDES)
    of_cells = {wall for wall in designed if wall.pad == CELL}
    assert {replace(wall, pad=CELL) for wall in designed} == of_cells, "whole pads repeat rows of one cell"


def test_complete_rows_are_on_the_page(tmp_path, studies):
    wall = MouldWalls("spherical", 0.1, "z", "isotropic", 0.05)
    of_design = MouldWalls("hemispheric", change="flange in contact", pad=CELL)
    parts = {"mould_rest": {wall: studies}, "mould": {of_design: {"fz": studies["fz"]}}}
    (page,) = write_pages(parts, tmp_path, "taxel reproduce")
    text = page.read_text()
    assert f"1 of {len(list(design()))} planned rows are computed, and 1 of" in text.replace("\n", " ")
    assert "| spherical | 0.1 mm along z | isotropic | 5% | 10.0" in text
    assert "| hemispheric | one cell | flange in contact | 1.66" in text.replace("1.67", "1.66")
    assert "| 19.6 | 35.5 | 3.18 | 34.2 | 31.4 |" in text
    assert (tmp_path / "mould" / "steps.png").exists()
    assert page_of(read_mould_rows(tmp_path / "mould" / "rows.csv"), text.split("`")[1]) == text


def made_up(most, nonlinearity, error=0.02):
    slope = (most, error * most)
    return MouldFigures(slope, slope, (nonlinearity, 0.1), slope, slope, 1)


def measured_figures(**factors):
    """Figures as measured, as if 1 V were 1 W, with sensitivities of shapes times a factor."""
    return {
        cell: made_up(paper.MEASURED_NORMAL[cell][1] * factors.get(cell, 1), paper.MEASURED_NONLINEARITY[cell])
        for cell in paper.MEASURED_NORMAL
    }


@pytest.mark.parametrize(
    ("factors", "expected"),
    [
        ({}, 1.0),
        ({"parallelepiped": 3, "spherical": 3, "hemispheric": 3}, 1.0),
        ({"parallelepiped": 0.5}, 2.0),
        ({"spherical": 4}, 4 ** math.sqrt(0.5)),
    ],
)
def test_the_misfit_is_the_typical_factor_between_ratios(factors, expected):
    assert misfit(measured_figures(**factors)) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("factor", "rise", "more", "words"),
    [
        (1.5, 0, "2 more", "does not hold in this model"),
        (0.2, 6, "0 more", "holds"),
        (1.01, 0.1, "0 more", "does not hold in this model"),
    ],
)
def test_the_judgement_follows_the_effect_of_steps(factor, rise, more, words):
    """Errors are 2 % of sensitivities and 0.1 points of nonlinearity: 1 % and 0.1 points are not resolved."""
    figures = {MouldWalls(cell): row for cell, row in measured_figures().items()}
    for cell in ("spherical", "hemispheric"):
        smooth = figures[MouldWalls(cell)]
        figures[MouldWalls(cell, 0.1, "z")] = made_up(smooth.most[0] * factor, smooth.nonlinearity[0] + rise)
    text = "\n".join(judgement(figures))
    assert f"steps make round cells less sensitive.** This {words}. " in text and more in text
    effects = list(_effects_of_steps(figures))
    assert [row["linearity"] for row in effects] == 2 * ["less" if rise > 1 else "not resolved"]
    assert "smooth, roof white, Lambertian 0.9, sides 0%* is closest" in text or factor == 0.2


def test_the_rows_of_the_page_are_kept_in_full(tmp_path):
    figures = {MouldWalls("spherical", 0.05, "x", side=0.2): made_up(1 / 3, math.pi)}
    figures[MouldWalls("hemispheric", change="flange in contact")] = figures[next(iter(figures))]._replace(
        along_x=(math.nan, math.nan), along_y=(math.nan, math.nan)
    )
    write_mould_rows(figures, tmp_path / "rows.csv")
    assert repr(read_mould_rows(tmp_path / "rows.csv")) == repr(figures)


def test_the_page_of_the_docs_is_that_of_its_rows():
    page = (DOCS / "mould.md").read_text(encoding="utf-8")
    command = page.split("`")[1]
    assert page_of(read_mould_rows(DOCS / "mould" / "rows.csv"), command) == page


def test_nothing_is_computed_by_a_store_that_reads(tmp_path):
    with pytest.raises(MissingStudy):
        moulds(PaperStudies(tmp_path), None, design())
