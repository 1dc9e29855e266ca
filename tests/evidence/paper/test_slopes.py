"""Slopes and curves of studies with and without derivatives."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.evidence.paper.slopes import change, curves, sensitivity

pytestmark = pytest.mark.quick

FORCE = np.array([0.0, -7.0, -20.0])
SHARES = np.array([0.5, 1.0])


@pytest.fixture
def parabolas(make_study):
    """Two taxels, the second the steeper one."""
    power, slope = (np.outer(each, SHARES) for each in (0.01 - 1e-5 * FORCE + 2e-6 * FORCE**2, -1e-5 + 4e-6 * FORCE))
    return make_study({"fz": FORCE}, power, 1e-6, 0, slope)


def test_the_maximum_slope_is_that_of_the_steepest_taxel(parabolas):
    found = sensitivity(parabolas, "fz")
    assert (found.taxel, found.at) == (2, -20)
    assert found.max_slope == pytest.approx(9e-5)
    assert found.max_slope_error == pytest.approx(1e-9)
    assert found.mean_slope == pytest.approx(-5e-5)


def test_without_derivatives_slopes_are_differences(parabolas):
    found = sensitivity(parabolas.drop_vars(["derivative", "derivative_error", "smooth_power"]), "fz")
    assert (found.taxel, found.at) == (2, -13.5)
    assert found.max_slope == pytest.approx(6.4e-5, abs=5 * found.max_slope_error)
    assert 0 < found.max_slope_error < 1e-6


def test_curves_follow_the_readings(parabolas):
    force = np.linspace(-20, 0, 7)
    expected = np.outer(0.01 - 1e-5 * force + 2e-6 * force**2, SHARES)
    np.testing.assert_allclose(curves(parabolas, "fz").power(force), expected, rtol=1e-12)


def test_a_study_that_has_lost_a_derivative_has_no_curves(parabolas):
    parabolas.derivative[1] = np.nan
    parabolas.attrs["notes"] = "there is not enough memory for it.\nanother note"
    with pytest.raises(
        ComputationError, match=r"^a study along fz lacks derivatives: there is not enough memory for it\. Re"
    ):
        curves(parabolas, "fz")


def test_changes_along_a_diagonal(make_study):
    force = np.array([0.0, 5.0, 11.0])
    power, slope = (np.outer(each, SHARES) for each in (0.01 + 1e-6 * force**2, 2e-6 * force))
    study = make_study({"resultant": force}, power, 1e-6, 0, slope)
    value, error = change(study, "resultant", 8.0, np.array([2.0, -1.0]))
    assert value == pytest.approx(0, abs=1e-15)
    assert change(study, "resultant", 8.0, np.array([0.0, 1.0]))[0] == pytest.approx(64e-6)
    assert error == pytest.approx(3 * 8 * 1e-9 * np.sqrt(2))
