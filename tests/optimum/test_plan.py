"""Designs within the bounds of a study: where descents begin, and what choices have."""

from __future__ import annotations

import pytest
from one_cell import one_cell

from mitsuba_taxel import InputError
from mitsuba_taxel.optimum.plan_file import read_plan

STUDY = """
scene = "pad.xml"
[optimise]
maximise = "rest"
starts = 3
[optimise.variables]
spacing = { low = %s, high = 1.2, start = 1 }
youngs_modulus = { low = 1, high = 9, start = 3 }
"""


@pytest.fixture
def plan(tmp_path):
    def read(text):
        (tmp_path / "study.toml").write_text(text)
        return read_plan(tmp_path / "study.toml")

    return read


def test_starts_are_where_a_sensor_is_possible(plan):
    """Of spacings that are too wide for the package, some are not."""
    one = plan(STUDY % 0.85)
    assert one.refusal(one.before) is not None
    assert len(one.initial_designs()) == 3 and all(one.refusal(design) is None for design in one.initial_designs())
    with pytest.raises(InputError, match="no sensor within the bounds of variables is possible: spacing = 1"):
        plan(STUDY % 0.96).initial_designs()


def test_variables_that_some_choices_have(plan, tmp_path):
    """Others leave out what uses them; what is left out nowhere is refused for the choice that cannot have it."""
    cell = one_cell(cell="$shape", shape="profile", r2=0.7, z2=0.8, led_power=1, fz=0)
    roof = '<string name="profile" value="1 0.6; $r2 $z2; 0 1"/> <vector'
    (tmp_path / "cell.xml").write_text(cell.replace("<vector", roof, 1))
    only = 'r2 = { low = 0.6, high = 0.8, only = { shape = "profile" } }\n'
    text = (
        'scene = "cell.xml"\n[optimise]\nmaximise = "rest"\nstarts = 2\n[optimise.variables]\nled_power = [0.5, 2]\n'
        + only
        + '[optimise.choices]\nshape = ["cylindrical", "profile"]\n'
    )
    one = plan(text)
    begun = one.initial_designs()
    assert [design.choice[0] for design in begun] == ["cylindrical"] * 2 + ["profile"] * 2
    assert [design.x[1] for design in begun[:2]] == [pytest.approx(0.5)] * 2 and begun[2] == one.before
    assert begun[0].x[0] == begun[2].x[0] and begun[1].x[0] == begun[3].x[0]
    assert one.parameters(begun[0]) == {"shape": "cylindrical", "led_power": "1", "r2": "none"}
    assert one.values(begun[0]) == {"led_power": 1} and one.has(("profile",)) == [True, True]
    with pytest.raises(InputError) as refused:
        plan(text.replace(', only = { shape = "profile" }', "")).initial_designs()
    assert str(refused.value) == (
        "shape = cylindrical is not possible within the bounds of variables: profile is not allowed for cell = "
        "'cylindrical', only for 'profile' (parameter shape = cylindrical, r2 = 0.7, z2 = 0.8)."
    )
    alone = text.replace("led_power = [0.5, 2]\n", "")
    assert len(plan(alone).initial_designs()) == 3  # there is one cylinder
