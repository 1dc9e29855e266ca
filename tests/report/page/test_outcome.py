"""Pages of folders that other commands wrote hold what these say."""

from __future__ import annotations

import numpy as np
import pandas
import pytest

from mitsuba_taxel import InputError, sweep
from mitsuba_taxel.base.files.printed import PrintedTable, write_printed
from mitsuba_taxel.fitting import run_fit
from mitsuba_taxel.report.page import write_report
from mitsuba_taxel.report.page.model_plot import plot_model
from mitsuba_taxel.report.page.outcome import MOST_ROWS, outcome_sections
from mitsuba_taxel.surrogates import export
from mitsuba_taxel.surrogates.onnx_model import read_polynomial


def test_the_page_of_a_fit_has_its_unknowns_residuals_and_warnings(tmp_path, llvm_mono):
    (tmp_path / "data.csv").write_text("z_mm,v1_mV\n0.5,10\n0.7,8\n0.9,6\n")
    table = "[fit.unknowns]\ngain = { start = 0.8, low = 0.5, high = 0.9 }\n"
    (tmp_path / "study.toml").write_text(f'scene = "plate.xml"\npoints = 64\n[fit]\ndata = "data.csv"\n{table}')
    result = run_fit(tmp_path / "study.toml", tmp_path / "out")
    assert write_report(tmp_path / "out", tmp_path / "page.html") == []
    page = (tmp_path / "page.html").read_text()
    assert (
        f"<td>{result.unknowns.low[0]:.6g} to {result.unknowns.high[0]:.6g}</td>" in page
        and "data:image/svg+xml;base64," in page
    )
    assert result.warnings and all(
        f"<li>warning: {line}</li>" in page.replace("&#x27;", "'") for line in result.warnings
    )
    assert page.count("<h2") == 1 and "Residuals" in page
    assert "<th></th><th>gain</th>" in page.replace(' scope="col"', "")  # of the correlation


@pytest.mark.quick
def test_the_page_of_tolerances_has_spreads_and_indices_and_the_shortened_samples(tmp_path):
    pandas.DataFrame({"figure": ["gain"], "sd": [0.01234567]}).to_csv(tmp_path / "spread.csv", index=False)
    pandas.DataFrame({"parameter": ["<x>"], "total_gain": [0.5]}).to_csv(tmp_path / "parameters.csv", index=False)
    pandas.DataFrame({"x": range(MOST_ROWS + 3)}).to_csv(tmp_path / "samples.csv", index=False)
    (tmp_path / "notes.txt").write_text("samples without readings, left out: 2 of 9\n")
    (part,) = outcome_sections(tmp_path)
    assert "<td>0.01235</td>" in part and "&lt;x&gt;" in part and '<th scope="col">total gain</th>' in part
    assert "<li>samples without readings, left out: 2 of 9</li>" in part and "3 more rows in samples.csv" in part


@pytest.mark.quick
def test_the_page_has_the_tables_as_the_command_prints_them(tmp_path, capsys):
    """With a nominal value of 2, a mean of 2.02 and a spread of 0.1: 1 % and 5 %."""
    from types import SimpleNamespace

    from taxel_cli.designs.tolerance import _show

    row = {"figure": "gain", "taxel": 3, "unit": "W/N", "nominal": 2.0, "mean": 2.02, "mean_error": 0.002, "sd": 0.1}
    row |= {"sd_error": 0.01, "linear_sd": 0.09, "linear_error": 0.04, "explained": 0.9}
    indices = {"parameter": "wall", "law": "normal", "total_gain": 0.5, "total_error_gain": 0.02}
    spread, parameters = pandas.DataFrame([row]), pandas.DataFrame([indices])
    spread.to_csv(tmp_path / "spread.csv", index=False)
    parameters.to_csv(tmp_path / "parameters.csv", index=False)
    (part,) = outcome_sections(tmp_path)
    shares = pandas.DataFrame({"rate": [1.0]})
    _show(SimpleNamespace(samples=pandas.DataFrame({"x": [1]}), shares=shares, spread=spread, parameters=parameters))
    printed = capsys.readouterr().out
    for word in ("1.0% ± 0.1%", "5.0% ± 0.5%", "4.5%", "90.0%", "50.0% ± 2.0%"):
        assert f"<td>{word}</td>" in part and word in printed


@pytest.mark.quick
def test_folders_of_comparisons_and_training_sets_have_pages(tmp_path):
    for name in ("one", "other"):
        (tmp_path / name).mkdir()
    pandas.DataFrame({"variant": ["a"], "rank": [1]}).to_csv(tmp_path / "one" / "comparison.csv", index=False)
    (tmp_path / "one" / "comparison.png").write_bytes(b"picture")
    (tmp_path / "one" / "notes.txt").write_text("a note\n")
    pandas.DataFrame({f"c{n}": [n] for n in range(14)}).to_csv(tmp_path / "other" / "train.csv", index=False)
    (tmp_path / "other" / "README.md").write_text("# Set\n\n- a caveat\n")
    (tmp_path / "other" / "images").mkdir()  # as of a training set of images
    write_report(tmp_path / "one", tmp_path / "one.html")
    write_report(tmp_path / "other", tmp_path / "other.html")
    one, other = ((tmp_path / f"{name}.html").read_text() for name in ("one", "other"))
    assert "data:image/png;base64,cGljdHVyZQ==" in one and "<li>a note</li>" in one and "<td>a</td>" in one
    assert "<summary>Training</summary>" in other  # rows that are many and alike do not fill the page
    assert "<p>Rows: train 1</p>" in other and "<li>a caveat</li>" in other and "2 more columns in train.csv" in other


