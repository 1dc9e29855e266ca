"""Plates and membranes, from the first load on: against the theory of clamped strips, small and large deflections."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from mitsuba_taxel.mechanics import NeoHookean, PatchForce, Pressure, SpreadForce, load_path
from mitsuba_taxel.mechanics.elements.elements import Elements
from mitsuba_taxel.mechanics.equilibrium.natural_step import MOST_TURNED, TICKS, ticks_of
from mitsuba_taxel.pads import REGIONS, Pad

PAD, SPAN, MODULUS = Pad(rows=1, columns=1), 20.0, 1.0
LAW = NeoHookean(MODULUS, 0.0)
"""Of silicone that does not shrink across, a strip of any width is one of a plate that bends to a cylinder."""


@pytest.fixture
def strip(fresh, monkeypatch, symmetric_block):
    """A function that makes pads strips, clamped at both ends: of the span over the thickness."""

    def clamped(slenderness):
        thickness = SPAN / slenderness
        along, through = (16, 2) if slenderness < 10 else (8, 1) if slenderness < 100 else (16, 1)
        mesh = symmetric_block((SPAN, 2.0, thickness), (along, 1, through))
        ends = (np.abs(mesh.points[mesh.faces, 0]) == SPAN / 2).all(axis=1)
        region = np.where(mesh.face_region == REGIONS["bottom"], REGIONS["roof"], mesh.face_region)
        region = np.where(ends, REGIONS["bottom"], region)
        high = replace(mesh, points=mesh.points + [0.0, 0.0, SPAN], face_region=region)  # far above the board
        monkeypatch.setattr("mitsuba_taxel.mechanics.continuation.path_problem.pad_mesh", lambda *_: high)
        return thickness

    return clamped


def deflection(state):
    """mm, in the middle of the lower side."""
    points = state.mesh.points
    middle = np.flatnonzero((points[:, 0] == 0) & (points[:, 1] == 0) & (points[:, 2] == SPAN))
    return -float(state.displacement[middle, 2].mean())


def small_deflection(pressure, thickness):
    """mm, by bending and shear (S. Timoshenko and S. Woinowsky-Krieger, Theory of Plates and Shells, 1959)."""
    bending = pressure * SPAN**4 / (32 * MODULUS * thickness**3)
    return bending + pressure * SPAN**2 / (8 * 5 / 6 * MODULUS / 2 * thickness)


def large_deflection(pressure, thickness):
    """mm, of a thin strip between fixed ends, whose tension grows as it bends (the same, section 3)."""
    stiffness = MODULUS * thickness**3 / 12

    def bent(u):  # (24/u^4)(u^2/2 + u/sinh u - u/tanh u), of u^2 = tension times span^2 over 4 stiffnesses
        return 24 / u**4 * (u**2 / 2 + u / np.sinh(u) - u / np.tanh(u))

    def missing(u):
        x = np.linspace(-0.5, 0.5, 4001) * SPAN
        k = 2 * u / SPAN
        # Slope of the strip: w'' = (q x^2/2 - c)/D + k^2 w with w' = 0 in the middle and at the ends.
        slope = pressure / (k**2 * stiffness) * (SPAN / 2 * np.sinh(k * x) / np.sinh(u) - x)
        longer = np.trapezoid(slope**2, x) / 2
        return 4 * u**2 * stiffness / SPAN**2 * SPAN / (MODULUS * thickness) - longer

    u = brentq(missing, 5e-3, 200.0)
    return pressure * SPAN**4 / (384 * stiffness) * bent(u)


@pytest.mark.parametrize(("slenderness", "loads"), [(20, [0.01, 0.3, 1]), (50, [0.01, 1, 10]), (200, [0.01, 1, 100])])
@pytest.mark.parametrize("load", [SpreadForce(), Pressure()], ids=["force", "pressure"])
def test_plates_and_membranes(strip, slenderness, loads, load):
    """Loads are deflections by bending alone, relative to the thickness: true ones are down to a twentieth of the
    last."""
    thickness = strip(slenderness)
    pressures = np.array(loads) * thickness * 32 * MODULUS * thickness**3 / SPAN**4
    values = [(p,) if isinstance(load, Pressure) else (0.0, 0.0, -p * SPAN * 2.0) for p in pressures]
    found = np.array([deflection(state) for state in load_path(PAD, LAW, values, load=load, mesh_size=1.0)])
    expected = [large_deflection(pressure, thickness) for pressure in pressures]
    np.testing.assert_allclose(found, expected, rtol=0.03)
    assert found[0] == pytest.approx(small_deflection(pressures[0], thickness), rel=0.03)
    assert found[2] / pressures[2] < 0.75 * found[0] / pressures[0]  # it stiffens


@pytest.mark.parametrize("slenderness", [5, 10, 30])
def test_plates_under_small_loads(strip, slenderness):
    """On a part of the strip as well: of a force in the middle, a strip of the width bends twice as much."""
    thickness = strip(slenderness)
    pressure = 1e-3 * thickness * 32 * MODULUS * thickness**3 / SPAN**4
    force = (0.0, 0.0, -pressure * SPAN * 2.0)
    (spread,) = load_path(PAD, LAW, [force], mesh_size=1.0)
    assert deflection(spread) == pytest.approx(small_deflection(pressure, thickness), rel=0.03)
    (narrow,) = load_path(PAD, LAW, [force], load=PatchForce((0.0, 0.0), (0.01 * SPAN, 2.0)), mesh_size=1.0)
    line = -force[2] / 2.0  # N per mm of the width
    bent = line * SPAN**3 / (16 * MODULUS * thickness**3) + line * SPAN / (4 * 5 / 6 * MODULUS / 2 * thickness)
    bent -= 0.21 * line / MODULUS  # near the force (S. Timoshenko and J. N. Goodier, Theory of Elasticity, section 40)
    assert deflection(narrow) == pytest.approx(bent, rel=0.03)


def test_a_plate_is_pushed_along_its_span_as_well(strip):
    """From where it has sunk a little: half of the force is carried by tension, half by compression."""
    thickness = strip(30)
    down = 0.1 * thickness * 32 * MODULUS * thickness**3 / SPAN**4 * SPAN * 2.0
    (state,) = load_path(PAD, LAW, [(down, 0.0, -down)], mesh_size=1.0)
    points = state.mesh.points
    middle = (points[:, 0] == 0) & (points[:, 1] == 0)
    along = down * SPAN / (8 * MODULUS * 2.0 * thickness)
    assert state.displacement[middle, 0].mean() == pytest.approx(along, rel=0.05)


def test_steps_of_blocks_are_cut_as_they_were(symmetric_block):
    """And of what turns more, into so many more parts that the smallest turns as little."""
    mesh = symmetric_block((4.0, 4.0, 4.0), (1, 1, 1))
    elements = Elements(mesh, LAW)
    for turned in (1e-3, 1.0, 40.0, 1e5):
        response = turned * mesh.points[:, [2, 1, 0]] * [1.0, 0.0, 0.0]
        ticks = ticks_of(elements, response)
        assert ticks >= TICKS and ticks & (ticks - 1) == 0
        assert turned / ticks <= MOST_TURNED and (ticks == TICKS or turned / ticks > MOST_TURNED / 2)
