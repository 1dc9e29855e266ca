"""The page of the best sensors, from numbers that are made up; and that its studies are ones."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pandas
import pytest
import xarray as xr

from mitsuba_taxel.evidence.paper.optima import (
    EFFORT,
    LEANING,
    PROFILES,
    PURPOSES,
    SHAPES,
    SQUARE,
    _descents,
    optima,
    write_study,
)
from mitsuba_taxel.evidence.paper.page.page import write_pages
from mitsuba_taxel.evidence.paper.paper_studies import MissingStudy, PaperStudies
from mitsuba_taxel.optimum.designs import pads_of
from mitsuba_taxel.optimum.plan_file import read_plan
from mitsuba_taxel.pads.cells.meridian import control_points

ROOF = {"r1": 1.0, "z1": 0.7, "r2": 0.6, "z2": 0.5, "z3": 0.5}


def made_up(before: float, best: float, said: list[str], cell: str) -> xr.Dataset:
    roof = ROOF if cell in PROFILES else {"cell_height": 1.2}
    roof |= {"top_x": 0.25} if cell == LEANING else {}
    figures = {"before": [before, 0.02], "best": [0.9 * best, 0.03]}
    figures |= {f"{name}_finer": [value, 0.02] for name, value in (("before", before), ("best", best))}
    named = roof | {"cell_size": 2.5, "height": 4.5, "wall": 0.8}
    variables = {"variable": list(named), "best": list(named.values()), "at": ["low"] + [""] * (len(named) - 1)}
    numbers = {"gain": best / before - 1, "gain_error": 0.1, "unbalanced": 0.01, "designs": 9, "failed": 1}
    numbers |= {
        "beyond": {"cylindrical": 0.0031, "spherical": 0.03}.get(cell, np.nan),
        "beyond_ended": cell == "cylindrical",
    }
    numbers |= {"unbalanced_error": {"cylindrical": 0.05, "spherical": np.nan}.get(cell, 0.02), "gradients": 3}
    numbers |= {"reach": 12.0 if cell == "spherical" else 20.0, "reach_ended": "it touches the board"}
    descents = 2 if cell == SQUARE else 1
    several = {"best": [best, np.nan], "designs": [8, 20], "failed": [0, 5], "seconds": [90, 200], "close": [6, np.nan]}
    return xr.Dataset(
        {f"descent_{name}": ("descent", values[:descents]) for name, values in several.items()}
        | {f"figures_{name}": ("figures", values) for name, values in figures.items()}
        | {f"variables_{name}": ("variables", np.array(values)) for name, values in variables.items()},
        attrs={**numbers, "load_steps": 27.0, "seconds": 60.0, "said": json.dumps(said)},
    )


@pytest.mark.usefixtures("painted_figures")
def test_the_page(tmp_path):
    every = dict.fromkeys(cell for cells in SHAPES.values() for cell in cells)
    shapes = {cell: (1e-5 * max(5 - number, 1), ["so so"] * bool(number)) for number, cell in enumerate(every)}
    found = {
        purpose: {cell: made_up(before, 6e-5, said, cell) for cell, (before, said) in shapes.items() if cell in cells}
        for purpose, cells in SHAPES.items()
    }
    (page,) = write_pages({"optimum": found}, tmp_path, "taxel reproduce")
    text = page.read_text(encoding="utf-8")
    assert page.name == "optimum.md" and (tmp_path / "optimum" / "optima.png").stat().st_size > 5000
    assert (
        "| cylindrical | 40 | 60 | 50% ± 10% | 1.2 | 2.5 | 4.5 | 0.8 | cell_height (low) | 1.0% ± 5.0% | within "
        "0.4% |" in text
    )
    assert (
        "| cell_height (low) | 1.0% | 3.0% or more off |" in text
        and "| cell_height (low) | 1.0% ± 2.0% | yes |" in text
    )
    assert "The best of the paper's four designs is the parallelepiped, with 50 µW/N. The best design found" in text
    assert (
        "touch nothing up to 20 N, the range of the sensor, but the spherical one to 12 N (it touches the board)."
        in text
    )
    assert "- hemispheric: so so" in text and "135 designs with 405 load steps" in text
    assert (
        "- profile: points (r, z) of the roof in mm, from the rim to the crown: (1.25, 1.68), (0.75, 1.2), (0, 1.2)"
        in text
    )
    assert "a *profile* is a roof of revolution" in text.lower() and (
        "- square profile: its descents ended at 60 µW/N (8 designs in 90 s, within 1% of the best of all after 6, "
        "0 failed; as its steps gained no more), "
        "no allowed design (20 designs in 200 s, 5 failed; as no more was allowed)\n" in text
    )
    assert "- leaning parallelepiped: tops of cells lie 0.25 mm off their axes along x; the" in text
    for cell in PROFILES:
        assert f"The best {cell} is 1.20 times as sensitive as the paper's parallelepiped cells, and 1.00 times" in text
    assert "{" not in text.replace("{cite}", "")


@pytest.mark.parametrize(
    ("purpose", "cell", "starts"),
    [
        *((purpose, "hemispheric", 1) for purpose in PURPOSES),
        *((*case, starts) for case, (starts, _) in EFFORT.items()),
        ("tangential", LEANING, 1),
    ],
)
def test_studies_can_be_read(purpose, cell, starts, tmp_path):
    write_study(tmp_path, purpose, cell)
    plan = read_plan(tmp_path / "study.toml")
    assert plan.refusal(plan.before) is None and len(plan.initial_designs()) == starts


def test_square_profiles_begin_as_the_paper_has_its_box(tmp_path):
    shapes = []
    for cell in ("parallelepiped", SQUARE):
        write_study(tmp_path / cell, "normal", cell)
        (pad,) = pads_of(read_plan(tmp_path / cell / "study.toml").batch.scene({}))
        shapes.append(pad.as_profile(3))
    box, square = shapes
    assert square.section == box.section == "square" and square.cell_size == box.cell_size
    points = [pad.cell_height * control_points(pad.profile)[:, 1] for pad in shapes]
    np.testing.assert_allclose(points[1], points[0], rtol=1e-4)
    assert square.top_of_cell == pytest.approx(box.top_of_cell, rel=1e-4)


def test_what_descents_are_told_of():
    """Two descents after an initial design: one close to the best after two designs, one that stays off."""
    goal = "sensitivity along normal"
    history = pandas.DataFrame(
        {
            "descent": [0, 1, 1, 1, 2, 2],
            goal: [1.0, 3.0, 3.98, 4.0, np.nan, 2.0],
            "allowed": [True, True, True, True, None, True],
            "failed": [None] * 4 + ["no light", None],
        }
    )
    figures = pandas.DataFrame({"figure": [f"maximise {goal}"]})
    told = {
        name: values.tolist()
        for name, (_, values) in _descents(
            SimpleNamespace(history=history, figures=figures, design_seconds=2.0 ** np.arange(6))
        ).items()
    }
    assert told["descent_designs"] == [3, 2] and told["descent_failed"] == [0, 1]
    assert told["descent_seconds"] == [14, 48]
    assert told["descent_best"] == [4.0, 2.0] and told["descent_close"][0] == 2 and np.isnan(told["descent_close"][1])


def test_nothing_is_computed_where_a_page_is_written(tmp_path):
    with pytest.raises(MissingStudy):
        optima(PaperStudies(tmp_path), workers=None)
