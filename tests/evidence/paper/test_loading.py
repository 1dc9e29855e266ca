"""What the studies along the load paths of the paper ask for."""

from __future__ import annotations

import pytest
import xarray as xr

from mitsuba_taxel.evidence.paper import loading
from mitsuba_taxel.evidence.paper.paper_studies import PaperStudies

pytestmark = pytest.mark.quick


@pytest.mark.parametrize("finer", [None, 0.9])
def test_tangential_studies_are_computed_once_each_from_the_mesh_of_the_one_before(tmp_path, monkeypatch, finer):
    """With the target of their slopes, for which they may take a finer one."""
    asked = []

    def sweep(scene, vary, defines, **settings):
        ((force, _),) = vary.items()
        asked.append((force, settings))
        sizes = {"fz": 1.25, "fx": finer or 1.25, "fy": finer or 1.25}
        return xr.Dataset({force: [0.0]}, attrs={"points": 0, "mesh_size": sizes[force]})

    monkeypatch.setattr(loading, "sweep", sweep)
    store = PaperStudies(tmp_path, announce=lambda name: None)
    loading.along_y(store, "cylindrical")
    slopes = {"target_slope": loading.TARGET_SLOPE, "points": None}
    assert asked == [
        ("fz", {"target_error": loading.TARGET_ERROR, "target_slope": loading.TARGET_SLOPE}),
        ("fx", slopes | {"mesh_size": 1.25}),
        ("fy", slopes | {"mesh_size": finer or 1.25}),
    ]
