"""Which studies take a finer mesh than the one before."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from mitsuba_taxel.reproduce import loading

SETTINGS = {"points": None, "mesh_size": 1.25}


@pytest.mark.parametrize(
    ("errors", "targets"), [([0.02], [{}]), ([0.021, 0.01], [{}, {"target_slope": loading.TARGET_SLOPE}])]
)
def test_a_study_searches_for_a_mesh_only_if_its_slopes_miss_the_target(monkeypatch, errors, targets):
    asked, shares = [], iter(errors)

    def sweep(scene, vary, defines, **settings):
        asked.append(settings)
        slopes = xr.DataArray([[[-2.0], [1.0]]], dims=["fx", "taxel", "parameter"])
        return xr.Dataset({"derivative": slopes, "derivative_error": np.abs(slopes) * next(shares)})

    monkeypatch.setattr(loading, "sweep", sweep)
    study = loading.within_target({"fx": "0:11"}, {}, SETTINGS)
    assert asked == [{**SETTINGS, **target} for target in targets]
    assert loading.slope_share(study) == pytest.approx(errors[-1])
