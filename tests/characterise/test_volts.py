"""What a circuit shows along a line of load, where power goes linearly with the force."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas
import pytest
import xarray as xr

from mitsuba_taxel import Circuit
from mitsuba_taxel.characterise import characteristics, experiments, simulated_experiments, volts_notes, volts_table
from mitsuba_taxel.characterise.wording import remarks_explained, table_rows
from mitsuba_taxel.electronics import in_volts, power_at, saturating_power, total_noise

pytestmark = pytest.mark.quick

CIRCUIT = Circuit(supply=3.3, load_resistance=22e3, transfer=8.0, saturation_voltage=0.1)
FORCES = np.linspace(0, -10, 21)


@pytest.fixture
def study():
    """Three taxels: one far from saturation, one that saturates on the way, one that does so at rest."""
    power = np.array([1e-6, 1e-5, 1e-3]) + np.array([2e-7, 4e-6, 1e-6]) * -FORCES[:, None]
    samples = np.repeat(power[:, None], 32, axis=1)
    data = {
        "replicate_power": (("fz", "replicate", "taxel"), samples, {"units": "W"}),
        "power": (("fz", "taxel"), power),
    }
    return xr.Dataset(data, {"fz": FORCES, "taxel": [1, 2, 3]}, {"curve": "fz", "notes": ""})


def test_closed_forms(study):
    table = volts_table(study, CIRCUIT).set_index("taxel")
    slope = 22e3 * 8 * 2e-7
    assert table.mean_slope_V_per_N[1] == pytest.approx(-slope) and table.rest_V[1] == pytest.approx(0.176)
    assert table.mean_slope_counts_per_N[1] == pytest.approx(-slope / (3.3 / 4096)) and table.rest_counts[1] == 218
    noise = total_noise(CIRCUIT, 1e-6)
    assert table.noise_V[1] == pytest.approx(noise)
    assert table.noise_force_N[1] == pytest.approx(noise / slope, rel=1e-3)
    limit = power_at(CIRCUIT, CIRCUIT.limit)
    assert np.isnan(table.saturation_N[1]) and table.saturation_N[3] == 0
    assert table.saturation_N[2] == pytest.approx(-(limit - 1e-5) / 4e-6, rel=1e-6)
    assert table.least_noise_force_N[2] < table.noise_force_N[3]


def test_no_slope_and_no_force_of_a_saturated_converter(study):
    """A full scale of 0.5 V lies below the second and third taxel at rest; the step of 12 bits hides the noise."""
    cut = replace(CIRCUIT, adc_reference=0.5)
    table = volts_table(study, cut).set_index("taxel")
    assert table.rest_V.tolist() == pytest.approx([0.176, 0.5, 0.5]) and table.rest_counts[2] == 4095
    assert (table.mean_slope_counts_per_N[[2, 3]] == 0).all() and np.isfinite(table.noise_force_N[1])
    assert np.isinf(table.noise_force_N[[2, 3]]).all() and np.isinf(table.least_noise_force_N[[2, 3]]).all()
    saturated, fine = volts_notes(table.reset_index(), cut)
    assert saturated.startswith(
        "Saturated (output of 0.5 V or more; full scale 0.5 V): taxel 1 from -9.205 N on, taxel 2"
    )
    assert "taxel 2 at rest, taxel 3 at rest" in saturated and "half of its step of 0.0001221 V" in fine
    noisy = replace(CIRCUIT, other_noise=1e-2)
    assert volts_notes(volts_table(study.isel(taxel=[0]), noisy), noisy) == []
    assert len(volts_notes(volts_table(study, noisy), noisy)) == 1 and volts_notes(table, None) == []


@pytest.mark.parametrize(
    ("load", "said"),
    [
        (22e3, []),  # 218 counts at rest, 655 under load
        (2.2e3, ["The largest reading is 65 of 4096 counts; load_resistance = 67000 would use half of the range."]),
        (220, ["The largest reading is 6 of 4096 counts", "from the least force to the largest: 4 at most."]),
        (0, ["The largest reading is 0 of 4096 counts.", "from the least force to the largest: 0 at most."]),
    ],
)
def test_a_converter_that_is_hardly_used_is_remarked(study, load, said):
    """With the load that uses half of it."""
    circuit = replace(CIRCUIT, load_resistance=float(load), other_noise=1e-2)
    notes = volts_notes(volts_table(study.isel(taxel=[0]), circuit), circuit)
    assert len(notes) == len(said) and all(words in note for words, note in zip(said, notes, strict=True))
    if load == 2.2e3:
        better = replace(circuit, load_resistance=67e3)
        table = volts_table(study.isel(taxel=[0]), better)
        assert (table.rest_counts + table.signal_counts).item() == pytest.approx(0.5 * 4096 * 3.2 / 3.3, rel=0.02)


def test_of_a_run_through_zero_neighbouring_forces_count(study):
    """The light of one taxel is linear, that of the other changes on one side of zero alone."""
    force = np.array([-2.0, -1.0, 0.0, 1.0, 2.0])
    power = np.array([1e-6, 1e-5]) + np.array([2e-7, 3e-5]) * force[:, None]
    power[0, 1], power[1, 1] = 1e-5, 1e-5
    samples = np.repeat(power[:, None], 32, axis=1)
    coords = {"fx": force, "taxel": [1, 2]}
    both = xr.Dataset({"replicate_power": (("fx", "replicate", "taxel"), samples)}, coords, study.attrs)
    table = volts_table(both, CIRCUIT).set_index("taxel")
    assert table.rest_V[1] == pytest.approx(0.176)
    assert table.noise_force_N[1] == pytest.approx(total_noise(CIRCUIT, 1e-6) / (22e3 * 8 * 2e-7), rel=1e-3)
    limit = saturating_power(CIRCUIT)
    assert np.isnan(table.saturation_N[1]) and np.isinf(table.noise_force_N[2])
    assert table.saturation_N[2] == pytest.approx((limit - 1e-5) / 3e-5)


def test_only_forces_up_to_a_limit(study):
    near = volts_table(study, CIRCUIT, up_to=5).set_index("taxel")
    expected = volts_table(study.sel(fz=slice(0, -5)), CIRCUIT).set_index("taxel")
    pandas.testing.assert_frame_equal(near, expected)
    assert np.isnan(near.saturation_N[1]) and len(volts_table(study, CIRCUIT, up_to=0.1)) == 0


def test_saturated_variants_are_named_by_what_distinguishes_them(study):
    """All were `taxel 3 at rest`."""
    both = xr.concat([study, study], pandas.Index([0.8, 0.9], name="spacing"))
    (saturated, *_) = volts_notes(volts_table(both, CIRCUIT), CIRCUIT)
    assert "taxel 3 of spacing = 0.8 at rest" in saturated and "taxel 3 of spacing = 0.9 at rest" in saturated


def test_a_reading_that_does_not_change_is_no_slope_below_its_error(study):
    """The remark was `not resolved: smaller than its standard error`, of 0 V/N with an error of 0."""
    table = characteristics(experiments(in_volts(study, replace(CIRCUIT, adc_reference=0.1))))
    slopes = table[table.figure == "mean_slope"]
    assert slopes.remark.tolist() == ["no change"] * 3
    assert "the same at all forces" in remarks_explained(table)[0]
    headings, rows = table_rows(table, ["mean_slope"])
    assert [row[-1] for row in rows] == ["no change"] * 3


def test_experiments_come_in_watts_and_volts(study):
    both = simulated_experiments(study, CIRCUIT).experiments
    assert [(one.unit, one.where) for one in both] == [("W", {"reading": "W"}), ("V", {"reading": "V"})]
    (alone,) = experiments(in_volts(study, CIRCUIT))
    np.testing.assert_array_equal(both[1].runs[0].samples, alone.runs[0].samples)


def test_studies_of_several_scenes(study):
    table = volts_table(xr.DataTree.from_dict({"flat": study, "round": study}), CIRCUIT)
    assert list(table.scene.unique()) == ["flat", "round"] and len(table) == 6
    assert len(volts_table(study.isel(fz=[0]), CIRCUIT)) == 0
