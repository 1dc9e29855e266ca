"""Studies as arrays: what is known at some scenes of a curve only."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mitsuba_taxel import open_study, sweep
from mitsuba_taxel.sensing import Readings, find_scene
from mitsuba_taxel.sensing.reading.runs import REPLICATES
from mitsuba_taxel.studies.plan.vary import Axis
from mitsuba_taxel.studies.store import folder
from mitsuba_taxel.studies.store.dataset import assemble
from mitsuba_taxel.studies.store.folder import StoredResult

ABOUT = {
    "scene": "made up", "seed": 0, "target_error": None, "target_slope": None, "points": 0, "mesh_size": None,
    "parameters": {}, "versions": {}, "pilot_seconds": {},
}  # fmt: skip
SHARE = 0.01
"""Deviation of a reading over its power, per N."""


def study_of(axis, loads, known):
    """Readings at the loads, whose deviation is proportional to these, and known at some of them."""
    results = {}
    for place, load in enumerate(loads):
        deviation = np.array([SHARE * load]) if place in known else None
        facets = np.array([0.1 * SHARE * load]) if place in known else None
        read = Readings(np.ones((2, 1)), 0, 0, deviation=deviation, facets=facets, roof_errors=[None])
        results[place,] = StoredResult(read, {}, [])
    return assemble((axis,), results, {}, ABOUT)


@pytest.mark.parametrize("together", [False, True], ids=["of a force", "in steps"])
def test_deviations_between_scenes_follow_the_load(together):
    """Loads need not be evenly spaced: near the ends of a curve they may lie close together."""
    loads = 1 - np.cos(np.linspace(0, np.pi, 8))
    words = [str(-load) for load in loads]
    axis = Axis("step", {"time": words, "fz": words}) if together else Axis("fz", {"fz": words}, is_force=True)
    study = study_of(axis, loads, known=(0, 3, 5, 7))
    assert study.deviation.values[:, 0] == pytest.approx(SHARE * loads)
    assert study.geometry_error.values[:, 0] == pytest.approx(0.2 * 0.1 * SHARE * loads)


def test_deviations_between_scenes_of_equal_or_unordered_parameters_are_known():
    names = study_of(Axis("mesh", {"mesh": list("abcde")}), np.arange(5.0), known=(0, 2, 4))
    assert names.deviation.values[:, 0] == pytest.approx(SHARE * np.arange(5.0))
    equal = study_of(Axis("step", {"fz": ["0", "-1", "-1", "-1"]}), np.array([0.0, 1.0, 1.0, 1.0]), known=(0, 1, 3))
    assert equal.deviation.values[:, 0] == pytest.approx(SHARE * np.array([0.0, 1.0, 1.0, 1.0]))


def test_the_largest_stretch_of_all_scenes_is_noted_once():
    limit = "its tests reach 1.5: beyond that, its law is an extrapolation"
    results = {}
    for place, limits in enumerate(({}, {limit: 1.6}, {limit: 1.8}, {limit: 1.7})):
        read = Readings(np.ones((REPLICATES, 1)), 0, 0, exceeded_limits=limits)
        results[place,] = folder._kept(folder._arrays(StoredResult(read, {}, [])))  # as it is read from its file
    study = assemble((Axis("fz", {"fz": list("0123")}, is_force=True),), results, {}, ABOUT)
    notes = [note for note in study.attrs["notes"].splitlines() if "stretched" in note]
    assert notes == [f"the silicone is stretched to 1.80 in its most strained 1%, {limit}"]


@pytest.mark.parametrize("moved", [False, True])
def test_positions_of_taxels_survive_their_file_and_have_dimensions_where_they_change(moved):
    pitch = np.array([2.0, 3.0 if moved else 2.0])
    results = {}
    for place, distance in enumerate(pitch):
        positions = distance * np.array([[-1.0, 1.0], [0.0, 1.0], [1.0, 1.0]])
        read = Readings(np.ones((REPLICATES, 3)), 0, 0, positions=positions)
        results[place,] = folder._kept(folder._arrays(StoredResult(read, {}, [])))
    study = assemble((Axis("pitch", {"pitch": list("23")}),), results, {}, ABOUT)
    assert study.taxel_x.dims == (("pitch", "taxel") if moved else ("taxel",)) and study.taxel_y.attrs["units"] == "mm"
    x = study.taxel_x.values if moved else np.tile(study.taxel_x.values, (2, 1))
    np.testing.assert_array_equal(x, pitch[:, None] * (-1, 0, 1))
    np.testing.assert_array_equal(study.taxel_y.values[..., 0], pitch if moved else pitch[0])
    unknown = {**results, (1,): results[0,]._replace(readings=replace(results[0,].readings, positions=None))}
    assert "taxel_x" not in assemble((Axis("pitch", {"pitch": list("23")}),), unknown, {}, ABOUT)


def test_positions_of_a_board_are_its_pitch_apart_and_its_study_opens_again(llvm_mono, tmp_path):
    """Row by row from (-x, +y), along the board's own axes where it is turned."""
    array = '<integer name="rows" value="2"/><integer name="columns" value="3"/><float name="pitch" value="4"/>'
    turned = '<transform name="to_world"><rotate z="1" angle="90"/></transform>'
    part = '<shape type="photo_reflector">'
    scene = find_scene("plate.xml").read_text().replace(part, f"{part}{array}{turned}")
    (tmp_path / "board.xml").write_text(scene)
    study = sweep(tmp_path / "board.xml", {"width": [8, 12]}, {"depth": 20}, points=16, output=tmp_path / "out")
    opened = open_study(tmp_path / "out")
    np.testing.assert_array_equal(opened.power, study.power)
    for each in (study, opened):
        x, y = each.taxel_x.values.reshape(2, 3), each.taxel_y.values.reshape(2, 3)
        np.testing.assert_allclose(np.diff(x, axis=1), 4, atol=1e-5)
        np.testing.assert_allclose(np.diff(y, axis=0), -4, atol=1e-5)
        np.testing.assert_allclose(np.ptp(x, axis=0), 0, atol=1e-5)
