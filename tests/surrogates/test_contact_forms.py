"""Other forms of a contact model: ONNX and a file for JAX give the readings and flags of the model itself.

The model solves the contact by pivoting, the other forms by an iteration, so that each is a check of the other.
"""

from __future__ import annotations

import json
import runpy
from dataclasses import replace

import numpy as np
import pytest
from made_up_contact import linear_model, made_up

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.surrogates import contact_iteration, contact_onnx, write_contact_model
from mitsuba_taxel.surrogates.contact_iteration import iterated_forces, iteration_of
from mitsuba_taxel.surrogates.contact_pressures import contact_forces
from mitsuba_taxel.surrogates.contact_readings import NOT_A_NUMBER, NOT_RESOLVED, NOT_SOLVED, TOO_DEEP, TOO_FAR
from mitsuba_taxel.surrogates.contact_states import touches
from mitsuba_taxel.surrogates.second_order import with_second_order


def learnt():
    linear = linear_model()
    model = with_second_order(linear, made_up(linear, 8, (0.02, 0.8, 0.3, 0.2), (0.03, 0.1, -0.2, 0.1)))
    return replace(model, second=model.second._replace(side=0.8))


def cut():
    """A linear model of a top of 11 x 11 patches without its corners."""
    linear = linear_model()
    covered = np.abs(linear.x) + np.abs(linear.y)[:, None] < 3.3
    kept = covered.ravel()
    return replace(
        linear,
        covered=covered,
        compliance=linear.compliance[np.ix_(kept, kept)],
        gradient=linear.gradient[:, kept],
        places=np.array([[-1.2, -1.2], [1.2, 1.2]]),
    )


def maps_of(model):
    """Maps of balls and rods, and some that are flagged."""
    maps = np.array([body.below(model.points, depth) for body in touches(model, 40, seed=3) for depth in body.depths])
    maps[0] = touches(model, 1)[0].below(model.points, 0.3)
    maps[1, 2, 2], maps[2, 1, 1], maps[3, 0, 0] = np.nan, -np.inf, np.inf
    maps[4] += 0.5
    maps[5] = np.where(np.hypot(model.points[..., 0] - 1.9, model.points[..., 1]) < 0.5, 0.1, -1.0)
    maps[6] = np.where(np.hypot(*model.points[..., :2].transpose(2, 0, 1)) < 0.1, 0.3, -1.0)
    maps[7] = -1.0
    return maps


def assert_same(found, expected, tolerance):
    for name, own in expected._asdict().items():
        scale = np.nanmax(np.abs(own))
        np.testing.assert_allclose(found[name], own, rtol=0, atol=tolerance * scale, equal_nan=True, err_msg=name)
    assert expected.status[1] == expected.status[2] == expected.status[3] == NOT_A_NUMBER
    assert expected.status[4] & TOO_DEEP and expected.status[5] == TOO_FAR and expected.status[6] == NOT_RESOLVED


@pytest.mark.quick
def test_the_iteration_finds_the_forces_of_the_pivots():
    for model in (linear_model(), cut()):
        iteration = iteration_of(model)
        depth = maps_of(model)[8:, model.covered]
        forces, count = iterated_forces(iteration.operator, iteration.penalty, depth, iteration.most)
        expected = contact_forces(model.compliance, depth)
        assert count <= iteration.most and iteration.difference < 1e-8
        np.testing.assert_allclose(forces, expected, rtol=0, atol=1e-8 * expected.max())


@pytest.mark.quick
def test_compliances_that_the_iteration_cannot_solve_are_refused(monkeypatch):
    model = linear_model()
    with pytest.raises(ComputationError, match="compliance of the patches is singular"):
        iteration_of(replace(model, compliance=np.ones_like(model.compliance)))
    monkeypatch.setattr(contact_iteration, "MOST_ITERATIONS", 5)
    with pytest.raises(ComputationError, match="do not converge in 5 iterations"):
        iteration_of(model)


