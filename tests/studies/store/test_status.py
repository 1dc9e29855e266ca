"""Progress of a study as another process sees it."""

from __future__ import annotations

import pytest
from filelock import FileLock

from mitsuba_taxel import open_study, sweep
from mitsuba_taxel.studies.plan.vary import make_axes
from mitsuba_taxel.studies.store.status import _seconds_left, study_status


def test_time_left_is_a_range_by_kind_of_scene():
    """Of nine steps, 0, 2, 4, 6 and 8 compute the error of mechanics; 0, 1 and 2 are done, and 3 has failed."""
    axes = make_axes({"fz": "0:-8:-1"})
    least, most = _seconds_left(axes, {0: 10.0, 1: 1.0, 2: 30.0}, {3}, processes=2)
    assert (least, most) == pytest.approx(((3 * 10 + 2 * 1) / 2, (3 * 30 + 2 * 1) / 2))
    assert _seconds_left(axes, {}, {3}, 1) is None
    assert _seconds_left(axes, {0: 3.0}, set(), 1) == pytest.approx((24, 24))
    assert _seconds_left(axes, dict.fromkeys(range(9), 3.0), set(), 1) == (0, 0)


def test_a_time_budget_leaves_scenes_and_says_so(tmp_path):
    folder = tmp_path / "out"
    left = sweep("plate.xml", {"z": "0.5:1.4:0.1"}, time_budget=1e-3, output=folder)
    note = "9 of 10 scenes have no reading yet: the same command computes them"
    assert int(left.power.notnull().sum()) == 1 and note in left.attrs["notes"].splitlines()
    assert note in open_study(folder).attrs["notes"].splitlines()
    with FileLock(folder / ".lock"):
        (state,) = study_status(folder)
    assert (state.done, state.total) == (1, 10) and 0 < state.seconds_left[0] == state.seconds_left[1]
    whole = sweep("plate.xml", {"z": "0.5:1.4:0.1"}, output=folder)
    assert whole.power.notnull().all() and "no reading yet" not in whole.attrs["notes"]
