"""The benchmark's deterministic truth, and that it runs where no peer is installed."""

from __future__ import annotations

import csv

import pytest
from click.testing import CliRunner
from taxel_cli.evidence.bench_peers import peers

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.evidence.peers.optics import table
from mitsuba_taxel.evidence.peers.plate_quadrature import plate_power


@pytest.mark.parametrize("z, expected", [(0.7, 0.019702463), (1.05, 0.011441221), (2.0, 0.0034533907)])
def test_quadrature_matches_an_independent_one(z, expected):
    assert plate_power(z) == pytest.approx(expected, rel=5e-8)


def test_quadrature_has_converged_near_contact():
    assert plate_power(0.1, panels=40) == pytest.approx(plate_power(0.1), rel=1e-9)


def test_quadrature_of_a_response_tends_to_the_closed_form():
    assert plate_power(0.7, panels=20, exponent=1 + 1e-9) == pytest.approx(plate_power(0.7), rel=1e-7)


def test_ours_alone_agrees_with_the_truth(tmp_path):
    file = tmp_path / "table.csv"
    arguments = ["optics", "--case", "plate-1.05", "--peer", "none", "--runs", "16", "--seconds", "0.02"]
    done = CliRunner().invoke(peers, [*arguments, "--csv", str(file)], catch_exceptions=False)
    assert done.exit_code == 0
    with file.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert rows[0]["system"] == "taxel_tracer" and float(rows[0]["FoM"]) > 0
    assert "DISAGREES" not in done.output


@pytest.mark.parametrize("names", [(["plate-9"], []), ([], ["povray"])])
def test_a_name_that_is_not_known_is_refused(names):
    with pytest.raises(InputError, match="is not allowed: one of "):
        next(table(*names, 16, 0.02))
