"""Other assumptions of the measured pad, on made-up paths."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from mitsuba_taxel import Scene, measure
from mitsuba_taxel.reproduce import bench_pad, measured, pad_assumptions, pad_comparison
from mitsuba_taxel.reproduce.bench_pad import Assumed, Press
from mitsuba_taxel.reproduce.page_assumptions import assumptions_section
from mitsuba_taxel.reproduce.pad_fit import Found

GREY = Assumed("grey", walls=0.2)


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
    fit = Found(np.array([7.5, 1.05]), 0.5, 0.0, np.array([0.2, 0.05, 0.01]), 0.01, {})
    press = Press(7.5, "sphere", 1.05)
    taxels = {
        taxel: pad_comparison.compare(
            made_up(None, press.moved(*bench_pad.centre_of(taxel))), taxel, fit, pad_comparison.measured_curve(taxel)
        )
        for taxel in (13, 17)
    }
    offset = np.array([-0.3, 0.4])
    moved = pad_comparison.held_map(made_up(None, press.moved(*offset), (1.6,)))
    return SimpleNamespace(found=fit, fitted=press, taxels=taxels, offset=offset, moved=moved)


def test_a_taxel_that_changes_more_does_so_in_the_table(found, monkeypatch):
    monkeypatch.setattr(bench_pad, "path", made_up)
    monkeypatch.setattr(pad_assumptions, "OTHERS", {pad_assumptions.OFF: Assumed("off"), "grey walls": GREY})
    off, grey = pad_assumptions.tried(None, found).values()
    there, here = pad_assumptions.ratio(found)
    assert there == pytest.approx((0.3646 / 1.609) / (0.3401 / 1.915), rel=1e-3)
    assert (here, off.ratio, grey.ratio) == pytest.approx((1, 1, 1.2), rel=0.02)
    assert off.held is found.moved and grey.held[3, 1] == pytest.approx(1.2 * found.moved[3, 1], rel=0.02)
    text = " ".join(assumptions_section(found, {"grey walls": grey}).split())
    assert f"measured {there:.2f}" in text and "| grey walls |" in text and "nan" not in text
    assert "The nearest ratio is 1.20, of: grey walls." in text


def test_what_is_a_taxels_own_is_so_in_the_map(found):
    """Records of 13 and 17 at their forces, by least squares; a forced line through 0."""
    there, computed, expected = pad_assumptions.expected_at(found)
    assert there == 34 and computed == pytest.approx(found.moved[3, 1])
    one = pad_comparison.measured_curve(17)
    here = np.interp(one.force, *(getattr(pad_comparison.measured_curve(13), name) for name in ("force", "change")))
    assert expected / computed == pytest.approx(here @ one.change / (here @ here), rel=0.02)
    text = " ".join(assumptions_section(found, {"grey walls": SimpleNamespace(**made_entry(found))}).split())
    assert f"would make {expected:.0f} of {computed:.0f}; measured, 34" in text


def made_entry(found):
    return {"fitted": found.taxels[13], "predicted": found.taxels[17], "held": found.moved, "ratio": float("nan")}


def test_walls_reflect_and_collars_shade_no_roof(monkeypatch, tmp_path):
    """One cell at rest: grey walls send light back, and every line from the dies to the roof passes the collars."""
    monkeypatch.setattr(bench_pad, "SIDE", 1)
    monkeypatch.setattr(measured, "PAD_SIDE", 5.0)
    power = {}
    for assumed in (bench_pad.AS_FITTED, GREY, Assumed("free", collar=0.0)):
        bench_pad.write_scene(tmp_path / "pad.xml", assumed)
        defines = bench_pad.defines_of(Press(4.0, "sphere", 1.0), assumed)
        found = measure(Scene(tmp_path / "pad.xml", defines), points=64, mechanics_error=False)
        power[assumed.name] = found.power[0]
    assert 1.01 * power[""] < power["grey"] < 2 * power[""]
    assert power["free"] == pytest.approx(power[""], rel=1e-4)
