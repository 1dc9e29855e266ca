"""Errors of a model carried to the unknowns, against fits to changed readings and all signs of these."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from mitsuba_taxel.base.replicates import standard_error
from mitsuba_taxel.fitting.model_error import ModelError, carried

X = np.array([0.0, 1.0, 2.0, 4.0])
LINE = np.linalg.pinv(np.stack([np.ones_like(X), X], axis=1))
"""(unknowns, settings) change of offset and slope of a straight line with each reading."""


def error(replicates, mechanics, geometry=None):
    geometry = np.zeros_like(mechanics) if geometry is None else geometry
    return ModelError(replicates[..., None], mechanics[:, None], geometry[:, None], LINE[..., None], np.arange(len(X)))


def test_light_has_the_covariance_of_its_replicates():
    """Refits by every replicate; noise that all settings share moves the offset alone."""
    random = np.random.default_rng(1)
    replicates = 1 + random.normal(size=(32, len(X)))
    slopes = [np.polyfit(X, each, 1)[::-1] for each in replicates]
    found = carried(error(replicates, np.zeros(4)))
    np.testing.assert_allclose(found.light, standard_error(np.array(slopes)), rtol=1e-9)
    common = carried(error(np.repeat(replicates[:, :1], 4, axis=1), np.zeros(4)))
    assert common.light[0] == pytest.approx(standard_error(replicates[:, 0])) and common.light[1] < 1e-12
    np.testing.assert_allclose(common.total, common.light)


def test_the_worst_signs_of_the_other_errors_are_stated():
    size = np.array([0.1, 0.2, 0.3, 0.4])
    shifts = [np.abs(LINE @ (signs * size)) for signs in product((-1, 1), repeat=4)]
    found = carried(error(np.ones((32, 4)), size, 2 * size))
    np.testing.assert_allclose(found.mechanics, np.max(shifts, axis=0), rtol=1e-12)
    np.testing.assert_allclose(found.geometry, 2 * found.mechanics)
    np.testing.assert_allclose(found.total, np.sqrt(5) * found.mechanics)


def test_an_unknown_error_is_left_out_of_the_total():
    found = carried(error(np.ones((32, 4)), np.full(4, np.nan), np.ones(4)))
    assert np.isnan(found.mechanics).all()
    np.testing.assert_allclose(found.total, found.geometry)
