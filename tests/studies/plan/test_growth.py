"""Studies that grow: what is there is kept, what is new is computed, and the results are those of one study."""

from __future__ import annotations

import shutil

import numpy as np
import pytest
from one_cell import one_cell

from mitsuba_taxel import InputError, open_study, sweep
from mitsuba_taxel.studies.plan.batch import make_batch
from mitsuba_taxel.studies.plan.growth import grown
from mitsuba_taxel.studies.run import job

RUN = {"points": 256, "seed": 3}
STORED = {"vary": {"z": ["0.6", "0.8"]}, "provenance": {"parameters": {"hole": "0", "law": "lambertian"}}, "points": 64}
PAD = one_cell(integrator="taxel_tracer", fz=0)


def joined(vary, defines=None, stored=STORED, **what):
    batch = grown(make_batch("plate.xml", vary, defines or {"hole": "0"}, **{"points": 64, **what}), stored)
    return {axis.dim: axis.values[axis.dim] for axis in batch.axes}, batch


@pytest.mark.parametrize(
    "asked, z",
    [
        ("0.60:0.80:0.10", ["0.6", "0.70", "0.8"]),
        ("0.9,1", ["0.6", "0.8", "0.9", "1"]),
        ("0.7", ["0.6", "0.7", "0.8"]),
        ("0.8", ["0.6", "0.8"]),
        ("1,0.8,0.6", ["1", "0.8", "0.6"]),
        ("0.7,0.1,0.9", ["0.6", "0.8", "0.7", "0.1", "0.9"]),
    ],
)
def test_values_are_joined(asked, z):
    assert joined({"z": asked})[0] == {"z": z}


def test_a_parameter_that_had_one_value_gets_more_and_back():
    wide, batch = joined({"z": "0.6,0.8", "hole": "0.05,0.1"}, {"law": "lambertian"})
    assert wide["hole"] == ["0", "0.05", "0.1"] and "hole" not in batch.defines
    stored = {"vary": {"z": ["0.6"], "hole": ["0", "0.1"]}, "provenance": {"parameters": {}}}
    back, batch = joined({"z": "0.6"}, {"hole": "0.2"}, stored)
    assert back["hole"] == ["0", "0.1", "0.2"] and not batch.defines


@pytest.mark.parametrize(
    "z, hole, kept",
    [("0.6,0.8,1", "0,0.1,0", "0.6,0.8,1"), ("0.6", "0", "0.6,0.8"), ("0.8,0.6", "0.1,0", "0.8,0.6")],
    ids=["continued", "a part", "another, which the folder refuses"],
)
def test_rows_are_continued_and_never_mixed(z, hole, kept):
    stored = {"together": {"z": ["0.6", "0.8"], "hole": ["0", "0.1"]}, "provenance": {"parameters": {}}}
    batch = make_batch("plate.xml", {}, together={"z": z, "hole": hole}, points=64)
    assert ",".join(grown(batch, stored).axes[0].values["z"]) == kept


@pytest.mark.parametrize(
    "asked, points, target",
    [
        ({"points": 32}, 64, None),
        ({"points": 128}, 128, None),
        ({"points": None}, 64, None),
        ({"points": None, "target_error": 0.1}, None, 0.1),
    ],
)
def test_the_better_target_counts(asked, points, target):
    batch = joined({"z": "0.6,0.8"}, **asked)[1]
    assert (batch.points, batch.target_error) == (points, target)


@pytest.fixture
def computed(monkeypatch):
    """What is computed: z, hole, and how many points it goes on from."""
    calls, really = [], job.measure

    def measure(ready, **how):
        before = how["continued"].points if how["continued"] else 0
        calls.append((ready.parameters["z"], ready.parameters["hole"], before))
        return really(ready, **how)

    monkeypatch.setattr(job, "measure", measure)
    return calls


def test_a_study_grows_in_values_parameters_and_points(tmp_path, computed):
    """In the end it is what one study of all gives from the start, to the bit."""

    def more(vary, points=256, **defines):
        del computed[:]
        return sweep("plate.xml", vary, defines, output=tmp_path / "out", points=points, seed=3)

    more({"z": "0.6,0.8"}, hole=0)
    wider = more({"z": "0.60:0.80:0.10"}, hole=0)
    assert list(wider.z) == [0.6, 0.7, 0.8] and computed == [("0.70", "0", 0)]
    more({"hole": "0,0.1", "z": "0.6,0.8"})
    assert sorted(computed) == [("0.6", "0.1", 0), ("0.70", "0.1", 0), ("0.8", "0.1", 0)]
    assert more({"z": "0.6"}, hole=0).power.size == 6 and not computed
    better = more({"z": "0.6"}, points=512, hole=0)
    assert len(computed) == 6 and {points for *_, points in computed} == {256}
    whole = sweep("plate.xml", {"z": "0.6,0.70,0.8", "hole": "0,0.1"}, points=512, seed=3)
    dims = better.replicate_power.dims
    np.testing.assert_allclose(better.replicate_power, whole.replicate_power.transpose(*dims), rtol=1e-12)
    np.testing.assert_array_equal(open_study(tmp_path / "out").replicate_power, better.replicate_power)
    with pytest.raises(InputError, match="holds another study"):
        more({"z": "0.6,0.9"}, hole=0, width=3)


@pytest.mark.parametrize("where", ["copy2", "rmtree"], ids=["before all is ready", "amid putting it in place"])
def test_growth_that_is_killed_loses_nothing(tmp_path, computed, monkeypatch, where):
    really = getattr(shutil, where)

    def killed(*files, **how):
        if not how.get("ignore_errors"):
            raise KeyboardInterrupt
        really(*files, **how)

    sweep("plate.xml", {"z": "0.6,0.8"}, {"hole": 0}, output=tmp_path / "out", **RUN)
    with monkeypatch.context() as patch:
        patch.setattr(shutil, where, killed)
        with pytest.raises(KeyboardInterrupt):
            sweep("plate.xml", {"z": "0.60:0.80:0.10"}, {"hole": 0}, output=tmp_path / "out", **RUN)
    assert sweep("plate.xml", {"z": "0.60:0.80:0.10"}, {"hole": 0}, output=tmp_path / "out", **RUN).power.size == 3
    assert len(computed) == 3 and not list((tmp_path / "out").glob(".gro*"))


@pytest.mark.parametrize("meshes, kept", [("all", 3), ("last", 1), ("none", 0)])
def test_meshes_that_are_kept(tmp_path, meshes, kept):
    scene = tmp_path / "pad.xml"
    scene.write_text(PAD)
    study = sweep(scene, {"fz": "0,-0.5,-1"}, points=64, output=tmp_path / "out", meshes=meshes)
    assert len(list((tmp_path / "out").glob("meshes/*.ply"))) == kept
    assert int((study.mesh != "").sum() if "mesh" in study else 0) == kept


def test_meshes_of_other_kinds_are_refused(tmp_path):
    with pytest.raises(InputError, match="meshes = 'some' is not allowed: one of all, last, none"):
        sweep("plate.xml", {"z": "0.6"}, output=tmp_path, meshes="some")
