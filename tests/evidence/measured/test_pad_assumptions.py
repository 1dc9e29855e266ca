"""Other assumptions of the measured pad, on made-up paths."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from mitsuba_taxel import Scene, measure
from mitsuba_taxel.evidence.measured import bench_pad, measured, pad_assumptions, pad_comparison
from mitsuba_taxel.evidence.measured.bench_pad import IndenterPress, PadAssumptions
from mitsuba_taxel.evidence.measured.pad_fit import FittedPad
from mitsuba_taxel.evidence.measured.page.assumptions import assumptions_section

GREY = PadAssumptions("grey", walls=0.2)


def made_up(store, press, travels=bench_pad.TRAVELS, assumed=bench_pad.AS_FITTED):
    """Forces and changes of taxel 13, for 0.5 MPa, whatever is pressed; of a grey one, 17 changes by 1.2 times that."""
    there = pad_comparison.measured_curve(13)
    travel = np.array(travels)
    change = np.interp(travel, there.travel, there.change)
    place = np.array([bench_pad.centre_of(taxel) for taxel in range(1, 26)])
    near = np.exp(-(((place - [press.x, press.y]) / 4.5) ** 2).sum(axis=1))
    own = np.where((np.arange(25) == 16) & (assumed == GREY), 1.2, 1.0)
    return xr.Dataset(
        {
            "force": ("travel", np.interp(travel, there.travel, there.force) / 0.5),
            "change": (("travel", "taxel"), change[:, None] * near * own),
        },
        coords={"travel": travel, "taxel": np.arange(1, 26)},
        attrs={"end": ""},
    )


@pytest.fixture
def found():
    """What the fit assumes: all taxels change alike when they are pressed."""
    fit = FittedPad(np.array([7.5, 1.05]), 0.5, 0.0, np.array([0.2, 0.05, 0.01]), 0.01, {})
    press = IndenterPress(7.5, "sphere", 1.05)
    taxels = {
        taxel: pad_comparison.compare(
            made_up(None, press.moved(*bench_pad.centre_of(taxel))), taxel, fit, pad_comparison.measured_curve(taxel)
        )
        for taxel in (13, 17)
    }
    moved = pad_comparison.held_map(made_up(None, press.moved(-0.3, 0.4), (1.6,)))
    centred = pad_comparison.held_map(made_up(None, press))
    return SimpleNamespace(found=fit, fitted=press, taxels=taxels, moved=moved, centred=centred)


def test_a_pad_that_spreads_more_does_so_in_the_table(found, monkeypatch):
    monkeypatch.setattr(bench_pad, "path", made_up)
    monkeypatch.setattr(pad_assumptions, "OTHERS", {"grey walls": GREY})
    (grey,) = pad_assumptions.tried(None, found).values()
    steps = np.array([1.0, 2.0, 4.0, 5.0, 8.0]) * (measured.PITCH / 4.5) ** 2
    assert pad_assumptions.rings(found.centred) == pytest.approx(100 * np.exp(-steps))
    assert grey.rings == pytest.approx(100 * np.exp(-steps) * [1, 1.05, 1, 1, 1])
    assert np.nanmax(np.abs(grey.fitted.change_error)) < 1
    text = assumptions_section(found, {"grey walls": grey})
    assert "| measured |  |  | 55.0 | 31.0 |" in text and "| grey walls | " in text and "nan" not in text


def test_what_is_a_taxels_own_is_so_in_the_map(found):
    """Records of 13 and 17 at their forces, by least squares; a forced line through 0."""
    there, computed, expected = pad_assumptions.expected_at(found)
    assert there == 34 and computed == pytest.approx(found.moved[3, 1])
    one = pad_comparison.measured_curve(17)
    here = np.interp(one.force, *(getattr(pad_comparison.measured_curve(13), name) for name in ("force", "change")))
    assert expected / computed == pytest.approx(here @ one.change / (here @ here), rel=0.02)
    text = " ".join(assumptions_section(found, {}).split())
    nearer = abs(expected - 34) < abs(computed - 34)
    assert (f"change of {computed:.0f} into {expected:.0f}, and 34 was measured" in text) == nearer
    assert ("but not so in the map" in text) != nearer


def test_walls_reflect_and_collars_shade_no_roof(monkeypatch, tmp_path):
    """One cell at rest: grey walls send light back, and every line from the dies to the roof passes the collars."""
    monkeypatch.setattr(bench_pad, "SIDE", 1)
    monkeypatch.setattr(measured, "PAD_SIDE", 5.0)
    power = {}
    for assumed in (bench_pad.AS_FITTED, GREY, PadAssumptions("free", collar=0.0)):
        bench_pad.write_scene(tmp_path / "pad.xml", assumed)
        defines = bench_pad.defines_of(IndenterPress(4.0, "sphere", 1.0), assumed)
        found = measure(Scene(tmp_path / "pad.xml", defines), points=64, mechanics_error=False)
        power[assumed.name] = found.power[0]
    assert 1.01 * power[""] < power["grey"] < 2 * power[""]
    assert power["free"] == pytest.approx(power[""], rel=1e-4)