@pytest.mark.quick
@pytest.mark.parametrize("make", [learnt, cut])
def test_onnx_gives_the_same_readings_and_flags(tmp_path, make):
    pytest.importorskip("onnx")
    onnxruntime = pytest.importorskip("onnxruntime")
    model = make()
    write_contact_model(model, tmp_path / "pad.onnx", {"scene": "pad.xml"})
    session = onnxruntime.InferenceSession(tmp_path / "pad.onnx", providers=["CPUExecutionProvider"])
    names = [output.name for output in session.get_outputs()]
    maps = maps_of(model)
    assert_same(dict(zip(names, session.run(None, {"depth": maps}), strict=True)), model(maps), 1e-8)
    for row in (8, 1, 7):  # a pad alone
        single = dict(zip(names, session.run(None, {"depth": maps[row : row + 1]}), strict=True))
        np.testing.assert_allclose(single["power"], model(maps[row]).power, rtol=1e-8)
    about = session.get_modelmeta().custom_metadata_map
    assert about["scene"] == "pad.xml" and "in mm" in about["input"] and "of the .npz model" in about["difference"]
    ranges = json.loads(about["ranges"])
    assert ranges["x"] == model.x.tolist() and ranges["largest_depth"] == 0.4 and len(ranges["places"]) == 2


@pytest.mark.quick
def test_onnx_flags_contact_that_it_has_not_solved(tmp_path, monkeypatch):
    pytest.importorskip("onnx")
    onnxruntime = pytest.importorskip("onnxruntime")
    model, chosen = learnt(), iteration_of(learnt())
    monkeypatch.setattr(contact_onnx, "iteration_of", lambda model: chosen._replace(most=3))
    write_contact_model(model, tmp_path / "pad.onnx")
    session = onnxruntime.InferenceSession(tmp_path / "pad.onnx", providers=["CPUExecutionProvider"])
    power, status = session.run(["power", "status"], {"depth": maps_of(model)[[0, 1, 7]]})
    assert status.tolist() == [NOT_SOLVED, NOT_A_NUMBER, 0] and np.isnan(power[:2]).all()
    np.testing.assert_array_equal(power[2], model.rest)


@pytest.fixture
def double():
    """JAX in double precision."""
    jax = pytest.importorskip("jax")
    before = jax.config.jax_enable_x64
    jax.config.update("jax_enable_x64", True)
    yield jax
    jax.config.update("jax_enable_x64", before)


@pytest.mark.parametrize("make", [learnt, cut])
def test_a_file_for_jax_gives_the_same_readings_flags_and_derivatives(tmp_path, make, double):
    model = make()
    write_contact_model(model, tmp_path / "pad.py", {"scene": "pad.xml"})
    pure = runpy.run_path(str(tmp_path / "pad.py"))
    read, maps = double.jit(pure["read"]), maps_of(model)
    found = read(maps)._asdict()
    assert_same({name: np.asarray(values) for name, values in found.items()}, model(maps), 1e-8)
    np.testing.assert_array_equal(pure["POINTS"], model.points)
    assert pure["ABOUT"]["scene"] == "pad.xml" and pure["ABOUT"]["units"]["compliance"].startswith("mm/N")

    # Derivatives of readings and force by the depth of each patch, beside differences of the model itself.
    def results(depth):
        readings = pure["read"](depth)
        return double.numpy.concatenate([readings.power[0] * 1e4, readings.force[0], readings.moment[0]])

    reverse, forward = (double.jit(mode(results)) for mode in (double.jacrev, double.jacfwd))
    for row in (0, 9, 20):
        depth, step = maps[row], 1e-6
        derivatives = np.asarray(reverse(depth))
        places = [tuple(place) for place in np.argwhere(depth > 0)[::7]]
        changes = np.zeros((len(places), *depth.shape))
        for change, place in zip(changes, places, strict=True):
            change[place] = step
        above, below = (model(depth + sign * changes) for sign in (1, -1))
        differences = [
            1e4 * (above.power - below.power),
            above.force - below.force,
            above.moment - below.moment,
        ]
        expected = np.concatenate(differences, axis=1).T / (2 * step)
        found = np.stack([derivatives[(slice(None), *place)] for place in places], axis=1)
        np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1e-5 * np.abs(derivatives).max())
    np.testing.assert_allclose(forward(depth), derivatives, rtol=0, atol=1e-8 * np.abs(derivatives).max())
    bad = double.jit(double.grad(lambda depth: double.numpy.nansum(pure["read"](depth).power)))(maps[:4])
    assert np.isfinite(bad).all() and not bad[1:].any() and bad[0].any()
    with pytest.raises(ValueError, match="maps of .* rows and columns are needed"):
        pure["read"](maps[:, 1:])


def test_a_file_for_jax_in_single_precision(tmp_path):
    jax = pytest.importorskip("jax")
    model = learnt()
    write_contact_model(model, tmp_path / "pad.py")
    found = jax.jit(runpy.run_path(str(tmp_path / "pad.py"))["read"])(maps_of(model).astype(np.float32))._asdict()
    assert_same({name: np.asarray(values) for name, values in found.items()}, model(maps_of(model)), 1e-4)
