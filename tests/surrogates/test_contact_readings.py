"""Contact unlike that of the learnt bodies is flagged, by the model itself, its ONNX form and its form for JAX: against
features that are computed from their definition.
"""

from __future__ import annotations

import json
import runpy
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from made_up_contact import linear_model, made_up

from mitsuba_taxel.evidence.accuracy.contact_models import half_space_model
from mitsuba_taxel.surrogates import write_contact_model
from mitsuba_taxel.surrogates.contact_readings import NOT_SOLVED, PULLS, TOO_DEEP, TOO_FAR, UNLIKE
from mitsuba_taxel.surrogates.second_order import with_second_order

TERMS = (0.02, 0.8, 0.3, 0.2), (0.03, 0.1, -0.2, 0.1)


@cache
def fitted(make, *arguments):
    linear = make(*arguments)
    solved = made_up(linear, 28, *TERMS)
    return linear, solved, with_second_order(linear, solved)


PADS = [(linear_model,), (half_space_model, 15)]


def features_of(linear, depth):
    """Depth, root of the area, and depth by mean square distance, over powers of the height, from the linear model."""
    readings, middle = linear(depth), [linear.x.mean(), linear.y.mean()]
    pressure = readings.pressure[0]
    squares = ((linear.points[..., :2] - middle) ** 2).sum(axis=-1)
    deep = depth.max() / linear.height
    spread = (pressure * squares).sum() / pressure.sum() / linear.height**2
    return np.array([deep, np.sqrt(readings.area[0]) / linear.height, deep * spread])


def flat(model, radius, depth, x=0.0, y=0.0):
    return np.where(np.hypot(model.points[..., 0] - x, model.points[..., 1] - y) < radius, depth, -1.0)


def in_python(model, folder):
    return lambda maps: model(maps)._asdict()


def in_onnx(model, folder):
    pytest.importorskip("onnx")
    onnxruntime = pytest.importorskip("onnxruntime")
    write_contact_model(model, folder / "pad.onnx")
    session = onnxruntime.InferenceSession(folder / "pad.onnx", providers=["CPUExecutionProvider"])
    about = session.get_modelmeta().custom_metadata_map
    assert "64 for contact beyond 1.1 times the largest features" in about["status"]
    assert json.loads(about["ranges"])["second_largest"] == model.second.largest.tolist()
    names = [output.name for output in session.get_outputs()]
    return lambda maps: dict(zip(names, session.run(None, {"depth": maps}), strict=True))


def in_jax(model, folder):
    jax = pytest.importorskip("jax")
    write_contact_model(model, folder / "pad.py")
    pure = runpy.run_path(str(folder / "pad.py"))
    assert "64 for contact beyond" in pure["ABOUT"]["status"] and "64" in pure["Readings"].__doc__

    def read(maps):
        before = jax.config.jax_enable_x64
        jax.config.update("jax_enable_x64", True)
        try:
            return {name: np.asarray(values) for name, values in jax.jit(pure["read"])(maps)._asdict().items()}
        finally:
            jax.config.update("jax_enable_x64", before)

    return read


FORMS = [pytest.param(in_python, marks=pytest.mark.quick), in_onnx, in_jax]


@pytest.mark.parametrize("pad", PADS)
def test_the_fit_keeps_its_largest_features(pad):
    linear, solved, model = fitted(*pad)
    own = [features_of(linear, one.touch.below(linear.points, depth)) for one in solved for depth in one.touch.depths]
    np.testing.assert_allclose(model.second.largest, [1, *np.max(own, axis=0)], rtol=1e-9)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("pad", PADS)
