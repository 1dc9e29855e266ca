"""Figures of readings whose dependence on force is known, and their derivatives."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.tolerances.figures import figure_rates, figures, loaded_taxel

FORCE = np.array([0.0, -2.0])


def readings(gain, softness):
    """Two taxels; the second one changes most."""
    return gain * np.array([[4.0, 2.0], [4.0 * (1 + 0.1 * softness), 2.0 * (1 + 0.5 * softness**2)]])


def test_closed_forms():
    one = readings(3.0, 1.0)
    loaded = loaded_taxel(one, FORCE)
    found = figures(one, FORCE, loaded)
    assert loaded == 1
    np.testing.assert_allclose(found["rest"], [12, 6])
    np.testing.assert_allclose(found["sensitivity"], [-0.6, -1.5])
    np.testing.assert_allclose(found["crosstalk"], [0.2, np.nan])
    both = figures(np.stack([one, readings(5.0, 2.0)]), FORCE, loaded)
    np.testing.assert_allclose(both["crosstalk"][:, 0], [0.2, 0.1])


def test_of_one_reading_there_is_rest_alone():
    assert list(figures(np.ones((7, 1, 3)), FORCE[:1], 0)) == ["rest"]
    assert list(figures(np.ones((7, 2, 1)), FORCE, None)) == ["rest", "sensitivity"]


def test_noise_as_a_force_is_the_noise_at_rest_over_the_slope():
    one = readings(3.0, 1.0)
    found = figures(one, FORCE, 1, lambda rest: 0.01 * np.sqrt(rest))
    np.testing.assert_allclose(found["noise_force"], 0.01 * np.sqrt([12, 6]) / [0.6, 1.5])
    rates = figure_rates(one, (one / 3.0)[..., None], FORCE, 1, lambda rest: 0.01 * np.sqrt(rest))
    np.testing.assert_allclose(rates["noise_force"][:, 0], -0.5 / 3.0 * found["noise_force"], rtol=1e-6)


def test_derivatives():
    one, step = readings(3.0, 1.0), 1e-6
    by_gain = one / 3.0
    by_softness = (readings(3.0, 1 + step) - readings(3.0, 1 - step)) / (2 * step)
    unknown = np.full_like(one, np.nan)
    found = figure_rates(one, np.stack([by_gain, by_softness, unknown], axis=-1), FORCE, 1)
    np.testing.assert_allclose(found["sensitivity"][:, :2], [[-0.2, -0.6], [-0.5, -3.0]], rtol=1e-6)
    np.testing.assert_allclose(found["crosstalk"][0, :2], [0, 0.2 - 2 * 0.2], atol=1e-6)
    assert all(np.isnan(values[:, 2]).all() for values in found.values())


def test_without_any_derivative():
    found = figure_rates(readings(1.0, 1.0), np.full((2, 2, 1), np.nan), FORCE, 1)
    assert np.isnan(found["rest"]).all() and found["rest"].shape == (2, 1)


@pytest.mark.parametrize("value", [0.0, 1e-12])
def test_dark_taxels_do_not_count_as_loaded(value):
    assert loaded_taxel(np.array([[value * 0, 1.0], [1.0, 1.5]]), FORCE) == 1
