"""What holds a design whose gradients scatter from mesh to mesh."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.optimum.course import Course
from mitsuba_taxel.optimum.designs import Read
from mitsuba_taxel.optimum.figures import TINY, Line, Seen
from mitsuba_taxel.optimum.plan_file import read_plan
from mitsuba_taxel.optimum.run import readable_starts

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
        seen = [
            Seen({"": Line(np.zeros(1), np.array([[power]]), np.zeros(1), np.ones(1))}, {}, None)
            for power in (value + 0j, value + 1j * TINY * rate)
        ]
        return Read(seen[0], seen[1:], [])


def test_gradients_that_scatter_are_averaged(tmp_path):
    """Those of 0.49, 0.5 and 0.51 are -0.32, 0.3 and 0.02, and 0.6 is too far to count."""
    (tmp_path / "study.toml").write_text(STUDY)
    plan = read_plan(tmp_path / "study.toml")
    course = Course(plan, Scattered(), None)
    lone, *others = [plan.design((), [x]) for x in (0.5, 0.49, 0.51, 0.6)]
    course.look([lone])
    alone = course.stationarity(lone)
    assert alone.left == pytest.approx(0.3) and np.isnan(alone.error) and alone.gradients == 1
    course.look(others)
    assert course.best(plan.goal, plan.limits) == lone
    held = course.stationarity(lone)
    assert held.left == pytest.approx(0, abs=1e-12) and held.gradients == 3
    student = 1.3213  # 84.13 % of two degrees of freedom
    assert held.error == pytest.approx(student * np.std([-0.32, 0.3, 0.02], ddof=1) / np.sqrt(3), rel=1e-3)
    finer = course.stationarity(lone, course.read(others[0]))
    assert finer.gradients == 4 and finer.left == pytest.approx(0.08)


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
    course = Course(plan, Dark(), None)
    (start,) = readable_starts(course, plan.begun())
    assert start.x[0] > 0.7 and start == course.history[-1] and len(course.history) > 1
    assert readable_starts(course, [start]) == [start]
    hopeless = Course(plan, Dark(), None)
    hopeless.designs.least = 1.0
    with pytest.raises(ComputationError, match="none of 13 designs can be read to begin with: no light"):
        readable_starts(hopeless, plan.begun())
