"""What holds a design whose gradients scatter from mesh to mesh, and figures of designs whose meshes are moved."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from one_cell import one_cell

from mitsuba_taxel import Scene, measure, open_study
from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.optimum import optimise
from mitsuba_taxel.optimum.designs import DesignEvaluation, DesignEvaluator
from mitsuba_taxel.optimum.figures import TINY, DesignResponses, LineResponse
from mitsuba_taxel.optimum.optimiser import Optimiser, with_rates
from mitsuba_taxel.optimum.plan_file import read_plan
from mitsuba_taxel.optimum.run import readable_starts
from mitsuba_taxel.studies.run.pool import open_pool

STUDY = """
scene = "pad.xml"
[optimise]
minimise = "rest"
[optimise.variables]
spacing = { low = 0.8, high = 0.9, start = 0.85 }
"""
SCATTER = {0.49: -0.3, 0.5: 0.3, 0.51: 0.0, 0.6: 5.0}


class Scattered:
    """Designs of one taxel, whose light is 1 + (x - 0.5)^2 with a rate that is off by its design."""

    failures: dict = {}

    def read(self, designs):
        return [self._read(design.x[0]) for design in designs]

    def _read(self, x):
        rate = 2 * (x - 0.5) + SCATTER[x]
        value = 1 + (x - 0.5) ** 2
        responses = [
            DesignResponses({"": LineResponse(np.zeros(1), np.array([[power]]), np.zeros(1), np.ones(1))}, {}, None)
            for power in (value + 0j, value + 1j * TINY * rate)
        ]
        return DesignEvaluation(responses[0], responses[1:], [])


def test_gradients_that_scatter_are_averaged(tmp_path):
    """Those of 0.49, 0.5 and 0.51 are -0.32, 0.3 and 0.02, and 0.6 is too far to count."""
    (tmp_path / "study.toml").write_text(STUDY)
    plan = read_plan(tmp_path / "study.toml")
    optimiser = Optimiser(plan, Scattered(), None)
    lone, *others = [plan.design((), [x]) for x in (0.5, 0.49, 0.51, 0.6)]
    optimiser.evaluate([lone])
    alone = optimiser.stationarity(lone)
    assert alone.unbalanced == pytest.approx(0.3) and np.isnan(alone.error) and alone.gradients == 1
    optimiser.evaluate(others)
    assert optimiser.best(plan.goal, plan.limits) == lone
    held = optimiser.stationarity(lone)
    assert held.unbalanced == pytest.approx(0, abs=1e-12) and held.gradients == 3
    student = 1.3213  # 84.13 % of two degrees of freedom
    assert held.error == pytest.approx(student * np.std([-0.32, 0.3, 0.02], ddof=1) / np.sqrt(3), rel=1e-3)
    finer = optimiser.stationarity(lone, optimiser.read(others[0]))
    assert finer.gradients == 4 and finer.unbalanced == pytest.approx(0.08)


class Dark:
    """Designs that can be read above 0.7 only."""

    def __init__(self):
        self.failures = {}

    def read(self, designs):
        self.failures |= {design: "no light" for design in designs if design.x[0] <= self.least}
        return [None if design in self.failures else Scattered()._read(0.5) for design in designs]

    least = 0.7


def test_where_no_initial_design_can_be_read_others_are_tried(tmp_path):
    (tmp_path / "study.toml").write_text(STUDY)
    plan = read_plan(tmp_path / "study.toml")
    optimiser = Optimiser(plan, Dark(), None)
    (start,) = readable_starts(optimiser, plan.initial_designs())
    assert start.x[0] > 0.7 and start == optimiser.history[-1] and len(optimiser.history) > 1
    assert readable_starts(optimiser, [start]) == [start]
    hopeless = Optimiser(plan, Dark(), None)
    hopeless.designs.least = 1.0
    with pytest.raises(ComputationError, match="computed for any of 13 designs. The first one failed: no light"):
        readable_starts(hopeless, plan.initial_designs())


CELL_STUDY = """
scene = "cell.xml"
[optimise]
maximise = "sensitivity"
[optimise.variables]
cell_size = { low = 2.2, high = 2.8, start = 2.5 }
[optimise.loads]
normal = { fz = [0, -0.5] }
"""

STEP = 0.02

SMOOTH = 1e-4

"""Relative to a figure: what is left of its change beside that of its derivatives."""


def cell(shape):
    return one_cell(cell=shape, scattering="isotropic", fz=0, cell_size=2.5).replace(
        "<vector", '<float name="cell_size" value="$cell_size"/> <vector', 1
    )


def off_the_derivatives(figures):
    """How far changes of figures (values, rates) at even steps are from the mean of the rates at both ends."""
    values, rates = (np.array(each).ravel() for each in zip(*figures, strict=True))
    return np.abs(np.diff(values) - STEP * (rates[1:] + rates[:-1]) / 2) / values[1:]


@pytest.mark.parametrize("shape", ["parallelepiped", "hemispheric"])
def test_figures_along_a_line_of_designs_are_smooth(tmp_path, shape):
    """As their derivatives have it, with moved meshes; with own meshes they jump by far more."""
    (tmp_path / "cell.xml").write_text(cell(shape))
    (tmp_path / "study.toml").write_text(CELL_STUDY)
    plan = read_plan(tmp_path / "study.toml")
    own = [plan.design((), [0.5 + STEP * place]) for place in (1, 2)]
    moved = [replace(design, origin=own[0].x) for design in own]
    with open_pool() as pool:
        designs = DesignEvaluator(plan, pool, tmp_path / "designs", False)
        assert all(map(designs.can_move, moved))
        off = [
            off_the_derivatives([with_rates(plan.goal.figure, read) for read in designs.read(line)])
            for line in (moved, own)
        ]
    assert off[0].max() < SMOOTH
    assert off[1].max() > 10 * SMOOTH


class Families:
    """Designs of one taxel: at rest 2 + (x - 0.7)^2, times what its mesh makes of it; meshes reach 0.25 far."""

    failures: dict = {}
    has_parts = True

    def __init__(self, reach):
        self.reach, self.responses = reach, []

    def can_move(self, design):
        return max(np.abs(np.subtract(design.x, design.origin))) <= self.reach

    def read(self, designs):
        return [self._read(design) for design in designs]

    def _read(self, design):
        self.responses.append(design)
        x, (family,) = design.x[0], design.family
        jump = 1 + 0.05 * np.sin(1e3 * family)
        value, rate = jump * (2 + (x - 0.7) ** 2), jump * 2 * (x - 0.7)
        responses = [
            DesignResponses({"": LineResponse(np.zeros(1), np.array([[power]]), np.zeros(1), np.ones(1))}, {}, None)
            for power in (value + 0j, value + 1j * TINY * rate)
        ]
        return DesignEvaluation(responses[0], responses[1:], [])


PLATE = """
scene = "pad.xml"
[optimise]
minimise = "rest"
evaluations = 40
[optimise.variables]
spacing = { low = 0.8, high = 0.9, start = 0.81 }
"""


def descended(tmp_path, reach):
    (tmp_path / "study.toml").write_text(PLATE)
    plan = read_plan(tmp_path / "study.toml")
    optimiser = Optimiser(plan, Families(reach), None)
    optimiser.evaluate([plan.before])
    optimiser.descend(plan.before, plan.goal, plan.limits)
    return optimiser, optimiser.history


def test_a_descent_stays_on_one_mesh_as_long_as_it_reaches(tmp_path):
    optimiser, history = descended(tmp_path, 1.0)
    assert {design.origin for design in history} == {None, history[0].x}
    assert history[-1].x[0] == pytest.approx(0.7, abs=0.02)
    assert all(row["mesh_of"] == 1 for row in optimiser.rows())


def test_where_the_mesh_is_renewed_the_last_design_is_judged_anew(tmp_path):
    """Jumps of 5 % between meshes do not end the descent, as each comparison is of designs on one mesh."""
    optimiser, history = descended(tmp_path, 0.32)
    assert history[-1].x[0] == pytest.approx(0.7, abs=0.02)
    renewed = [design for design in history[1:] if design.origin is None]
    assert renewed
    for design in renewed:
        place = history.index(design)
        assert any(design.x == before.x for before in history[:place]), "the last one that was accepted"
        assert history[place + 1].origin == design.x
        assert optimiser.rows()[place + 1]["mesh_of"] == place + 1


@pytest.mark.parametrize("reach", [1.0, 0.32])
def test_what_a_descent_gains_is_that_on_each_mesh(tmp_path, reach):
    """From 2 + 0.6^2 to 2, however the meshes jump by up to 5 % in between."""
    (tmp_path / "study.toml").write_text(PLATE)
    plan = read_plan(tmp_path / "study.toml")
    optimiser = Optimiser(plan, Families(reach), None)
    optimiser.evaluate([plan.before])
    gain, designs = optimiser.gain_from(plan.before)
    assert designs == len(optimiser.history) - 1 < plan.evaluations
    assert gain == pytest.approx(0.36 / 2.36, rel=1e-3 if reach == 1 else 0.1)


def test_where_no_mesh_can_be_moved_each_design_has_its_own(tmp_path):
    optimiser, history = descended(tmp_path, -1.0)
    assert {design.origin for design in history} == {None}


def test_of_one_mesh_only_one_gradient_counts(tmp_path):
    optimiser, history = descended(tmp_path, 1.0)
    best = optimiser.best(optimiser.plan.goal, optimiser.plan.limits)
    assert optimiser.stationarity(best).gradients == 1
    optimiser.evaluate([best.alone])
    assert optimiser.stationarity(best).gradients == 2


RESUMED = """
scene = "cell.xml"
[optimise]
maximise = "sensitivity"
evaluations = 3
[optimise.variables]
cell_size = { low = 2.2, high = 2.8, start = 2.5 }
youngs_modulus = { low = 3.5, high = 4.5, start = 4.0 }
[optimise.loads]
normal = { fz = [0, -0.5] }
"""


def test_a_run_that_was_ended_goes_on_with_the_same_meshes(tmp_path):
    """Readings of another run, in an empty cache, are bitwise those of the one that went on; nothing is read twice."""
    text = cell("parallelepiped").replace("<vector", '<float name="youngs_modulus" value="$youngs_modulus"/> <vector')
    (tmp_path / "cell.xml").write_text(
        text.replace("<default", '<default name="youngs_modulus" value="4"/> <default', 1)
    )
    (tmp_path / "study.toml").write_text(RESUMED)

    def ended(progress):
        if progress.designs == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        optimise(tmp_path / "study.toml", tmp_path / "out", progress=ended)
    kept = {file: file.stat().st_mtime_ns for file in (tmp_path / "out").rglob("jobs/*.npz")}
    went_on = optimise(tmp_path / "study.toml", tmp_path / "out")
    assert {file: file.stat().st_mtime_ns for file in kept} == kept
    study = open_study(tmp_path / "out" / "designs")
    origins = {str(word) for word in study.meshed_as.values}
    assert len(origins) > 1 and "none" in origins and study.sizes["step"] == 2 * len(went_on.history)
    last = int(np.flatnonzero(study.meshed_as.values != "none")[-1])
    values = {name: str(study[name].values[last]) for name in ("cell_size", "youngs_modulus", "fz", "meshed_as")}
    alone = measure(Scene(tmp_path / "cell.xml", values), derivatives=["cell_size"], points=16)
    np.testing.assert_array_equal(alone.derivatives.power, study.smooth_power.values[last])
    assert "meshed_as" not in went_on.best and "meshed_as" not in (tmp_path / "out" / "best.xml").read_text()
