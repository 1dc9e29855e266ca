"""Forces from readings: intervals hold as many as they say, on paths that were not seen."""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray as xr
from scipy import stats

from mitsuba_taxel import Circuit, InputError
from mitsuba_taxel.characterise import Measurement
from mitsuba_taxel.electronics import respond, with_volts
from mitsuba_taxel.surrogates import calibrate, write_calibration
from mitsuba_taxel.surrogates.wording import printed_calibration

FORCE, NOISE = np.linspace(0, -10, 11), 0.005


def readings(fx, fz, stiffness):
    """Of four taxels, of pads whose stiffness differs from path to path."""
    return 4e-3 * np.stack(
        [1 - stiffness * (0.02 * fz * (1 - 0.01 * fz) + side * 0.03 * fx) for side in (-1, -0.3, 0.4, 1)], axis=-1
    )


def study(paths=24):
    fx = np.linspace(-2, 2, paths)
    stiffness = 1 + 0.02 * np.random.default_rng(5).normal(size=paths)
    power = readings(fx[:, None], FORCE[None], stiffness[:, None])
    coords = {"fx": fx, "fz": FORCE, "taxel": range(1, 5)}
    return xr.Dataset({"power": (["fx", "fz", "taxel"], power)}, coords, {"curve": "fz"})


@pytest.mark.parametrize("coverage", [0.5, 0.9])
def test_intervals_cover_on_new_paths(coverage):
    """400 pads that are not in the study: what they spread by, the paths that were left out have shown."""
    found = calibrate(study(), coverage=coverage, noise=NOISE)
    assert found.forces == ("fx", "fz") and abs(found.covered - coverage) < 0.05
    rng = np.random.default_rng(7)
    fx, fz = rng.uniform(-2, 2, 400), rng.uniform(-10, 0, 400)
    shown = readings(fx, fz, 1 + 0.02 * rng.normal(size=400)) * (1 + NOISE * rng.normal(size=(400, 4)))
    inside = np.abs(found.polynomial(shown) - np.stack([fx, fz], axis=1)) <= found.half_width
    assert abs(inside.mean() - coverage) < 0.1 and found.half_width[1] < 2


def test_a_measurement_is_calibrated_by_its_runs():
    time = np.arange(0, 400, 0.1)
    force = -5 * (1 - np.cos(time / 8))
    rng = np.random.default_rng(2)
    volts = 1 - 0.05 * force[:, None] * [1, 0.5] + 2e-3 * rng.normal(size=(len(time), 2))
    bench = Measurement(time, force[:, None], ("fz",), volts, np.array([1, 2]), "bench.csv")
    found = calibrate(bench, coverage=0.9)
    assert found.unit == "V" and found.forces == ("fz",) and found.units == ("N",) and found.paths == 16
    assert found.covered == pytest.approx(0.9 * 13.8 / 12.8, abs=0.01)  # of the 12.8 other paths on average, and one
    best, rank = 2e-3 / 0.05 / np.hypot(1, 0.5), 0.9 * (found.paths + 1) / found.paths
    assert found.half_width[0] == pytest.approx(stats.norm.isf((1 - rank) / 2) * best, rel=0.1)


def test_behind_a_circuit_readings_are_volts_with_its_noise():
    """One taxel, linear in the force: intervals are as wide as those of noise and converter alone."""
    slope, noise = 0.05, 4e-3  # V/N, V
    circuit = Circuit(supply=5.0, load_resistance=1e3, transfer=0.25, adc_bits=8, other_noise=noise)
    power, dims = 4e-3 * (1 - slope * FORCE) * np.ones((24, 1)), ["x", "fz", "taxel"]
    watts = xr.Dataset(
        {"power": (dims, power[..., None]), "total_error": (dims, 0 * power[..., None])},
        {"x": np.arange(24.0), "fz": FORCE, "taxel": [1]},
        {"curve": "fz"},
    )
    found = calibrate(with_volts(watts, circuit), coverage=0.9)
    deviation = np.hypot(noise, circuit.step / np.sqrt(12))
    assert found.unit == "V" and found.noise == 0 and set(found.polynomial.units) == {"V"}
    rank = 0.9 * 25 / 24  # of 24 paths and a new one
    assert found.half_width[0] == pytest.approx(stats.norm.isf((1 - rank) / 2) * deviation / slope, rel=0.1)
    shown = circuit.step * respond(circuit, power[0, 5:6]).counts[:, None]
    assert found.polynomial(shown)[0, 0] == pytest.approx(FORCE[5], abs=circuit.step / slope)
    in_watts = calibrate(watts)
    assert in_watts.unit == "W" and in_watts.noise == 0.005


def behind(full_scale, taxels):
    """A study of 8 paths behind a circuit with this full scale; the taxels read 0.5 and 5 V at rest, less when
    loaded."""
    power = np.array([1e-4, 1e-3])[:taxels] * (1 - 0.02 * np.abs(FORCE[:, None])) * np.ones((8, 1, 1))
    dims = ["x", "fz", "taxel"]
    watts = xr.Dataset(
        {"power": (dims, power), "total_error": (dims, 0 * power)},
        {"x": np.arange(8.0), "fz": FORCE, "taxel": np.arange(taxels) + 1},
        {"curve": "fz"},
    )
    return with_volts(
        watts, Circuit(supply=6.0, load_resistance=5e3, transfer=1.0, adc_bits=12, adc_reference=full_scale)
    )


