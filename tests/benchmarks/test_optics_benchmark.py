"""The benchmark's deterministic truth, and that it runs where no peer is installed."""

from __future__ import annotations

import csv
import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "benchmarks"


@pytest.mark.parametrize("z, expected", [(0.7, 0.019702463), (1.05, 0.011441221), (2.0, 0.0034533907)])
def test_quadrature_matches_an_independent_one(monkeypatch, z, expected):
    monkeypatch.syspath_prepend(str(FOLDER))
    from quadrature import plate_power

    assert plate_power(z) == pytest.approx(expected, rel=5e-8)


def test_quadrature_has_converged_near_contact(monkeypatch):
    monkeypatch.syspath_prepend(str(FOLDER))
    from quadrature import plate_power

    assert plate_power(0.1, panels=40) == pytest.approx(plate_power(0.1), rel=1e-9)


def test_quadrature_of_a_response_tends_to_the_closed_form(monkeypatch):
    monkeypatch.syspath_prepend(str(FOLDER))
    from quadrature import plate_power

    assert plate_power(0.7, panels=20, exponent=1 + 1e-9) == pytest.approx(plate_power(0.7), rel=1e-7)


def test_quick_benchmark_of_ours_alone_agrees_with_the_truth(tmp_path):
    table = tmp_path / "table.csv"
    command = [sys.executable, FOLDER / "optics.py", "--quick", "--peers", "--csv", table]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    with table.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert rows[0]["system"] == "taxel_tracer" and float(rows[0]["FoM"]) > 0
    assert "DISAGREES" not in done.stdout
