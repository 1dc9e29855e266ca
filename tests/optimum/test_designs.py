"""Every figure of readings of a whole chain: its gradient against differences of designs on the same mesh."""

from __future__ import annotations

from shutil import rmtree

import numpy as np
import pytest
from one_cell import one_cell

from mitsuba_taxel import ComputationError
from mitsuba_taxel.optimum.designs import DesignEvaluator
from mitsuba_taxel.optimum.figures import FIGURES_OF_MERIT, TINY, end_of
from mitsuba_taxel.optimum.optimiser import with_rates
from mitsuba_taxel.optimum.plan_file import read_plan
from mitsuba_taxel.sensing.reading.contact_value import FirstContact
from mitsuba_taxel.studies.run.pool import open_pool

STUDY = """
scene = "pair.xml"
[circuit]
supply = 3.3
load_resistance = 1e4
transfer = 0.02
current_gain = 100
[optimise]
maximise = "sensitivity"
[optimise.variables]
youngs_modulus = { low = 3.0, high = 5.0, start = 4.0 }
led_power = { low = 0.8, high = 1.2, start = 1.0 }
[optimise.loads]
normal = { fz = [0, -0.4, -0.8] }
side = { fz = -0.4, fx = [0, 0.2] }
deep = { fz = [-0.4, -0.8] }
"""
TOLD = {"cross_talk": "taxel = 1", "cross_sensitivity": 'by = "deep"', "resolution": 'along = ["normal", "side"]'}
STEP = 0.02
"""Relative to the bounds' width."""
OF_READINGS = [name for name, kind in FIGURES_OF_MERIT.items() if kind.lines]


@pytest.fixture(scope="module")
def along(tmp_path_factory):
    """The figures, and what is read of designs -1, 0 and 1 steps along a direction of all variables."""
    folder = tmp_path_factory.mktemp("pair")
    cells = one_cell(youngs_modulus=4, led_power=1, fx=0, fz=0)
    package = cells[cells.index('<shape type="photo_reflector">') : cells.index("</scene>")]
    left, right = (
        package.replace(">", f'><transform name="to_world"><translate x="{x}"/></transform>', 1)
        for x in (-1.775, 1.775)
    )
    cells = cells.replace(package, left + right).replace('"columns" value="1"', '"columns" value="2"')
    (folder / "pair.xml").write_text(cells)
    limits = [f'[[optimise.constraints]]\nfigure = "{name}"\n{TOLD.get(name, "")}\nmost = 1\n' for name in OF_READINGS]
    (folder / "study.toml").write_text(STUDY + "".join(limits))
    plan = read_plan(folder / "study.toml")
    with open_pool() as pool:
        reads = DesignEvaluator(plan, pool, folder / "designs", False).read(
            [plan.design((), [0.5 + step, 0.5 - step]) for step in (-STEP, 0.0, STEP)]
        )
    assert None not in reads
    return {limit.figure.kind: limit.figure for limit in plan.limits}, reads


@pytest.mark.parametrize("kind", OF_READINGS)
def test_gradients_through_the_whole_chain(along, kind):
    figures, (behind, here, ahead) = along
    _, rates = with_rates(figures[kind], here)
    ends = [figures[kind].components(read.values).real for read in (behind, ahead)]
    difference = (ends[1] - ends[0]) / (2 * STEP)
    np.testing.assert_allclose(rates @ [1, -1], difference, rtol=1e-3, atol=1e-3 * np.abs(difference).max())


def test_first_contact_of_a_design(tmp_path, monkeypatch):
    """That of a low pad, which is proportional to its modulus, and is kept; a design without one fails."""
    low = '<float name="height" value="2"/> <float name="cell_height" value="0.6"/> <float name="wall" value="2"/> '
    (tmp_path / "low.xml").write_text(one_cell(youngs_modulus=4, fz=0).replace("<vector", low + "<vector", 1))
    (tmp_path / "study.toml").write_text(
        'scene = "low.xml"\n[optimise]\nmaximise = "first_contact"\n[optimise.variables]\nyoungs_modulus = [3, 6]\n'
        "[optimise.loads]\nnormal = { fz = [0, -2] }\n[optimise.tolerances]\nyoungs_modulus = 0.1\n"
    )
    plan = read_plan(tmp_path / "study.toml")
    assert plan.goal.figure.unit == "N"
    with open_pool() as pool:
        designs = DesignEvaluator(plan, pool, tmp_path / "designs", False)
        (read,) = designs.read([plan.before])
        found, rates = with_rates(plan.goal.figure, read)
        assert 5 < found[0] < 20 and read.values.lines["normal"].touched == "a package"
        assert rates.ravel() == pytest.approx(found / 4 * (6 - 3), rel=1e-3)
        assert plan.goal.figure.components(read.by_tolerance[0]).imag / TINY == pytest.approx(found / 4 * 0.1, rel=1e-3)
        assert designs.loads == 2

        def refused(*_):
            raise ComputationError("the contact was not found again")

        monkeypatch.setattr("mitsuba_taxel.sensing.derivatives.first_contact.first_contact", refused)
        softer = plan.design((), [0.0])
        assert designs.read([softer]) == [None]
        assert designs.failures[softer] == "the contact was not found again"
        (kept,) = DesignEvaluator(plan, pool, tmp_path / "designs", False).read([plan.before])
        assert kept is not None and plan.goal.figure.components(kept.values) == found


UNSTABLE = """
scene = "high.xml"
[circuit]
supply = 3.3
load_resistance = 1e4
transfer = {transfer}
[optimise]
maximise = "{goal}"
[optimise.variables]
youngs_modulus = {{ low = 3, high = 6, start = 4 }}
[optimise.loads]
normal = {{ fz = [0, -2] }}
[[optimise.constraints]]
figure = "range"
least = {least}
"""


def test_range_of_a_cell_that_becomes_unstable(tmp_path, monkeypatch):
    """It ends where a taxel saturates before, or else with the load that the cell bears, which is proportional to its
    modulus; if the derivative of that is not known, the design fails, unless it bears as much as is asked for."""
    (tmp_path / "high.xml").write_text(one_cell(youngs_modulus=4, fz=0))

    def found(transfer, goal="range", least=1):
        (tmp_path / "study.toml").write_text(UNSTABLE.format(transfer=transfer, goal=goal, least=least))
        plan = read_plan(tmp_path / "study.toml")
        with open_pool() as pool:
            designs = DesignEvaluator(plan, pool, tmp_path / "designs", False)
            return plan, designs, designs.read([plan.before])[0]

    plan, _, read = found(0.09)
    (light,) = plan.goal.figure.components(read.values).real.min(keepdims=True)
    assert 2 < light < 10 and end_of(plan.goal.figure, read.values) == "where taxel 1 saturates"
    plan, _, read = found(0.02)
    values, rates = with_rates(plan.goal.figure, read)
    assert 10 < values[0] < 19 < values[1] and "as the pad cannot be loaded further" in end_of(
        plan.goal.figure, read.values
    )
    assert rates[0] == pytest.approx(values[0] / 4 * (6 - 3), rel=1e-4)
    contact = FirstContact(-15.0, np.array([np.nan]), "", "an element is inverted")
    monkeypatch.setattr("mitsuba_taxel.sensing.derivatives.first_contact.first_contact", lambda *_: contact)
    rmtree(tmp_path / "designs")
    for goal, least, fails in (("range", 1, True), ("rest", 16, True), ("rest", 14, False)):
        plan, designs, read = found(0.02, goal, least)
        assert (read is None) == fails
        assert designs.failures == ({plan.before: "an element is inverted"} if fails else {})
