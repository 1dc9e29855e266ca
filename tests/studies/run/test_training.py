"""Training sets: right readings beside right forces, noise as asked, no force in two parts, and a true datasheet."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from scipy import stats

from mitsuba_taxel import Circuit, InputError
from mitsuba_taxel.electronics import respond, total_noise, with_volts
from mitsuba_taxel.studies.run.training import PARTS, training_set

FORCE = ["fx_N", "fy_N", "fz_N"]
POWER = [f"power_{taxel}_W" for taxel in range(1, 10)]
ERROR = [f"standard_error_{taxel}_W" for taxel in range(1, 10)]
SLOPES = np.linspace(0.01, 0.09, 9)
CELLS = {"parallelepiped": 1.0, "hemispheric": 2.0}
ALARM = 1e-4
"""Chance that a statistical check fails although all is well."""


def reading(fx, fy, fz, cell):
    """Closed form of the made-up readings, in W."""
    return CELLS[cell] * (1 + SLOPES * fz + 0.001 * fx + 0.0001 * fy)


def attributes(**parameters):
    return {
        "scene": "pad.xml",
        "parameters": json.dumps({name: str(value) for name, value in parameters.items()}),
        "units": json.dumps({"poisson_ratio": "1", "youngs_modulus": "MPa"}),
        "versions": json.dumps({"mitsuba": "3.9.0"}),
        "seed": 7,
        "points": 64,
        "notes": "mechanics: error of the roofs 0.001 mm",
    }


def dataset(dims, coords, power, **fixed):
    """A study with a standard error of a thousandth of each reading."""
    return xr.Dataset(
        {
            "power": ([*dims, "taxel"], power),
            "standard_error": ([*dims, "taxel"], 0.001 * power),
            "seconds": ([*dims, "stage"], np.ones((*power.shape[:-1], 2))),
        },
        coords={**coords, "taxel": np.arange(1, 10), "stage": ["mechanics", "optics"]},
        attrs=attributes(**fixed),
    )


def product(fz=41, cells=tuple(CELLS)):
    """A product of fz and cell, with fx and fy fixed."""
    values = -0.5 * np.arange(fz)
    power = np.array([[reading(3, -1, z, cell) for cell in cells] for z in values])
    return dataset(["fz", "cell"], {"fz": values, "cell": list(cells)}, power, fx=3, fy=-1, poisson_ratio=0.49)


def together(count=20, cell="parallelepiped"):
    """fx and fz row by row along ``step``, with fy and cell fixed."""
    fx, fz = 0.25 * np.arange(count), -8 - 0.1 * np.arange(count)
    power = np.array([reading(x, 2, z, cell) for x, z in zip(fx, fz, strict=True)])
    return dataset(["step"], {"fx": ("step", fx), "fz": ("step", fz)}, power, fy=2, cell=cell)


def forces_of(table):
    return {tuple(row) for row in table[FORCE].to_numpy(dtype=float).round(9)}


def everything(tables):
    return pd.concat(tables.values(), ignore_index=True)


def test_a_product_becomes_a_row_for_each_job():
    tables = training_set(product())
    assert list(tables) == list(PARTS)
    rows = everything(tables)
    assert list(rows) == [*FORCE, "cell", *POWER, *ERROR] and len(rows) == 41 * 2
    expected = np.array([reading(*row) for row in rows[[*FORCE, "cell"]].itertuples(index=False)])
    np.testing.assert_allclose(rows[POWER], expected, rtol=1e-12)
    np.testing.assert_allclose(rows[ERROR], 0.001 * expected, rtol=1e-12)
    assert not rows[[*FORCE, "cell"]].duplicated().any() and set(rows.fx_N) == {3} and set(rows.fy_N) == {-1}
    assert set(rows.fz_N) == set(product().fz.values) and set(rows.cell) == set(CELLS)


@pytest.mark.parametrize("order", [("taxel", "fz", "cell"), ("cell", "taxel", "fz")])
def test_the_order_of_dimensions_does_not_matter(order):
    expected, given = (everything(training_set(s)) for s in (product(), product().transpose(*order, ...)))
    columns = [*FORCE, "cell"]
    pd.testing.assert_frame_equal(*(t.sort_values(columns, ignore_index=True) for t in (expected, given)))


def test_steps_become_rows_with_their_own_forces():
    rows = everything(training_set(together()))
    assert list(rows) == [*FORCE, *POWER, *ERROR] and len(rows) == 20
    expected = np.array([reading(*row, "parallelepiped") for row in rows[FORCE].itertuples(index=False)])
    np.testing.assert_allclose(rows[POWER], expected, rtol=1e-12)
    np.testing.assert_allclose(rows.fz_N, -8 - 0.4 * rows.fx_N, rtol=1e-12)


def test_a_selection_keeps_its_fixed_force():
    study = xr.concat([product().assign_coords(fx=fx) for fx in (1.0, 2.0)], dim="fx").sel(fx=2.0, cell="hemispheric")
    rows = everything(training_set(study))
    assert set(rows.fx_N) == {2.0} and "cell" not in rows


def test_scenes_of_a_tree_are_told_apart():
    tree = xr.DataTree.from_dict({"normal": product(), "tangential": together(cell="hemispheric")})
    rows = everything(training_set(tree))
    assert list(rows) == [*FORCE, "scene", "cell", *POWER, *ERROR]
    assert rows.scene.value_counts().to_dict() == {"normal": 82, "tangential": 20}
    expected = np.array([reading(*row) for row in rows[[*FORCE, "cell"]].itertuples(index=False)])
    np.testing.assert_allclose(rows[POWER], expected, rtol=1e-12)
    assert set(rows.fy_N[rows.scene == "normal"]) == {-1} and set(rows.fy_N[rows.scene == "tangential"]) == {2}


def test_numbers_fixed_in_one_scene_and_varied_in_another_share_a_column():
    soft = product(cells=("hemispheric",)).drop_vars("cell").isel(cell=0)
    moduli = xr.concat(
        [soft, soft], dim=pd.Index([1.0, 2.5], name="youngs_modulus"), join="exact", combine_attrs="override"
    )
    fixed = soft.assign_attrs(attributes(fx=3, fy=-1, youngs_modulus="2.5"))
    rows = everything(training_set(xr.DataTree.from_dict({"a": moduli, "b": fixed})))
    assert rows.youngs_modulus_MPa.value_counts().to_dict() == {2.5: 82, 1.0: 41}


@pytest.mark.parametrize(("noise", "relative"), [(2e-3, False), ("0.002", False), ("0.2%", True), ("5 %", True)])
def test_noise_is_gaussian_as_asked_and_independent(noise, relative):
    study, copies = product(), 50
    rows = everything(training_set(study, noise=noise, copies=copies, seed=4))
    true = np.array([reading(*row) for row in rows[[*FORCE, "cell"]].itertuples(index=False)])
    sigma = float(str(noise).strip("% ")) * (np.abs(true) / 100 if relative else 1)
    z = (rows[POWER].to_numpy() - true) / sigma
    assert z.shape == (82 * copies, 9)
    assert stats.kstest(z.ravel(), "norm").pvalue > ALARM
    # Each force, each taxel and each pair of taxels has noise of its own: chi-squared, and correlations near 0.
    for axis in (0, 1):
        squares = np.square(z).sum(axis=axis)
        freedom = z.shape[axis]
        tail = stats.chi2.sf(squares, freedom)
        limit = 1 - (1 - ALARM) ** (1 / tail.size)
        assert limit / 2 < tail.min() and tail.max() < 1 - limit / 2
    for lag in (1, 82):
        assert abs((z[lag:] * z[:-lag]).sum()) < stats.norm.isf(ALARM / 2) * np.sqrt(z[lag:].size)
    between = np.corrcoef(z.T)[np.triu_indices(9, 1)]
    assert np.abs(between).max() < stats.norm.isf(ALARM / 2 / between.size) / np.sqrt(len(z))
    np.testing.assert_allclose(rows[ERROR], 0.001 * true, rtol=1e-12)


def test_the_same_seed_gives_the_same_set_and_another_another():
    first, again, other = (training_set(product(), noise="1%", copies=2, seed=seed) for seed in (1, 1, 2))
    for name in PARTS:
        pd.testing.assert_frame_equal(first[name], again[name])
        assert forces_of(first[name]) != forces_of(other[name])


@pytest.mark.parametrize("split", [(0.7, 0.15, 0.15), (0.5, 0.25, 0.25), (0.1, 0.2, 0.7)])
@pytest.mark.parametrize("fz", [20, 41, 200])
def test_no_force_is_in_two_parts_and_shares_are_as_asked(split, fz):
    tables = training_set(product(fz), noise=1e-6, copies=3, split=split, seed=fz)
    forces = [forces_of(table) for table in tables.values()]
    assert len(set.union(*forces)) == sum(map(len, forces)) == fz
    for share, mine, table in zip(split, forces, tables.values(), strict=True):
        assert abs(len(mine) - share * fz) <= 1 and len(table) == len(mine) * 2 * 3


def test_parts_look_drawn_by_chance():
    """The number of runs of train and not train along the path (Wald and Wolfowitz, 1940), over many seeds."""
    z = []
    for seed in range(30):
        inside = (
            product(100).fz.isin(training_set(product(100), split=(0.5, 0.25, 0.25), seed=seed)["train"].fz_N).values
        )
        runs = 1 + np.count_nonzero(np.diff(inside))
        z.append((runs - 51) / np.sqrt(50 * 49 / 99))
    assert abs(np.mean(z)) < stats.norm.isf(ALARM / 2) / np.sqrt(len(z)) and np.var(z) > 0.3


@pytest.mark.parametrize(
    "changed",
    [
        lambda study: dict(study=study, noise="1%", copies=4),
        lambda study: dict(study=study.isel(cell=[1])),
        lambda study: dict(study=study.isel(fz=slice(None, None, -1))),
        lambda study: dict(study=study.where(study.fz != -3)),
        lambda study: dict(study=study.assign_coords(fz=study.fz.values.astype("float32"))),
        lambda study: dict(study=study.assign_coords(fz=study.fz.values + 0.0)),
    ],
    ids=["noise", "one cell", "order", "a failed force", "single precision", "no sign of 0"],
)
def test_the_part_of_a_force_stays(changed):
    before = training_set(product(), seed=9)
    after = training_set(**changed(product()), seed=9)
    for name in PARTS:
        assert forces_of(before[name]) - {(3, -1, -3)} == forces_of(after[name]) - {(3, -1, -3)}


def test_added_forces_move_only_what_is_beside_a_cut():
    before, after = (training_set(product(count), seed=2) for count in (100, 104))
    stayed = sum(len(forces_of(before[name]) & forces_of(after[name])) for name in PARTS)
    assert stayed >= 100 - 2 * 4  # a permutation drawn anew would leave about 54


def test_failed_jobs_are_left_out_and_named(tmp_path):
    study = product()
    study.power[5, 1], study.power[7, 0, 3] = np.nan, np.nan
    rows = everything(training_set(study, tmp_path / "set", noise="1%", copies=2))
    assert len(rows) == (82 - 2) * 2 and rows.notna().all().all()
    assert ((rows.fz_N == -2.5) & (rows.cell == "hemispheric")).sum() == 0
    assert ((rows.fz_N == -2.5) & (rows.cell == "parallelepiped")).sum() == 2
    sheet = (tmp_path / "set" / "README.md").read_text(encoding="utf-8")
    left_out = sheet.split("## Left out")[1].split("##")[0]
    assert "2 jobs" in left_out and left_out.count("\n- ") == 2
    assert "fz = -2.5; cell = hemispheric" in left_out and "fz = -3.5; cell = parallelepiped" in left_out


def test_files_hold_the_tables_to_the_last_digit(tmp_path):
    tables = training_set(product(), tmp_path / "set", noise="1%", copies=2)
    assert {file.name for file in (tmp_path / "set").iterdir()} == {"README.md", *(f"{name}.csv" for name in PARTS)}
    for name, table in tables.items():
        read = pd.read_csv(tmp_path / "set" / f"{name}.csv", dtype=str)
        assert list(read) == list(table) and list(read.cell) == list(table.cell)
        numbers = [*FORCE, *POWER, *ERROR]
        assert np.array_equal(np.vectorize(float)(read[numbers]), table[numbers])


def test_parquet_holds_the_same(tmp_path):
    pytest.importorskip("pyarrow")
    tables = training_set(product(), tmp_path / "set", parquet=True)
    for name, table in tables.items():
        read = pd.read_parquet(tmp_path / "set" / f"{name}.parquet")
        pd.testing.assert_frame_equal(read, table, check_exact=True, check_dtype=False)


def test_parquet_without_its_package_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("mitsuba_taxel.studies.store.tables.find_spec", lambda name: None)
    with pytest.raises(InputError, match="pyarrow"):
        training_set(product(), tmp_path / "set", parquet=True)
    assert not (tmp_path / "set").exists()


def test_the_datasheet_says_what_was_done(tmp_path):
    tree = xr.DataTree.from_dict({"normal": product(), "tangential": together()})
    tables = training_set(tree, tmp_path / "set", noise="0.5%", copies=3, seed=11)
    sheet = (tmp_path / "set" / "README.md").read_text(encoding="utf-8")
    for words in (
        "pad.xml", "normal: ", "tangential: ", "poisson_ratio = 0.49", "mitsuba 3.9.0", "seed 7", "64 points",
        "0.5% of each reading", "3 noisy copies", "seed (11)", "every job of the study gave readings",
        "share their random numbers",
        "error of the roofs 0.001 mm", "| fz_N | N |", "one of parallelepiped, hemispheric",
    ):  # fmt: skip
        assert words in sheet, words
    for name, table in tables.items():
        assert f"| {name} | {len(forces_of(table))} | {len(table)} |" in sheet
    listed = [line.split(" | ") for line in sheet.split("## Columns")[1].split("##")[0].splitlines()[5:]]
    rows = everything(tables)
    assert [words[0].removeprefix("| ") for words in listed if len(words) > 1] == list(rows)
    about = {words[0].removeprefix("| "): words for words in listed}
    for column in ("fz_N", "power_4_W", "standard_error_9_W"):
        low, high = (float(word.strip(" |")) for word in about[column][3:5])
        assert (low, high) == pytest.approx((rows[column].min(), rows[column].max()), rel=1e-5)


def test_the_datasheet_says_that_no_noise_was_added(tmp_path):
    training_set(product(), tmp_path / "set")
    sheet = (tmp_path / "set" / "README.md").read_text(encoding="utf-8")
    assert "None was added" in sheet and "Gaussian" not in sheet


def test_behind_a_circuit_there_are_volts_and_counts(tmp_path):
    """Of the noisy light of each row, with the circuit's own noise, which makes copies differ without any other."""
    circuit = Circuit(supply=5.0, load_resistance=1e3, transfer=1e-3, other_noise=2e-3)
    study = with_volts(product().assign(total_error=0 * product().power), circuit)
    volts, counts = ([f"{name.format(taxel)}" for taxel in range(1, 10)] for name in ("voltage_{}_V", "counts_{}"))
    for noise in (0, "2%"):
        rows = everything(training_set(study, tmp_path / str(noise), noise=noise, copies=30))
        assert list(rows) == [*FORCE, "cell", *POWER, *volts, *counts, *ERROR]
        light = np.maximum(rows[POWER].to_numpy(), 0)
        z = (rows[volts].to_numpy() - respond(circuit, light).voltage) / total_noise(circuit, light)
        assert stats.kstest(z.ravel(), "norm").pvalue > ALARM
        np.testing.assert_array_equal(rows[counts], np.floor(rows[volts] / circuit.step).clip(0, 4095))
    sheet = (tmp_path / "0" / "README.md").read_text(encoding="utf-8")
    about = ("noise of the circuit", "30 noisy copies", "load_resistance = 1000", "| voltage_3_V | V |", "| counts_3 |")
    for words in about:
        assert words in sheet, words


