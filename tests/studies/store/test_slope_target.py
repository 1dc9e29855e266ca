"""Curves through readings of a study, and the words on a target of slopes that they miss."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.characterise import sensitivity
from mitsuba_taxel.sensing import Readings
from mitsuba_taxel.sensing.reading.derivative_values import BY_CURVE, Derivatives
from mitsuba_taxel.studies.plan.vary import Axis
from mitsuba_taxel.studies.store.curve_slopes import fitted_forces
from mitsuba_taxel.studies.store.dataset import assemble
from mitsuba_taxel.studies.store.folder import StoredResult

ABOUT = {
    "scene": "made up", "seed": 0, "target_error": None, "target_slope": None, "points": 64, "mesh_size": None,
    "parameters": {}, "versions": {}, "pilot_seconds": {}, "derivatives": ("fz",),
}  # fmt: skip
LOADS = np.linspace(0, -8, 6)
SLOPES = np.array([-2e-3, -1e-3])
"""W/N of two taxels."""


def study_of(noise, deviation=0.0, curve=lambda force: force, target=None):
    """Readings of two taxels along a curve, whose derivatives the jobs left open."""
    rng = np.random.default_rng(3)
    nothing, unknown = np.full(1, np.nan), np.full((2, 1), np.nan)
    results = {}
    for number, load in enumerate(LOADS):
        replicates = 0.1 + SLOPES * curve(load) + noise * rng.normal(size=(32, 2))
        readings = Readings(
            replicates, 64, 0, deviation=deviation * load * np.ones(2), facets=np.zeros(2), roof_errors=[None],
            derivatives=Derivatives(
                ("fz",), ("W/N",), unknown, unknown, replicates.mean(axis=0), np.zeros(2), np.nan, nothing, np.nan,
                nothing, BY_CURVE,
            ),
        )  # fmt: skip
        results[number,] = StoredResult(readings, {}, [])
    axis = Axis("fz", {"fz": [f"{load:g}" for load in LOADS]}, is_force=True)
    return assemble((axis,), results, {}, {**ABOUT, "target_slope": target})


def test_derivatives_are_those_of_the_curve_and_characterise_uses_it():
    study = study_of(1e-5)
    assert set(study.derivative_method.values.ravel()) == {BY_CURVE}
    np.testing.assert_allclose(study.derivative.values[..., 0], np.tile(SLOPES, (6, 1)), rtol=0.02)
    assert (study.derivative_error > 0).all()
    figures = sensitivity(study, "fz")
    steps = study.replicate_power.mean("replicate").values
    np.testing.assert_allclose(figures.mean_slope, (steps[-1] - steps[0]) / -8)
    np.testing.assert_allclose(figures.max_slope, SLOPES, rtol=0.02)


@pytest.mark.parametrize(
    ("case", "words"),
    [
        ({"noise": 2e-3}, "more points reduce the first"),
        ({"noise": 1e-6, "deviation": 2e-4}, "the pad's mesh is fixed or at its limit"),
        ({"noise": 1e-6, "curve": lambda force: 4 * np.tanh(force + 4)}, "give steps where it bends"),
    ],
    ids=["light", "mechanics", "bend"],
)
def test_a_target_that_is_missed_names_the_largest_source(case, words):
    notes = [line for line in study_of(**case, target=0.01).attrs["notes"].splitlines() if "target slope" in line]
    assert notes and words in notes[-1] and "largest slopes by fz: the error of taxel" in notes[-1]
    assert "light " in notes[-1] and "curve between the loads " in notes[-1]


def test_a_target_that_is_reached_is_not_mentioned():
    assert "target slope" not in study_of(1e-6, target=0.05).attrs["notes"]


def test_curves_need_a_force_of_its_own_and_four_loads():
    def axis(name, count, is_force=True):
        return Axis(name, {name: [str(number) for number in range(count)]}, is_force=is_force)

    axes = [axis("fz", 4), axis("fx", 3), axis("size", 9, False)]
    assert fitted_forces(axes, ("fz", "fx", "size"), ("fx", "fz")) == ("fz",)
