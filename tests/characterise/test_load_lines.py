"""Runs of load that a study holds, and what becomes of readings that are missing."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from mitsuba_taxel import InputError
from mitsuba_taxel.characterise import characteristics, experiments, sensitivity, sensitivity_table

REPLICATES = 4


def path(power, **listed) -> xr.Dataset:
    """A study along ``step``: readings (steps,), and what is listed along it."""
    samples = np.asarray(power)[:, None, None] + np.zeros((1, REPLICATES, 2))
    coords = {name: ("step", values) for name, values in listed.items()}
    dims = ["step", "replicate", "taxel"]
    return xr.Dataset(
        {"replicate_power": (dims, samples)}, coords={"step": range(len(power)), **coords, "taxel": [1, 2]}
    )


def test_one_force_that_changes_along_steps():
    fx = np.array([0, -1, -2.5, -6])
    study = path(3 * fx - fx**2, fx=fx, fz=np.full(4, -8.0))
    for name in ("fx", "step"):
        found = sensitivity(study, name)
        np.testing.assert_allclose(found.zero_slope, 3)
        np.testing.assert_allclose(found.mean_slope, 3 + 6)
    table = sensitivity_table(study)
    assert list(table.force) == ["fx", "fx"] and list(table.columns[:3]) == ["force", "fz", "taxel"]
    assert set(table.fz) == {-8.0}
    with pytest.raises(InputError, match="fz"):
        sensitivity(study, "fz")


@pytest.mark.parametrize(
    "ratio, name", [(1.0, "0.707 fx + 0.707 fy"), (-1.0, "0.707 fx - 0.707 fy"), (0.75, "0.8 fx + 0.6 fy")]
)
def test_a_diagonal_force_is_given_by_its_resultant(ratio, name):
    """Also where its components are rounded, as they are written in a file."""
    fx = np.linspace(0, -5.657, 9).round(3)
    resultant = fx * np.hypot(1, ratio)
    (found,) = experiments(path(2 * resultant, fx=fx, fy=(ratio * fx).round(3), fz=np.full(9, -8.0)))
    assert found.force == name and found.where == {"fz": -8.0}
    np.testing.assert_allclose(found.direction, np.array([1, ratio, 0]) / np.hypot(1, ratio), atol=1e-3)
    np.testing.assert_allclose(found.runs[0].force, resultant, atol=1e-3)
    np.testing.assert_allclose(characteristics([found]).query("figure == 'mean_slope'").value, 2, rtol=1e-3)


def test_a_path_there_and_back_is_one_experiment_and_one_that_bends_is_two():
    fz = np.array([0, -4, -8, -8, -8, -8, -8])
    fx = np.array([0, 0, 0, 1, 2, 1, 0.0])
    normal, tangential = experiments(path(fx - fz, fx=fx, fz=fz))
    assert (normal.force, normal.where) == ("fz", {"fx": 0.0}) and len(normal.runs) == 1
    assert (tangential.force, tangential.where) == ("fx", {"fz": -8}) and len(tangential.runs) == 2
    assert [branch.loading for branch in tangential.branches] == [True, False]
    assert len(sensitivity_table(path(fx - fz, fx=fx, fz=fz))) == 4
    with pytest.raises(InputError, match="2 series of loads"):
        sensitivity(path(fx - fz, fx=fx, fz=fz), "step")


def test_runs_end_where_another_parameter_changes():
    cells = ["a", "a", "a", "b", "b", "b"]
    both = experiments(path(np.arange(6.0), fz=[0, -1, -2, -3, -4, -5], cell=cells))
    assert [one.where["cell"] for one in both] == ["a", "b"] and [len(one.runs[0].force) for one in both] == [3, 3]


def test_forces_without_order_are_no_run():
    forces = np.random.default_rng(1).normal(size=(30, 3))
    assert experiments(path(forces[:, 0], fx=forces[:, 0], fy=forces[:, 1], fz=forces[:, 2])) == []
    assert len(sensitivity_table(path(np.arange(4.0), fz=[-1.0, -1, -1, -1]))) == 0


def product(fz, cells=("a", "b")) -> xr.Dataset:
    """A study over cells and forces, 7 per cent of its readings being noise that scenes share."""
    noise = np.random.default_rng(1).normal(size=(1, 1, 32, 3)) * 1e-5
    slope = np.array([1.0, 2.0])[: len(cells), None, None, None]
    power = 1e-3 - 1e-4 * slope * np.asarray(fz)[:, None, None] + noise
    coords = {"cell": list(cells), "fz": fz, "taxel": [1, 2, 3]}
    return xr.Dataset({"replicate_power": (["cell", "fz", "replicate", "taxel"], power)}, coords=coords)


def test_missing_readings_are_left_out():
    fz = np.array([0.0, -1, -2, -4, -8])
    study = product(fz)
    study.replicate_power[1, 2] = np.nan
    found = sensitivity(study, "fz")
    xr.testing.assert_allclose(found.isel(cell=0), sensitivity(product(fz), "fz").isel(cell=0))
    xr.testing.assert_allclose(found.isel(cell=1), sensitivity(product(np.delete(fz, 2)), "fz").isel(cell=1))


def test_a_curve_without_readings_has_slopes_that_are_not_a_number():
    study = product(np.array([0.0, -1, -2]))
    study.replicate_power[0] = np.nan
    table = sensitivity_table(study)
    assert table[table.cell == "a"].mean_slope_W_per_N.isna().all() and len(table) == 6
    np.testing.assert_allclose(table[table.cell == "b"].mean_slope_W_per_N, -2e-4)
    assert [one.where["cell"] for one in experiments(study)] == ["b"]


def test_scenes_of_a_tree_are_told_apart():
    tree = xr.DataTree.from_dict({name: product(np.array([0.0, -1, -2]), ("a",)) for name in ("flat", "round")})
    both = experiments(tree)
    assert [one.where for one in both] == [{"scene": "flat", "cell": "a"}, {"scene": "round", "cell": "a"}]


def test_changes_are_since_zero_force_on_either_side():
    force = np.array([-2.0, -1, 0, 1, 2, 3])
    study = path(5 + force**2, f=force).swap_dims(step="f").rename(f="fx")
    (one,) = experiments(study)
    assert [list(part.force) for part in one.branches] == [[0, -1, -2], [0, 1, 2, 3]]
    np.testing.assert_allclose(one.branches[1].value[:, 0], [0, 1, 4, 9])
    table = characteristics([one])
    assert list(table[table.figure == "nonlinearity"].loading) == [1, 1, 2, 2]
    np.testing.assert_allclose(table[table.figure == "zero_slope"].value, 0, atol=1e-12)
