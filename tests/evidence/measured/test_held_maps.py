"""Maps of held taxels: places of indenters found in made maps, and what the page says."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from mitsuba_taxel.evidence.measured import bench_pad, held_maps, measured
from mitsuba_taxel.evidence.measured.held_maps import HeldMapComparison, place_of, rms
from mitsuba_taxel.evidence.measured.pad_fit import FittedPad
from mitsuba_taxel.evidence.measured.page.held_maps import maps_section

SITES = np.array([bench_pad.centre_of(number) for number in range(1, 26)])


def made(taxel, place, gain=1.0):
    """Changes (25,) that fall with the distance from an indenter beside a taxel; each taxel has its own share."""
    squared = np.square((SITES - SITES[taxel - 1] - place) / measured.PITCH).sum(axis=1)
    shares = 1 + 0.03 * np.cos(np.arange(25.0))
    return 0.15 * gain * shares * np.exp(-0.66 * squared + 0.02 * squared**2) * (squared < 9)


def relative(changes, taxel):
    return 100 * (changes / changes[taxel - 1]).reshape(5, 5)


@pytest.mark.parametrize(
    ("taxel", "place"), [(13, (-0.28, 0.55)), (17, (0.2, 0.4)), (5, (-0.3, 0.25)), (5, (0.0, 0.0))]
)
def test_the_place_of_an_indenter_is_found_in_a_map(taxel, place):
    centred, there = (relative(made(taxel, at), taxel) for at in (np.zeros(2), np.array(place)))
    found, shifted = place_of(centred, there, taxel)
    np.testing.assert_allclose(found, place, atol=0.03)
    assert rms(shifted - there) < 0.6 and rms(shifted - there) <= rms(centred - there)


def test_a_held_taxel_is_compared_at_the_travel_from_the_first_contact(monkeypatch):
    """Half of the computed changes of made paths are measured, around all of the pad."""
    taxel, place = 17, np.array([0.2, 0.4])
    record = measured.HELD_PRESSES[taxel]._replace(
        travel=1.0, force=3.0, change=float(made(taxel, place)[16]),
        changes=tuple(map(tuple, relative(made(taxel, place), taxel))),
    )  # fmt: skip
    monkeypatch.setattr(measured, "HELD_PRESSES", {taxel: record})
    travels = np.array([0.4, 0.8, 1.1, 1.6])
    changes = travels[:, None] / 1.1 * made(17, 0.0, 2.0)
    path = xr.Dataset(
        {"force": ("travel", 5 * travels), "change": (("travel", "taxel"), changes)}, coords={"travel": travels}
    )
    found = FittedPad(np.array([8.0, 1.0]), 0.5, 0.1, np.zeros(3), 0.0, {})
    compared = held_maps.held_map(found, taxel, path)
    assert compared.computed.force == pytest.approx(0.5 * 5 * 1.1)
    np.testing.assert_allclose(compared.place, place, atol=0.03)
    expected = made(17, place)[16] / made(17, 0.0, 2.0)[16]
    assert compared.ratio[3, 1] == pytest.approx(expected) and np.isnan(compared.ratio[0, 4])
    np.testing.assert_allclose(compared.shifted, compared.measured, atol=2)

    text = " ".join(maps_section([compared], np.array(measured.HELD_MAP) + 2.0).split())
    assert f"{compared.place[0]:+.2f} mm along x and {compared.place[1]:+.2f} mm along y" in text
    assert "17 are within the target" in text
    assert "| 13 | fitted, see above | 2.0 | +2.0, row 1, column 1 |" in text
    assert "the force is -8 % off" in text


def test_records_of_held_taxels_are_maps_in_percent_of_their_own_change():
    for taxel, record in measured.HELD_PRESSES.items():
        values = np.array(record.changes, dtype=float)
        assert values.shape == (5, 5) and values.ravel()[taxel - 1] == 100 and values.max() == 100
        assert isinstance(record, measured.HeldPress) and 0 < record.change < 0.2


def test_root_mean_square_leaves_the_held_taxel_out():
    difference = np.full((5, 5), 2.0)
    difference[2, 2] = 0.0
    assert rms(difference) == pytest.approx(2.0)
    assert HeldMapComparison._fields[0] == "taxel"
