"""Correlated tolerances: factors that scale several parameters, against closed forms of a linear model."""

from __future__ import annotations

import numpy as np
import pytest
from one_cell import one_cell

from mitsuba_taxel import InputError
from mitsuba_taxel.tolerances import run_tolerance
from mitsuba_taxel.tolerances.analysis import _of_figure
from mitsuba_taxel.tolerances.factors import read_factors
from mitsuba_taxel.tolerances.plan import read_plan

NORMAL = {"law": "normal", "mean": 1.0, "sd": 0.02}
SCENE = {"width": "2.5", "height": "1", "gap": "0.2", "cell": "spherical", "tilt": "0"}
OF = {"mould": {**NORMAL, "scales": ["width", "height"]}, "height": {"law": "normal", "mean": 1.0, "sd": 0.03}}


def test_parameters_are_products_and_have_their_derivatives():
    factors = read_factors({**OF, "hall": {**NORMAL, "mean": 2.0, "scales": ["height"]}}, SCENE)
    values = {"mould": 0.9, "height": 1.1, "hall": 3.0}
    assert factors.parameters(values) == pytest.approx({"width": 2.5 * 0.9, "height": 0.9 * 1.1 * 3.0})
    assert factors.partial_derivatives("mould") == pytest.approx({"width": 2.5, "height": 2.0})
    assert factors.partial_derivatives("hall") == {"height": 1.0} and factors.partial_derivatives("height") == {
        "height": 2.0
    }
    note, _ = factors.notes()
    assert note.startswith("height, width vary with mould: ")
    assert note.endswith("the index of height is that of its own law, without mould")
    assert read_factors({"gap": NORMAL}, SCENE).notes() == []


@pytest.mark.parametrize(("table", "said"), [
    ({"mould": {**NORMAL, "scales": ["deep"]}}, "scales = deep is not a parameter of the scene: one of width, height"),
    ({"mould": {**NORMAL, "scales": "width"}}, "scales = 'width' is not allowed"),
    ({"mould": {**NORMAL, "scales": []}}, "scales = [] is not allowed"),
    ({"mould": {**NORMAL, "scales": ["cell"]}}, "cell = spherical cannot be scaled"),
    ({"mould": {**NORMAL, "scales": ["tilt"]}}, "tilt = 0 cannot be scaled: a number other than 0 is needed, or a law"),
    ({"gap": {**NORMAL, "scales": ["width"]}}, "gap is a parameter of the scene: a factor needs another name"),
])  # fmt: skip
def test_what_is_no_factor_is_refused(table, said):
    with pytest.raises(InputError) as refused:
        read_factors(table, SCENE)
    assert said in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.parametrize("exact", [256, 32])
def test_spread_quantiles_and_linear_answer_follow_the_correlation(tmp_path, exact):
    """Of 3 z + 2 spacing, both scaled by one factor f with a deviation of s, and the spacing of a deviation d of its
    own: variance (s (3 z0 + 2 s0))^2 + (2 d)^2 and a part of s d. Without correlation it would be 40 % less."""
    (tmp_path / "study.toml").write_text(f"""
scene = "plate.xml"
points = 64
define = {{ z = 0.7 }}
[tolerance]
samples = 256
exact = {exact}
sampling = "sobol"
[tolerance.of]
shrinkage = {{ law = "normal", mean = 0.98, sd = 0.002, scales = ["z", "spacing"] }}
spacing = {{ law = "normal", mean = 0.9, sd = 0.002 }}
""")
    plan = read_plan(tmp_path / "study.toml")
    words = plan.samples(64, None).axes[-1].values
    z, spacing = (np.array(words[name], dtype=float) for name in ("z", "spacing"))
    assert len(z) == exact and plan.batch.axes[-1].values == {"z": ["0.686"], "spacing": ["0.882"]}
    assert "z" not in plan.batch.defines
    slopes = np.array([[sum({"z": 3, "spacing": 2}[name] * by for name, by in chain.items())
                        for chain in map(plan.factors.partial_derivatives, ["shrinkage", "spacing"])]])  # fmt: skip
    parts = 0.002 * (3 * 0.7 + 2 * 0.9), 0.98 * 2 * 0.002
    sd = np.hypot(*parts)
    (row,), shares = _of_figure(
        plan, "rest", np.array([0.98 * 3.9]), (3 * z + 2 * spacing)[:, None], slopes, plan.standardised[:exact],
        plan.standardised[exact:],
    )  # fmt: skip
    assert row["linear_sd"] == pytest.approx(sd, rel=1e-9) and row["sd"] == pytest.approx(sd, rel=0.02)
    assert row["linear_error"] < 0.01
    assert [row["low"], row["high"]] == pytest.approx([3.822 - 1.645 * sd, 3.822 + 1.645 * sd], abs=0.1 * sd)
    assert [share["total"] for share in shares] == pytest.approx(np.square(parts) / sd**2, abs=0.02)


def test_what_scales_power_and_stiffness_leaves_the_sensitivity(tmp_path):
    """Of small loads that is proportional to power over modulus; independent tolerances would add up."""
    (tmp_path / "cell.xml").write_text(one_cell(scattering="isotropic", fz=0, youngs_modulus=4, led_power=1))
    (tmp_path / "study.toml").write_text("""
scene = "cell.xml"
[vary]
fz = [0, -0.1]
[tolerance]
samples = 8
[tolerance.of]
batch = { law = "normal", mean = 1, sd = 0.1, scales = ["led_power", "youngs_modulus"] }
""")
    result = run_tolerance(tmp_path / "study.toml", tmp_path / "out")
    rows = result.spread.set_index("figure")
    rest, slope = rows.loc["rest"], rows.loc["sensitivity"]
    assert rest.linear_sd / rest.nominal == pytest.approx(0.1, rel=1e-3)
    assert rest.sd / rest.nominal == pytest.approx(result.samples.batch.std(), rel=1e-3)
    assert abs(slope.sd / slope.nominal) < 0.005 and abs(slope.linear_sd / slope.nominal) < 0.005
    np.testing.assert_allclose(result.samples.youngs_modulus, 4 * result.samples.batch, rtol=1e-10)
    assert list(result.parameters.parameter) == ["batch"] and result.parameters.law[0].endswith(
        "x led_power, youngs_modulus"
    )
    assert any(note.startswith("led_power, youngs_modulus vary with batch") for note in result.notes)
