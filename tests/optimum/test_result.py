"""What is said of the best design, where the finer mesh has another function of which the optimum is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mitsuba_taxel.optimum.designs import DesignEvaluation
from mitsuba_taxel.optimum.figures import TINY, DesignResponses, LineResponse
from mitsuba_taxel.optimum.optimiser import Optimiser
from mitsuba_taxel.optimum.plan_file import read_plan
from mitsuba_taxel.optimum.result import make_optimum
from mitsuba_taxel.optimum.verification import FineDescent, MeshVerification

STUDY = """
scene = "pad.xml"
[optimise]
minimise = "rest"
evaluations = 20
[optimise.variables]
spacing = { low = 0.8, high = 0.9, start = 0.82 }
"""
LIMIT = '[[optimise.constraints]]\nfigure = "largest_reading"\nmost = 1.01\n'


class Parabola:
    """Designs of one taxel, at rest ``scale`` times 1 + (x - ``least``)^2."""

    has_parts = True

    def __init__(self, least, scale):
        self._least, self._scale = least, scale
        self.failures, self.no_contact, self.seconds_of, self.notes = {}, {}, {}, []
        self.loads, self.seconds = 0, 0.0

    def can_move(self, design):
        return True

    def read(self, designs):
        return [self._read(design.x[0] - self._least) for design in designs]

    def _read(self, off):
        value, rate = self._scale * (1 + off**2), 2 * self._scale * off
        responses = [
            DesignResponses({"": LineResponse(np.zeros(1), np.array([[power]]), np.zeros(1), np.ones(1))}, {}, None)
            for power in (value + 0j, value + 1j * TINY * rate)
        ]
        return DesignEvaluation(responses[0], responses[1:], [])


def linearisation(tmp_path, least, limits="", is_finer=True):
    """The best design of a parabola with its least at 0.5, judged again by one with its least elsewhere."""
    (tmp_path / "study.toml").write_text(STUDY + limits)
    plan = read_plan(tmp_path / "study.toml")
    optimiser, finer = Optimiser(plan, Parabola(0.5, 1.0), None), Optimiser(plan, Parabola(least, 1.02), None)
    optimiser.evaluate([plan.before])
    optimiser.descend(plan.before, plan.goal, plan.limits)
    best = optimiser.best(plan.goal, plan.limits)
    optimiser.evaluate([best.alone])
    assert best.x[0] == pytest.approx(0.5, abs=1e-3)
    pair = finer.evaluate([plan.before, best.alone])
    reads = dict(zip(("before_finer", "best_finer"), pair, strict=True))
    verification = MeshVerification(finer, plan.before, best.alone, reads, is_finer)
    return make_optimum(optimiser, best, verification, None), verification


def test_an_optimum_of_both_meshes(tmp_path):
    result, _ = linearisation(tmp_path, 0.5)
    assert result.is_local and np.isnan(result.beyond) and not result.warnings
    assert result.figures.best_finer[0] == pytest.approx(1.02, rel=1e-5)
    # With an error e(h) = c h^1.5, elements of 0.75 h leave 0.65 of it.
    assert result.figures.error[0] == pytest.approx(0.02 / (1 - 0.75**1.5), rel=1e-3)


def test_what_a_finer_mesh_would_gain(tmp_path):
    """Its least is at 0.56: 1 + 0.06^2 may become 1."""
    result, verification = linearisation(tmp_path, 0.56)
    assert not result.is_local and result.beyond_ended
    assert result.beyond == pytest.approx(0.06**2 / (1 + 0.06**2), rel=0.02)
    (warning,) = result.warnings
    assert f"on the finer mesh, a further descent from it gains {result.beyond:.2%} with" in warning
    assert (
        "finds no better design" in warning
        and verification.optimiser.best(verification.optimiser.plan.goal, []) != verification.winner
    )


def test_a_mesh_that_is_fixed_tells_nothing_of_what_may_be_gained(tmp_path):
    result, verification = linearisation(tmp_path, 0.56, is_finer=False)
    assert verification.descend() is None and np.isnan(result.beyond) and np.isnan(result.figures.error[0])
    assert any("the scene fixes its mesh size, so no finer mesh was tried" in note for note in result.notes)


def test_a_descent_that_was_not_ended_says_so(tmp_path):
    result, verification = linearisation(tmp_path, 0.56)
    short = MeshVerification(
        Optimiser(verification.optimiser.plan, Parabola(0.9, 1.0), None),
        verification.first,
        verification.winner,
        verification.reads,
        True,
    )
    short.optimiser.plan = replace(verification.optimiser.plan, evaluations=1)
    short.optimiser.evaluate([verification.winner])
    fine_descent = short.descend()
    assert fine_descent == FineDescent(fine_descent.gain, 1, False) and fine_descent.gain > 0


def test_a_constraint_that_the_best_design_breaks_on_the_finer_mesh(tmp_path):
    """1.02 is more than 1.01, which the design kept on the mesh of the search."""
    result, _ = linearisation(tmp_path, 0.5, LIMIT)
    (limit,) = result.figures.index[1:]
    assert result.figures.best[limit] < 1.01 < result.figures.best_finer[limit]
    assert result.warnings == ["on the finer mesh the best design violates largest reading <= 1.01 (1.02)"]
