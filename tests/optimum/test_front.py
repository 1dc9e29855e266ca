"""Trade-offs of two objectives, of readings by a formula."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.optimum.designs import DesignEvaluation
from mitsuba_taxel.optimum.figures import TINY, DesignResponses, LineResponse
from mitsuba_taxel.optimum.front import front
from mitsuba_taxel.optimum.optimiser import Optimiser
from mitsuba_taxel.optimum.plan_file import read_plan

STUDY = """
scene = "pad.xml"
[optimise]
minimise = "rest"
evaluations = 20
[optimise.variables]
spacing = { low = 0.8, high = 0.9, start = 0.85 }
[optimise.loads]
normal = { fz = [0, -1] }
[optimise.front]
maximise = "sensitivity"
points = 6
"""


class Formula:
    """Designs of one taxel: at rest 1 + x^2, under 1 N more by 1.1 - (1 - x)^2; beyond 0.98 they fail."""

    has_parts = True

    def __init__(self):
        self.failures = {}

    def read(self, designs):
        return [self._read(design) for design in designs]

    def can_move(self, design):
        return False

    def _read(self, design):
        (x,) = design.x
        if x > 0.98:
            self.failures[design] = "no."
            return None
        responses = []
        for z in (x + 0j, x + 1j * TINY):
            rest = 1 + z**2
            power = np.array([[rest], [rest + 1.1 - (1 - z) ** 2]])
            responses.append(
                DesignResponses(
                    {"normal": LineResponse(np.array([0.0, -1.0]), power, np.zeros(2), np.ones(2))}, np.zeros(0), None
                )
            )
        return DesignEvaluation(responses[0], responses[1:], [])


@pytest.fixture
def optimiser(tmp_path):
    (tmp_path / "study.toml").write_text(STUDY)
    plan = read_plan(tmp_path / "study.toml")
    optimiser = Optimiser(plan, Formula(), None)
    optimiser.evaluate([plan.before])
    optimiser.descend(plan.before, plan.goal, plan.limits)
    return optimiser


def test_a_front_that_is_known(optimiser):
    table = front(optimiser, *optimiser.plan.front)
    rest, sensitivity = table["rest along normal"], table["sensitivity along normal"]
    x = (table.spacing - 0.8) / 0.1
    np.testing.assert_allclose(rest, 1 + x**2, atol=1e-9)
    np.testing.assert_allclose(rest, 1 + (1 - np.sqrt(1.1 - sensitivity)) ** 2, atol=1e-9)
    assert len(table) == 6 and rest.is_monotonic_increasing and sensitivity.is_monotonic_increasing
    np.testing.assert_allclose(sensitivity, np.linspace(0.1, sensitivity[5], 6), rtol=1e-3, atol=1e-6)
    assert rest[0] == pytest.approx(1, abs=1e-6) and sensitivity[5] > 1.095


def test_the_history_says_what_failed(optimiser):
    front(optimiser, *optimiser.plan.front)
    failed = [row for row in optimiser.rows() if "failed" in row]
    assert failed and {row["failed"] for row in failed} == {"no."} and "allowed" not in failed[0]
