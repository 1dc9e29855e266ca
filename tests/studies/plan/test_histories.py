"""What loads were before each step of a path with times."""

from __future__ import annotations

import pytest

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.studies.plan.batch import make_batch
from mitsuba_taxel.studies.plan.histories import histories
from mitsuba_taxel.studies.plan.vary import combinations

SCENE = {"fx": "0.5", "fy": "0", "fz": "0", "time": "0", "history": ""}


def test_each_step_knows_those_before_it():
    steps = {"time": ["1", "2", "3"], "fz": ["-1", "-2", "0"]}
    assert histories(steps, SCENE)["history"] == ["0 0 0 0", "0 0 0 0; 1 0.5 0 -1", "0 0 0 0; 1 0.5 0 -1; 2 0.5 0 -2"]
    held = {**SCENE, "history": "0 0 0 -3"}
    assert histories(steps, held)["history"][1] == "0 0 0 -3; 1 0.5 0 -1"


def test_other_loads_and_steps_without_times():
    assert histories({"fz": ["-1"]}, SCENE) is None
    assert histories({"time": ["1"], "history": ["0 0 0 0"]}, SCENE) is None
    plate = {"uz": "0", "time": "0", "history": ""}
    assert histories({"time": ["1", "2"], "uz": ["-1", "0"]}, plate)["history"][1] == "0 0 0 0; 1 0 0 -1"
    assert histories({"time": ["1", "2"], "pressure": ["1", "0"]}, plate)["history"][1] == "0 0; 1 1"
    assert histories({"time": ["1", "2"]}, SCENE)["history"][1] == "0 0 0 0; 1 0.5 0 0"


@pytest.mark.parametrize(
    ("steps", "scene", "varied", "words"),
    [
        ({"time": ["1"]}, {"fz": "0"}, (), "a parameter named 'history'"),
        ({"time": ["1"], "fz": ["-1"]}, SCENE, ("fx",), "fx cannot be varied"),
        ({"time": ["1"], "fz": ["much"]}, SCENE, (), "finite numbers for time, fx, fy, fz"),
        ({"time": ["0", "2", "1"]}, SCENE, (), r"time = 1 s in row 3 is not allowed: at least 2 s is needed"),
    ],
)
def test_refusals(steps, scene, varied, words):
    with pytest.raises(InputError, match=words):
        histories(steps, scene, varied)


def test_a_study_gives_them_to_its_scenes():
    batch = make_batch("pad.xml", {"prony": ["0.1 1", "0.2 1"]}, together={"time": [1, 2], "fz": [-1, -2]})
    given = [values["history"] for _, values in combinations(batch.axes)]
    assert given == ["0 0 0 0", "0 0 0 0; 1 0 0 -1"] * 2
