"""The paper's nominal study: what a row is made of, and the page."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from mitsuba_taxel.evidence.accuracy import nominal
from mitsuba_taxel.evidence.paper import loading


def study(source, vary, defines, **settings):
    """Of two forces and two taxels, whose slopes have errors of a hundredth of the steepest and a fiftieth of it."""
    (force,) = vary
    slopes = np.array([[-3e-5, -1e-5], [-4e-5, -2e-5]])
    dims = (force, "taxel")
    return xr.Dataset(
        {
            "power": (dims, np.full((2, 2), 1e-3)),
            "total_error": (dims, [[1e-6, 2e-6], [3e-6, 1e-6]]),
            "derivative": ((*dims, "parameter"), slopes[..., None]),
            "derivative_error": ((*dims, "parameter"), np.array([[3e-7, 1e-7], [1e-7, 8e-7]])[..., None]),
        },
        coords={force: [0.0, -20.0], "parameter": [force]},
        attrs={"points": 256, "mesh_size": 0.75},
    )


def test_rows_and_page(monkeypatch, tmp_path):
    asked = []
    monkeypatch.setattr(loading, "sweep", lambda *scene, **targets: asked.append(targets) or study(*scene, **targets))
    monkeypatch.setattr(nominal, "measure_isolated", lambda case, *limits: case.measured())
    rows = list(nominal.nominal("hemi*"))
    slopes = {"target_slope": 0.02}
    assert asked == [{"target_error": 0.005, **slopes}, {"points": 256, "mesh_size": 0.75, **slopes}]
    (row,) = rows
    assert row.forces == [2, 2] and row.mesh_size == [0.75, 0.75]
    assert row.error == pytest.approx([3e-3] * 2) and row.slope == pytest.approx([0.02] * 2)
    nominal.write_page([*rows, nominal.NominalShape("spherical").failed("out of memory")], tmp_path / "a.md", "it")
    page = (tmp_path / "a.md").read_text()
    assert page.count("| hemispheric") == 2 and "out of memory" in page
    by_default = nominal.nominal_cells([replace(row, mesh_size=[None, None])])
    assert [line[3] for line in by_default] == ["default", "default"]
