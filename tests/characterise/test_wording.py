"""Values with their errors as words, and tables as LaTeX."""

from __future__ import annotations

import math

import numpy as np
import pandas
import pytest
import xarray as xr

from mitsuba_taxel.characterise.wording import (
    figure_rows,
    latex_table,
    power_answer,
    remarks_explained,
    slope_answers,
    table_rows,
    with_error,
)


@pytest.mark.parametrize(
    "value, error, words, formula",
    [
        (1.4803e-4, 3.13e-6, "(1.480 ± 0.031)e-04", r"$(1.480 \pm 0.031) \times 10^{-4}$"),
        (-3.1789, 0.0512, "-3.179 ± 0.051", r"$-3.179 \pm 0.051$"),
        (123456.0, 120.0, "(1.2346 ± 0.0012)e+05", r"$(1.2346 \pm 0.0012) \times 10^{5}$"),
        (5e-3, 9.96e-5, "(5.000 ± 0.100)e-03", r"$(5.000 \pm 0.100) \times 10^{-3}$"),
        (-1e-9, 2e-7, "(0.0 ± 2.0)e-07", r"$(0.0 \pm 2.0) \times 10^{-7}$"),
        (250.0, 30.0, "250 ± 30", r"$250 \pm 30$"),
        (1.4803e-4, math.nan, "1.480e-04", r"$1.480 \times 10^{-4}$"),
        (0.0355, math.nan, "0.03550", "$0.03550$"),
        (2.0, 0.0, "2.000 ± 0", r"$2.000 \pm 0$"),
        (0.0, math.nan, "0.000", "$0.000$"),
        (math.nan, 1.0, "-", "--"),
    ],
)
def test_value_and_error(value, error, words, formula):
    assert with_error(value, error) == words and with_error(value, error, latex=True) == formula


def row(figure, value, error, unit, **more):
    where = {"at_N": -4.0, "from_N": 0, "to_N": -8}
    words = {"remark": "not resolved"} if abs(value) < error else {"remark": ""}
    return {"figure": figure, "force": "fz", **more, "value": value, "error": error, "unit": unit, **where, **words}


def test_rows_of_a_table():
    table = pandas.DataFrame(
        [
            row("max_slope", 2e-4, 1e-6, "W/N", cell="a", taxel=1, loading=1),
            row("mean_slope", 1e-4, 1e-6, "W/N", cell="a", taxel=1, loading=1),
            row("mean_slope", 3e-4, 1e-6, "W/N", cell="b", taxel=1, loading=1),
            row("zero_slope", 3e-6, 4e-6, "W/N", cell="b", taxel=1, loading=1),
            row("nonlinearity", 2.5, 0.1, "%", cell="b", taxel=1, loading=1),
        ]
    )
    headings, rows = table_rows(table, ("max_slope", "mean_slope", "zero_slope"))
    slopes = ["max slope [µW/N]", "at [N]", "mean slope [µW/N]", "zero slope [µW/N]"]
    assert headings == ["force", "cell", "taxel", *slopes]
    assert rows[0] == ["fz", "a", "1", "200.0 ± 1.0", "-4", "100.0 ± 1.0", "-"]
    assert rows[1] == ["fz", "b", "1", "-", "-", "300.0 ± 1.0", "not resolved"]
    assert remarks_explained(table)[0].startswith("not resolved: ")
    assert table_rows(table, ("hysteresis",))[1] == []


def test_circuit_figures_have_units_and_errors():
    table = pandas.DataFrame(
        {
            "force": ["fz", "fz"],
            "taxel": [1, 2],
            "rest_counts": [826.0, 900.0],
            "mean_slope_V_per_N": [-0.0438, -0.05],
            "mean_slope_V_per_N_error": [0.00099, math.nan],
            "noise_force_N": [0.01059, math.inf],
        }
    )
    headings, rows = figure_rows(table)
    assert headings == ["force", "taxel", "rest [counts]", "mean slope [mV/N]", "noise force [mN]"]
    assert rows == [["fz", "1", "826", "-43.80 ± 0.99", "10.59"], ["fz", "2", "900", "-50", "-"]]


def test_mean_slopes_are_the_answer_in_a_line():
    slopes = [row("mean_slope", value, 4e-6, "W/N", taxel=taxel) for taxel, value in enumerate((-1e-4, -3e-4, -2e-4))]
    largest = row("max_slope", -9e-4, 1e-6, "W/N", taxel=1)
    assert slope_answers(pandas.DataFrame([slopes[0], largest])) == ["Mean slope over fz: -100.0 ± 4.0 µW/N."]
    assert slope_answers(pandas.DataFrame([*slopes, largest])) == [
        "Mean slopes over fz: -300 to -100 µW/N, each ± 4 µW/N or less."
    ]
    (renamed,) = slope_answers(pandas.DataFrame(slopes), {"fx": "f", "fz": "-push"})
    assert renamed.startswith("Mean slopes over fz = -push: -300 to -100 ")
    assert slope_answers(pandas.DataFrame([largest])) == slope_answers(pandas.DataFrame()) == []


def test_powers_are_the_answer_in_a_line_without_a_force():
    def study(power, error):
        over = ("z", "taxel")
        return xr.Dataset({"power": (over, np.array(power)), "total_error": (over, np.array(error))})

    both = study([[1e-3, 2e-3], [math.nan, math.nan], [4e-3, 3e-3]], [[1e-5, 2e-5], [math.nan, math.nan], [5e-5, 1e-5]])
    assert power_answer(both) == "Power over z: 1 to 4 mW, each ± 0.05 mW or less."
    assert power_answer(study([[2.5e-3]], [[1e-5]])) == "Power over z: 2.5 mW ± 0.01 mW."
    assert power_answer(study([[2.5e-3, 0.0]], [[math.nan, 0.0]])) == "Power over z: 0 to 2.5 mW; an error is unknown."
    assert power_answer(study([[math.nan]], [[math.nan]])) == ""


def test_latex_needs_no_package_and_escapes_words():
    text = latex_table(["cell_type & more", "e [%]"], [[r"a_b#1 {x} ~^\ $", "$1 \\pm 2$"], ["c", "--"]])
    assert text.splitlines() == [
        r"\begin{tabular}{lr}",
        r"\hline",
        r"cell\_type \& more & e [\%] \\",
        r"\hline",
        r"a\_b\#1 \{x\} \textasciitilde{}\textasciicircum{}\textbackslash{} \$ & $1 \pm 2$ \\",
        r"c & -- \\",
        r"\hline",
        r"\end{tabular}",
    ]
