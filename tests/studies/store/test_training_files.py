"""Training sets as HDF5 and in the layout of LeRobot, read back by h5py, xarray, pandas and lerobot."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from mitsuba_taxel import Circuit, InputError
from mitsuba_taxel.electronics import with_volts
from mitsuba_taxel.studies.run.training import PARTS, training_set

FORCE, PLACES, CELLS = -0.25 * np.arange(1.0, 31), np.array([-1.0, 0.0, 1.0]), ["a", "b"]
TAXELS = np.array([1, 2])


def study():
    """Two taxels, whose readings in W tell force, place and cell by a closed form."""
    power = reading(FORCE[:, None, None], PLACES[:, None], np.arange(2))
    attributes = {
        "scene": "ball.xml",
        "parameters": json.dumps({"fx": "0.5", "push": "1", "spot": "0", "cell": "a"}),
        "units": json.dumps({"spot": "mm", "push": "N"}),
        "roles": json.dumps({"spot": ["indenter_x", 1], "push": ["fz", -1]}),
        "forces": json.dumps({"push": ["fz", -1], "fx": ["fx", 1]}),
        "versions": json.dumps({"mitsuba": "3.9.0"}),
        "seed": 7,
        "points": 64,
        "notes": "",
        "curve": "push",
    }
    dims = ["push", "spot", "cell", "taxel"]
    return xr.Dataset(
        {
            "power": (dims, power),
            "standard_error": (dims, 1e-3 * power),
            "total_error": (dims, 1e-3 * power),
            "seconds": (["push", "spot", "cell", "stage"], np.ones((30, 3, 2, 1))),
        },
        {"push": -FORCE, "spot": PLACES, "cell": CELLS, "taxel": TAXELS, "stage": ["optics"]},
        attributes,
    )


def reading(fz, spot, cell):
    """Power (..., taxels) of a force in N at a place in mm, in cell 0 or 1."""
    fz, spot, cell = (np.asarray(values)[..., None] for values in (fz, spot, cell))
    return 1e-4 * (1 + 0.1 * cell) * (2 + 0.1 * fz * (1 + 0.2 * np.array([1, -1]) * spot))


def test_h5py_and_xarray_read_groups_with_units(tmp_path):
    h5py = pytest.importorskip("h5py")
    tables = training_set(study(), tmp_path / "set", noise="0.5%", copies=2, hdf5=True)
    with h5py.File(tmp_path / "set" / "dataset.h5") as file:
        assert sorted(file) == sorted(PARTS) and "ball.xml" in file.attrs["about"]
        units = {name: file[f"train/{name}"].attrs["units"] for name in ("fx", "fz", "spot", "power", "standard_error")}
        assert units == {"fx": "N", "fz": "N", "spot": "mm", "power": "W", "standard_error": "W"}
        for name, table in tables.items():
            np.testing.assert_array_equal(file[f"{name}/power"][:], table[["power_1_W", "power_2_W"]])
            np.testing.assert_array_equal(file[f"{name}/fz"][:], table["fz_N"])
            assert file[f"{name}/cell"].asstr()[:].tolist() == table["cell"].tolist()
    tree = xr.open_datatree(tmp_path / "set" / "dataset.h5", engine="h5netcdf").load()
    train = tree["train"].to_dataset()
    assert set(train["copy"].values) == {0, 1} and set(train["path"].values) == set(range(6))
    # A path is one place and one cell, and noise is 0.5 % of the closed form.
    for _, rows in train.groupby("path"):
        assert len(set(rows["spot"].values)) == len(set(rows["cell"].values)) == 1
    exact = reading(train["fz"].values, train["spot"].values, (train["cell"].values == "b").astype(float))
    assert np.std(train["power"].values / exact - 1) == pytest.approx(0.005, rel=0.15)


def test_voltages_are_in_it(tmp_path):
    pytest.importorskip("h5netcdf")
    volts = with_volts(study(), Circuit(supply=5.0, load_resistance=5e3, transfer=1.0, adc_bits=12))
    tables = training_set(volts, tmp_path / "set", hdf5=True, lerobot=True)
    tree = xr.open_datatree(tmp_path / "set" / "dataset.h5", engine="h5netcdf").load()
    assert tree["test/voltage"].attrs["units"] == "V"
    np.testing.assert_array_equal(tree["test/counts"], tables["test"][["counts_1", "counts_2"]])
    info = json.loads((tmp_path / "set" / "lerobot" / "meta" / "info.json").read_text())
    assert info["features"]["observation.voltage"]["names"] == ["voltage_1_V", "voltage_2_V"]


def test_episodes_are_curves_in_their_order_with_named_features(tmp_path):
    tables = training_set(study(), tmp_path / "set", noise="0.5%", copies=2, lerobot=True)
    folder = tmp_path / "set" / "lerobot"
    info = json.loads((folder / "meta" / "info.json").read_text())
    names = {name: feature["names"] for name, feature in info["features"].items() if feature["names"]}
    assert names == {
        "observation.power": ["power_1_W", "power_2_W"],
        "observation.wrench": ["fx_N", "fz_N"],
        "observation.contact_place": ["spot_mm"],
    }
    # Episodes: 3 places, 2 cells and 2 copies in each part, without gaps in their numbers and frames.
    episodes = pd.read_parquet(folder / "meta" / "episodes")
    frames = pd.read_parquet(folder / "data")
    assert info["splits"] == {"train": "0:12", "validation": "12:24", "test": "24:36"}
    assert info["total_episodes"] == len(episodes) == 36 and info["total_frames"] == len(frames) == 360
    assert frames["index"].tolist() == list(range(360))
    for row in episodes.itertuples():
        own = frames.iloc[row.dataset_from_index : row.dataset_to_index]
        assert set(own.episode_index) == {row.episode_index} and own.frame_index.tolist() == list(range(row.length))
        np.testing.assert_allclose(own.timestamp, own.frame_index / info["fps"], rtol=1e-6)
        wrench, power = (np.stack(own[f"observation.{name}"].to_list()) for name in ("wrench", "power"))
        assert (np.diff(wrench[:, 1]) < 0).all() and (wrench[:, 0] == 0.5).all()  # the curve, in its order
        assert own["observation.contact_place"].nunique() == 1
        cell = float(row.tasks[0] == "touch, cell = b")
        exact = reading(wrench[:, 1], own["observation.contact_place"].to_numpy(float), np.full(len(own), cell))
        assert np.abs(power / exact - 1).max() < 0.03
    # Each part has the rows of its table.
    for name, table in tables.items():
        first, last = map(int, info["splits"][name].split(":"))
        own = frames[frames.episode_index.between(first, last - 1)]
        powers = np.stack(own["observation.power"].to_list())[:, 0]
        np.testing.assert_array_equal(np.sort(powers), np.sort(table["power_1_W"].to_numpy(np.float32)))
    statistics = json.loads((folder / "meta" / "stats.json").read_text())
    wrench = np.stack(frames["observation.wrench"].to_list())
    np.testing.assert_allclose(statistics["observation.wrench"]["mean"], wrench.mean(axis=0), rtol=1e-6)


def test_the_wrench_and_the_centre_of_pressure_of_an_indenter_are_features(tmp_path):
    pressed, dims = study(), ("push", "spot", "cell")
    fz = np.broadcast_to(FORCE[:, None, None], (30, 3, 2))
    wrench = {"fx": 0 * fz, "fy": 0 * fz, "fz": fz, "mx": 0 * fz, "my": -PLACES[:, None] * fz, "mz": 0 * fz}
    for name, values in wrench.items():
        pressed[f"reaction_{name}"] = (dims, values, {"units": "N" if name[0] == "f" else "N mm"})
    for axis, place in {"x": PLACES, "y": 0 * PLACES}.items():
        pressed[f"centre_of_pressure_{axis}"] = (dims, np.broadcast_to(place[:, None], fz.shape), {"units": "mm"})
    training_set(pressed, tmp_path / "set", lerobot=True)
    folder = tmp_path / "set" / "lerobot"
    info = json.loads((folder / "meta" / "info.json").read_text())
    assert info["features"]["observation.wrench"]["names"] == [
        f"reaction_{name}_{'N' if name[0] == 'f' else 'N mm'}" for name in wrench
    ]
    assert info["features"]["observation.contact_place"]["names"] == [
        "spot_mm",
        "centre_of_pressure_x_mm",
        "centre_of_pressure_y_mm",
    ]
    frames = pd.read_parquet(folder / "data")
    values, places = (np.stack(frames[f"observation.{name}"].to_list()) for name in ("wrench", "contact_place"))
    np.testing.assert_allclose(values[:, 4], -places[:, 0] * values[:, 2], rtol=1e-6)
    np.testing.assert_array_equal(places[:, 0], places[:, 1])
    assert (places[:, 2] == 0).all() and (values[:, 2] < 0).all()
    sheet = (tmp_path / "set" / "README.md").read_text(encoding="utf-8")
    assert "y component of the moment of the plate or the indenter on the pad" in sheet


def test_a_study_by_depth_is_split_by_depth(tmp_path):
    pressed = study()
    pressed.attrs |= {
        "parameters": json.dumps({"fx": "0", "push": "1", "spot": "0", "cell": "a"}),
        "units": json.dumps({"spot": "mm", "push": "mm"}),
        "roles": json.dumps({"spot": ["indenter_x", 1]}),
        "forces": json.dumps({"fx": ["fx", 1]}),
    }
    with pytest.raises(InputError, match="distinct forces in the study: 1"):
        training_set(pressed)
    for name in ("fx", "fy", "fz"):
        pressed[f"reaction_{name}"] = (("push", "spot", "cell"), np.ones((30, 3, 2)), {"units": "N"})
    tables = training_set(pressed, tmp_path / "set")
    depths = [set(table.push_mm) for table in tables.values()]
    assert set.union(*depths) == set(-FORCE) and sum(map(len, depths)) == len(FORCE)
    assert [len(table) for table in tables.values()] == [6 * len(depth) for depth in depths]  # all places and cells
    sheet = (tmp_path / "set" / "README.md").read_text(encoding="utf-8")
    assert "All rows of one value of push_mm" in sheet and "All rows of one force" not in sheet


def test_frames_without_contact_are_left_out_of_the_statistics(tmp_path):
    pressed, dims = study(), ("push", "spot", "cell")
    pressed["reaction_fz"] = (dims, np.broadcast_to(FORCE[:, None, None], (30, 3, 2)), {"units": "N"})
    x = np.broadcast_to(PLACES[:, None], (30, 3, 2)).copy()
    x[:4, :2], x[7:12, 2] = np.nan, np.nan
    pressed["centre_of_pressure_x"] = (dims, x, {"units": "mm"})
    pressed["centre_of_pressure_y"] = (dims, np.full(x.shape, np.nan), {"units": "mm"})
    training_set(pressed, tmp_path / "set", lerobot=True)
    text = (tmp_path / "set" / "lerobot" / "meta" / "stats.json").read_text()
    place = json.loads(text, parse_constant=lambda word: pytest.fail(f"{word} is no JSON"))["observation.contact_place"]
    # The place of the indenter, the x of the frames with contact, sorted by hand, and y, which has none.
    touches = np.sort(x[np.isfinite(x)])
    assert len(touches) == 180 - 2 * (4 * 2 + 5) and place["count"] == [180]
    mean = touches.sum() / len(touches)
    assert (place["min"], place["max"]) == ([-1, -1, 0], [1, 1, 0]) and mean != 0
    np.testing.assert_allclose(place["mean"], [0, mean, 0], atol=1e-12)
    spread = np.sqrt((touches**2).sum() / len(touches) - mean**2)
    np.testing.assert_allclose(place["std"], [np.sqrt(2 / 3), spread, 0], rtol=1e-12)
    assert place["q50"] == [0, touches[len(touches) // 2], 0]
    # Frames have no NaN: 0 where nothing touches, and a flag; x alone has a centre nowhere, as y is missing.
    frames = pd.read_parquet(tmp_path / "set" / "lerobot" / "data")
    assert all(np.isfinite(np.stack(frames[name].to_list())).all() for name in frames)
    assert (frames["observation.contact"] == 0).all()
    sheet = (tmp_path / "set" / "README.md").read_text(encoding="utf-8")
    assert sheet.count("NaN (blank in CSV) where nothing touches") == 2


def test_a_flag_tells_frames_with_contact(tmp_path):
    pressed, dims = study(), ("push", "spot", "cell")
    x = np.broadcast_to(PLACES[:, None], (30, 3, 2)).copy()
    x[:4], x[7:12, 2] = np.nan, np.nan
    pressed["reaction_fz"] = (dims, np.where(np.isnan(x), 0.0, FORCE[:, None, None]), {"units": "N"})
    for axis in "xy":
        pressed[f"centre_of_pressure_{axis}"] = (dims, x, {"units": "mm"})
    training_set(pressed, tmp_path / "set", lerobot=True)
    frames = pd.read_parquet(tmp_path / "set" / "lerobot" / "data")
    touched, places = frames["observation.contact"].to_numpy(), np.stack(frames["observation.contact_place"].to_list())
    wrench = frames["observation.wrench"].to_numpy()
    assert (touched == 0).sum() == 4 * 3 * 2 + 5 * 2 and (touched == 1).sum() == np.isfinite(x).sum()
    np.testing.assert_array_equal(touched == 1, wrench < 0)
    np.testing.assert_array_equal(places[:, 1], np.where(touched == 1, places[:, 0], 0.0))
    meta = tmp_path / "set" / "lerobot" / "meta"
    assert json.loads((meta / "info.json").read_text())["features"]["observation.contact"]["names"] == ["contact"]
    figures = json.loads((meta / "stats.json").read_text())["observation.contact"]
    np.testing.assert_allclose(figures["mean"], [touched.mean()], rtol=1e-6)


def test_a_force_that_a_scene_does_not_have_is_not_zero(tmp_path):
    pressed, dims = study(), ("push", "spot", "cell")
    pressed["reaction_fz"] = (dims, np.broadcast_to(FORCE[:, None, None], (30, 3, 2)), {"units": "N"})
    for axis in "xy":
        pressed[f"centre_of_pressure_{axis}"] = (dims, np.full((30, 3, 2), 0.3), {"units": "mm"})
    training_set(xr.DataTree.from_dict({"a": pressed, "b": study()}), tmp_path / "set", lerobot=True)
    frames = pd.read_parquet(tmp_path / "set" / "lerobot" / "data")
    touched, wrench = frames["observation.contact"] == 1, np.stack(frames["observation.wrench"].to_list())
    places = np.stack(frames["observation.contact_place"].to_list())
    assert touched.sum() == (~touched).sum() == 180
    assert np.isnan(wrench[~touched]).all() and (wrench[touched] < 0).all()
    assert (places[~touched, -2:] == 0).all() and np.allclose(places[touched, -2:], 0.3)


@pytest.mark.parametrize("reactions", [(), ("fz",), ("fx", "fz")])
def test_the_applied_force_is_a_feature_beside_the_force_of_the_plate(tmp_path, reactions):
    pressed, applied = study(), ["fx_N", "fz_N"]
    for name in reactions:
        pressed[f"reaction_{name}"] = (("push", "spot", "cell"), np.ones((30, 3, 2)), {"units": "N"})
    training_set(pressed, tmp_path / "set", lerobot=True)
    folder = tmp_path / "set" / "lerobot"
    features = json.loads((folder / "meta" / "info.json").read_text())["features"]
    group = "observation.parameters" if reactions else "observation.wrench"
    assert features[group]["names"] == applied and ("observation.parameters" in features) is bool(reactions)
    forces = np.stack(pd.read_parquet(folder / "data")[group].to_list())
    assert (forces[:, 0] == 0.5).all() and set(forces[:, 1]) == set(FORCE)


def pressed_together(count=30, **coordinates):
    """A study whose parameters vary together along ``step``: the depth of an indenter, and others."""
    steps, depth = np.arange(1, count + 1), -0.01 * np.arange(count)
    power = np.stack([1 + depth, 2 + depth], axis=-1)
    attributes = {"parameters": json.dumps({"youngs_modulus": "0.2"}), "units": json.dumps({"uz": "mm", "x": "mm"})}
    attributes |= {"scene": "ball.xml", "versions": "{}", "seed": 7, "points": 64, "notes": "", "curve": "step"}
    return xr.Dataset(
        {
            "power": (["step", "taxel"], power),
            "standard_error": (["step", "taxel"], 1e-3 * power),
            "reaction_fx": ("step", 0 * depth, {"units": "N"}),
            "reaction_fz": ("step", 3 * depth, {"units": "N"}),
        },
        {"step": steps, "uz": ("step", depth), "taxel": TAXELS}
        | {name: ("step", values) for name, values in coordinates.items()},
        attributes,
    )


@pytest.mark.parametrize("copies", [1, 2])
def test_a_study_of_steps_is_split_by_all_that_varies_with_the_depth(tmp_path, copies):
    pressed = pressed_together(x=np.arange(30) % 3.0, y=np.zeros(30))
    again = pressed.assign(power=2 * pressed.power)  # a second scene, with the same touches
    tree = xr.DataTree.from_dict({"a": pressed, "b": again})
    tables = training_set(tree, tmp_path / "set", noise=1e-6, copies=copies)
    touches = [set(zip(table.uz_mm, table.x_mm, strict=True)) for table in tables.values()]
    assert set.union(*touches) == set(zip(pressed.uz.values, pressed.x.values, strict=True))
    assert sum(map(len, touches)) == 30  # no touch is in two parts
    assert [len(table) for table in tables.values()] == [2 * copies * len(touch) for touch in touches]
    assert all("step" not in table and "y_mm" not in table for table in tables.values())
    sheet = (tmp_path / "set" / "README.md").read_text(encoding="utf-8")
    assert "All rows of one value of uz_mm and x_mm" in sheet


def test_curves_that_do_not_say_how_to_split_are_refused():
    by_depth = pressed_together().swap_dims(step="uz").drop_vars("step").assign_attrs(curve="uz")
    assert len(training_set(xr.DataTree.from_dict({"a": pressed_together(), "b": by_depth}))["train"]) == 42
    moved = pressed_together(x=np.arange(30.0))
    with pytest.raises(InputError, match="scene b varies uz and x along its curves, the first scene uz: the same"):
        training_set(xr.DataTree.from_dict({"a": by_depth, "b": moved}))
    still = moved.assign_coords(uz=("step", np.zeros(30)), x=("step", np.ones(30)))
    with pytest.raises(InputError, match="no force and no parameter varies along the curves"):
        training_set(still)
    with pytest.raises(InputError, match="scene b varies no parameter along its curves, the first scene uz"):
        training_set(xr.DataTree.from_dict({"a": by_depth, "b": still}))
    with pytest.raises(InputError, match="distinct values of uz and x in the study: 9, but at least 10"):
        training_set(moved.isel(step=slice(9)))


def test_lerobot_reads_it(tmp_path, monkeypatch):
    pytest.importorskip("lerobot")
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    training_set(study(), tmp_path / "set", lerobot=True)
    read = LeRobotDataset("local/taxel", root=tmp_path / "set" / "lerobot")
    assert read.meta.total_episodes == 18 and len(read) == 180
    frame = read[0]
    assert frame["task"] == "touch, cell = a" and tuple(frame["observation.wrench"].shape) == (2,)
    cell, place, wrench = 0.0, float(frame["observation.contact_place"]), frame["observation.wrench"].numpy()
    np.testing.assert_allclose(frame["observation.power"], reading(wrench[1], place, np.array(cell)), rtol=1e-6)


def test_what_is_missing_is_said(tmp_path, monkeypatch):
    monkeypatch.setattr("mitsuba_taxel.studies.store.netcdf.find_spec", lambda name: None)
    with pytest.raises(InputError, match="HDF5 needs h5netcdf: pip install h5netcdf h5py"):
        training_set(study(), tmp_path / "set", hdf5=True)
    assert not (tmp_path / "set").exists()
