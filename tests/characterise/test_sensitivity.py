"""Slopes of synthetic studies whose slopes and noise are known."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from mitsuba_taxel import InputError
from mitsuba_taxel.characterise import sensitivity, sensitivity_table
from mitsuba_taxel.characterise.shape_error import COURSE

FORCES = np.linspace(0, -20, 41)
REPLICATES = 32


def study_of(replicate_power, dims, **coords) -> xr.Dataset:
    return xr.Dataset({"replicate_power": (dims, replicate_power)}, coords=coords)


def test_slopes_of_a_parabola_without_noise():
    power = 1e-3 + 2e-6 * FORCES**2
    study = study_of(
        np.tile(power[:, None, None], (1, REPLICATES, 1)), ["fz", "replicate", "taxel"], fz=FORCES, taxel=[1]
    )
    slopes = sensitivity(study, "fz").squeeze()
    assert float(slopes.mean_slope) == pytest.approx(-4e-5)
    assert float(slopes.max_slope) == pytest.approx(-2e-6 * 39.5) and float(slopes.max_slope_at) == -19.75
    assert float(slopes.max_slope_error) < 1e-15 and slopes.max_slope.units == "W/N"


def test_order_of_the_forces_does_not_matter():
    power = 1e-3 + 2e-6 * FORCES**2
    study = study_of(np.tile(power[:, None, None], (1, 4, 1)), ["fz", "replicate", "taxel"], fz=FORCES, taxel=[1])
    shuffled = study.isel(fz=np.random.default_rng(1).permutation(len(FORCES)))
    xr.testing.assert_allclose(sensitivity(study, "fz"), sensitivity(shuffled, "fz"))


def test_noise_that_steps_share_does_not_enter_a_slope():
    noise = np.random.default_rng(2).normal(size=(1, REPLICATES, 3)) * 1e-5
    study = study_of(noise - 4e-5 * FORCES[:, None, None], ["fz", "replicate", "taxel"], fz=FORCES, taxel=[1, 2, 3])
    slopes = sensitivity(study, "fz")
    np.testing.assert_allclose(slopes.mean_slope, -4e-5)
    np.testing.assert_allclose(slopes.max_slope, -4e-5)
    assert float(slopes.mean_slope_error.max()) < 1e-15


def test_stated_errors_are_the_true_ones_and_the_maximum_is_not_biased():
    """300 studies of one slope: normalised errors have mean 0 and variance 31/29, each within 5 sigma.

    Of the largest of slopes that are all the same, the error is stated up to 1.6 times too large: that a place was
    chosen among equals cannot be told from one among such as the noise makes alike.
    """
    count, scale = 300, 1e-6
    noise = np.random.default_rng(3).normal(size=(len(FORCES), REPLICATES, count)) * scale
    power = noise - 4e-5 * FORCES[:, None, None]
    slopes = sensitivity(study_of(power, ["fz", "replicate", "taxel"], fz=FORCES, taxel=np.arange(count)), "fz")
    for name in ("mean_slope", "max_slope"):
        z = (slopes[name] + 4e-5) / slopes[f"{name}_error"]
        assert abs(float(z.mean())) < 5 / np.sqrt(count), name
        low = 1 / 1.6**2 if name == "max_slope" else 1
        assert low * 31 / 29 - 5 * np.sqrt(2 / count) * low < float(z.var()) < 31 / 29 + 5 * np.sqrt(2 / count), name


def test_table_has_a_row_for_each_curve_and_taxel():
    power = np.zeros((2, 3, 4, 5)) + np.array([0, -1.0, -2])[:, None, None]
    dims = ["cell", "fz", "replicate", "taxel"]
    study = study_of(power, dims, cell=["a", "b"], fz=[0.0, -1, -2], taxel=range(1, 6))
    table = sensitivity_table(study)
    assert len(table) == 10 and list(table.columns[:3]) == ["force", "cell", "taxel"]
    assert np.allclose(table.mean_slope_W_per_N, 1) and set(table.force) == {"fz"}


def test_without_a_varied_force_there_is_no_table():
    study = study_of(np.zeros((2, 4, 1)), ["z", "replicate", "taxel"], z=[1.0, 2], taxel=[1])
    assert len(sensitivity_table(study)) == 0
    with pytest.raises(InputError, match="fz"):
        sensitivity(study, "fz")


def test_what_the_mechanics_is_off_by_is_in_the_error_of_a_slope():
    """Readings that deviate by 1 % of their slope: of it, the share that the finite elements' order gives, and more
    where a slope is local. Of a deviation of one size at all loads, the random course may differ, with the
    correlation of loads a range apart."""
    from mitsuba_taxel.sensing.reading.readings import ERROR_SHARE

    power = np.tile(-4e-5 * FORCES[:, None, None], (1, REPLICATES, 1))
    study = study_of(power, ["fz", "replicate", "taxel"], fz=FORCES, taxel=[1])
    off = study.assign(deviation=(("fz", "taxel"), 4e-7 * FORCES[:, None]))
    assert float(sensitivity(study, "fz").mean_slope_error.max()) < 1e-15
    found = sensitivity(off, "fz")
    for name in ("max_slope", "mean_slope", "zero_slope"):
        assert 0.9 < found[f"{name}_error"].item() / (ERROR_SHARE * 4e-7) < 2
        assert found[name].item() == pytest.approx(-4e-5)
    assert found.mean_slope_error.item() == pytest.approx(ERROR_SHARE * 4e-7, rel=2e-3)
    found = sensitivity(study.assign(deviation=(("fz", "taxel"), np.full((len(FORCES), 1), 1e-4))), "fz")
    apart = np.sqrt(2 * (1 - np.exp(-1 / 2))) * 1e-4 / np.ptp(FORCES)
    assert found.mean_slope_error.item() == pytest.approx(COURSE * ERROR_SHARE * apart, rel=1e-2)


def test_what_facets_change_is_in_the_error_of_a_slope():
    """The same share of it as of the readings, whatever noise that has along the curve, and the random course of the
    error of readings that hardly change."""
    power = np.tile(0.02 - 4e-5 * FORCES[:, None, None], (1, REPLICATES, 1))
    study = study_of(power, ["fz", "replicate", "taxel"], fz=FORCES, taxel=[1]).assign_attrs(curve="fz")
    share = 1e-3 * (1 + 0.3 * np.tile([1, -1], 21)[:41])
    found = sensitivity(study.assign(geometry_error=(("fz", "taxel"), power[:, 0] * share[:, None])), "fz")
    apart = np.sqrt(2 * (1 - np.exp(-1 / 2))) * COURSE * share.mean() * 0.02 / np.ptp(FORCES)
    assert found.mean_slope_error.item() == pytest.approx(np.hypot(share.mean() * 4e-5, apart), rel=2e-2)
    for name in ("max_slope", "mean_slope", "zero_slope"):
        assert 0.99 < found[f"{name}_error"].item() / found.mean_slope_error.item() < 3
        assert found[name].item() == pytest.approx(-4e-5)


def test_slopes_along_a_diagonal_are_sums_of_derivatives():
    """Along (0.6, 0, -0.8), with derivatives 3 and -2 by fx and fz: 0.6 x 3 + 0.8 x 2."""
    way = np.linspace(0, 10, 5)
    derivative = np.broadcast_to([3.0, -2.0], (5, 1, 2))
    study = study_of(np.random.default_rng(4).normal(size=(5, 8, 1)), ["step", "replicate", "taxel"], taxel=[1])
    study = study.assign_coords(fx=("step", 0.6 * way), fz=("step", -0.8 * way), parameter=["fx", "fz"]).assign(
        smooth_power=(["step", "taxel"], 3.4 * way[:, None]),
        derivative=(["step", "taxel", "parameter"], derivative),
        derivative_error=(["step", "taxel", "parameter"], 0.01 * np.abs(derivative)),
    )
    found = sensitivity(study, "step").squeeze()
    for name in ("max_slope", "mean_slope", "zero_slope"):
        assert float(found[name]) == pytest.approx(3.4), name
        assert float(found[f"{name}_error"]) == pytest.approx(0.034), name
    by_one = study.sel(parameter=["fx"])  # not enough: slopes are differences of readings
    assert abs(float(sensitivity(by_one, "step").mean_slope.squeeze()) - 3.4) > 1
