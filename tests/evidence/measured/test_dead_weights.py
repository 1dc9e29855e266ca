"""Dead weights on the measured pad: slopes, and what the page predicts."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from mitsuba_taxel.evidence.measured import bench_pad
from mitsuba_taxel.evidence.measured.dead_weights import slopes
from mitsuba_taxel.evidence.measured.page.dead_weights import weights_section


@pytest.fixture
def study():
    """Changes of 0.01 per N at all taxels but the last, which does not change; a tilt of 0.02 degrees per N mm."""
    force, x = np.array([1.0, 2.0]), np.array([0.0, 3.0])
    change = 0.01 * force[:, None] * np.where(np.arange(25) < 24, 1.0, 0.0)
    return xr.Dataset(
        {
            "change": (("place", "taxel"), change),
            "change_error": (("place", "taxel"), np.full_like(change, 1e-4)),
            "sinking": ("place", 0.01 * force),
            "sinking_error": ("place", [np.nan, 1e-4]),
            "tilt": ("place", 0.02 * force * x),
            "tilt_error": ("place", [np.nan, 0.001]),
            "force": ("place", force),
            "x": ("place", x),
            "y": ("place", np.zeros(2)),
        }
    )


def test_slopes_are_changes_of_the_mean_voltage_at_rest_per_newton(study):
    slope, error = slopes(study)
    np.testing.assert_allclose(slope[:, :24], 1.68 * 0.01)
    np.testing.assert_allclose(error, 1.68e-4 / np.array([[1.0], [2.0]]) * np.ones(25))


def test_the_page_predicts_slope_sinking_and_tilt(study):
    text = " ".join(weights_section(study, {13: 1.0, 17: 1.3}).split())
    assert "| 2 | 3 | 16.13 ± 0.08 | 0.00 to 16.80 | 0.0200 ± 0.0001 | 0.120 ± 0.001 |" in text
    assert "| 1 | 0 | 16.13 ± 0.17 | 0.00 to 16.80 | 0.0100 | 0.000 |" in text
    assert "20.0 thousandths of a degree per N mm" in text and "by 0.14 to 0.19°" in text
    assert "taxels 13 / 17 change 1.00 / 1.30 times" in text


def test_the_scene_has_the_plate_instead_of_the_indenter(tmp_path):
    bench_pad.write_scene(tmp_path / "plate.xml", load=bench_pad.PLATE)
    bench_pad.write_scene(tmp_path / "indenter.xml")
    plate, indenter = ((tmp_path / f"{name}.xml").read_text() for name in ("plate", "indenter"))
    assert "plate_wrench" in plate and "indenter" not in plate
    assert "indenter_displacement" in indenter and "plate_wrench" not in indenter
    assert "{" not in plate + indenter
