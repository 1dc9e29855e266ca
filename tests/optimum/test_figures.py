"""Figures of merit of readings that are made up: their values, and their gradients against differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mitsuba_taxel import Circuit
from mitsuba_taxel.optimum.figures import FIGURES_OF_MERIT, TINY, DesignResponses, Figure, LineResponse, end_of
from mitsuba_taxel.optimum.result import circuit_notes
from mitsuba_taxel.pads.mould import SHAPE

CIRCUIT = Circuit(supply=3.3, load_resistance=1e4, transfer=5e-2, current_gain=100.0)
OF_CIRCUITS = ("saturation",)
TOLD = {
    "cross_talk": {"along": "normal", "taxel": 2},
    "cross_sensitivity": {"along": "normal", "by": "side"},
    "resolution": {"along": ("normal", "side")},
    **{name: {} for name in SHAPE},
}


def responses(shift, circuit=CIRCUIT, imaginary=0.0):
    """Four taxels along two lines, and how they change with one variable."""
    random = np.random.default_rng(3)
    lines = {}
    for name, values in (("normal", [0, -1, -2.5, -4]), ("side", [0, 0.5])):
        power, rate = 1e-3 * (2 + random.random((2, len(values), 4)))
        changed = power + shift * rate + 1j * imaginary * rate
        others = changed[:, 0], 500 * changed[::-1, 1], -changed[0, 2]
        lines[name] = LineResponse(np.array(values, dtype=float), changed, *others)
    shape = np.array([1.0, 0.7]) + (shift + 1j * imaginary) * np.array([0.3, -0.2])
    return DesignResponses(lines, dict.fromkeys(SHAPE, shape), circuit)


@pytest.mark.parametrize(
    ("kind", "circuit"),
    [(kind, circuit) for kind in FIGURES_OF_MERIT for circuit in (None, CIRCUIT) if circuit or kind not in OF_CIRCUITS],
    ids=lambda one: one if isinstance(one, str) else "volts" if one else "watts",
)
def test_gradients_are_those_of_differences(kind, circuit):
    told = TOLD.get(kind, {"along": "normal"})
    if circuit is None and "noise" in FIGURES_OF_MERIT[kind].takes:
        told = {**told, "noise": 1e-6}
    figure = Figure(kind, told, "")
    step = 1e-5
    ahead, behind = (figure.components(responses(sign * step, circuit)).real for sign in (1, -1))
    rates = figure.components(responses(0.0, circuit, TINY)).imag / TINY
    difference = (ahead - behind) / (2 * step)
    np.testing.assert_allclose(rates, difference, rtol=1e-5, atol=1e-6 * np.abs(difference).max())


def test_values():
    """Of readings 1, 2 and 4 along 0, 1 and 2 N, and of twice as much: slopes, half a unit off the line."""
    power = np.array([[1.0, 2.0], [2.0, 4.0], [4.0, 8.0]]) + 0j
    strain = np.array([0.0, 0.2, 0.5])
    lines = {"z": LineResponse(np.array([0.0, 1.0, 2.0]), power, strain, 1 - strain, -7.0)}
    lines["x"] = LineResponse(np.array([0.0, 1.0]), power[:2] * [1, -1], strain[:2], 1 - strain[:2])
    one = DesignResponses(lines, {}, None)

    def of(kind, **told):
        return Figure(kind, {"along": "z"} | told, "").components(one).real

    np.testing.assert_allclose(of("sensitivity"), [1.5, 3.0])
    np.testing.assert_allclose(of("relative_sensitivity"), 1.5)
    assert of("nonlinearity").max() == pytest.approx(0.5 / 3)
    np.testing.assert_allclose(of("cross_talk", taxel=1), [1, -1])
    assert of("cross_sensitivity", by="x").max() == pytest.approx(4.5 / 11.25)  # (1.5, 3) on (1, -2)
    np.testing.assert_allclose(of("rest"), [1, 2])
    assert of("largest_reading").max() == 8
    np.testing.assert_allclose(of("clearance"), [1, 0.8, 0.5])
    assert of("first_contact") == [7.0]
    np.testing.assert_allclose(of("noise_equivalent_force", noise=0.3).max(), 0.2)
    slopes = np.array([[1.5, 3.0], [1.0, -2.0]]).T / 0.1
    expected = np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes)))
    np.testing.assert_allclose(of("resolution", along=("z", "x"), noise=0.1), expected)
    np.testing.assert_allclose(of("resolution", along=("z", "x"), of=("x",), noise=0.1), expected[1:])


@pytest.mark.parametrize("readings", [[[2.0], [1.0]], [[2.0, 1.0], [4.0, 2.0]], [[2.0, 1.0], [0.0, 0.0]]])
def test_resolution_of_forces_that_readings_do_not_tell_apart(readings):
    """One reading, changes that are alike, and none."""
    lines = {
        name: LineResponse(np.array([0.0, 1.0]), np.array([np.zeros(len(each)), each]) + 0j, np.zeros(2), np.zeros(2))
        for name, each in zip("zx", readings, strict=True)
    }
    told = {"along": ("z", "x"), "noise": 0.1}
    assert np.isnan(Figure("resolution", told, "N").components(DesignResponses(lines, {}, None)).real).all()


def test_range():
    """Light that saturates at 4 W: between loads, beyond the last one, never, and from the start; and pads that touch
    something, nothing, or are not known to."""
    circuit = Circuit(supply=4.0, load_resistance=1.0, transfer=1.0, saturation_voltage=0.0)
    power = np.array([[1.0, 1.0, 2.0], [2.0, 1.5, 1.0], [5.0, 3.0, 0.5]]) + 0j
    dark = LineResponse(np.array([0.0, -1.0, -2.0]), power, power[:, 0], np.full(3, np.nan))
    lit = replace(dark, power=np.array([[5.0], [6.0], [3.0]]) + 0j)

    def of(line, circuit):
        responses = DesignResponses({"z": line}, {}, circuit)
        figure = Figure("range", {"along": "z"}, "N")
        ends = figure.components(responses).real.tolist()
        return ends, end_of(figure, responses) if ends else ""

    saturated = [pytest.approx(5 / 3), pytest.approx(8 / 3), 20.0]
    assert of(dark, circuit) == (saturated, "where taxel 1 saturates") and of(dark, None) == ([], "")
    assert of(lit, circuit) == ([0.0], "where taxel 1 saturates")
    touching = replace(dark, contact=-1.5 + 0j, touched="the board")
    assert of(touching, circuit) == ([1.5, *saturated], "where the pad touches the board")
    later = replace(touching, contact=-1.7 + 0j)
    assert of(later, circuit) == ([1.7, *saturated], "where taxel 1 saturates")
    assert end_of(Figure("first_contact", {"along": "z"}, "N"), DesignResponses({"z": later}, {}, circuit)).endswith(
        "the board"
    )
    untouched = "up to which the pad touches nothing; loads beyond were not followed"
    assert of(replace(dark, contact=-20 + 0j), None) == ([20.0], untouched)
    unstable = replace(dark, contact=-1.7 + 0j, ended="it is unstable")
    assert of(unstable, circuit) == ([1.7, *saturated], "where taxel 1 saturates")
    assert of(replace(unstable, contact=-1.6 + 0j), circuit) == ([1.6, *saturated], "as it is unstable")


def test_what_a_circuit_shows_of_a_design():
    """Of 1 V per watt up to 4 V, with 0.3 V of noise: readings 1, 2, 5 and 1, 1.5, 3 W along 0, 1 and 2 N."""
    circuit = Circuit(supply=4.0, load_resistance=1.0, transfer=1.0, saturation_voltage=0.0, other_noise=0.3)
    power = np.array([[1.0, 1.0], [2.0, 1.5], [5.0, 3.0]]) + 0j
    lines = {
        name: LineResponse(np.arange(count), power[:count], *power[:count].T) for name, count in (("z", 3), ("x", 2))
    }
    lines["still"] = LineResponse(np.zeros(1), power[:1], *power[:1].T)
    assert circuit_notes(DesignResponses(lines, {}, circuit), {"z": "fz", "x": "fx", "still": ""}) == [
        "one count: 0.0009766 V",
        "along z: noise of the first reading as fz: 0.2 to 0.3; saturated from fz = 1.667 on (taxel 1)",
        "along x: noise of the first reading as fx: 0.3 to 0.6; saturated nowhere",
    ]
    assert circuit_notes(DesignResponses(lines, {}, None), {}) == []
    quiet = circuit_notes(
        DesignResponses(lines, {}, replace(circuit, other_noise=0.0)), {"z": "fz", "x": "fx", "still": ""}
    )
    assert len(quiet) == 4 and quiet[-1].startswith("The noise before the converter is less than half of its step")


def test_words():
    assert Figure("resolution", {"along": ("z", "x")}, "N").words == "resolution along z, x"
    assert Figure("resolution", {"along": ("z", "x"), "of": ("x",)}, "N").words == "resolution of x along z, x"
    assert Figure("least_wall", {}, "mm").words == "least wall"
