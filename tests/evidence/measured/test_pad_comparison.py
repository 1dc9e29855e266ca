"""The measured pad beside its model, on made-up paths, and one path of a single coarse cell."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from mitsuba_taxel.backend import activate_variant
from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.electronics import Circuit, respond
from mitsuba_taxel.evidence.measured import bench_pad, measured, pad_comparison
from mitsuba_taxel.evidence.measured.bench_pad import IndenterPress
from mitsuba_taxel.evidence.measured.pad_fit import FittedPad
from mitsuba_taxel.evidence.measured.page import pad as page_pad
from mitsuba_taxel.evidence.paper.paper_studies import PaperStudies
from mitsuba_taxel.mechanics import Indenter, IndenterDisplacement, NeoHookean, load_path, reactions
from mitsuba_taxel.pads import Pad


def made_up(x=0.0, y=0.0, end=""):
    """A path whose force is that of taxel 13 for 0.5 MPa, and whose changes fall off with the distance."""
    there = pad_comparison.measured_curve(13)
    travel = np.array([0.3, 0.6, 1.2, 1.7, 1.92])
    places = np.array([bench_pad.centre_of(taxel) for taxel in range(1, 26)])
    share = np.exp(-(((places - [x, y]) / 4.5) ** 2).sum(axis=1))
    change = np.interp(travel, there.travel, there.change)[:, None] * share
    force = np.interp(travel, there.travel, there.force) / 0.5
    each = {"force": force, "force_error": 0.01 * force}
    return xr.Dataset(
        {name: ("travel", values) for name, values in each.items()}
        | {"change": (("travel", "taxel"), change), "change_error": (("travel", "taxel"), 0.01 * change)},
        coords={"travel": travel, "taxel": np.arange(1, 26)},
        attrs={"end": end},
    )


FOUND = FittedPad(
    np.array([7.5, 1.05]), 0.5, 0.0, np.array([0.2, 0.05, 0.01]), 0.01, {(7.5, 1.05): 0.01, (8.0, 1.05): 0.05}
)


def test_taxels_lie_in_rows_from_the_upper_left():
    assert bench_pad.centre_of(1) == (-7.1, 7.1)
    assert bench_pad.centre_of(13) == (0, 0)
    assert bench_pad.centre_of(17) == (-3.55, -3.55)


@pytest.mark.parametrize("offset", [(0.0, 0.0), (-0.3, 0.4), (0.5, 0.1)])
def test_the_offset_is_found_from_the_asymmetry(offset):
    centred, there = (pad_comparison.held_map(made_up(*place)) for place in ((0, 0), offset))
    assert pad_comparison.offset_from(centred, there) == pytest.approx(offset, abs=0.05)


def test_a_curve_beside_the_measured_one():
    one = pad_comparison.compare(made_up(), 13, FOUND, pad_comparison.measured_curve(13))
    inside = one.measured.travel < 1.92
    assert np.abs(one.force_error[inside]).max() < 2
    assert np.abs(one.change_error[inside]).max() < 2
    assert np.isnan(one.force_error[~inside]).all()


def test_a_record_that_begins_late_is_compared_from_its_own_start():
    there = pad_comparison.measured_curve(13)
    one = pad_comparison.compare(made_up(), 13, FOUND._replace(late=0.1), there._replace(travel=there.travel - 0.1))
    inside = one.measured.travel < 1.82
    assert np.abs(one.force_error[inside]).max() < 2
    assert one.along.travel[0] == pytest.approx(-0.1) and FOUND._replace(late=0.079).travel(1.7) == 1.779


def test_voltages_of_the_pad_are_far_from_saturation():
    """So that relative changes of the voltage are those of the power."""
    circuit = Circuit(supply=measured.ADC_REFERENCE, load_resistance=measured.LOAD_RESISTANCE, transfer=1e-4)
    power = np.array([1.5, 3.0]) / (measured.LOAD_RESISTANCE * 1e-4)
    assert respond(circuit, power).voltage == pytest.approx([1.5, 3.0], rel=1e-3)


def test_the_section_says_what_was_fitted_and_what_misses(tmp_path):
    curve = pad_comparison.measured_curve(13)
    fitted = pad_comparison.compare(made_up(), 13, FOUND, curve)
    weak = pad_comparison.compare(made_up(end="the pad touches itself."), 13, FOUND._replace(modulus=0.4), curve)
    found = pad_comparison.PadComparison(
        FOUND,
        {13: fitted, 5: weak},
        np.array([-0.3, 0.4]),
        pad_comparison.held_map(made_up()),
        pad_comparison.held_map(made_up(-0.3, 0.4)),
        0.17,
        made_up(),
        made_up(),
        pad_comparison.NeighbourChange(8.0, 55.0, 0.14),
    )
    text = " ".join(page_pad.pad_section(found, tmp_path).split())
    for words in (
        "7.50 ± 0.20 mm",
        "0.5 MPa",
        "-0.30 mm along x",
        "**not within** the target of 10 %",
        "the pad touches itself",
        "paths reach a travel of 1.92 mm (taxel 13), 1.92 mm (taxel 5) from the first contact; why they end is said",
    ):
        assert words in text
    complete = " ".join(page_pad.pad_section(found._replace(taxels={13: fitted, 5: fitted}), tmp_path).split())
    assert "stable states up to the largest computed travels, 1.92 mm (taxel 13)" in complete
    assert "nan" not in text
    assert {file.name for file in tmp_path.iterdir()} == {"pressed.png", "map.png"}


@pytest.fixture
def one_cell(monkeypatch):
    for module, name, value in (
        (bench_pad, "SIDE", 1),
        (bench_pad, "MESH_SIZE", 3.0),
        (bench_pad, "POINTS", 64),
        (measured, "PAD_SIDE", 5.0),
    ):
        monkeypatch.setattr(module, name, value)


def test_a_path_has_the_force_of_its_board_for_any_modulus_and_is_kept(one_cell, tmp_path):
    press, asked = IndenterPress(4.0, "sphere", 2.0), []
    store = PaperStudies(tmp_path, asked.append)
    study = bench_pad.path(store, press, (0.2,))
    pad = Pad(rows=1, columns=1, wall=1.225, height=3.5, cell_height=0.55)
    load = IndenterDisplacement(Indenter("sphere", 2.0))
    (state,) = load_path(pad, NeoHookean(youngs_modulus=2.5), [(0, 0, -0.2)], load=load, mesh_size=3.0)
    assert 2.5 * study.force.item() == pytest.approx(reactions(state).force[2], rel=1e-6)
    assert 0 < study.change.item() < 1
    assert 0 < study.change_error.item() < 0.05 * study.change.item()
    assert bench_pad.path(PaperStudies(tmp_path), press, (0.2,)).equals(study)
    assert asked == ["pressed/sphere_2_on_4"]


def test_a_path_tells_why_it_ends(one_cell, tmp_path):
    study = bench_pad.path(PaperStudies(tmp_path, str), IndenterPress(2.0, "sphere", 2.0), (0.1, 1.4))
    assert study.travel.values.tolist() == [0.1]
    assert "path ends" in study.attrs["end"]
    with pytest.raises(ComputationError, match="path ends"):
        bench_pad.path(PaperStudies(tmp_path, str), IndenterPress(2.0, "sphere", 1.9), (1.4,))


@pytest.mark.parametrize(("x", "wall"), [(0.9, 1.275), (1.1, 0.975)])
def test_light_passes_the_windows_alone(one_cell, tmp_path, x, wall):
    """Towards ``x`` at the top of the collar it meets the wall of the cell, or that of the collar."""
    activate_variant()
    import mitsuba as mi

    bench_pad.write_scene(tmp_path / "pad.xml")
    scene = mi.load_file(str(tmp_path / "pad.xml"))
    way = np.array([x, 0.0, measured.COLLAR_HEIGHT]) / np.hypot(x, measured.COLLAR_HEIGHT)
    start = mi.Point3f(0, 0, -measured.COLLAR_HEIGHT + 1e-3)
    found = scene.ray_intersect(mi.Ray3f(start, mi.Vector3f(*way.tolist())))
    assert np.array(found.p).ravel()[0] == pytest.approx(wall, abs=1e-4)
