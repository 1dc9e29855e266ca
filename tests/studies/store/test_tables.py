"""Files of a study beside its readings."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from mitsuba_taxel.characterise import resolution
from mitsuba_taxel.studies.store import tables
from mitsuba_taxel.studies.store.tables import write_resolution

pytestmark = pytest.mark.quick


@pytest.fixture
def study():
    """Three readings of two unknowns at 2 x 3 places."""
    slopes = np.broadcast_to([[1e-7, 0], [0, 2e-7], [1e-7, 1e-7]], (2, 3, 3, 2))
    dims = ["patch_x", "patch_y", "taxel"]
    return xr.Dataset(
        {
            "smooth_power": (dims, np.full((2, 3, 3), 2e-6)),
            "replicate_power": ([*dims, "replicate"], np.full((2, 3, 3, 2), 2e-6)),
            "derivative": ([*dims, "parameter"], slopes),
        },
        {
            "patch_x": [0.0, 1.0], "patch_y": [-1.0, 0.0, 1.0], "parameter": ["fz", "patch_x"],
            "derivative_unit": ("parameter", ["W/N", "W/mm"]),
        },
        {"circuit": json.dumps({"supply": 3.3, "load_resistance": 1e4, "transfer": 5e-2})},
    )  # fmt: skip


def test_the_resolution_is_computed_once(study, tmp_path, monkeypatch):
    """Table and map are of the same numbers."""
    computed = []

    def once(of):
        computed.append(resolution(of))
        return computed[-1]

    monkeypatch.setattr(tables, "resolution", once)
    write_resolution(study, tmp_path)
    (found,) = computed
    assert {file.name for file in tmp_path.iterdir()} == {f"resolution.{form}" for form in ("csv", "png", "svg")}
    table = pd.read_csv(tmp_path / "resolution.csv")
    np.testing.assert_allclose(table.resolution, found.resolution.values.ravel())
    np.testing.assert_allclose(table.resolution_error, found.resolution_error.values.ravel())


@pytest.mark.parametrize("without", ["derivative", "circuit", "patch_y"])
def test_studies_without_a_resolution(study, tmp_path, without):
    less = study.isel(patch_y=[0]) if without == "patch_y" else study.drop_vars("derivative", errors="ignore")
    if without == "circuit":
        less = study.copy()
        less.attrs = {}
    write_resolution(less, tmp_path)
    assert not list(tmp_path.iterdir())