def test_saturated_readings_are_named_and_a_saturated_sensor_is_refused():
    """It had an interval of its forces, and no word."""
    assert not calibrate(behind(6.0, 2)).saturated
    partly = calibrate(behind(1.0, 2))  # the second taxel is saturated at all forces, the first at none
    assert partly.saturated.startswith("the output is saturated (at 1 V or more)")
    assert "most often of taxel 2" in partly.saturated
    assert any("most often of taxel 2" in line for line in printed_calibration(partly))
    with pytest.raises(InputError, match=r"saturated \(at 0.2 V or more\) in all .* readings: a larger full scale"):
        calibrate(behind(0.2, 1))


def test_a_runtime_reads_it(tmp_path):
    pytest.importorskip("onnx")
    onnxruntime = pytest.importorskip("onnxruntime")
    found = calibrate(study(), noise=NOISE)
    write_calibration(found, tmp_path / "c.onnx")
    session = onnxruntime.InferenceSession(tmp_path / "c.onnx")
    shown = readings(np.array([0.5, 9.0]), np.array([-3.0, -50.0]), 1.0)
    force, inside, width = session.run(["force", "inside", "half_width"], {"inputs": shown})
    np.testing.assert_allclose(force, found.polynomial(shown), rtol=1e-9)
    assert inside.tolist() == [True, False] and width.tolist() == found.half_width.tolist()


def touches(places=8, reaction=True):
    """A study of an indenter's depth and place: the force grows with the depth, the light with force and place."""
    depth, x = np.linspace(0, 0.4, 5), np.linspace(-1, 1, places)
    force = -20 * depth[None] ** 1.5 * (1 + 0.1 * x[:, None])
    power = 1e-3 * np.stack([1 + 0.05 * force * (1 + 0.3 * side * x[:, None]) for side in (-1, 1)], axis=-1)
    study = xr.Dataset({"power": (["spot", "down", "taxel"], power)}, {"spot": x, "down": depth, "taxel": [1, 2]})
    roles = {"spot": ["indenter_x", 1], "down": ["uz", -1]}
    study.attrs = {"curve": "down", "roles": json.dumps(roles), "forces": "{}", "parameters": "{}"}
    columns = {"fx": 1e-3 * force, "fy": 0.05 * force, "fy_error": 0.5 + 0 * force, "fz": force}  # only fz is resolved
    named = {f"reaction_{name}": (["spot", "down"], values) for name, values in columns.items()}
    return study.assign(named) if reaction else study


@pytest.mark.parametrize(
    ("over", "names", "units"),
    [
        (None, ("fz", "spot"), ("N", "mm")),
        ("depth", ("down",), ("mm",)),
        (["depth", "place"], ("down", "spot"), ("mm", "mm")),
        ("force", ("fz",), ("N",)),
    ],
)
def test_studies_by_depth_are_calibrated_over_force_depth_or_place(over, names, units):
    """Two taxels tell force and place apart; the names are the scene's own."""
    found = calibrate(touches(), noise=1e-5, over=over)
    assert found.forces == names and found.units == units and found.paths == 8
    study = touches(places=3)  # the places -1, 0 and 1, of which 0 was not seen
    shown = study.power.sel(spot=0).isel(down=3).values[None]
    true = {"fz": study.reaction_fz.sel(spot=0).values[3], "down": study.down.values[3], "spot": 0.0}
    size = {"fz": 5, "down": 0.4, "spot": 2}
    for name, value in zip(names, found.polynomial(shown)[0], strict=True):
        assert value == pytest.approx(true[name], abs=0.1 * size[name])
    words = printed_calibration(found)
    assert any("8 paths are too few for 90% by ranks of paths: at least 9 are needed" in line for line in words)
    assert f"{names[0]}: +- " in words[0] and f" {units[0]} is meant to contain" in words[0]
    assert calibrate(touches(reaction=False), noise=1e-5).forces == ("down", "spot")


def test_too_little_is_refused():
    with pytest.raises(InputError, match="no force is varied"):
        calibrate(touches(reaction=False), over="force")
    with pytest.raises(InputError, match="no place is varied: a study of several values of the position"):
        calibrate(study(), over="place")
    with pytest.raises(InputError, match="over = 'weight' is not allowed: one or several of force, depth, place"):
        calibrate(study(), over=["force", "weight"])
    with pytest.raises(InputError, match="coverage = 1.0 is not allowed: a number above 0 and below 1"):
        calibrate(study(), coverage=1.0)
    with pytest.raises(InputError, match="at least three curves"):
        calibrate(study().isel(fx=slice(0, 2)))
    with pytest.raises(InputError, match="no force is varied"):
        calibrate(study().rename(fx="a", fz="b").assign_attrs(curve="b"))
