"""The table of figures of random scenes: its scenes, its truth on made-up readings, and its page."""

from __future__ import annotations

import hashlib
import math
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from click.testing import CliRunner
from taxel_cli.evidence.bench import command

from mitsuba_taxel.base.convergence import ERROR_SHARE
from mitsuba_taxel.evidence.coverage import figure_cases, figures
from mitsuba_taxel.evidence.coverage.figure_row import FigureRow


def test_scenes_are_of_every_kind_and_the_same_for_a_seed():
    cases = figure_cases.figure_cases()
    names = [case.name for case in cases]
    assert names == [case.name for case in figure_cases.figure_cases()]
    assert names != [case.name for case in figure_cases.figure_cases(1)] and len(set(names)) == 45
    # A change of the draw would choose other scenes after results are known.
    assert hashlib.sha256("\n".join(names[:41]).encode()).hexdigest()[:16] == "9e0582ba99378a59"
    kinds = [name[3:].partition(":")[0] for name in names]
    assert {kind: kinds.count(kind) for kind in kinds} == {
        "normal force": 28, "tangential force": 4, "random paths": 4, "viscoelastic": 4, "thin roof": 1,
        "larger loads": 4,
    }  # fmt: skip
    assert len({case.sensor.pad.cell for case in cases}) == 4 and any(case.sensor.pad.columns == 2 for case in cases)
    assert {len(case.vary[name]) for case in cases for name in case.vary} == {figure_cases.LOADS}
    assert cases[41].vary["fz"][-1] == 4 * cases[4].vary["fz"][-1] and cases[41].sensor is cases[4].sensor
    assert {case.sensor.pad.cell for case in cases[41:]} == {case.sensor.pad.cell for case in cases}


def made_up_study(case, size, stated=0.0):
    """Readings without derivatives on a bent curve, whose change has an error of c h^1.5 for elements of h mm."""
    force = np.array(case.vary["fz"])
    power = 1e-3 * (1 + (0.2 + 0.02 * size**1.5) * (force / force[-1]) + 0.05 * (force / force[-1]) ** 3)
    dims, shape = ["fz", "replicate", "taxel"], (len(force), 2, 1)
    variables = {
        "replicate_power": (dims, np.broadcast_to(power[:, None, None], shape)),
        "deviation": (["fz", "taxel"], (stated * (power - 1e-3) / ERROR_SHARE)[:, None]),
        "mechanics_error": (["fz", "taxel"], (stated * (power - 1e-3))[:, None]),
        "largest_strain": ("fz", 0.1 * force / force[-1]),
    }
    coords = {"fz": force, "taxel": [1]}
    return xr.Dataset(variables, coords, {"curve": "fz", "seed": 0, "points": 0, "mesh_size": size})


def test_the_truth_is_the_limit_of_small_elements(monkeypatch):
    """Sizes are those asked for, as numbers of elements tell."""
    case = figure_cases.figure_cases()[0]
    monkeypatch.setattr(figure_cases, "sweep", lambda file, vary, **how: made_up_study(case, 1.0, 0.1))
    monkeypatch.setattr(figure_cases, "make_batch", lambda file, vary, **how: case)
    sizes = iter([0.6 * math.sqrt(2), 0.6])
    monkeypatch.setattr(figure_cases, "replace", lambda batch, bare: batch)
    monkeypatch.setattr(figure_cases, "run_batch", lambda batch, pool, folder: made_up_study(case, next(sizes)))
    monkeypatch.setattr(figure_cases, "size_ratio", lambda *meshes: math.sqrt(2))
    row = case.measured()
    length = abs(case.vary["fz"][-1])
    assert not row.remark and row.fine == pytest.approx(0.6)
    assert row.mean_slope_true == pytest.approx(-2.5e-4 / length, rel=1e-9)
    assert row.mean_slope_further == pytest.approx(2e-5 * 0.6**1.5 / length, rel=1e-6)
    assert row.mean_slope_default_value == pytest.approx(-2.7e-4 / length, rel=1e-9)
    assert row.deviation("mean_slope", "default") == pytest.approx(-2e-5 / (0.1 * 2.7e-4), rel=0.02)
    # The true error is 0.02 of the load, that stated a tenth of the change.
    first, last = (
        0.02 / (0.022 + 0.005 * (force / case.vary["fz"][-1]) ** 2) for force in np.array(case.vary["fz"])[[1, -1]]
    )
    assert row.course == pytest.approx(last - first, rel=1e-6) and row.strain == pytest.approx(0.1)


