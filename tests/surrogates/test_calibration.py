"""Forces from readings: intervals hold as many as they say, on paths that were not seen."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from scipy import stats

from mitsuba_taxel import Circuit, InputError
from mitsuba_taxel.characterise import Measurement
from mitsuba_taxel.electronics import respond, with_volts
from mitsuba_taxel.surrogates import calibrate, write_calibration
from mitsuba_taxel.surrogates.calibration import interval_of_paths
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


@pytest.mark.parametrize("paths", [3, 10])
@pytest.mark.parametrize("coverage", [0.5, 0.9])
def test_intervals_cover_errors_that_are_common_to_a_path(paths, coverage):
    """Of few paths, whose rows count once however many there are; false-alarm rate 1e-4. The quantile of all rows
    contained 75 % where 90 % were stated of three paths."""
    random, count = np.random.default_rng(paths), 3000
    path = np.repeat(np.arange(paths), [2 + 3 * number for number in range(paths)])
    inside = 0
    for _ in range(count):
        common = random.normal(size=(paths + 1, 1))
        (width,) = interval_of_paths(common[:-1][path] + 0.01 * random.normal(size=(len(path), 1)), path, coverage)
        inside += abs(common[-1, 0]) < width
    assert inside >= stats.binom.ppf(1e-4, count, coverage)
    if coverage == 0.9:
        assert inside <= stats.binom.isf(1e-4, count, coverage + 0.01)


def test_intervals_of_errors_of_single_rows_are_little_wider_than_needed():
    """By Student's distribution for 24 paths instead of the normal one."""
    missed = np.random.default_rng(3).normal(size=(24 * 200, 1))
    (width,) = interval_of_paths(missed, np.repeat(np.arange(24), 200), 0.9)
    assert width == pytest.approx(stats.t.isf(0.05, 24), rel=0.03)


def test_a_measurement_is_calibrated_by_its_runs():
    time = np.arange(0, 400, 0.1)
    force = -5 * (1 - np.cos(time / 8))
    rng = np.random.default_rng(2)
    volts = 1 - 0.05 * force[:, None] * [1, 0.5] + 2e-3 * rng.normal(size=(len(time), 2))
    bench = Measurement(time, force[:, None], ("fz",), volts, np.array([1, 2]), "bench.csv")
    found = calibrate(bench, coverage=0.9)
    assert found.unit == "V" and found.forces == ("fz",) and 0.9 <= found.covered < 0.93
    assert found.half_width[0] == pytest.approx(1.645 * 2e-3 / 0.05 / np.hypot(1, 0.5), rel=0.1)  # the best there is


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
    assert found.half_width[0] == pytest.approx(1.645 * deviation / slope, rel=0.1)
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


def test_too_little_is_refused():
    with pytest.raises(InputError, match="at least three curves"):
        calibrate(study().isel(fx=slice(0, 2)))
    with pytest.raises(InputError, match="no force is varied"):
        calibrate(study().rename(fx="a", fz="b").assign_attrs(curve="b"))
