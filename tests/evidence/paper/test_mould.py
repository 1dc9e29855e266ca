"""Pads of the experiments with printed moulds: scenes, figures of merit, and the page."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel import check_scene
from mitsuba_taxel.evidence.paper import mould
from mitsuba_taxel.evidence.paper.mould import MouldWalls, mould_figures, moulds, walls
from mitsuba_taxel.evidence.paper.page.page import write_pages
from mitsuba_taxel.evidence.paper.paper_studies import MissingStudy, PaperStudies
from mitsuba_taxel.evidence.paper.scenes import scene_text

SLOPE, BEND, NOISE = 20e-6, 4e-6, 1e-8
"""Of taxel 1 in W/N; of the parabola that is added to its readings, in W; of the light, in W."""
SHARES = np.linspace(1, 0.5, 12)


@pytest.fixture(scope="module")
def studies(make_study):
    """Taxel k has a share of the slope of taxel 1; tangential slopes are a half and a quarter of normal ones."""
    normal, tangential = np.array([0.0, -2.5, -5, -7.5, -10]), np.array([0.0, 2, 4])
    bend = BEND * (1 - (normal / 5 + 1) ** 2)
    made = {"fz": make_study({"fz": normal}, 1e-3 + (bend - SLOPE * normal)[:, None] * SHARES, NOISE, 1)}
    for seed, (force, part) in enumerate({"fx": 0.5, "fy": 0.25}.items()):
        power = 1e-3 + part * SLOPE * tangential[:, None] * SHARES
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


@pytest.mark.parametrize(
    "wall",
    [w for w in walls() if w.side == 0 and w.roof == "isotropic" and w.cell == "spherical" and w.layer in (0, 0.2)],
)
def test_scenes_are_right(llvm_mono, tmp_path, wall):
    scene = tmp_path / "pad.xml"
    scene.write_text(scene_text("mould").format(rows=mould.ROWS, columns=mould.COLUMNS, finish=wall.finish))
    assert not [f for f in check_scene(scene, cell=wall.cell) if f.severity != "note"]


def test_combinations_are_those_of_three_shapes_seven_moulds_three_roofs_and_three_sides():
    combinations = list(walls())
    assert len(combinations) == len({wall.folder for wall in combinations}) == 3 * 7 * 3 * 3


def test_complete_rows_are_on_the_page(tmp_path, studies):
    wall = MouldWalls("spherical", 0.1, "z", "isotropic", 0.05)
    (page,) = write_pages({"mould": {wall: studies}}, tmp_path, "taxel reproduce")
    text = page.read_text()
    assert "1 of 189 combinations" in text
    assert (
        "| spherical | 0.1 mm along z | isotropic | 5% | 10.0" in text
        and "| 19.6 | 35.5 | 3.18 | 34.2 | 31.4 |" in text
    )


def test_nothing_is_computed_by_a_store_that_reads(tmp_path):
    with pytest.raises(MissingStudy):
        moulds(PaperStudies(tmp_path), workers=None)
