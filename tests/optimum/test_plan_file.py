"""Studies that say what is to be optimised, and those that do not: one line each."""

from __future__ import annotations

import pytest

from mitsuba_taxel import InputError
from mitsuba_taxel.optimum.plan import Design
from mitsuba_taxel.optimum.plan_file import read_plan

HEAD = 'scene = "pad.xml"\n'
GOAL = '[optimise]\nmaximise = "sensitivity"\n'
VARIABLES = "[optimise.variables]\nspacing = [0.85, 0.93]\nyoungs_modulus = { low = 1, high = 9, start = 3 }\n"
LOADS = "[optimise.loads]\nnormal = { fz = [0, -1, -2] }\nside = { fz = -2, fx = [0, 0.1] }\n"
CIRCUIT = "circuit = { supply = 3.3, load_resistance = 1e4, transfer = 0.1 }\n"
WHOLE = HEAD + GOAL + VARIABLES + LOADS
CONSTRAINT = "[[optimise.constraints]]\n"


@pytest.fixture
def plan(tmp_path):
    def read(text):
        (tmp_path / "study.toml").write_text(text)
        return read_plan(tmp_path / "study.toml")

    return read


def test_a_plan(plan):
    choices = '[optimise.choices]\ncell = ["hemispheric", "parallelepiped"]\n'
    one = plan(WHOLE + choices + CONSTRAINT + 'figure = "nonlinearity"\nmost = 0.03\nleast = 0\n')
    assert one.goal.words == "maximise sensitivity along normal" and one.goal.figure.unit == "W/N"
    assert [limit.words for limit in one.limits] == [
        "nonlinearity along normal <= 0.03", "nonlinearity along normal >= 0",
    ]  # fmt: skip
    assert one.before == Design(("parallelepiped",), (pytest.approx(0.625), 0.25))
    assert one.parameters(one.before) == {"cell": "parallelepiped", "spacing": "0.9", "youngs_modulus": "3"}
    assert {"fz": "-2", "fx": "0.1"} in one.loads and len(one.loads) == 5
    begun = one.initial_designs()
    assert [design.choice for design in begun] == [
        ("hemispheric",),
        ("parallelepiped",),
    ] and begun == one.initial_designs()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (HEAD + GOAL, "nothing to optimise"),
        (HEAD + "optimise = 3\n", "nothing to optimise"),
        ("vary = { fz = [1, 2] }\n" + WHOLE, "vary is not allowed"),
        (WHOLE.replace(GOAL, GOAL + "start = 2\n"), "optimise: start is not known"),
        (WHOLE.replace(GOAL, GOAL + "starts = 0\n"), "starts = 0"),
        (WHOLE.replace(GOAL, GOAL + 'minimise = "rest"\n'), "one goal is needed, maximise or minimise"),
        (WHOLE.replace("sensitivity", "sensitiveness"), "figure 'sensitiveness' is not known"),
        (WHOLE.replace("[0.85, 0.93]", "[0.93, 0.85]"), "low = 0.93 must be below"),
        (WHOLE.replace("[0.85, 0.93]", "[0.91, 0.93]"), "start = 0.9 must lie from 0.91"),
        (WHOLE.replace("[0.85, 0.93]", "0.9"), "variable spacing = 0.9"),
        (WHOLE.replace("spacing", "law"), "variable law = 'uniform_solid_angle'"),
        (WHOLE.replace("spacing", "cell_size"), "cell_size is not a parameter"),
        (WHOLE.replace("spacing = [0.85, 0.93]", "fx = [-1, 1]"), "fx is given twice"),
        (WHOLE.replace("youngs_modulus", "cell_size"), "cell_size is not a <default>"),
        ("define = { spacing = 0.9 }\n" + WHOLE, "spacing is both varied and given a value"),
        (WHOLE + "[optimise.choices]\ncell = 3\n", "choice cell = 3"),
        (WHOLE.replace("start = 3", "start = 3, only = 2"), "variable youngs_modulus: only = 2"),
        (WHOLE.replace("start = 3", 'only = { law = "a" }'), "only.law is not allowed: it is not one of the choices"),
        (
            WHOLE.replace("start = 3", 'only = { cell = "cube" }') + '[optimise.choices]\ncell = ["spherical"]\n',
            "only.cell = 'cube' is not allowed: one or more of spherical",
        ),
        (WHOLE.replace("[0, -1, -2]", "[0, -1, -1]"), "values must only rise, or only fall"),
        (WHOLE.replace("[0, -1, -2]", "-2"), "one list of two numbers"),
        (WHOLE.replace("fx = ", "fw = "), "fw is not a <default>"),
        (WHOLE + CONSTRAINT + 'figure = "rest"\n', "a number for least, most or both"),
        (WHOLE + CONSTRAINT + 'figure = "rest"\nalong = "top"\nmost = 1\n', "one line of loads of normal, side"),
        (WHOLE + CONSTRAINT + 'figure = "nonlinearity"\nalong = "side"\nmost = 1\n', "3 loads or more"),
        (WHOLE + CONSTRAINT + 'figure = "rest"\ntaxel = 3\nmost = 1\n', "rest: taxel is not known"),
        (WHOLE + CONSTRAINT + 'figure = "cross_talk"\nmost = 1\n', "taxel = None"),
        (WHOLE + CONSTRAINT + 'figure = "cross_sensitivity"\nmost = 1\n', "by = None"),
        (WHOLE + CONSTRAINT + 'figure = "resolution"\nmost = 1\n', "without a table [circuit], or a noise"),
        (WHOLE + CONSTRAINT + 'figure = "resolution"\nalong = ["side"]\nmost = 1\n', "two or more"),
        (WHOLE + CONSTRAINT + 'figure = "resolution"\nnoise = 0\nmost = 1\n', "noise = 0"),
        (WHOLE + CONSTRAINT + 'figure = "resolution"\nnoise = 1\nof = "top"\nmost = 1\n', "of = 'top' is not allowed"),
        (WHOLE + CONSTRAINT + 'figure = "resolution"\nnoise = 1\nof = [[1]]\nmost = 1\n', "of = [[1]] is not allowed"),
        (
            WHOLE.replace("fx = [0, 0.1]", "poisson_ratio = [0.4, 0.45]")
            + CONSTRAINT
            + 'figure = "resolution"\nnoise = 1\nmost = 1\n',
            "resolution of normal, side is in 1 and N: of = a line",
        ),
        (WHOLE + CONSTRAINT + 'figure = "saturation"\nmost = 1\n', "without a table [circuit]"),
        *(
            (
                WHOLE + CONSTRAINT + f'figure = "{name}"\nleast = 40\n',
                f"{name.replace('_', ' ')} along normal >= 40 is not allowed with loads of fz up to 2: the figure "
                "is computed up to 10 times that load, so loads up to 4 or more are needed",
            )
            for name in ("range", "first_contact")
        ),
        (WHOLE + "[optimise.tolerances]\nhole = 0\n", "tolerance of hole = 0"),
        (WHOLE + "[optimise.tolerances]\nwall = 1\n", "wall is not a <default>"),
        (WHOLE + '[optimise.front]\nminimise = "rest"\npoints = 2\n', "points = 3 or more"),
        (WHOLE + '[optimise.front]\nminimise = "rest"\nmaximise = "rest"\n', "one goal is needed"),
        (HEAD + GOAL + VARIABLES, "sensitivity cannot be computed: 2 loads or more"),
    ],
)  # fmt: skip
def test_what_is_no_optimisation_is_refused(plan, text, said):
    with pytest.raises(InputError) as refused:
        plan(text)
    assert said in str(refused.value) and "\n" not in str(refused.value)


def test_a_range_may_reach_as_far_as_it_is_told(plan):
    one = plan(WHOLE + CONSTRAINT + 'figure = "range"\nleast = 20\nmost = 99\n')
    assert [limit.words for limit in one.limits] == ["range along normal >= 20", "range along normal <= 99"]


def test_a_circuit_makes_volts(plan):
    one = plan(CIRCUIT + WHOLE + CONSTRAINT + 'figure = "saturation"\nmost = 1\n')
    assert one.goal.figure.unit == "V/N" and one.limits[0].figure.unit == "1"