def test_the_course_is_compared_with_that_taken():
    """At a strain of 0.04, 0.2 of the stated error; its difference over the largest load is 0.887 times as large."""
    case = figure_cases.figure_cases()[0]
    rows = [made_up_row(case, 1.0, course=course, strain=0.04) for course in (-0.17, 0.18, 0.36)]
    assert figures.courses([*rows, made_up_row(case, 1.0)]) == (
        "The course is known for 3 scenes without random numbers, with strains up to 0.04. Its median magnitude is "
        "0.180, and its largest 0.36. 1 of 3 courses are within one of these standard deviations, and 2 within two."
    )


def test_slopes_of_the_truth_are_those_of_its_curve():
    case = figure_cases.figure_cases()[0]
    study, length = made_up_study(case, 0.0), abs(case.vary["fz"][-1])
    found = figure_cases._true_figures(study, smooth=True)
    assert found["max_slope"][0] == pytest.approx(-1e-3 * (0.2 + 0.15) / length, rel=1e-9)
    assert found["zero_slope"][0] == pytest.approx(-1e-3 * 0.2 / length, rel=1e-9)


def made_up_row(case, off, **changed):
    numbers = {"mean_slope_true": 1.0, "mean_slope_noise": 0.0, "nonlinearity_true": 2.0, "nonlinearity_noise": 0.3}
    numbers |= {"mean_slope_further": 0.001, "nonlinearity_further": 0.0}
    for target in figures.TARGETS:
        numbers |= {f"mean_slope_{target}_value": 1 + 0.1 * off, f"mean_slope_{target}_error": 0.1}
        numbers |= {f"nonlinearity_{target}_value": 2 + 0.5 * off, f"nonlinearity_{target}_error": 0.4}
    return replace(FigureRow(case.name, seconds=9.0, true_seconds=3.0, fine=0.5, **numbers), **changed)


def test_the_page_counts_what_holds(monkeypatch, tmp_path):
    """The noise of the truth counts: errors of 0.4 and 0.3 are 0.5 together."""
    offs = iter([0.5, 1.5, 4.0])
    monkeypatch.setattr(figures, "measure_isolated", lambda case, seconds: made_up_row(case, next(offs)))
    page, rows = tmp_path / "page.md", tmp_path / "rows.csv"
    asked = ["figures", "--only", "0[1-3] n*: *", "--csv", str(rows), "--markdown", str(page)]
    result = CliRunner().invoke(command, asked)
    assert result.exit_code == 0, result.output
    again = CliRunner().invoke(command, asked)  # nothing is measured, as no offset is left
    assert again.exit_code == 0 and again.stdout == result.stdout
    text = page.read_text()
    assert "Scenes measured before this rule, on larger elements: 03." in text  # of 0.5 mm
    assert "12 of 18 figures (66.7%) of 3 scenes are within twice" in text
    assert "| nonlinearity | 0.2 % | 3 | 0 | 1 | 2 | 0.7 | 4.00 |" in text and str(rows) in text


def test_the_error_of_the_truth_counts():
    """Half of what is extrapolated, at least 0.2 % of a slope, and the noise of random paths."""
    case = figure_cases.figure_cases()[0]
    row = made_up_row(case, 1.0, mean_slope_further=-0.15, nonlinearity_further=0.8)
    assert row.truth_error("mean_slope") == pytest.approx(0.075)
    assert row.weakness("mean_slope", "default") == pytest.approx(0.75)
    assert row.deviation("mean_slope", "default") == pytest.approx(0.1 / 0.125)
    assert row.truth_error("nonlinearity") == pytest.approx(0.5)
    assert made_up_row(case, 1.0).truth_error("mean_slope") == pytest.approx(0.002)


def test_what_the_truth_cannot_judge_is_no_success_but_may_fail():
    """Its error is 0.5 beside 0.4: deviations of 1 and 2.3 of both are not judged, and beyond."""
    case = figure_cases.figure_cases()[0]
    rows = [made_up_row(case, off, nonlinearity_further=0.8) for off in (1.28, 2.95)]
    assert figures.deviations(rows[:1], "nonlinearity", "default") == ([], 1)
    values, others = figures.deviations(rows, "nonlinearity", "default")
    assert others == 1 and values == [pytest.approx(0.5 * 2.95 / math.hypot(0.4, 0.5))]
    assert "3 figures are not judged" in figures.summary(rows)


def test_a_scene_that_cannot_be_read_is_named():
    case = figure_cases.figure_cases()[0]
    rows = [made_up_row(case, 1.0), case.failed("out of memory")]
    assert figures.summary(rows).endswith("1 scenes could not be read.")
    assert figures.cells(rows[1])[-1] == "out of memory"
    assert figures.summary(rows[1:]) == "None of 1 scenes could be read."
