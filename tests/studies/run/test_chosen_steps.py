"""Steps that a study chooses itself: as many as curves and slopes need, the same in every run."""

from __future__ import annotations

import numpy as np
import pytest
from one_cell import one_cell

from mitsuba_taxel import ComputationError, InputError, open_study, sweep
from mitsuba_taxel.characterise import sensitivity
from mitsuba_taxel.studies.plan.batch import make_batch
from mitsuba_taxel.studies.run import chosen_steps
from mitsuba_taxel.studies.run.chosen_steps import with_chosen_steps
from mitsuba_taxel.studies.store.slope_target import curve_errors

PAD = one_cell(cell="cylindrical", mesh_size=2.5, scattering="$roof", fx=0, fz=0, roof="lambertian")


@pytest.fixture
def pad(tmp_path):
    (tmp_path / "pad.xml").write_text(PAD)
    return tmp_path / "pad.xml"


def steps_of(pad, monkeypatch, curve, rate, text="0:-8"):
    """The steps for readings along a known curve of the share of the way."""
    slopes = lambda x: np.broadcast_to(np.array(rate(x)), 2)[:, None]  # noqa: E731
    monkeypatch.setattr(chosen_steps._StepCurve, "_read", lambda self, x: (np.array([curve(x)]), slopes(x)))
    batch = with_chosen_steps(make_batch(pad, {"fz": text}, {"fx": "0.1"}))
    assert batch.derivatives == ("fz",) and not batch.axes[0].is_open
    return [float(word) for word in batch.axes[0].values["fz"]]


def test_a_cubic_needs_its_ends_and_its_middle(pad, monkeypatch):
    cubic, rate = (lambda x: 1 + x - x**2 + 2 * x**3), (lambda x: 1 - 2 * x + 6 * x**2)
    assert steps_of(pad, monkeypatch, cubic, rate) == [0, -4, -8]


@pytest.mark.parametrize("width", [0.3, 0.1, 0.03])
def test_curves_between_the_steps_are_within_the_target(pad, monkeypatch, width):
    """A bend that has some width: steps crowd there."""
    from scipy.interpolate import CubicHermiteSpline

    curve, rate = (lambda x: 1 + width * np.log(np.cosh((x - 0.3) / width))), (lambda x: np.tanh((x - 0.3) / width))
    x = np.array(steps_of(pad, monkeypatch, curve, rate)) / -8
    assert len(x) < 40 and np.diff(x).min() < width and np.all(np.diff(x) > 0)
    found, at = CubicHermiteSpline(x, curve(x), rate(x)), np.linspace(0, 1, 1000)
    assert np.abs(found(at) / curve(at) - 1).max() < 0.005 and np.abs(found(at, 1) - rate(at)).max() < 0.01


def test_a_kink_is_told(pad, monkeypatch):
    with pytest.raises(ComputationError, match="fz .* 6 halvings .* -2.4.*; give a step, as start:stop:step"):
        steps_of(pad, monkeypatch, lambda x: 1 + abs(x - 0.3), lambda x: np.sign(x - 0.3))


def test_a_kink_at_a_step_has_the_slopes_of_both_sides(pad, monkeypatch):
    ahead, behind = (lambda x: np.sign(x - 0.5 + 1e-9)), (lambda x: np.sign(x - 0.5 - 1e-9))
    found = steps_of(pad, monkeypatch, lambda x: 1 + abs(x - 0.5), lambda x: (behind(x), ahead(x)), "4:-4")
    assert found == [4, 2, 0, -2, -4]


def test_a_curve_along_x_begins_at_rest_with_its_own_slope(tmp_path, error_unknown_here):
    """Of a flat isotropic roof, whose slope on the other side is a third of that."""
    (tmp_path / "pad.xml").write_text(one_cell(cell="cylindrical", mesh_size=2.5, scattering="isotropic", fx=0, fz=0))
    study = sweep(tmp_path / "pad.xml", {"fx": "0:2"}, points=16)
    assert study.fx.values.tolist() == [0, 1, 2]
    slopes, read = study.derivative.values[:, 0, 0], study.smooth_power.values[:, 0]
    assert read[2] - read[0] == pytest.approx(2 * (slopes[0] + 4 * slopes[1] + slopes[2]) / 6, abs=0.01 * np.ptp(read))


