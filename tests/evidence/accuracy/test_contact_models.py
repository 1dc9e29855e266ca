"""The table of contact models: forces of one ball against Hertz, and all forms in one table."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mitsuba_taxel.evidence.accuracy import contact_models
from mitsuba_taxel.evidence.accuracy.contact_models import ContactSpeedRow, contact_speed, half_space_model
from mitsuba_taxel.evidence.rows.row import cells, headings


@pytest.mark.parametrize(("radius", "depth"), [(12.0, 0.4), (20.0, 0.15)])
def test_a_ball_on_the_half_space_presses_as_hertz_says(radius, depth):
    model = half_space_model(31)
    squares = (model.points[..., :2] ** 2).sum(axis=-1)
    force = -model(depth - squares / (2 * radius)).force[0, 2]
    expected = 4 / 3 * contact_models.MODULUS * radius**0.5 * depth**1.5
    assert force == pytest.approx(expected, rel=0.02)


def test_rows_of_forms_differ_little_and_know_their_error():
    rows = list(contact_speed([9, 15], 64))
    assert len({row.form for row in rows}) * 2 == len(rows) and rows[0].form == "numpy" and rows[0].difference == 0
    for row in rows:
        assert row.difference < (1e-4 if "single" in row.form else 1e-8) and row.seconds > 0
        assert len(cells(row)) == len(headings(ContactSpeedRow))
    coarse, fine = (next(row for row in rows if row.case.startswith(case)) for case in ("9 x 9", "15 x 15"))
    assert 0.2 > coarse.hertz > 1.5 * fine.hertz > 0.002


def test_a_wrong_modulus_is_seen(monkeypatch):
    """The error against Hertz is that of the forces: 10 % more force is at most a tenth of the largest."""
    row = next(contact_speed([21], 32))
    own = half_space_model(21)
    softer = replace(own, compliance=own.compliance / 1.1)
    monkeypatch.setattr(contact_models, "half_space_model", lambda count: softer)
    stiffer = next(contact_speed([21], 32))
    assert row.hertz + 0.02 < stiffer.hertz < 0.1 and np.isfinite(row.hertz)
