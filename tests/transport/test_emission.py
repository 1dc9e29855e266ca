"""Narrow and wide beams on walls: their power, readings and derivatives, against integrals over directions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from patch_cells import cell, dome, led, phototransistor, plate

from mitsuba_taxel.transport import emission as module
from mitsuba_taxel.transport.emission import emission
from mitsuba_taxel.transport.laws.ends import CosineFactor, uniform_cone
from mitsuba_taxel.transport.laws.polar_cone import PolarCone
from mitsuba_taxel.transport.laws.tabulated_law import TabulatedLaw


def cone(angle):
    return uniform_cone(math.cos(math.radians(angle)))


def power(exponent):
    return CosineFactor((exponent + 1) / (2 * math.pi), exponent)


def table(angles, values):
    """A table by ascending angles, linear in the angle between them."""
    nodes = np.linspace(angles[-1], 0, 2001)
    law = TabulatedLaw(np.cos(np.radians(nodes)), np.interp(nodes, angles, values))
    return TabulatedLaw(law.cosines, law.values / law.within(np.array(law.cutoff)))


LAWS = {
    **{f"cone of {angle:g} degrees": cone(angle) for angle in (0.05, 0.1, 0.5, 1, 2, 5, 12, 20, 35, 60, 90)},
    **{f"polar cone of {angle:g} degrees": PolarCone(math.radians(angle)) for angle in (0.05, 1, 4, 20, 90)},
    **{f"exponent {exponent:g}": power(exponent) for exponent in (0, 1, 6, 60, 1e3, 5e3, 1e6)},
    "table with an edge": table([0, 3], [1, 1]),
    "ring": table([0, 1, 2, 4], [0, 0, 1, 0]),
    "wide table": table([0, 20, 50, 80], [1, 0.9, 0.3, 0]),
}
every_law = pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
NARROW = (
    "cone of 0.5 degrees", "cone of 20 degrees", "polar cone of 0.05 degrees", "polar cone of 20 degrees",
    "exponent 1000", "exponent 1e+06", "table with an edge", "ring",
)  # fmt: skip
"""The narrowest and the widest of each kind."""


@every_law
@pytest.mark.parametrize("rim", [0.05, 1.3])
def test_a_dome_catches_all_light_and_no_patch_more_than_passes_its_outline(law, rim):
    places = dome(1.275, rim, 2)
    light = emission(led(0.9, law, 0.1, 2), places, places, 2)
    outside = 0.0 if law.spread < 0.6 else 1 - law.within(np.array(0.0))  # below the LED's plane
    if rim == 0.05:
        assert light.power.sum() == pytest.approx(1 - outside, abs=0.05 if law.spread > 1.4 else 2e-5)
    assert np.abs(light.deviation).sum() < 3e-4 and abs(light.deviation.sum()) < 3e-5
    assert len(light.lit) < 500_000


def directions(law, count=12):
    """Cosines (N,) of a rule on the light of a narrow law, and shares (N,) of the power."""
    share, weight = np.polynomial.legendre.leggauss(count)
    parts = np.concatenate([np.linspace(0, 1, 4)[:-1], 1 - 0.3 ** np.arange(1.0, 19)])
    angles = np.linspace(0, law.spread, 20001)
    inside = law.within(np.cos(angles))
    low, high = np.interp(parts, inside, angles)[:, None], np.interp([*parts[1:], 1], inside, angles)[:, None]
    theta = low + (high - low) * (share + 1) / 2
    cosine = np.cos(theta)
    at = (high - low) / 2 * weight * 2 * np.pi * np.sin(theta) * law(cosine)[0]
    return theta.ravel(), (at / at.sum()).ravel()


def received(law, height, shift=0.0):
    """By the directions of the LED's light, on an endless plate that scatters by Lambert's law."""
    source, sensor = led(0.9, law, 0.1), phototransistor(0.9)
    theta, weight = directions(law)
    turn = np.arange(24) * np.pi / 12
    across = height * np.tan(theta)[:, None, None] * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    total = 0.0
    for at, of_source in zip(source.points, source.weights, strict=True):
        x, y = np.moveaxis(at[:2] + across + (shift, 0), -1, 0)
        squared = (x[..., None] - sensor.points[:, 0]) ** 2 + (y[..., None] - sensor.points[:, 1]) ** 2 + height**2
        total += of_source * weight @ (height**2 / (np.pi * squared**2) @ sensor.weights).mean(axis=1)
    return total


@pytest.mark.parametrize("name", NARROW)
def test_a_narrow_beam_on_a_plate_reads_as_the_integral_over_its_directions(name):
    law = LAWS[name]
    places = plate(3.7, 1.3, 6) + (0.11, 0.07, 0.0)
    under = cell(places, 0, 0.9, law, hole=0.1)
    assert under.reading == pytest.approx(received(law, 1.3), rel=1e-4)
    step = 1e-4
    slope = (received(law, 1.3 + step) - received(law, 1.3 - step)) / (2 * step)
    gradient = under.gradient()
    along = gradient.sum(axis=(0, 1))
    assert along[2] == pytest.approx(slope, rel=2e-3)
    stretched = (gradient * places).sum(axis=(0, 1))  # as the plate has no end within the beam, nothing changes
    most = 5e-3 if name == "ring" else 2.5e-3  # a kink within the beam
    assert np.abs([*along[:2], *stretched[:2]]).max() < most * abs(slope)


@pytest.mark.parametrize("exponent", [0.05, 0.76])
def test_a_wall_that_reaches_below_the_plane_of_an_led_has_derivatives(exponent):
    """Of an intensity whose slope is infinite in that plane."""
    places, upwards = dome(1.275, -0.1, 2), np.zeros((24, 15, 3))
    upwards[..., 2] = 1.0
    under, above, below = (
        cell(places + step * upwards, 0, 0.9, power(exponent), hole=0.1) for step in (0, 3e-3, -3e-3)
    )
    off = abs(under.gradient().sum(axis=(0, 1))[2] - (above.reading - below.reading) / 6e-3)
    assert off < 2 * under.conservation_slope_error(upwards) < 0.02


def test_derivatives_state_what_the_beam_gains_or_loses_on_the_walls(monkeypatch):
    """On pieces that are too large, the derivative by the height is that of the light at a few points."""
    law, places, upwards = LAWS["exponent 1000"], plate(3.7, 1.3, 6), np.zeros((72, 15, 3))
    upwards[..., 2] = 1.0
    whole = cell(places, 0, 0.9, law, hole=0.1)
    truth = whole.gradient().sum(axis=(0, 1))[2]
    assert whole.conservation_slope_error(upwards) < 1e-4 * abs(truth)
    monkeypatch.setattr(module, "MOST_CUTS", 1)
    coarse = cell(places, 0, 0.9, law, hole=0.1)
    off = abs(coarse.gradient().sum(axis=(0, 1))[2] - truth)
    assert off > 0.01 * abs(truth)
    assert off < 2 * coarse.conservation_slope_error(upwards)


@pytest.mark.parametrize("name", ["cone of 0.5 degrees", "exponent 1000", "ring", "polar cone of 4 degrees"])
def test_a_beam_on_pieces_that_are_too_large_has_a_large_error(monkeypatch, name):
    places = plate(3.7, 1.3, 6) + (0.11, 0.07, 0.0)
    right = cell(places, 0, 0.9, LAWS[name], hole=0.1)
    assert right.emission_error < 3e-4 * right.reading
    monkeypatch.setattr(module, "MOST_CUTS", 0)
    monkeypatch.setattr(module, "MOST_EDGE_CUTS", 0)
    coarse = cell(places, 0, 0.9, LAWS[name], hole=0.1)
    assert abs(coarse.reading - right.reading) > 5e-3 * right.reading
    assert abs(coarse.reading - right.reading) < 2 * coarse.emission_error