def test_contact_beyond_the_features_of_the_fit_is_flagged(tmp_path, pad, form):
    linear, solved, model = fitted(*pad)
    read, most = form(model, tmp_path), 1.1 * model.second.largest[1:]
    learnt = [one.touch.below(linear.points, depth) for one in solved for depth in one.touch.depths]
    half = np.abs(linear.x).max()
    wide = [flat(model, radius, 0.3 * linear.largest_depth) for radius in half * np.linspace(0.3, 1.5, 13)]
    corner, depth = 0.8 * half, 0.99 * linear.largest_depth
    apart = [
        np.maximum(flat(model, 0.3 * half, depth, place, place), flat(model, 0.3 * half, depth, -place, -place))
        for place in corner * np.linspace(0.4, 1.0, 7)
    ]
    beside = [np.full_like(wide[0], -1.0)]
    found = read(np.array([*learnt, *wide, *apart, *beside]))["status"]
    assert not (found[: len(learnt)] & UNLIKE).any() and found[-1] == 0
    features = np.array([features_of(linear, depth) for depth in (*wide, *apart)])
    expected = np.where((features > most).any(axis=1), UNLIKE, 0)
    np.testing.assert_array_equal(found[len(learnt) : -1], expected)
    # Both limits are met from either side: the area alone by wide bodies, the distance alone by those apart.
    beyond = features > most
    assert set(beyond[: len(wide), 1]) == {False, True} == set(beyond[len(wide) :, 2])
    assert (beyond == [False, True, False]).all(axis=1).any() and (beyond == [False, False, True]).all(axis=1).any()


@pytest.mark.parametrize("form", FORMS)
def test_touches_of_other_flags_keep_these(tmp_path, form):
    linear, _, model = fitted(*PADS[0])
    maps = np.array([flat(model, 9.0, 0.5), flat(model, 0.5, 0.1, 1.9), flat(model, 9.0, 0.3)])
    maps[2, 0, 0] = np.nan
    status = form(model, tmp_path)(maps)["status"]
    assert status[0] == TOO_DEEP + UNLIKE and status[1] == TOO_FAR and status[2] == 1
    assert not (replace(model, second=None)(maps).status & UNLIKE).any()  # a linear model has no such limits


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("slope", [-0.5, -0.8])
def test_a_factor_that_turns_forces_into_pulls_is_flagged(tmp_path, form, slope):
    """The factor is 1 + slope r, at features that the fit has: r is the root of the area over the height."""
    linear, _, model = fitted(half_space_model, 15)
    second = model.second._replace(force=np.array([0.0, 0.0, slope, 0.0]), largest=np.full(4, 9.0))
    model = replace(model, second=second)
    half = np.abs(linear.x).max()
    maps = np.array([flat(model, radius, 0.3) for radius in half * np.linspace(0.3, 1.5, 13)])
    own, plain = form(model, tmp_path)(maps), linear(maps)
    factor = 1 + slope * np.sqrt(plain.area) / linear.height
    np.testing.assert_array_equal(own["status"], np.where(factor <= 0, UNLIKE, 0))
    assert (factor <= 0).any() and (factor > 0).any()
    np.testing.assert_allclose(own["force"][:, 2], factor * plain.force[:, 2], rtol=1e-6, atol=1e-9)
    np.testing.assert_array_equal(np.isnan(own["centre"]).all(axis=1), factor <= 0)


def test_forces_without_a_touch_of_this_factor_are_not_solved():
    """From given forces, features beyond the fit and factors that are not above 0 are flagged, too."""
    linear, _, model = fitted(half_space_model, 15)
    wide, small = np.full(linear.covered.shape, 1e-4), np.where(flat(linear, 1.0, 1.0) > 0, 1e-4, 0.0)
    assert model.from_forces(np.stack([wide, small, 0 * wide])).status.tolist() == [UNLIKE, 0, 0]
    falling = replace(model, second=model.second._replace(force=np.array([0, 0, -0.5, 0])))
    readings = falling.from_forces(np.stack([wide, small, -small]))
    assert readings.status.tolist()[:2] == [NOT_SOLVED, 0] and readings.status[2] & PULLS
    assert np.isnan(readings.power[0]).all() and readings.force[1, 2] == pytest.approx(-small.sum())
