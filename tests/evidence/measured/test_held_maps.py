"""Maps of held taxels: places of indenters found in made maps, and what the page says."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from mitsuba_taxel.evidence.measured import bench_pad, held_maps, measured
from mitsuba_taxel.evidence.measured.held_maps import ComputedMap, HeldMapComparison, place_of, rms
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
@pytest.mark.parametrize("start", [(0.0, 0.0), (-0.2, 0.3)])
def test_the_place_of_an_indenter_is_found_in_a_map(taxel, place, start):
    computed, there = (relative(made(taxel, np.array(at)), taxel) for at in (start, place))
    found = place_of(computed, there, taxel, np.array(start))
    np.testing.assert_allclose(found, place, atol=0.03)


def made_path(places):
    """Changes that grow with the travel, for an indenter beside taxel 17; places are recorded."""

    def pressed_at(place, travel):
        places.append((*place, travel))
        travels = np.array([travel])
        changes = travels[:, None] / 1.1 * made(17, place, 2.0)
        data = {"force": ("travel", 5 * travels), "change": (("travel", "taxel"), changes)}
        return xr.Dataset(data, coords={"travel": travels})

    return pressed_at


def test_a_held_taxel_is_compared_at_its_place_and_at_the_travel_from_the_first_contact(monkeypatch):
    """Half of the computed changes of made paths are measured, around all of the pad."""
    taxel, place = 17, np.array([0.2, 0.4])
    record = measured.HELD_PRESSES[taxel]._replace(
        travel=1.0, force=3.0, change=float(made(taxel, place)[16]),
        changes=tuple(map(tuple, relative(made(taxel, place), taxel))),
    )  # fmt: skip
    monkeypatch.setattr(measured, "HELD_PRESSES", {taxel: record})
    places = []
    path = xr.concat([made_path([])(np.zeros(2), travel) for travel in (0.4, 0.8, 1.1, 1.6)], "travel")
    found = FittedPad(np.array([8.0, 1.0]), 0.5, 0.1, np.zeros(3), 0.0, {})
    compared = held_maps.held_map(found, taxel, path, made_path(places))
    assert compared.computed.force == pytest.approx(0.5 * 5 * 1.1)
    np.testing.assert_allclose(compared.place, place, atol=0.03)
    assert places == [(*compared.place, 1.1)]  # the place of its map is the same
    assert compared.ratio[3, 1] == pytest.approx(0.5, rel=0.01) and np.isnan(compared.ratio[0, 4])
    np.testing.assert_allclose(compared.placed, compared.measured, atol=1)

    text = " ".join(maps_section([compared], {17: 1.3, 5: 1.0}).split())
    assert f"{compared.place[0]:+.2f} mm along x and {compared.place[1]:+.2f} mm along y" in text
    assert "the map of taxel 17 is within the target" in text
    assert "the computed force differs by -8 %" in text


def test_the_place_is_corrected_once_and_the_better_map_is_kept(monkeypatch):
    """The changes of this pad fall off less around the indenter's place than around the middle."""
    taxel = 17
    record = measured.HELD_PRESSES[taxel]._replace(
        travel=1.0, changes=tuple(map(tuple, relative(made(taxel, np.array([0.3, 0.6])), taxel)))
    )
    monkeypatch.setattr(measured, "HELD_PRESSES", {taxel: record})
    places = []
    steep = made_path([])(np.zeros(2), 1.1)
    steep = steep.assign(change=steep.change * np.exp(-0.3 * np.square(SITES - SITES[16]).sum(axis=1) / 12.6))
    path = xr.concat([steep.assign_coords(travel=[t]) * t for t in (0.5, 1.1, 1.5)], "travel")
    found = FittedPad(np.array([8.0, 1.0]), 0.5, 0.1, np.zeros(3), 0.0, {})
    compared = held_maps.held_map(found, taxel, path, made_path(places))
    assert len(places) == held_maps.MOST_PLACES
    errors = [np.hypot(x - 0.3, y - 0.6) for x, y, _ in places]
    assert errors[1] < 0.03 < errors[0]
    np.testing.assert_allclose(compared.place, places[1][:2])


def test_the_middle_is_the_place_if_no_other_map_is_closer(monkeypatch):
    """Finite elements at the place that the maps suggest give a map that is further from the measured one."""
    taxel, path = 17, xr.concat([made_path([])(np.zeros(2), travel) for travel in (0.5, 1.1, 1.5)], "travel")
    record = measured.HELD_PRESSES[taxel]._replace(
        travel=1.0, changes=tuple(map(tuple, relative(made(taxel, np.array([0.2, 0.4])), taxel)))
    )
    monkeypatch.setattr(measured, "HELD_PRESSES", {taxel: record})
    found = FittedPad(np.array([8.0, 1.0]), 0.5, 0.1, np.zeros(3), 0.0, {})
    opposite = made_path([])
    compared = held_maps.held_map(found, taxel, path, lambda place, travel: opposite(-4 * place, travel))
    np.testing.assert_array_equal(compared.place, 0.0)
    np.testing.assert_allclose(compared.placed, compared.centred)


@pytest.mark.parametrize(
    ("share", "words"),
    [
        (1.3, "points asks for less than the taxels' own spread"),
        (1.05, "more than the target of 3 points in 0 of 1 maps"),
    ],
)
def test_whether_the_target_is_below_the_spread_is_computed(share, words):
    middle = relative(made(13, np.zeros(2)), 13)
    same = HeldMapComparison(13, np.zeros(2), ComputedMap(1.0, made(13, np.zeros(2))), middle + 1, middle)
    assert words in " ".join(maps_section([same], {13: 1.0, 17: share}).split())


def test_the_spread_of_the_taxels_is_beside_the_target():
    middle = relative(made(13, np.zeros(2)), 13)
    off = middle.copy()
    off[3, 1] *= 1.3  # taxel 17
    same = HeldMapComparison(13, np.zeros(2), ComputedMap(1.0, made(13, np.zeros(2))), off, middle)
    text = " ".join(maps_section([same], {13: 1.0, 17: 1.3}).split())
    deviation = np.hypot(np.log(1.3) * middle, np.sqrt(1 / 12))
    deviation[2, 2] = 0
    assert f"an rms of {rms(deviation):.1f} points in these maps" in text
    assert "the map of taxel 13 has an rms of 0.0 points" in text
    assert f"| 13 | fitted | {rms(off - middle):.1f} | {middle[3, 1] - off[3, 1]:+.1f}, row 4, column 2 |" in text


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
