"""The page of the best sensors, from numbers that are made up; and that its studies are ones."""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray as xr

from mitsuba_taxel.optimum.plan import read_plan
from mitsuba_taxel.reproduce import paper
from mitsuba_taxel.reproduce.optima import PURPOSES, optima, write_study
from mitsuba_taxel.reproduce.page import write_pages
from mitsuba_taxel.reproduce.paper_studies import MissingStudy, PaperStudies


def made_up(before: float, best: float, said: list[str]) -> xr.Dataset:
    figures = {"before": [before, 0.02], "best": [0.9 * best, 0.03]}
    figures |= {f"{name}_finer": [value, 0.02] for name, value in (("before", before), ("best", best))}
    variables = {"variable": ["cell_height", "cell_size", "height", "wall"], "best": [1.2, 2.5, 4.5, 0.8]}
    variables["at"] = ["low", "", "", ""]
    numbers = {"gain": best / before - 1, "gain_error": 0.1, "unbalanced": 0.01, "designs": 9, "failed": 1}
    return xr.Dataset(
        {f"figures_{name}": ("figures", values) for name, values in figures.items()}
        | {f"variables_{name}": ("variables", np.array(values)) for name, values in variables.items()},
        attrs={**numbers, "load_steps": 27.0, "seconds": 60.0, "said": json.dumps(said)},
    )


def test_the_page(tmp_path):
    shapes = [(cell, 1e-5 * (4 - number), ["so so"] * bool(number)) for number, cell in enumerate(paper.CELLS)]
    found = {purpose: {cell: made_up(before, 6e-5, said) for cell, before, said in shapes} for purpose in PURPOSES}
    (page,) = write_pages({"optimum": found}, tmp_path, "taxel reproduce")
    text = page.read_text(encoding="utf-8")
    assert page.name == "optimum.md" and (tmp_path / "optimum" / "optima.png").stat().st_size > 5000
    assert "| cylindrical | 30 | 60 | 100% ± 10% | 1.2 | 2.5 | 4.5 | 0.8 | cell_height (low) | 1.0% |" in text
    assert "Of the paper's four the parallelepiped one is best, with 40 µW/N; of those found" in text
    assert "- hemispheric: so so" in text and "108 designs with 324 load steps" in text
    assert "{" not in text.replace("{cite}", "")


@pytest.mark.parametrize("purpose", PURPOSES)
def test_studies_can_be_read(purpose, tmp_path):
    write_study(tmp_path, purpose, "hemispheric", 8)
    plan = read_plan(tmp_path / "study.toml")
    assert plan.refusal(plan.before) is None and len(plan.begun()) == 1


def test_nothing_is_computed_where_a_page_is_written(tmp_path):
    with pytest.raises(MissingStudy):
        optima(PaperStudies(tmp_path), workers=None)
