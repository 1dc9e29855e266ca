"""Loops by Mullins' effect to first order: a block of one strain, in closed form."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import quad

from mitsuba_taxel import Mullins, NeoHookean, Pad, SpreadForce, load_path
from mitsuba_taxel.evidence.measured import measured, softening
from mitsuba_taxel.evidence.measured.memory_fit import HysteresisLoop, linear_tail
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


def test_play_alone_changes_what_an_unloading_at_less_travel_does():
    """A spring that is pressed by 0.03 mm less on the way back; without softening, as r is huge."""
    study, play = one_strain(), 0.03
    found = loop_of(study, (1e9, 0.1, 0.0), play)
    force = 3 * TRAVEL[-1]
    assert found.force == pytest.approx(100 * 3 * play / force, rel=1e-6)
    assert found.energy == pytest.approx(100 * play * force / (force * TRAVEL[-1] / 2), rel=1e-4)
    assert found.change_at_travel == pytest.approx(100 * play / TRAVEL[-1], rel=1e-6)
    assert found.change_at_force == pytest.approx(0, abs=1e-6)


def test_other_causes_leave_less_to_mullins_effect(monkeypatch):
    study, constants, play = one_strain(follows=0.01), (4.0, 0.2, 0.5), 0.02
    others = HysteresisLoop(0.5, 0.4, 0.3, -0.2)
    target = HysteresisLoop(*np.add(loop_of(study, constants, play), others))
    monkeypatch.setattr(softening, "MEASURED", target)
    fitted = fit(study, None, play, others)
    np.testing.assert_allclose(fitted.loop, target, atol=0.02)
    np.testing.assert_allclose(loop_of(study, fitted.constants), loop_of(study, constants), atol=0.03)


@pytest.mark.parametrize("eta", [1.0, 0.8])
def test_a_softened_solid_creeps_back_in_closed_form(eta):
    g, tau = 0.2, softening.TIMES[1]
    stiffness = eta * (1 - g) + g
    times = np.array(measured.TAIL_TIMES)
    expected = g / stiffness * np.exp(-(1 - g / stiffness) * times / tau)
    np.testing.assert_allclose(softening.softened_tail(np.array([0.0, g, 0.0]), eta), expected, rtol=1e-10)
    shares = np.array([0.2, 0.03, 0.02])
    np.testing.assert_allclose(softening.softened_tail(shares, 1.0), linear_tail(shares), rtol=1e-10)


def test_first_order_agrees_with_the_law_along_a_path():
    """A block under a force that is taken off: the roof of its cell, with Mullins' effect along the path."""
    pad, law, load, largest = Pad("parallelepiped", 1, 1), NeoHookean(1.0), SpreadForce(), 0.2
    study = softening._computed(pad, law, load, [0.1, 0.2], 0.0)
    constants = (12.0, 2e-4, 0.3)
    _, back = load_path(pad, Mullins(law, *constants), [(0, 0, -largest), (0, 0, -0.5 * largest)], load=load)
    x, y, z = back.mesh.points.T
    roof = (np.maximum(np.abs(x), np.abs(y)) < pad.cell_size / 2 + 1e-6) & (np.abs(z - pad.cell_height) < 1e-6)
    change = -back.displacement[roof, 2].mean() - float(study.roof[0])
    expected = 1e-2 * softening.hysteresis_under_force(study, constants) * float(study.roof[-1])
    assert change == pytest.approx(expected, rel=0.12)  # of second order: the stress is softened by up to 8 %


def test_the_section_states_fits_and_predictions(monkeypatch):
    study, constants = one_strain(follows=0.01), (4.0, 0.2, 0.5)
    monkeypatch.setattr(softening, "MEASURED", HysteresisLoop(*loop_of(study, constants)))
    memory = SimpleNamespace(
        terms=((0.2, 0.05), (0.03, 0.5), (0.02, 5.0)),
        tail=linear_tail(np.array([0.2, 0.03, 0.02])),
        loop=HysteresisLoop(0.5, 0.5, 0.1, 0.1),
        rubbed=HysteresisLoop(0.5, 0.5, 0.1, 0.1),
    )
    text = softening_section({13: study, 17: study}, study, memory)
    assert "not a proof" in text and "| alone |" in text and "17: force" in text
    first = next(line for line in text.splitlines() if line.startswith("| alone |"))
    predicted = [line for line in text.splitlines() if line.startswith("| alone |")][1]
    widths = [float(cell) for cell in first.split("|")[5:-1]]
    np.testing.assert_allclose([float(cell) for cell in predicted.split("|")[2:-1]], widths, atol=0.06)

    # Loops that no explanation gives: a wide loop of the force beside narrow ones of the voltage.
    monkeypatch.setattr(softening, "MEASURED", HysteresisLoop(90.0, 0.1, 0.1, 0.1))
    text = softening_section({13: study, 17: study}, study, memory)
    assert "**cannot** explain" in text and "No row agrees with all four" in text and "not a proof" not in text
