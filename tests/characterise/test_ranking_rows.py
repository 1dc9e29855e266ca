"""Rankings as text."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from mitsuba_taxel.characterise import compare, comparison_rows, ranking_notes

FORCE = np.array([0.0, -5, -10])


def study_of(slopes, noise, bend=0.0):
    """Variants that read 1 W at rest, with noise of mean 0 in W/N, bent by a share of the force beyond -10 N."""
    rows = np.random.default_rng(0).normal(size=(len(slopes), 3, 32, 1))
    rows -= rows.mean(axis=2, keepdims=True)
    each = np.reshape(slopes, (-1, 1, 1, 1)) + np.reshape(noise, (-1, 1, 1, 1)) * rows
    line = FORCE[:, None, None]
    power = 1 - each * line * (1 + np.reshape(bend, (-1, 1, 1, 1)) * (line + 10))
    coords = {"cell": list("abcd")[: len(slopes)], "fz": FORCE, "taxel": [1]}
    return {"one": xr.Dataset({"replicate_power": (["cell", "fz", "replicate", "taxel"], power)}, coords)}


BENT = study_of([0.02, 0.01], 1e-4, [0.05, 0.0])
"""The first one is twice as sensitive, and bent by 12.5 %."""


def test_a_figure_that_is_not_resolved_has_its_error():
    headings, rows = comparison_rows(compare(BENT, "mean_slope", {"nonlinearity": 3}))
    assert headings == ["rank", "cell", "mean slope [mW/N]", "nonlinearity [%]", "allowed", "first", "behind [mW/N]"]
    assert rows[0][-3:] == ["100%", "100.0%", "-"]
    value, error = map(float, rows[0][3].split(" ± "))
    assert abs(value) <= error and 0.01 < error < 1


def test_where_no_variant_is_within_the_limits_none_is_ranked():
    """12.5 % and 0 %, of which a limit of 0 allows neither."""
    found = compare(BENT, "mean_slope", {"nonlinearity": 3, "mean_slope": 0.005})
    assert not found.ranked and found.table["rank"].isna().all() and found.table.behind.isna().all()
    assert found.table["first"].sum() == 0
    _, rows = comparison_rows(found)
    assert [row[0] for row in rows] == ["-", "-"] and [row[-1] for row in rows] == ["-", "-"]
    assert ranking_notes(found)[1] == "In 100.0% of the draws no variant is within the limits."
    assert compare(BENT, "mean_slope", {"nonlinearity": 3}).ranked


def test_a_variant_of_a_larger_error_may_be_first_more_often():
    """The others are 0.5 % worse than the first, with errors of 2 % where that has 0.1 %."""
    found = compare(study_of([0.02, 0.0199, 0.0199, 0.0199], [1e-4, 2e-3, 2e-3, 2e-3]), "mean_slope")
    best = found.table["first"]
    assert best.sum() == pytest.approx(1) and found.table.cell[0] == "a" and best.max() > best[0]
    assert "with a larger error" in ranking_notes(found)[-1] and len(ranking_notes(found)) == 2