def test_the_page_of_an_optimum_has_its_verdict(tmp_path):
    (tmp_path / "optimum.md").write_text("# Range\n\n- Improvement: 12%\n- a local optimum\n\n| a |\n|---|\n| 1 |\n")
    pandas.DataFrame({"figure": ["range"], "best": [2.0]}).to_csv(tmp_path / "figures.csv", index=False)
    write_report(tmp_path, tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text()
    assert "<li>Improvement: 12%</li><li>a local optimum</li>" in page and "<td>range</td><td>2</td>" in page


def test_what_was_printed_is_on_the_page_in_its_order(tmp_path):
    (tmp_path / "optimum.md").write_text("- Improvement: 12%\n")
    table = PrintedTable("By slope:", ["variant", "slope [W/N]"], [["a", "1.2 ± 0.1"]])
    write_printed([table, "first: <of those>", "warning: few", table], tmp_path)
    (part,) = outcome_sections(tmp_path)
    lines = "<ul><li>first: &lt;of those&gt;</li><li>warning: few</li></ul>"
    before, after = part.split(lines)
    assert before.count("<td>1.2 ± 0.1</td>") == after.count("<td>1.2 ± 0.1</td>") == 1 and "Improvement" not in part
    (tmp_path / "printed.json").write_text("[{}]")
    assert "<li>Improvement: 12%</li>" in outcome_sections(tmp_path)[0]  # of another version


def test_the_page_of_a_model_has_its_curves(tmp_path):
    """A calibration has none; another file of the same ending is no result."""
    pytest.importorskip("onnx")
    (tmp_path / "foreign.onnx").write_bytes(b"no model")
    assert outcome_sections(tmp_path) == []
    study = sweep("plate.xml", {"z": "0.6,0.7,0.8,0.9", "width": "3,3.5,4"}, points=64)
    found, _ = export(study, tmp_path / "model.onnx")
    left, right = plot_model(read_polynomial(tmp_path / "model.onnx")).axes
    (line,) = left.lines
    assert left.get_xlabel() == "z [mm]"
    expected = study.power.sel(width=3.5, z=[0.6, 0.9]).values.ravel()
    np.testing.assert_allclose(line.get_ydata()[[0, -1]], expected, atol=2 * found.worst * np.ptp(study.power.values))
    assert right.get_xlabel() == "width"
    (part,) = outcome_sections(tmp_path)
    assert "Model model.onnx" in part and "data:image/svg+xml;base64," in part


@pytest.mark.parametrize("changed", [
    {"inputs": None}, {"inputs": "3"}, {"inputs": '["f$\\frac"]'}, {"units": "x"}, {"printed": "[1]"},
    {"low": np.zeros((2, 2))}, {"high": np.array([np.nan])}, {"weights": np.zeros(0)},
    {"exponents": np.array([[[1e9]]])}, {"low": np.ones(1), "high": np.ones(1)},
])  # fmt: skip
def test_models_of_somebody_else_are_not_run_and_end_in_no_error(tmp_path, changed):
    onnx = pytest.importorskip("onnx")
    about = {"printed": '["told"]', "inputs": '["f"]', "units": '["N"]'}
    held = {"low": np.zeros(1), "high": np.ones(1), "weights": np.ones((1, 1)), "exponents": np.ones((1, 1, 1))}
    about |= {name: value for name, value in changed.items() if name in about}
    held |= {name: value for name, value in changed.items() if name in held}
    result = onnx.helper.make_tensor_value_info("readings", onnx.TensorProto.DOUBLE, [1])
    endless = onnx.helper.make_node("Loop", ["", ""], ["readings"])
    constants = [onnx.numpy_helper.from_array(np.asarray(value), name) for name, value in held.items()]
    model = onnx.helper.make_model(onnx.helper.make_graph([endless], "g", [], [result], constants))
    onnx.helper.set_model_props(model, {name: value for name, value in about.items() if value is not None})
    (tmp_path / "model.onnx").write_bytes(model.SerializeToString())
    (part,) = outcome_sections(tmp_path) or [""]
    assert "data:image" not in part and ("told" in part or "printed" in changed)


@pytest.mark.quick
def test_a_folder_without_results_is_refused(tmp_path):
    with pytest.raises(InputError, match="is not allowed"):
        write_report(tmp_path, tmp_path / "page.html")
