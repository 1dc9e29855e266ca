"""A job leaves nothing behind but its result."""

from __future__ import annotations

import gc
from dataclasses import replace

import numpy as np
import pytest
from one_cell import one_cell

from mitsuba_taxel.sensing import find_scene
from mitsuba_taxel.studies.plan.job import Failure, Job, JobResult, describe
from mitsuba_taxel.studies.run import job


def one_of(name, **parameters):
    values = {key: str(value) for key, value in parameters.items()}
    return Job(0, find_scene(name), values, 64, 0, None, False, False, False)


@pytest.mark.parametrize("parameters, kind", [({"fz": -1}, JobResult), ({"spacing": 30}, Failure)])
def test_no_scene_lives_on(llvm_mono, monkeypatch, parameters, kind):
    def plugins():
        return sum(isinstance(thing, llvm_mono.Object) for thing in gc.get_objects())

    def read(*arguments):
        ready = prepare(*arguments)
        seen.append(plugins())
        return ready

    prepare, seen = job.prepare, []
    monkeypatch.setattr(job, "prepare", read)
    gc.collect()
    before = plugins()
    for _ in range(3):
        assert isinstance(job.run(one_of("pad.xml", **parameters)), kind)
        assert plugins() == before
    assert kind is Failure or (len(seen) == 3 and min(seen) > before)


def test_values_in_words_leave_out_the_way_to_contact_unless_it_is_all_there_is():
    assert describe({"fz": "-3", "to_contact": "fz=-40"}) == "fz=-3"
    assert describe({"to_contact": "fz=-40"}) == "to_contact=fz=-40" and describe({}) == ""


def test_values_in_words_leave_out_the_history_whatever_it_is_called():
    assert describe({"fz": "-3", "history": "0 0"}) == "fz=-3"
    roles = {"past": ("history", 1), "f": ("fz", 1)}
    assert describe({"f": "-3", "past": "0 0; 1 -2", "history": "7"}, roles) == "f=-3, history=7"


def test_derivatives_beside_a_fitted_curve_are_those_of_the_scene_alone(tmp_path):
    """Readings that are paired with another load do not change them; the column of the fitted force is left open."""
    finish = '<string name="finish" value="layer_steps"/> <float name="layer_height" value="0.3"/>'
    text = one_cell(cell="spherical", fz=0, youngs_modulus=4).replace("<bsdf", finish + "<bsdf", 1)
    (tmp_path / "pad.xml").write_text(text)
    values = {"youngs_modulus": "4", "fz": "-0.3"}
    alone = Job(0, tmp_path / "pad.xml", values, 16, 0, None, False, False, False, ("fz", "youngs_modulus"))
    alone = replace(alone, from_paths=True, fitted=("fz",))
    paired = replace(alone, base={**values, "fz": "-0.6"})
    derivatives = [job.run(each).readings.derivatives for each in (alone, paired)]
    assert np.isnan(derivatives[0].values[:, 0]).all() and np.isfinite(derivatives[0].values[:, 1]).all()
    np.testing.assert_array_equal(derivatives[0].values, derivatives[1].values)
