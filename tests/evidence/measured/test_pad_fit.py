"""The unknowns of the measured pad, found again from curves of a known law."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.evidence.measured.pad_fit import PressedTaxel, fit, modulus, residuals, rounded

TRAVEL = np.array([0.15, 0.3, 0.6, 1.2, 1.7, 1.95, 2.05])
PLACES = np.linspace(0.15, 1.9, 9)


def law(height, radius, travel=TRAVEL):
    """Like a ball on a layer: stiffer on a thin one, and less light from far below, slower at first."""
    force = np.sqrt(radius) * travel**1.5 / (1 + 0.4 * travel / radius) * (1 + travel / height)
    return PressedTaxel(travel, force, 0.3 * travel**2 * (1 - 0.15 * travel) * np.sqrt(radius) / height**1.5)


@pytest.mark.parametrize(("height", "radius", "stiffness", "late"), [(7.0, 1.2, 0.5, 0.0), (8.6, 0.9, 2.0, 0.06)])
def test_height_radius_and_modulus_are_found_again(height, radius, stiffness, late):
    there = law(height, radius, PLACES)
    there = there._replace(travel=PLACES - late, force=stiffness * there.force)
    found = fit(law, there, (7.8, 1.05))
    assert found.unknowns == pytest.approx([height, radius], rel=0.02)
    assert found.modulus == pytest.approx(stiffness, rel=0.02)
    assert found.late == pytest.approx(late, abs=0.02)
    assert np.all(found.deviations < [0.5, 0.1, 0.02]) and np.all(found.deviations > 0)
    assert found.misfit < 0.01
    assert len(found.tried) < 12


def test_the_modulus_is_the_ratio_of_forces():
    there = law(8, 1, PLACES)
    assert modulus(there, there._replace(force=0.7 * there.force)) == pytest.approx(0.7)


def test_a_path_that_ends_early_is_judged_as_far_as_it_goes():
    there = law(8, 1, PLACES)
    short = PressedTaxel(*(values[:4] for values in law(8, 1)))
    assert np.abs(residuals(short, there)).max() < 0.02  # of a spline through four points
    assert len(residuals(short, there)) == 2 * len(PLACES)


def test_a_path_that_ends_early_is_no_result_beside_complete_ones():
    """Below a radius of 1 mm paths end early, and fit the measured curve as far as they go."""

    def pressed(height, radius):
        curve = law(height, radius)
        return curve if radius >= 1 else PressedTaxel(*(values[:5] for values in curve))

    found = fit(pressed, law(8.6, 0.9, PLACES), (7.8, 1.05))
    assert found.unknowns[1] >= 1 and found.misfit == found.tried[tuple(found.unknowns)]
    assert min(found.tried.values()) < found.misfit < 0.1


def test_unknowns_have_three_digits():
    assert (rounded(8.0049), rounded(0.98765)) == (8.0, 0.988)
