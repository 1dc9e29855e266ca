"""Anything that is a number is taken where a number is: NumPy's and those of the standard library do as Python's."""

from __future__ import annotations

import json
from fractions import Fraction

import numpy as np
import pytest

from mitsuba_taxel import Scene, crosstalk, energy_audit, measure, open_study, sweep
from mitsuba_taxel.studies.run import pool

pytestmark = pytest.mark.quick

WHOLE = (np.int64, np.uint8, np.int32)
REAL = (np.float32, np.float64, np.int64, Fraction)


@pytest.fixture(scope="module")
def live():
    return Scene("plate.xml").load()


@pytest.mark.parametrize("kind", WHOLE)
def test_seeds_and_points(live, kind):
    for read in (measure, crosstalk):
        plain, other = read(live, points=16, seed=3), read(live, points=kind(16), seed=kind(3))
        assert json.dumps([other.points, other.seed]) == json.dumps([plain.points, 3])
        if read is measure:
            np.testing.assert_array_equal(other.power, plain.power)


def test_seeds_of_audits(live):
    energy_audit(live, points=np.int64(1), seed=np.uint8(3))


@pytest.mark.parametrize("kind", REAL)
def test_targets_and_values_of_scenes(live, kind):
    measure(live, target_error=kind(1) / kind(2), time_budget=kind(1))
    scene = Scene("plate.xml", {"z": kind(1)}, mesh_size=kind(2))
    assert float(scene.parameters["z"]) == 1 and json.dumps(scene.mesh_size) in ("2", "2.0")


def test_halves_and_digits():
    assert Scene("plate.xml", {"z": Fraction(1, 2)}).parameters["z"] == "0.5"
    assert Scene("plate.xml", {"z": np.float32(0.7)}).parameters["z"] == "0.7"


def test_studies_are_stored_alike(tmp_path):
    plain = {"points": 16, "seed": 3, "mesh_size": 2.0, "maps": True}
    other = {"points": np.int64(16), "seed": np.uint8(3), "mesh_size": np.float32(2), "maps": np.True_}
    values = {"z": [1, 0.5]}, {"z": [np.int32(1), Fraction(1, 2)]}
    for name, vary, run in zip(("plain", "other"), values, (plain, other), strict=True):
        sweep("plate.xml", vary, {"hole": np.array(0)}, output=tmp_path / name, **run)
    texts = [(tmp_path / name / "study.toml").read_text() for name in ("plain", "other")]
    assert texts[0] == texts[1]
    numbers = {"time_budget": np.int64(5), "target_error": np.float32(0.5)}
    sweep("plate.xml", {"z": np.array(0.5)}, output=tmp_path / "o", **numbers)
    assert open_study(tmp_path / "o").z.values.tolist() == [0.5]


def test_numbers_of_workers():
    with pool.open_pool(np.int64(2)) as processes:
        assert json.dumps(processes.processes) == "2"
