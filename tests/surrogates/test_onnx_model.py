"""Models of studies: what they say of their error, of their box, and that a runtime reads them as they are meant."""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray as xr

from mitsuba_taxel import Circuit, InputError
from mitsuba_taxel.electronics import respond, with_volts
from mitsuba_taxel.surrogates import export, polynomial_of

pytestmark = pytest.mark.quick

FORCE, PLACE = np.linspace(0, -10, 6), np.linspace(-2, 2, 9)


def study(noise=0.0, **varied):
    """Readings of two taxels: smooth in force and place, no polynomial."""
    varied = varied or {"x": PLACE, "fz": FORCE}
    grid = np.meshgrid(*varied.values(), indexing="ij")
    at = dict(zip(varied, grid, strict=True))
    power = [truth(at.get("fz", 0.0), at.get("x", 0.0), side) * np.ones(grid[0].shape) for side in (-1, 1)]
    power = np.stack(power, axis=-1) + noise * np.random.default_rng(0).normal(size=(*grid[0].shape, 2))
    about = {name: "" for name in ("scene", "parameters", "seed", "points", "versions")}
    coords = {name: (name, values, {"units": "N" if name == "fz" else "mm"}) for name, values in varied.items()}
    data = {
        name: ([*varied, "taxel"], values) for name, values in (("power", power), ("total_error", 2e-6 + 0 * power))
    }
    return xr.Dataset(data, {**coords, "taxel": [1, 2]}, {"curve": "fz", **about})


def truth(force, x, side):
    return 4e-3 * (1 - 0.01 * force * np.exp(-((x - side) ** 2) / 8)) + 1e-7 * force**3


def test_the_stated_error_is_that_of_paths_which_were_not_seen():
    model = polynomial_of(study(noise=2e-6))
    assert model.names == ("x", "fz") and model.units == ("mm", "N") and model.tested == "7 paths left out one by one"
    x, force = np.random.default_rng(1).uniform([-2, -10], [2, 0], (500, 2)).T
    expected = np.stack([truth(force, x, side) for side in (-1, 1)], axis=1)
    scale = np.ptp(study().power.values, axis=(0, 1))
    miss = (model(np.stack([x, force], axis=1)) - expected) / scale
    rms = np.sqrt(np.square(miss).mean(axis=0)).max()
    assert 0.3 * model.rms < rms < 2 * model.rms < 0.02 and np.abs(miss).max() < 2 * model.worst


def test_one_path_is_tested_at_points():
    model = polynomial_of(study(fz=FORCE))
    assert model.names == ("fz",) and model.tested == "4 points left out one by one" and model.rms < 1e-3


def test_a_path_of_several_forces():
    steps = study(fz=FORCE).rename(fz="step").assign_attrs(curve="step")
    steps = steps.assign_coords(step=np.arange(1, 7), fz=("step", FORCE), fx=("step", FORCE**2))
    assert polynomial_of(steps).names == ("fz", "fx")


@pytest.fixture
def runtime(tmp_path):
    pytest.importorskip("onnx")
    onnxruntime = pytest.importorskip("onnxruntime")
    model, notes = export(study(), tmp_path / "model.onnx")
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    return model, notes, onnxruntime.InferenceSession(tmp_path / "model.onnx", options)


def test_a_runtime_gives_what_the_polynomial_does(runtime):
    model, notes, session = runtime
    inputs = np.array([[0.3, -4.0], [-2.0, 1e-12], [2.5, -4.0], [0.0, 1.0]])
    readings, inside = session.run(None, {"inputs": inputs})
    np.testing.assert_allclose(readings, model(inputs), rtol=1e-12)
    assert inside.tolist() == [True, True, False, False] and notes[0].startswith("error of the study's own")
    np.testing.assert_allclose(readings[2], model(np.array([[2.0, -4.0]]))[0], rtol=1e-12)
    about = session.get_modelmeta().custom_metadata_map
    assert json.loads(about["units"]) == ["mm", "N"] and json.loads(about["error"])["rms"] == model.rms < 0.01


