"""Loops by Mullins' effect to first order: a block of one strain, in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import quad

from mitsuba_taxel.evidence.measured.memory_fit import HysteresisLoop
from mitsuba_taxel.evidence.measured.page.softening import softening_section
from mitsuba_taxel.evidence.measured.softening import fit, loop_of

TRAVEL = np.linspace(0.05, 2.0, 40)


def one_strain(volume=3.0, follows=0.2):
    """A spring with the energy density z^2 / 2; its roof moves by 0.1 z, and by ``follows`` times the missing force."""
    return xr.Dataset(
        {
            "force": ("travel", volume * TRAVEL),
            "roof": ("travel", 0.1 * TRAVEL),
            "energy": (("travel", "point"), 0.5 * TRAVEL[:, None] ** 2),
            "response": (("travel", "point"), follows * volume * TRAVEL[:, None]),
            "weight": ("point", np.array([volume])),
        },
        coords={"travel": TRAVEL},
    )


@pytest.mark.parametrize("constants", [(3.0, 0.4, 0.0), (5.0, 0.1, 0.3)])
def test_a_block_of_one_strain_loses_what_the_law_says(constants):
    r, m, beta = constants
    largest = 0.5 * TRAVEL[-1] ** 2

    def missing(z):
        return math.erf((largest - 0.5 * z**2) / (m + beta * largest)) / r * z

    found = loop_of(one_strain(), constants)
    widest = max(missing(z) for z in np.linspace(0.1, 2, 400))
    assert found.force == pytest.approx(100 * widest / TRAVEL[-1], rel=2e-3)
    assert found.energy == pytest.approx(100 * quad(missing, 0, TRAVEL[-1])[0] / largest, rel=1e-5)
    at_travel = 0.2 * 3 * widest  # less pressed, as the response to less stress is less displacement
    assert found.change_at_travel == pytest.approx(100 * at_travel / (0.1 * TRAVEL[-1]), rel=2e-3)
    at_force = at_travel - 0.1 * widest
    assert found.change_at_force == pytest.approx(-100 * at_force / (0.1 * TRAVEL[-1]), rel=3e-3)


def test_the_section_states_fits_and_their_limits(monkeypatch):
    from mitsuba_taxel.evidence.measured import softening

    study, constants = one_strain(follows=0.01), (4.0, 0.2, 0.5)
    monkeypatch.setattr(softening, "MEASURED", HysteresisLoop(*loop_of(study, constants)))
    fitted = fit(study)
    np.testing.assert_allclose(fitted.loop, softening.MEASURED, atol=0.02)
    text = softening_section(study)
    assert "not a proof" in text and "| free: " in text