@pytest.mark.parametrize(
    ("given", "culprit"),
    [
        (dict(noise="-1%"), "noise = '-1%'"),
        (dict(noise=float("nan")), "noise = nan"),
        (dict(noise="inf"), "noise"),
        (dict(noise="loud"), "'loud'"),
        (dict(noise="1%%"), "noise"),
        (dict(copies=2), "copies = 2"),
        (dict(copies=0, noise=1e-6), "copies = 0"),
        (dict(split=(0.7, 0.3)), "split"),
        (dict(split=(0.8, 0.2, 0.0)), "split"),
        (dict(split=(0.8, 0.2, 0.1)), "split"),
        (dict(split=(1.2, -0.1, -0.1)), "split"),
        (dict(split=(float("nan"),) * 3), "split"),
        (dict(split=(0.98, 0.01, 0.01)), "no job with readings is left for test"),
        (dict(seed=-1), "seed = -1"),
        (dict(seed=1 << 32), "seed"),
        (dict(study=product(9)), "forces in the study: 9"),
        (dict(study=product(9, cells=tuple(CELLS))), "at least 10"),
        (dict(study=product(41).isel(fz=[0])), "forces in the study: 1"),
        (dict(study=product().where(False)), "no job with readings"),
        (dict(study=product().drop_vars("power")), "no readings"),
        (dict(study=xr.DataTree()), "no readings"),
    ],
)
def test_refuses_and_writes_nothing(tmp_path, given, culprit):
    with pytest.raises(InputError, match=culprit):
        training_set(output=tmp_path / "set", **{"study": product(), **given})
    assert not (tmp_path / "set").exists()


def test_a_study_of_no_force_is_refused():
    heights = product().rename(fz="z").assign_attrs(attributes(scattering="mirror"))
    with pytest.raises(InputError, match="forces in the study: 1"):
        training_set(heights)


@pytest.mark.parametrize(
    ("other", "culprit"),
    [
        (together().isel(taxel=[0, 1]), "2 taxels"),
        (together().assign_attrs(attributes(cell="hemispheric")), "forces"),
    ],
)
def test_scenes_that_do_not_fit_together_are_refused(other, culprit):
    with pytest.raises(InputError, match=f"scene tangential .*{culprit}"):
        training_set(xr.DataTree.from_dict({"normal": product(), "tangential": other}))


def test_a_folder_in_use_is_refused(tmp_path):
    (tmp_path / "mine").write_text("")
    with pytest.raises(InputError, match="not empty"):
        training_set(product(), tmp_path)
    assert [file.name for file in tmp_path.iterdir()] == ["mine"]
