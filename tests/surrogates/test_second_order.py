"""Second-order terms of a contact model, and its file: against terms that are known, and full solutions made up."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_up_contact import linear_model, made_up

from mitsuba_taxel import InputError
from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.surrogates import contact_states
from mitsuba_taxel.surrogates.contact_export import contact_notes, read_contact_model, write_contact_model
from mitsuba_taxel.surrogates.contact_states import StateFile, Touch, touches
from mitsuba_taxel.surrogates.second_order import with_second_order

pytestmark = pytest.mark.quick

SQUARE, NONE = (0.0, 0.8, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("reading", "force"), [(SQUARE, NONE), ((0.1, -0.5, 1.4, 0.6), (0.05, 0.9, -0.3, 0.2))]
)
def test_known_terms_are_found_and_used(reading, force):
    linear = linear_model()
    model = with_second_order(linear, made_up(linear, 12, reading, force))
    np.testing.assert_allclose(model.second.reading, np.tile(reading, (2, 1)), atol=1e-6)
    np.testing.assert_allclose(model.second.force, force, atol=1e-6)
    assert model.errors.reading_worst < 1e-9 and model.errors.force_worst < 1e-9 and model.errors.moment_rms < 1e-9
    assert (model.errors.bodies, model.errors.states) == (12, 24)
    other = made_up(linear, 15, reading, force)[14]
    readings = model(np.stack([other.touch.below(linear.points, depth) for depth in other.touch.depths]))
    np.testing.assert_allclose(readings.power, other.power, rtol=1e-9)
    np.testing.assert_allclose(readings.force, other.force, atol=1e-9)
    np.testing.assert_allclose(readings.moment, other.moment, atol=1e-9)
    total = readings.pressure.sum(axis=(1, 2)) * np.prod(linear.size)
    np.testing.assert_allclose(total, -readings.force[:, 2], rtol=1e-12)


def test_the_stated_error_is_that_of_bodies_left_out():
    """Errors of 3 % of the changes are no terms of second order: they remain, on bodies of the fit and on others."""
    linear = linear_model()
    solved = made_up(linear, 60, SQUARE, NONE, noise=0.03)
    model = with_second_order(linear, solved[:20])
    scale = np.abs(np.array([row for one in solved[:20] for row in one.power]) - linear.rest).max(axis=0)
    misses = np.array(
        [
            (model(one.touch.below(linear.points, depth)).power[0] - power) / scale
            for one in solved[20:]
            for depth, power in zip(one.touch.depths, one.power, strict=True)
        ]
    )
    rms = np.sqrt(np.square(misses).mean(axis=0)).max()
    assert 0.6 * model.errors.reading_rms < rms < 1.5 * model.errors.reading_rms
    assert 0.002 < model.errors.reading_rms < 0.03 < 1.01 * model.errors.reading_worst + 0.03
    notes = " ".join(contact_notes(model, 1e-4, ["it buckled"]))
    assert "20 balls and rods, 40 states" in notes and "target of 0.01% is not reached" in notes and "buckled" in notes
    assert "target" not in " ".join(contact_notes(model, 0.05, []))


def test_a_touch_that_no_patch_sees_counts_as_an_error():
    """It is shallow, between the centres of patches: the linear model has neither force nor moment for it."""
    linear = linear_model()
    solved = made_up(linear, 12, SQUARE, NONE)
    unseen = replace(solved[0], touch=replace(solved[0].touch, depth=1e-9), moment=[[3.0, 0.0, 0.0], [3.0, 0.0, 0.0]])
    model = with_second_order(linear, [unseen, *solved[1:]])
    errors = model.errors
    assert np.isfinite(model.places).all() and (model.places[0] < model.places[1]).all()
    assert errors.moment_rms == pytest.approx(np.sqrt(2 * 9 / 24)) and errors.force_worst > 0.1


def test_too_few_bodies_are_refused():
    linear = linear_model()
    solved = made_up(linear, 4, SQUARE, NONE)
    with pytest.raises(InputError, match="no body reaches the centre of a patch of the top: a smaller spacing"):
        with_second_order(linear, [replace(one, touch=replace(one.touch, depth=-1e-3)) for one in solved])
    with pytest.raises(InputError, match="3 bodies are too few to learn from: at least 4"):
        with_second_order(linear, made_up(linear, 3, SQUARE, NONE))


def test_bodies_cover_the_range_and_more_of_them_begin_with_the_same():
    model = linear_model()
    bodies = touches(model, 200)
    assert bodies[:20] == touches(model, 20) and touches(model, 3, seed=1) != bodies[:3]
    assert 0.2 < np.mean([body.kind == "cylinder" for body in bodies]) < 0.5
    assert all(1.2 <= body.radius <= 4.8 and 0.12 <= body.depth <= 0.4 for body in bodies)
    assert np.abs([(body.x, body.y) for body in bodies]).max() <= 0.6 * 2.2 + 1e-4
    assert max(body.radius for body in bodies) > 4.4 and max(body.x for body in bodies) > 1.2


def test_depth_maps_of_bodies():
    points = np.array([[0.5, 0.2, 3.0], [0.5 + 0.6, 0.2 + 0.8, 3.0], [5.0, 0.2, 3.0]])
    ball = Touch("sphere", 2.0, 0.5, 0.2, 0.0, 0.3)
    np.testing.assert_allclose(ball.below(points, 0.3), [0.3, 0.3 - 2 + np.sqrt(3), -1.7])
    rod = Touch("cylinder", 2.0, 0.5, 0.2, 90.0, 0.3)  # along y: across it is x
    np.testing.assert_allclose(rod.below(points, 0.3), [0.3, 0.3 - 2 + np.sqrt(4 - 0.36), -1.7])
    assert rod.indenter().body.gap is not None and rod.indenter().angle == 90.0 and ball.indenter().radius == 2.0


def test_solved_states_are_kept_and_those_of_another_pad_refused(tmp_path):
    model, file, calls = linear_model(), tmp_path / "pad.states.json", []
    expected = made_up(model, 3, SQUARE, NONE)

    def solve(touch):
        calls.append(touch)
        if len(calls) == 2:
            raise ComputationError("the roof touches its package.")
        return next(one for one in expected if one.touch == touch)

    first = [StateFile(file, model).of(one.touch, solve) for one in expected]
    again = [StateFile(file, model).of(one.touch, solve) for one in expected]
    assert first == again == [expected[0], "the roof touches its package.", expected[2]] and len(calls) == 3
    with pytest.raises(InputError, match="states of another pad"):
        StateFile(file, replace(model, rest=2 * model.rest))
    file.write_text("[1]")
    with pytest.raises(InputError, match="no states of a contact model"):
        StateFile(file, model)
    assert StateFile(None, model).of(expected[0].touch, lambda touch: expected[0]) == expected[0]
    assert contact_states.HALFWAY < 1


@pytest.mark.parametrize("learnt", [False, True])
def test_a_file_gives_the_same_model(tmp_path, learnt):
    linear = linear_model()
    terms = (0.0, 0.8, 0.3, 0.1), (0.0, 0.1, 0.0, 0.1)
    model = with_second_order(linear, made_up(linear, 8, *terms)) if learnt else linear
    model = replace(model, lateral=np.stack([linear.compliance, 2 * linear.compliance])) if learnt else model
    write_contact_model(model, tmp_path / "pad.npz", {"scene": "pad.xml"})
    copied = read_contact_model(tmp_path / "pad.npz")
    depth = touches(model, 1)[0].below(model.points, 0.2)
    for own, other in zip(model(depth), copied(depth), strict=True):
        np.testing.assert_array_equal(own, other)
    assert copied.lateral is None or np.array_equal(copied.lateral, model.lateral)
    assert (copied.lateral is not None) == learnt
    assert copied.errors == model.errors and copied.size == model.size
    np.testing.assert_array_equal(copied.places, model.places)
    with np.load(tmp_path / "pad.npz", allow_pickle=False) as content:
        assert '"mm/N' in str(content["about"]) and '"scene": "pad.xml"' in str(content["about"])


def test_other_files_are_refused(tmp_path, monkeypatch):
    with pytest.raises(InputError, match=r"a name that ends in \.npz, \.onnx or \.py"):
        write_contact_model(linear_model(), tmp_path / "pad.pt")
    for content in (b"", b"no archive"):
        (tmp_path / "pad.npz").write_bytes(content)
        with pytest.raises(InputError, match="no contact model"):
            read_contact_model(tmp_path / "pad.npz")
    write_contact_model(linear_model(), tmp_path / "pad.npz")
    whole = (tmp_path / "pad.npz").read_bytes()
    damaged = bytearray(whole)
    damaged[len(whole) // 3] ^= 255
    for content in (whole[:4], whole[: len(whole) // 2], bytes(damaged)):
        (tmp_path / "pad.npz").write_bytes(content)
        with pytest.raises(InputError, match="no contact model"):
            read_contact_model(tmp_path / "pad.npz")
    with pytest.raises(InputError, match="no contact model"):
        read_contact_model(tmp_path / "none.npz")
    monkeypatch.setattr("mitsuba_taxel.surrogates.contact_export.FORMAT", 4)
    write_contact_model(linear_model(), tmp_path / "pad.npz")
    monkeypatch.undo()
    with pytest.raises(InputError, match=r"later version of the format \(4\)"):
        read_contact_model(tmp_path / "pad.npz")
    for earlier in (1, 2):
        np.savez(tmp_path / "pad.npz", about=f'{{"format": {earlier}, "errors": null}}', size=[1.0, 1.0])
        with pytest.raises(InputError, match="earlier version of the format: export it again"):
            read_contact_model(tmp_path / "pad.npz")
    np.savez(tmp_path / "pad.npz", about='{"format": 3, "errors": null}', size=[1.0, 1.0])
    with pytest.raises(InputError, match="no complete contact model"):
        read_contact_model(tmp_path / "pad.npz")