def test_the_error_of_the_study_is_told_beside_that_of_the_fit(tmp_path):
    """7 % of full scale of the first taxel, less of the other: a perfect fit of wrong readings is not right."""
    onnx = pytest.importorskip("onnx")
    watts = study()
    scale = float(np.ptp(watts.power.values, axis=(0, 1)).min())
    wrong = watts.assign(total_error=0 * watts.power + 0.07 * scale)
    model, notes = export(wrong, tmp_path / "model.onnx")
    about = {each.key: each.value for each in onnx.load(tmp_path / "model.onnx").metadata_props}
    assert json.loads(about["study_error"])["rms"] == pytest.approx(0.07)
    assert json.loads(about["total_error"])["rms"] == pytest.approx(np.hypot(0.07, model.rms)) and model.rms < 0.01
    assert "7.00% of full scale (at worst 7.00%)" in notes[0] and "leave out" in notes[-1] == about["errors_leave_out"]
    unknown = wrong.assign(total_error=wrong.total_error.where(wrong.fz > -9))
    _, notes = export(unknown, tmp_path / "model.onnx")
    about = {each.key: each.value for each in onnx.load(tmp_path / "model.onnx").metadata_props}
    assert json.loads(about["total_error"])["rms"] is None and "total: unknown" in notes[0]


@pytest.mark.parametrize("load, saturates", [(470.0, False), (1500.0, True)])
def test_a_runtime_tells_the_volts_and_counts_of_the_circuit(tmp_path, load, saturates):
    """By the response to the model's own readings: the error stated in volts is that of unseen readings through it."""
    pytest.importorskip("onnx")
    onnxruntime = pytest.importorskip("onnxruntime")
    circuit = Circuit(supply=3.3, load_resistance=load, transfer=1.25)
    watts = study(noise=2e-6).assign(total_error=(("x", "fz", "taxel"), np.zeros((9, 6, 2))))
    model, (_, note, *others) = export(with_volts(watts, circuit), tmp_path / "model.onnx")
    assert any("saturated" in each for each in others) == saturates
    session = onnxruntime.InferenceSession(tmp_path / "model.onnx")
    x, force = np.random.default_rng(1).uniform([-2, -10], [2, 0], (500, 2)).T
    readings, _, voltage, counts = session.run(None, {"inputs": np.stack([x, force], axis=1)})
    right = respond(circuit, readings)
    assert bool(right.saturated.any()) == saturates
    np.testing.assert_allclose(voltage, right.voltage, atol=0.05 * circuit.step)
    assert (np.abs(counts - right.counts) <= 1).all() and (counts == right.counts).mean() > 0.9
    about = session.get_modelmeta().custom_metadata_map
    error = json.loads(about["voltage_error"])
    true = np.stack([truth(force, x, side) for side in (-1, 1)], axis=1)
    missed = respond(circuit, true).voltage - voltage
    rms = np.sqrt(np.square(missed).mean(axis=0)).max()
    assert 0.3 * error["rms"] < rms < 2 * error["rms"] and np.abs(missed).max() < 2 * error["worst"]
    assert f"error {error['rms']:.2g} V" in note and json.loads(about["circuit"])["load_resistance"] == load


@pytest.mark.parametrize(
    "one, complaint",
    [
        (study(fz=FORCE).expand_dims(cell=["a", "b"]), r"cell has values that are words \(a, b\): a study with one"),
        (study(fz=FORCE[:2]), "at least three values"),
        (study(fz=FORCE[:1]), "no parameter has more than one value"),
    ],
)
def test_what_cannot_be_a_model_is_refused(one, complaint):
    with pytest.raises(InputError, match=complaint):
        polynomial_of(one)


def test_several_scenes_are_refused(tmp_path):
    pytest.importorskip("onnx")
    with pytest.raises(InputError, match="several scenes"):
        export(xr.DataTree.from_dict({"a": study()}), tmp_path / "model.onnx")
