"""The table of estimators of random paths: its scenes, one of each kind, and its page."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.evidence.coverage import estimators
from mitsuba_taxel.evidence.coverage.estimators import EstimatorRow, estimator_cases
from mitsuba_taxel.pads.cells.cell_shape import CellShape
from mitsuba_taxel.specification.deformable_pad import FINISHES


def test_scenes_are_of_every_shape_and_finish():
    cases = estimator_cases()
    assert cases == estimator_cases() and len(cases) == len({case.name for case in cases})
    pads = [case.light.source["pad"] for case in cases]
    assert {pad["cell"] for pad in pads} == set(CellShape.kinds())
    assert {pad.get("finish") for pad in pads} >= set(FINISHES) and any(pad.get("fillet") for pad in pads)
    assert set(FINISHES) == set(estimators.FINISH_VALUES)


@pytest.mark.parametrize("kind", ["images 3 cylindrical", "differences 2 cylindrical"])
def test_an_estimator_agrees_with_plain_paths(monkeypatch, kind):
    """A Z-test at 4 standard errors (false alarms 6e-5)."""
    monkeypatch.setattr(estimators, "POINTS", 256)
    monkeypatch.setattr(estimators, "IMAGE_POINTS", 1024)
    monkeypatch.setattr(estimators, "DIFFERENCE_POINTS", 1024)
    case = next(case for case in estimator_cases() if case.name.startswith(kind))
    row = case.measured()
    assert not row.remark and row.value != 0 and row.error > 0 and row.deviates < 4, row


def test_the_page_counts_what_agrees(tmp_path):
    names = [case.name for case in estimator_cases()[:4]]
    off = (0.0, 3.0, 5.0)
    rows = [EstimatorRow(name, "", 2.0, z * 0.1, 0.1, 3.0, 1.0) for name, z in zip(names, off, strict=False)]
    rows.append(EstimatorRow(names[3], "refused"))
    assert rows[1].relative == pytest.approx(0.15) and np.isnan(rows[3].relative)
    estimators.write_page(rows, tmp_path / "page.md", "the command")
    page = (tmp_path / "page.md").read_text()
    assert "2 of 3 scenes agree within 4 combined errors, 1 within 2" in page and "1 were not compared" in page
