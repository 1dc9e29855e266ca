"""Studies that are computed once."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.evidence.paper import variations
from mitsuba_taxel.evidence.paper.paper_studies import MissingStudy, PaperStudies
from mitsuba_taxel.evidence.paper.parts import PARTS, chosen


def compute() -> xr.Dataset:
    return xr.Dataset({"power": ("fz", np.arange(3.0))}, {"fz": [0.0, -1.0, -2.0]})


def test_a_study_is_computed_once_and_read_after_that(tmp_path):
    announced: list[str] = []
    store = PaperStudies(tmp_path, announced.append)
    results = [store.study("nominal/one", {"fz": "0:-2:-1"}, compute) for _ in range(2)]
    assert announced == ["nominal/one"]
    assert results[0].identical(results[1])
    assert PaperStudies(tmp_path).study("nominal/one", {"fz": "0:-2:-1"}, compute).identical(results[0])


def test_another_request_is_refused(tmp_path):
    store = PaperStudies(tmp_path, lambda name: None)
    store.study("one", {"fz": 1}, compute)
    with pytest.raises(InputError, match="one.nc .* other settings"):
        store.study("one", {"fz": 2}, compute)


def test_a_store_for_reading_computes_nothing(tmp_path):
    with pytest.raises(MissingStudy):
        PaperStudies(tmp_path).study("one", {}, compute)
    assert not list(tmp_path.iterdir())


def test_a_study_that_fails_leaves_nothing(tmp_path):
    store = PaperStudies(tmp_path, lambda name: None)

    def fail() -> xr.Dataset:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        store.study("one", {}, fail)
    assert not list(tmp_path.iterdir())


def test_parts_are_chosen_by_name_and_group():
    assert chosen(None) == [name for name in PARTS if not name.startswith("mould")]
    assert chosen("analog, optics") == ["fig4", "fig5", "fig6", "peak", "analog"]
    with pytest.raises(InputError, match="only = 'fig7' is not allowed"):
        chosen("fig4,fig7")


def test_choices_that_are_complete_are_found_without_the_others(tmp_path, monkeypatch):
    """The costliest are computed last: all forces and shapes of the others are there when random paths begin."""
    computed: list[str] = []
    store = PaperStudies(tmp_path, computed.append)

    def sweep(*scene, **settings):
        assert settings["mesh_size"] == 1.1
        if not settings["derivatives"]:
            raise KeyboardInterrupt
        return xr.Dataset(coords={"taxel": [1, 2]}, attrs={"failures": ""})

    monkeypatch.setattr(variations, "sweep", sweep)
    monkeypatch.setattr(variations, "normal", lambda *_: xr.Dataset(attrs={"points": 0, "mesh_size": 1.1}))
    with pytest.raises(MissingStudy):
        variations.vary(PaperStudies(tmp_path), None)
    with pytest.raises(KeyboardInterrupt):
        variations.vary(store, None)
    found = variations.vary(PaperStudies(tmp_path), None)
    assert list(found) == [choice.words for choice in variations.choices() if choice.has_derivatives]
    assert len(computed) == 12 * len(found) + 1
