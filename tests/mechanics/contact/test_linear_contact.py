"""Pressures and tractions of linear bodies against the law of Coulomb."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.mechanics.contact.linear_contact import tractions


@pytest.mark.parametrize("friction", [0.05, 0.5, 2.0])
@pytest.mark.parametrize("seed", range(4))
def test_what_is_found_keeps_the_law(friction, seed):
    rng, count = np.random.default_rng(seed), 30
    places = np.sort(rng.uniform(size=count))
    green = np.exp(-np.abs(places[:, None] - places) / 0.3)
    coupling = 0.1 * green * np.sign(places[:, None] - places)
    matrix = np.block([[green, coupling, 0 * green], [coupling.T, green, 0 * green], [0 * green, 0 * green, green]])
    matrix += 1e-4 * np.eye(3 * count)
    offset = np.concatenate([rng.uniform(-1.0, 0.5, count), 0.3 * rng.normal(size=2 * count)])
    found = tractions(matrix, offset, friction, np.zeros(3 * count))
    gap, *slip = (matrix @ found + offset).reshape(3, count)
    pressure, *traction = found.reshape(3, count)
    slip, traction = np.array(slip), np.array(traction)
    assert pressure.min() >= -1e-9 and gap.min() >= -1e-9
    np.testing.assert_allclose(gap * pressure, 0, atol=1e-9)
    size, most = np.hypot(*traction), friction * np.maximum(pressure, 0)
    assert (size <= most + 1e-9).all()
    np.testing.assert_allclose(np.hypot(*slip)[size < most - 1e-9], 0, atol=1e-9)
    np.testing.assert_allclose(traction * np.hypot(*slip), -size * slip, atol=1e-9)


def test_places_that_give_way_the_wrong_way_alone_hold_together():
    """As on a pad that is unstable but for what holds it."""
    matrix = np.diag([-0.1, -0.1, 1.0, 1.0, 1.0, 1.0])
    matrix[0, 1] = matrix[1, 0] = 1.0
    found = tractions(matrix, np.array([-1.0, -1.0, 0.1, 5.0, 0.0, 0.0]), 0.3, np.zeros(6))
    np.testing.assert_allclose(found, np.array([1, 1, -0.09, -0.3, 0, 0]) / 0.9, atol=1e-9)


def test_rounding_in_flexible_contact_does_not_keep_it_from_settling():
    """As below a ball on small elements, where the matrix has a condition number of a million."""
    places, none = np.linspace(0, 1, 60), np.zeros((60, 60))
    green = np.exp(-(((places[:, None] - places) / 0.2) ** 2))
    matrix = np.block([[green, none, none], [none, green, none], [none, none, green]]) + 1e-4 * np.eye(180)
    expected = np.concatenate([1 + places, 0.1 * np.sin(9 * places), 0 * places])
    found = tractions(matrix, -matrix @ expected, 0.3, np.zeros(180))
    np.testing.assert_allclose(found, expected, atol=1e-9)


@pytest.mark.filterwarnings("error")
def test_a_place_pressed_without_traction_overflows_nowhere():
    found = tractions(np.diag([0.02, 1.0, 1.0]), np.array([-3.0, 0.0, 0.0]), 0.3, np.array([100.0, 0.0, 0.0]))
    np.testing.assert_allclose(found, [150, 0, 0], atol=1e-9)
