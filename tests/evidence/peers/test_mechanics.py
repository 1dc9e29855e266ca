"""What takes the time of the mechanics."""

from __future__ import annotations

import pytest

from mitsuba_taxel import ComputationError
from mitsuba_taxel.evidence.peers import calculix
from mitsuba_taxel.evidence.peers import mechanics as module
from mitsuba_taxel.evidence.peers.mechanics import NORMAL, TABLES, _parts
from mitsuba_taxel.mechanics.elements.solvers import Rslab, available_solvers
from mitsuba_taxel.pads import Pad


def test_parts_of_the_time_are_less_than_the_whole(tmp_path, monkeypatch):
    monkeypatch.setenv("MITSUBA_TAXEL_CACHE", str(tmp_path))
    factor = Rslab.factor
    total, factors, checks, second = _parts(Pad(rows=1, columns=1, wall=0.93), NORMAL[:3])
    assert 0 < factors < total and 0 < checks < total and 0 < second < total
    assert Rslab.factor is factor and "parts" in TABLES


def test_solvers_at_hand_are_compared(monkeypatch):
    """On one cell; in this process."""
    monkeypatch.setattr(module, "CELL_SHAPES", ("parallelepiped",))
    monkeypatch.setattr(module, "Pad", lambda cell: Pad(cell, 1, 1))
    monkeypatch.setattr(module, "_isolated", lambda function, *arguments: (*function(*arguments), 100.0))
    _, *rows = TABLES["solvers"]()
    assert [row[1] for row in rows] == available_solvers() and rows[0][4] == "1.0"
    assert all(float(row[5]) < 1e-8 for row in rows)


@pytest.mark.skipif(not calculix.installed(), reason="CalculiX is not installed")
def test_solvers_of_calculix_solve_the_pad_that_this_package_solves(monkeypatch):
    """One cell of large elements, in this process. Solvers of CalculiX agree with each other. Its element without
    pressures is stiffer than that of this package, by some 3 % on this mesh."""
    monkeypatch.setattr(module, "Pad", lambda rows, columns: Pad("hemispheric", rows, columns))
    monkeypatch.setattr(module, "_isolated", lambda function, *arguments: (*function(*arguments), 100.0))
    ours, whole, direct, *iterative = module._compared_programs(1)
    assert [row[1] for row in (direct, *iterative)] == [f"normal: ccx, {name.lower()}" for name in calculix.SOLVERS]
    assert float(ours[5]) == pytest.approx(float(whole[5]), rel=1e-5)  # six digits are printed
    assert 0.95 < float(direct[5]) / float(ours[5]) < 1
    for row in iterative:
        assert float(row[5]) == pytest.approx(float(direct[5]), rel=1e-4)

    # A solution that takes too long is a row with this reason.
    monkeypatch.setattr(module, "PEER_SECONDS", 1e-3)
    assert [row[2] for row in module._compared_programs(1)][2:] == ["ccx did not end within 0.001 s."] * 3


@pytest.mark.skipif(not calculix.installed(), reason="CalculiX is not installed")
def test_a_solution_by_calculix_that_takes_too_long_is_refused():
    with pytest.raises(ComputationError, match="within 0.001 s"):
        calculix.solve(Pad(rows=1, columns=1).mesh(2.0), module.MATERIAL, (0, 0, -1), seconds=1e-3)
