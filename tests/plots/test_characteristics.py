"""Files of figures of merit come out for every kind of experiment, and nothing else is left behind."""

from __future__ import annotations

import os
from dataclasses import replace

import numpy as np
import pandas
import pytest
from PIL import Image

from mitsuba_taxel.characterise import Branch, Experiment, characteristics, symmetric_pairs, tangential_map
from mitsuba_taxel.plots import figures
from mitsuba_taxel.plots.characteristics import plot_against, plot_sensitivity, write_characteristics

UP = np.linspace(0, -8, 9)
RNG = np.random.default_rng(1)


def run(force, taxels, replicates=8, bend=0.1):
    samples = (force + bend * force**2)[:, None, None] * np.linspace(-1, 1, taxels)
    return Branch(force, samples + 0.01 * RNG.normal(size=(len(force), replicates, taxels)))


def experiment(*runs, direction=(0, 0, 1), **where):
    taxels = np.arange(1, runs[0].samples.shape[2] + 1)
    return Experiment("fz", np.array(direction, dtype=float), where, "V", taxels, runs)


CYCLES = [run(UP, 12), run(UP[::-1], 12, bend=0.08), run(UP, 12)]
KINDS = {
    "one run": [experiment(run(UP, 9))],
    "cycles": [experiment(*CYCLES)],
    "two growing runs": [experiment(CYCLES[0], CYCLES[2])],
    "no replicates": [experiment(run(UP, 1, replicates=1))],
    "two points": [experiment(run(UP[:2], 3))],
    "panels": [experiment(run(UP, 2), cell="a", nu=0.1 * number) for number in range(4)],
    "only falling": [experiment(run(UP[::-1], 2)), experiment(run(UP, 2))],
    "constant": [experiment(Branch(UP, np.zeros((9, 4, 2))))],
    "tangential": [experiment(run(UP, 9), direction=(np.sqrt(0.5), np.sqrt(0.5), 0), fz=-8.0)],
}


@pytest.fixture(autouse=True)
def few_panels(monkeypatch):
    """Each takes a while to draw."""
    monkeypatch.setattr(figures, "MOST_LINES", 3)


@pytest.mark.usefixtures("painted_figures")
@pytest.mark.parametrize("experiments", KINDS.values(), ids=KINDS.keys())
def test_files(tmp_path, experiments):
    table = characteristics(experiments)
    maps = [tangential_map(one, 3, 3) for one in experiments if one.direction[0]]
    files = write_characteristics(tmp_path, experiments, maps, table, symmetric_pairs(maps))
    assert sorted(file.name for file in files) == sorted(os.listdir(tmp_path))
    for file in files:
        if file.suffix == ".png":
            with Image.open(file) as image:
                assert image.width > 600 and image.height > 300 and len(image.getcolors(1 << 20)) > 10
    written = pandas.read_csv(tmp_path / "characteristics.csv")
    np.testing.assert_allclose(written.value, table.value)
    assert ("nonlinearity.png" in os.listdir(tmp_path)) == (table.figure == "nonlinearity").any()
    assert ("tangential_map.png" in os.listdir(tmp_path)) == bool(maps)
    text = (tmp_path / "characteristics.tex").read_text()
    assert text.count(r"\begin{tabular}") == text.count(r"\end{tabular}") >= 1
    for line in text.splitlines():
        assert not line or line.startswith("\\") or line.endswith(r" \\")


@pytest.mark.usefixtures("painted_figures")
def test_panels_beyond_the_most_are_left_out_of_the_plot_and_not_of_the_table(tmp_path):
    experiments = KINDS["panels"]
    table = characteristics(experiments)
    assert table.nu.nunique() == 4 and len(table) == 4 * 2 * 4


def test_several_experiments_are_lines_of_the_taxel_that_changes_most():
    """The mean of its nine taxels, which change in opposite directions, is none: taxel 9 changes most."""
    pair = [experiment(run(UP, 9), cell=cell) for cell in "ab"]
    pair = [
        replace(one, runs=tuple(replace(r, samples=r.samples * np.linspace(1, 2, 9)) for r in one.runs)) for one in pair
    ]
    change, _ = plot_sensitivity(pair).axes[:2]
    drawn = [line.get_ydata() for line in change.lines if len(line.get_ydata()) == len(UP)]
    for line, one in zip(drawn, pair, strict=True):
        np.testing.assert_allclose(line, one.runs[0].value[:, 8])
    table = plot_against([replace(one, where={"step": n}) for n, one in enumerate(pair)]).axes[0]
    assert table.lines[0].get_linestyle() == "None"  # rows of a table are in any order
    against = plot_against([replace(one, where={"nu": n}) for n, one in enumerate(pair)]).axes[0]
    assert against.get_title() == "taxel 9" and "taxel 9" in change.get_ylabel()