def test_a_sweep_without_a_step(pad, tmp_path, monkeypatch):
    """The slope by derivatives is that of differences of readings without noise, and the same command goes on."""
    study = sweep(pad, {"fz": "0:-1"}, points=64, output=tmp_path / "out")
    assert study.fz.values.tolist() == [0, -0.5, -1] and study.derivative_unit.values.tolist() == ["W/N"]
    assert np.isfinite(study.derivative_error).all() and (study.derivative_error > 0).all()
    read = study.smooth_power.values[:, 0]
    assert np.all(abs(study.power[:, 0] - read) < 5 * study.standard_error[:, 0])
    slopes = study.derivative.values[:, 0, 0]
    simpson = -(slopes[0] + 4 * slopes[1] + slopes[2]) / 6  # exact where the curve is of fourth degree
    assert read[2] - read[0] == pytest.approx(simpson, rel=2e-3)
    assert float(sensitivity(study, "fz").mean_slope.squeeze()) == pytest.approx(read[0] - read[2])
    kept = open_study(tmp_path / "out")
    np.testing.assert_array_equal(kept.derivative, study.derivative)
    monkeypatch.setattr("mitsuba_taxel.studies.run.job.measure", None)  # nothing is left to do
    np.testing.assert_array_equal(sweep(pad, {"fz": "0:-1"}, points=64, output=tmp_path / "out").power, study.power)


def test_random_paths_have_derivatives_too_and_the_table_names_their_method(pad, tmp_path):
    study = sweep(
        pad, {"roof": "mirror,lambertian"}, {"fz": "-0.3"}, points=16, derivatives=["fz"], output=tmp_path / "out"
    )
    assert np.isfinite(study.derivative).all() and (study.derivative_error > 0).all()
    assert study.derivative_method.values.ravel().tolist() == ["differences of random paths", "without random numbers"]
    assert "derivative_method_fz" in (tmp_path / "out" / "readings.csv").read_text()
    np.testing.assert_array_equal(open_study(tmp_path / "out").derivative_method, study.derivative_method)


@pytest.mark.parametrize(
    ("vary", "words"),
    [
        ({"fz": "0:-1", "fx": "0:1"}, "fz and fx have no step: only one of them may be without one"),
        ({"fz": "0:0"}, "start:stop, two different numbers"),
        ({"fz": "0:down"}, "start:stop, two different numbers"),
        ({"roof": "0:1"}, "start:stop:step, three numbers, is needed"),
    ],
)
def test_what_needs_a_step_is_refused(pad, vary, words):
    with pytest.raises(InputError, match=words):
        sweep(pad, vary, points=16)


def test_a_run_that_goes_on_does_not_look_for_its_steps_again(pad, monkeypatch):
    batch = make_batch(pad, {"fz": "0:-0.4"})
    first = with_chosen_steps(batch)
    monkeypatch.setattr("mitsuba_taxel.sensing.derivatives.diffuse_derivatives.derivatives_by", None)
    assert with_chosen_steps(batch) == first


def test_a_printed_pad_chooses_its_steps_and_points_for_a_target_of_slopes(tmp_path, monkeypatch):
    """Light is by random paths. A second call reads nothing again."""
    finish = '<string name="finish" value="layer_steps"/> <float name="layer_height" value="0.2"/>'
    text = one_cell(cell="spherical", mesh_size=2.5, fz=0)
    (tmp_path / "pad.xml").write_text(text.replace("<bsdf", finish + "<bsdf", 1))
    how = {"vary": {"fz": "0:-0.8"}, "target_slope": 0.4}
    study = sweep(tmp_path / "pad.xml", **how, output=tmp_path / "out")
    assert study.sizes["fz"] == 5 and float(study.fz[1]) == pytest.approx(-0.8 * (1 - np.sqrt(0.5)) / 2)
    assert set(study.derivative_method.values.ravel()) == {"curve through readings"}
    for errors in curve_errors(study):
        light, fit, _ = errors.relative[:, 0]  # the mesh is fixed
        assert np.hypot(light, fit) < 0.4
    assert open_study(tmp_path / "out").attrs["notes"] == study.attrs["notes"]

    monkeypatch.setattr("mitsuba_taxel.studies.run.job.measure", None)  # nothing is left to do
    again = sweep(tmp_path / "pad.xml", **how, output=tmp_path / "out")
    np.testing.assert_array_equal(again.power, study.power)
