"""A plate that tilts on a cell beside CalculiX: both agree, also where the motion is given."""

from __future__ import annotations

import csv
import shutil

import pytest
from click.testing import CliRunner
from taxel_cli.evidence.bench_peers import peers

pytestmark = pytest.mark.skipif(shutil.which("ccx") is None, reason="ccx is not installed")


@pytest.mark.parametrize(("tilt", "degrees"), [("small", 1.8), ("large", 14.4)])
def test_rotation_force_and_moment_agree_with_the_peer(tmp_path, tilt, degrees):
    """The program's quadratic element has displacements alone, and is a little stiffer than ours."""
    file = tmp_path / "table.csv"
    arguments = ["plate", "--mesh-size", "1.6", "--tilt", tilt, "--csv", str(file)]
    assert CliRunner().invoke(peers, arguments, catch_exceptions=False).exit_code == 0
    with file.open(newline="") as stream:
        (row,) = csv.DictReader(stream)
    assert float(row["degrees"]) == pytest.approx(degrees, rel=0.1)
    off = {name: float(number.rstrip("%")) for name, number in row.items() if name.endswith("difference")}
    assert off["rotation difference"] < 1
    assert off["force difference"] < 0.5
    assert off["moment difference"] < 1
